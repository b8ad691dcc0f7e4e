"""The equation of a law, read from its code."""

from __future__ import annotations

from typing import Any

from particell.compute.expressions import Symmetric, Vector
from particell.errors import InputError
from particell.laws.law import Law

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
VECTORS = ("x", "v", "shift_velocity", "buoyancy", "wall_acceleration", "gravity")


#: What is not of a particle.
COMMON = ("gravity", "inverse_dt")


class _Symbols:
    """A particle or a pair of which everything is a symbol; vectors have one component."""

    dim = 1
    wall = False
    extrapolation = 1.0

    def __init__(self, side: str, **values: Any):
        self._side = side
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        import sympy

        if name.startswith("__"):
            raise AttributeError(name)
        side = "" if name in COMMON else f"_{self._side}"
        written = sympy.Symbol(f"{WRITTEN.get(name, name)}{side}", positive=True)
        return Vector.of(name, [written]) if name in VECTORS else written

    def noise(self, _: bool) -> Vector:
        """The numbers of a noise."""
        import sympy

        return Vector.of("noise", [sympy.Symbol("xi_ij", real=True)])


def equations(law: Law) -> dict[str, Any]:
    """What a pair of fluid particles adds by a law, as SymPy's expressions.

    Vectors are written by one component: x, v and products with e are along the line of both.

    Parameters
    ----------
    law
        The law.

    Returns
    -------
    dict
        An expression for each name that the law adds to.

    Raises
    ------
    InputError
        Where SymPy is missing.
    """
    try:
        import sympy
    except ImportError:
        raise InputError("equations", "asked for", "left out: SymPy is missing (sympy)") from None
    i, j = _Symbols("i"), _Symbols("j")
    e = sympy.Symbol("e_ij", real=True)
    r = sympy.Symbol("r_ij", positive=True)
    kernel = sympy.Symbol("F_ij", positive=True)
    ij = _Symbols("ij", r=r, square=r**2, F=kernel, e=Vector.of("e", [e]), weight=j.volume * kernel)
    found: dict[str, Any] = {}
    for name, value in law.pair(i, j, ij).items():
        if isinstance(value, Vector | Symmetric):
            (value,) = value.parts(1)
        found[name] = value.replace(
            lambda e: e.is_Float, lambda e: sympy.nsimplify(e, [sympy.sqrt(2)], tolerance=1e-12)
        )
    return found
