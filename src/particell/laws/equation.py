"""The equation of a law, read from its code."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from particell.compute.expressions import Symmetric, Vector
from particell.errors import MissingExtra
from particell.laws.dimensions import VECTORS
from particell.laws.law import Law, Values

#: How fields and properties are written.
WRITTEN = {
    "density": "rho",
    "density_half": "rho",
    "volume": "V",
    "mass": "m",
    "support": "h",
    "transverse": "a",
    "radial": "b",
    "thermal": "kT",
    "reference": "rho0",
    "pressure": "P",
    "pressure_over_square": "Pi",
    "kernel_sum": "n",
    "specific_volume": "nu",
    "shift_velocity": "delta v",
    "inverse_dt": "1/dt",
}


#: What is not of a particle.
COMMON = ("gravity", "inverse_dt")


class _Symbols:
    """A particle or a pair of which everything is a symbol."""

    wall = False
    extrapolation = 1.0

    def __init__(self, side: str, dim: int = 1, **values: Any):
        self._side, self.dim = side, dim
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        import sympy

        if name.startswith("__"):
            raise AttributeError(name)
        side = "" if name in COMMON else f"_{self._side}"
        if name not in VECTORS:
            return sympy.Symbol(f"{WRITTEN.get(name, name)}{side}", positive=True)
        if self.dim == 1:
            return Vector.of(name, [sympy.Symbol(f"{name}{side}", positive=True)])
        names = "xyz" if name == "x" else [f"{name}_{axis}" for axis in "xyz"]
        parts = [sympy.Symbol(f"{names[d]}{side}", real=True) for d in range(self.dim)]
        return Vector.of(name, parts)

    def noise(self, _: bool) -> Vector:
        """The numbers of a noise."""
        import sympy

        return Vector.of("noise", [sympy.Symbol("xi_ij", real=True)])


def equations(law: Law, dim: int = 1) -> dict[str, Any]:
    """What a pair of fluid particles adds by a law, as SymPy's expressions, and what is finished.

    Vectors of pairs are written by one component: x, v and products with e are along the line of
    both. What is added when all neighbours have been visited (:meth:`.Law.finish`) has all of its
    components, and the sums of the law's own in it are written ``sum_NAME``.

    Parameters
    ----------
    law
        The law.
    dim
        The number of dimensions.

    Returns
    -------
    dict
        An expression for each name that the law adds to, ``NAME, at the end`` for what is finished;
        several where that is a vector.

    Raises
    ------
    InputError
        Where SymPy is missing.
    """
    try:
        import sympy
    except ImportError:
        raise MissingExtra("printing equations", "SymPy", "equations") from None
    i, j = _Symbols("i"), _Symbols("j")
    e = sympy.Symbol("e_ij", real=True)
    r = sympy.Symbol("r_ij", positive=True)
    kernel = sympy.Symbol("F_ij", positive=True)
    ij = _Symbols("ij", r=r, square=r**2, F=kernel, e=Vector.of("e", [e]), weight=j.volume * kernel)
    pair = law.pair(i, j, ij)
    found: dict[str, Any] = {name: _plain(_only(value)) for name, value in pair.items()}
    sums = {name: _sum(name, pair.get(name), dim) for name in law.own}
    for name, value in law.finish(_Symbols("i", dim), Values(**sums)).items():
        key = f"{name}, at the end" if name in found or law.own else name
        parts = value.parts(dim) if isinstance(value, Vector | Symmetric) else (value,)
        found[key] = _plain(parts[0]) if len(parts) == 1 else tuple(map(_plain, parts))
    return found


def _only(value: Any) -> Any:
    """The one component of what a pair adds."""
    return value.parts(1)[0] if isinstance(value, Vector | Symmetric) else value


def _sum(name: str, value: Any, dim: int) -> Any:
    """A sum of the law's own, of the kind that pairs add."""
    import sympy

    if isinstance(value, Vector):
        return Vector.of(name, [sympy.Symbol(f"sum_{name}_{axis}") for axis in "xyz"[:dim]])
    if isinstance(value, Symmetric):
        places = [(p, q) for p in range(dim) for q in range(p, dim)]
        return Symmetric(dim, {place: sympy.Symbol(f"sum_{name}_{place}") for place in places})
    return sympy.Symbol(f"sum_{name}")


def _plain(value: Any) -> Any:
    """An expression whose floats are fractions, also of π and √2, where they are simple ones."""
    import sympy

    return sympy.sympify(value).replace(lambda e: e.is_Float, lambda e: _simple(float(e)))


def _simple(value: float) -> Any:
    import sympy

    for factor, written in ((1.0, 1), (math.pi, sympy.pi), (math.sqrt(2.0), sympy.sqrt(2))):
        near = Fraction(value / factor).limit_denominator(1000)
        if near and abs(float(near) * factor - value) < 1e-13 * abs(value):
            return sympy.Rational(near.numerator, near.denominator) * written
    return sympy.Float(value, 6)
