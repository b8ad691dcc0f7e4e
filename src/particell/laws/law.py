r"""What a law is: the equation of what particles do to each other, and nothing else.

A law says what a pair adds to the sums of particle *i* (:meth:`Law.pair`) and what becomes of the
sums when all neighbours have been visited (:meth:`Law.finish`). It is plain arithmetic on what it
is given, so that one definition is made into loops (:mod:`particell.compute.composer`), evaluated
on numbers, on quantities with units, and on SymPy's symbols.

``i`` and ``j`` show what is known of the two particles: fields (``i.density``) and properties of
their materials (``i.transverse``). ``ij`` is what the pair has (:class:`.Pair`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from particell.compute.expressions import Number, Vector, sqrt
from particell.errors import InputError
from particell.laws import digest

#: What a law adds, by the name of a field or of one of its own sums.
Adds = Mapping[str, Any]


class Law:
    """A law between particles; derive from it and write :meth:`pair`."""

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in sorted(vars(self).items()))
        return f"{type(self).__name__}({values})"

    #: Names that :meth:`pair` and :meth:`finish` give, other than fields: sums of its own.
    own: ClassVar[tuple[str, ...]] = ()

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """What j adds to the sums of i: numbers, vectors or symmetric tensors by name.

        A name is that of a field, to which everything is added, or one of :attr:`own`.
        """
        return {}

    def finish(self, i: Any, sums: Any) -> Adds:
        """What is added to fields of i when all neighbours have been visited.

        ``sums`` has the law's :attr:`own` ones as attributes.
        """
        return {}

    def largest_step(self, i: Any) -> Number:
        """The largest time step in s that the law allows particle i; without limit by default.

        It is asked where an automatic step is chosen, with arrays of all particles. Right is about
        1/λ where the law makes something decay, at most at the rate λ, and 1/(2ω) where it makes
        particles swing, at most with the frequency ω.
        """
        return math.inf

    def described(self) -> str:
        """Text that is the same for the same law: a run goes on with the laws that it began with.

        Values in full, functions by their code (:mod:`particell.laws.digest`). A law that holds
        something else says here what it is.
        """
        return digest.described(self)


def check_law(law: Any) -> None:
    """Refuse what is no law, or one that would do nothing.

    Raises
    ------
    InputError
        Naming the law.
    """
    if not isinstance(law, Law):
        allowed = "laws: instances of classes derived from particell.Law"
        raise InputError("more (laws)", law, allowed)
    kind = type(law)
    if all(
        getattr(kind, does) is getattr(Law, does) for does in ("pair", "finish", "largest_step")
    ):
        written = ", ".join(name for name in vars(kind) if not name.startswith("_")) or "neither"
        raise InputError(f"law {kind.__name__}", written, "one with a method 'pair' or 'finish'")
    if isinstance(law.own, str) or not all(isinstance(name, str) for name in law.own):
        raise InputError(f"own of {kind.__name__}", law.own, 'names, such as own = ("weights",)')


def numbers_of(law: Law) -> dict[str, float]:
    """The law's own numbers that may change while it runs: those that are no whole numbers."""
    kinds = (float, np.floating, np.ndarray)
    found = {name: v for name, v in vars(law).items() if isinstance(v, kinds)}
    return {name: float(v) for name, v in found.items() if np.ndim(v) == 0}


def number_of(law: Law, name: str) -> float:
    """The law's own number of that name, as it is now.

    Raises
    ------
    InputError
        Where it is no number any more.
    """
    value = getattr(law, name, None)
    if type(value) is float:
        return value
    if isinstance(value, (int, np.integer, np.floating, np.ndarray)) and np.ndim(value) == 0:
        return float(value)
    raise InputError(f"{name} of {type(law).__name__}, changed,", value, "a number")


def fixed_of(law: Law) -> dict[str, int]:
    """The law's own whole numbers that could change, which are part of its loops."""
    if digest.is_frozen(type(law)):
        return {}
    kinds = (int, np.integer)
    return {name: int(v) for name, v in vars(law).items() if isinstance(v, kinds)}


class Values:
    """Numbers by name, as attributes: what a law is given where it is evaluated by hand."""

    def __init__(self, **values: Number):
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        known = ", ".join(self.__dict__) or "none: a law names its sums in 'own'"
        raise AttributeError(f"there is no '{name}'; there are {known}")

    def replace(self, **values: Number) -> Values:
        """The same with other values."""
        return Values(**{**self.__dict__, **values})


def pair_of(i: Values, j: Values, F: Number, W: Number = 0.0, **more: Any) -> Values:
    """The pair of two particles given by hand, for laws to be evaluated on.

    Parameters
    ----------
    i, j
        With ``x``, ``v`` (:class:`.Vector`), ``support`` and what the law reads.
    F, W
        The kernel's −W'/r and value: numbers, quantities or symbols.
    **more
        What the pair has besides (``wall``, ``extrapolation``, ``noise``, …).
    """
    dim = i.x.dim
    x, v = (
        Vector.of(name, (p - q for p, q in zip(a.parts(dim), b.parts(dim), strict=True)))
        for name, a, b in (("x", i.x, j.x), ("v", i.v, j.v))
    )
    square = x.dot(x)
    r = sqrt(square)
    values = {
        "x": x,
        "v": v,
        "square": square,
        "r": r,
        "e": (1.0 / r) * x,
        "support": 0.5 * (i.support + j.support),
        "F": F,
        "W": W,
        "weight": j.volume * F,
        "wall": False,
        "extrapolation": 1.0,
    }
    return Values(**{**values, **more})
