r"""What laws compute, written down instead of carried out.

A law is plain arithmetic on what it is given (:mod:`particell.laws.law`). Given the symbols of
this module it leaves behind the expression of what it computes, from which
:mod:`particell.compute.composer` makes loops. Given floats, arrays, quantities with units or
SymPy's symbols it computes with those: the functions here (:func:`sqrt`, :func:`where`, …) take
all of them.

A :class:`Vector` is a sum of coefficients times *base vectors* (x_ij, v_ij, δv_j, …). So what
several laws add along one base vector is collected before it is multiplied by its components, as
one would by hand, and a scalar product of two bases is computed once.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

#: A float, an array, a :class:`Node`, a quantity, a SymPy expression.
Number = Any

_FOLD: dict[str, Callable[[float, float], Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


@dataclass(frozen=True, eq=False, slots=True)
class Node:
    """An operation on nodes and numbers; ``what`` says which symbol or function it is."""

    op: str
    args: tuple[Any, ...] = ()
    what: Any = None

    def __add__(self, other: Number) -> Number:
        return _binary("+", self, other)

    def __radd__(self, other: Number) -> Number:
        return _binary("+", other, self)

    def __sub__(self, other: Number) -> Number:
        return _binary("-", self, other)

    def __rsub__(self, other: Number) -> Number:
        return _binary("-", other, self)

    def __mul__(self, other: Number) -> Number:
        return _binary("*", self, other)

    def __rmul__(self, other: Number) -> Number:
        return _binary("*", other, self)

    def __truediv__(self, other: Number) -> Number:
        return _binary("/", self, other)

    def __rtruediv__(self, other: Number) -> Number:
        return _binary("/", other, self)

    def __neg__(self) -> Number:
        return Node("neg", (self,))

    def __pow__(self, exponent: Number) -> Number:
        if not _is_plain(exponent) or exponent not in (2, 3, 4):
            return Node("**", (self, exponent))
        square = self * self
        return square if exponent == 2 else square * (self if exponent == 3 else square)

    def __lt__(self, other: Number) -> Number:
        return _binary("<", self, other)

    def __le__(self, other: Number) -> Number:
        return _binary("<=", self, other)

    def __gt__(self, other: Number) -> Number:
        return _binary(">", self, other)

    def __ge__(self, other: Number) -> Number:
        return _binary(">=", self, other)

    def __and__(self, other: Number) -> Number:
        return Node("and", (self, other))

    def __or__(self, other: Number) -> Number:
        return Node("or", (self, other))

    def __eq__(self, other: object) -> Any:
        return _binary("==", self, other)

    def __ne__(self, other: object) -> Any:
        return _binary("!=", self, other)

    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        raise TypeError("a law decides with where(condition, a, b), and & and | join conditions")


def _is_plain(value: Any) -> bool:
    return isinstance(value, (int, float, np.number))


def _binary(op: str, a: Number, b: Number) -> Number:
    if isinstance(a, Vector | Symmetric) or isinstance(b, Vector | Symmetric):
        return NotImplemented
    if _is_plain(a) and _is_plain(b):
        return _FOLD[op](a, b)
    zero_a, zero_b = _is_plain(a) and a == 0, _is_plain(b) and b == 0
    if op == "+" and zero_a:
        return b
    if op in "+-" and zero_b:
        return a
    if op == "-" and zero_a:
        return -b
    if op == "*":
        if zero_a or zero_b:
            return 0.0
        for one, other in ((a, b), (b, a)):
            if _is_plain(one) and one == 1:
                return other
    if op == "/":
        if zero_a:
            return 0.0
        if _is_plain(b) and b == 1:
            return a
    return Node(op, (a, b))


@functools.cache
def symbol(kind: str, name: str, side: str = "", component: int | str | None = None) -> Node:
    """A value that the composer knows where to find (see :class:`particell.compute.composer`)."""
    return Node("symbol", (), (kind, name, side, component))


@functools.cache
def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """A plain function, compiled."""
    return njit(error_model="numpy")(function)


def call(function: Callable[..., Any], args: Sequence[Any], results: int = 1, early: bool = False):
    """What a function of numbers gives, for what arithmetic cannot say: a table, a solver.

    Parameters
    ----------
    function
        Of numbers, such as Numba compiles; it may read arrays that never change.
    args
        What it is given.
    results
        How many numbers it gives.
    early
        Functions that branch or look up tables would keep a loop from being vectorised: they are
        called where neighbours are gathered.
    """
    if any(_symbolic(a) for a in args) and results == 1:
        return _sympy().Function(getattr(function, "py_func", function).__name__)(*args)
    if not any(isinstance(a, Node) for a in args):
        return getattr(function, "py_func", function)(*args)
    if not hasattr(function, "py_func"):
        function = _compiled(function)
    whole = Node("call", tuple(args), (function, results, early))
    if results == 1:
        return whole
    return tuple(Node("item", (whole,), k) for k in range(results))


def early(value: Number) -> Number:
    """The value, computed where neighbours are gathered (once a pair, and not in vectors)."""
    return Node("early", (value,)) if isinstance(value, Node) else value


def _any_node(*values: Any) -> bool:
    return any(isinstance(v, Node) for v in values)


def _symbolic(value: Any) -> bool:
    return type(value).__module__.split(".")[0] == "sympy"


def _sympy() -> Any:
    import sympy  # where a law is given its symbols it is there

    return sympy


def sqrt(x: Number) -> Number:
    """The square root."""
    if isinstance(x, Node):
        return Node("sqrt", (x,))
    if _symbolic(x):
        return _sympy().sqrt(x)
    return x**0.5 if hasattr(x, "dimensionality") else np.sqrt(x)


def _function(name: str) -> Callable[[Number], Number]:
    def function(x: Number) -> Number:
        if isinstance(x, Node):
            return Node(name, (x,))
        return getattr(_sympy() if _symbolic(x) else np, name)(x)

    function.__name__ = name
    function.__doc__ = f"``{name}`` of a number, node or symbol."
    return function


exp, log, sin, cos, tanh = map(_function, ("exp", "log", "sin", "cos", "tanh"))


def where(condition: Number, a: Number, b: Number) -> Number:
    """``a`` where the condition holds, else ``b``."""
    if _any_node(condition, a, b):
        if isinstance(condition, bool | np.bool_):
            return a if condition else b
        return Node("where", (condition, a, b))
    if any(_symbolic(v) for v in (condition, a, b)):
        return _sympy().Piecewise((a, condition), (b, True))
    if isinstance(condition, bool | np.bool_):  # quantities keep their units
        return a if condition else b
    return np.where(condition, a, b)


def maximum(a: Number, b: Number) -> Number:
    """The larger one."""
    if _any_node(a, b):
        return Node("max", (a, b))
    return _sympy().Max(a, b) if _symbolic(a) or _symbolic(b) else np.maximum(a, b)


def minimum(a: Number, b: Number) -> Number:
    """The smaller one."""
    if _any_node(a, b):
        return Node("min", (a, b))
    return _sympy().Min(a, b) if _symbolic(a) or _symbolic(b) else np.minimum(a, b)


class Base:
    """Components of a vector that vectors are multiples of."""

    __slots__ = ("name", "parts")

    def __init__(self, name: str, parts: Iterable[Number]):
        self.name, self.parts = name, tuple(parts)


class Vector:
    """A sum of coefficients times base vectors; see the module's docstring."""

    __slots__ = ("terms",)
    __array_ufunc__ = None  # an array times a vector is a vector of arrays

    def __init__(self, terms: dict[Base, Number]):
        self.terms = terms

    @classmethod
    def of(cls, name: str, parts: Iterable[Number]) -> Vector:
        """A vector of given components, which becomes a base."""
        return cls({Base(name, parts): 1.0})

    @property
    def dim(self) -> int:
        """Number of components; 0 of the zero vector."""
        return max((len(base.parts) for base in self.terms), default=0)

    def parts(self, dim: int) -> tuple[Number, ...]:
        """The components."""
        sums: list[Number] = [0.0] * dim
        for base, factor in self.terms.items():
            if len(base.parts) != dim:
                raise ValueError(f"a vector of {len(base.parts)} components in {dim} dimensions")
            for d in range(dim):
                sums[d] = sums[d] + factor * base.parts[d]
        return tuple(sums)

    def __add__(self, other: Vector | float) -> Vector:
        if not isinstance(other, Vector):
            if _is_plain(other) and other == 0:
                return self
            return NotImplemented
        terms = dict(self.terms)
        for base, factor in other.terms.items():
            terms[base] = terms[base] + factor if base in terms else factor
        return Vector(terms)

    __radd__ = __add__

    def __neg__(self) -> Vector:
        return self * -1.0

    def __sub__(self, other: Vector) -> Vector:
        return self + -other

    def __mul__(self, factor: Number) -> Vector:
        if isinstance(factor, Vector | Symmetric):
            return NotImplemented
        return Vector({base: factor * own for base, own in self.terms.items()})

    __rmul__ = __mul__

    def __truediv__(self, divisor: Number) -> Vector:
        return self * (1.0 / divisor)

    def dot(self, other: Vector) -> Number:
        """The scalar product."""
        total: Number = 0.0
        for base, factor in self.terms.items():
            for its, by in other.terms.items():
                product: Number = 0.0
                for p, q in zip(base.parts, its.parts, strict=True):
                    product = product + p * q
                total = total + factor * by * product
        return total

    def outer(self, other: Vector) -> Symmetric:
        """½ (a b + b a)."""
        dim = max(self.dim, other.dim)
        a, b = self.parts(dim), other.parts(dim)
        return Symmetric(
            dim,
            {
                (p, q): a[p] * b[q] if p == q else 0.5 * (a[p] * b[q] + a[q] * b[p])
                for p in range(dim)
                for q in range(p, dim)
            },
        )


def vector(*parts: Number) -> Vector:
    """A vector of given components, one for each dimension."""
    return Vector.of("vector", parts)


class Symmetric:
    """A symmetric tensor: components (p, q) with p ≤ q, row by row."""

    __slots__ = ("dim", "values")
    __array_ufunc__ = None

    def __init__(self, dim: int, values: dict[tuple[int, int], Number]):
        self.dim, self.values = dim, values

    @classmethod
    def unit(cls, dim: int, factor: Number = 1.0) -> Symmetric:
        """A multiple of the unit tensor."""
        places = [(p, q) for p in range(dim) for q in range(p, dim)]
        return cls(dim, {place: factor if place[0] == place[1] else 0.0 for place in places})

    def parts(self, dim: int) -> tuple[Number, ...]:
        """The components of the upper triangle, row by row."""
        assert dim == self.dim
        return tuple(self.values[p, q] for p in range(dim) for q in range(p, dim))

    def __add__(self, other: Symmetric | float) -> Symmetric:
        if not isinstance(other, Symmetric):
            return self if _is_plain(other) and other == 0 else NotImplemented
        return Symmetric(self.dim, {k: v + other.values[k] for k, v in self.values.items()})

    __radd__ = __add__

    def __mul__(self, factor: Number) -> Symmetric:
        if isinstance(factor, Vector | Symmetric):
            return NotImplemented
        return Symmetric(self.dim, {k: factor * v for k, v in self.values.items()})

    __rmul__ = __mul__

    def __matmul__(self, vector: Vector) -> Vector:
        parts = vector.parts(self.dim)
        sums = []
        for p in range(self.dim):
            total: Number = 0.0
            for q in range(self.dim):
                total = total + self.values[min(p, q), max(p, q)] * parts[q]
            sums.append(total)
        return Vector.of("product", sums)


def components(value: Any, dim: int) -> tuple[Number, ...]:
    """A number as one component, a vector's or a tensor's own."""
    return value.parts(dim) if isinstance(value, Vector | Symmetric) else (value,)
