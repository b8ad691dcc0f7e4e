"""Laws: what particles do to each other, one file a law; and what laws are written with."""

from particell.compute.expressions import (
    Symmetric,
    Vector,
    call,
    cos,
    exp,
    log,
    maximum,
    minimum,
    sin,
    sqrt,
    tanh,
    vector,
    where,
)
from particell.laws.law import Law, Values, pair_of

__all__ = [
    "Law",
    "Symmetric",
    "Values",
    "Vector",
    "call",
    "cos",
    "exp",
    "log",
    "maximum",
    "minimum",
    "pair_of",
    "sin",
    "sqrt",
    "tanh",
    "vector",
    "where",
]
