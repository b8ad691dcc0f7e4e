"""Dimensions of a law: it is evaluated on quantities with units, where what does not fit shows.

A law is arithmetic on what it is given. Given two particles and their pair as quantities, it gives
quantities, or an error where metres are added to seconds.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pint
from numba.core.errors import NumbaError

from particell.compute.expressions import Symmetric, Vector, components
from particell.errors import InputError
from particell.laws.law import Law, Values, check_law, numbers_of, pair_of
from particell.units import registry

#: Units of what laws may read; ``{p}`` is the power of a missing dimension's metre, 3 − D, since
#: masses are per metre of each, and ``{d}`` is D.
SCALARS = {
    "mass": "kg/m^{p}",
    "volume": "m^{d}",
    "support": "m",
    "density": "kg/m^3",
    "specific_volume": "m^3/kg",
    "pressure": "Pa",
    "pressure_over_square": "Pa/(kg/m^3)^2",
    "transverse": "Pa*s",
    "radial": "Pa*s",
    "thermal": "J/m^{p}",
    "kernel_sum": "",
    "diffusion": "m/s",
    "equation": "",
    "fluid": "",
    "inverse_dt": "1/s",
    "reference": "kg/m^3",
    "sound_speed": "m/s",
    "exponent": "",
    "density_sum": "",
    "own_kernel": "1/m^{d}",
    "rest_height": "m",
    "rest_weight": "Pa/m",
    "rest_pressure": "Pa",
    "background": "Pa",
    "confinement": "Pa",
    "by_fraction": "",
    "time": "s",
}
VECTORS = {
    "x": "m",
    "v": "m/s",
    "shift_velocity": "m/s",
    "gravity": "m/s^2",
    "buoyancy": "m/s^2",
    "wall_acceleration": "m/s^2",
    "rest_direction": "",
    "wall_direction": "",
}
#: Units of what a law may add to.
ADDED = {"a": "m/s^2", "density_rate": "kg/m^3/s", "flux": "m/s^2", "wall_friction": "1/s"}


def check_units(
    law: Law, dim: int = 3, fields: Mapping[str, str] | None = None, **numbers: str
) -> dict[str, str]:
    """Evaluate a law on quantities with units.

    Parameters
    ----------
    law
        The law.
    dim
        Dimensions. Masses are in kg/m^(3−D), since they are per metre of each missing dimension,
        and so are forces.
    fields
        Units of fields of one's own, by name.
    **numbers
        Units of the law's own numbers, by name: ``strength="N/m^6"``.

    Returns
    -------
    dict
        The unit of what the law adds, by name.

    Raises
    ------
    InputError
        Where units do not fit together, or what is added to an acceleration, a field's rate, … has
        another than that.

    Examples
    --------
    >>> from particell.laws.viscosity import Viscosity
    >>> check_units(Viscosity(False))["a"]
    'meter / second ** 2'
    """
    check_law(law)
    units = registry()
    known: Any = pint.compat.upcast_type_map
    for kind in (Vector, Symmetric):  # which know better how to be multiplied by a quantity
        known[f"{kind.__module__}.{kind.__name__}"] = kind
    name = type(law).__name__
    shown = _with_units(law, numbers)
    wanted = {**ADDED, **{f"{n}_rate": f"({u or 1})/s" for n, u in (fields or {}).items()}}
    found: dict[str, str] = {}
    for what, value in _summed(shown, dim, fields or {}):
        found[what] = ""  # of zeros, which have any unit
        for part in components(value, dim):
            if isinstance(part, float) and part == 0.0:
                continue
            unit = units.Quantity(part).to_base_units().units
            found[what] = str(unit)
            if what in wanted and not units.Quantity(part).is_compatible_with(wanted[what]):
                raise InputError(f"unit of what {name} adds to {what}", str(unit), wanted[what])
    return found


def _with_units(law: Law, numbers: Mapping[str, str]) -> Law:
    """The law with units for its own numbers."""
    known, shown = numbers_of(law), object.__new__(type(law))
    shown.__dict__.update(vars(law))
    for name, unit in numbers.items():
        if name not in vars(law):
            raise InputError(f"number of {type(law).__name__}", name, f"one of {', '.join(known)}")
        object.__setattr__(shown, name, _quantity(float(vars(law)[name]), unit))
    return shown


def _quantity(value: float, unit: str) -> Any:
    try:
        return registry().Quantity(value, unit or "")
    except (pint.PintError, AttributeError, TypeError, ValueError) as error:
        raise InputError("unit", unit, f"a unit ({error})") from None


def _summed(law: Law, dim: int, fields: Mapping[str, str]) -> Iterator[tuple[str, Any]]:
    """What a pair of fluids and one with a wall add, and what becomes of the law's own sums."""
    draw = random.Random(1)
    i, j = (_particle(dim, fields, draw) for _ in range(2))
    noise = Vector.of("noise", [_quantity(draw.uniform(1, 2), "") for _ in range(dim)])
    kernel = _quantity(2.0, f"1/m^{dim + 2}"), _quantity(1.0, f"1/m^{dim}")
    sums: dict[str, Any] = dict.fromkeys(law.own, 0.0)
    try:
        for grow in (1.0, 1.7):
            wall = {"wall": grow > 1.0, "extrapolation": _quantity(grow, "")}
            more = {"noise": lambda _: noise, "missed": _quantity(0.1, "m^2"), **wall}
            for name, value in law.pair(i, j, pair_of(i, j, *kernel, **more)).items():
                sums[name] = value + sums[name] if name in sums else value
        own = Values(**{name: sums.pop(name) for name in law.own})
        for name, value in law.finish(i, own).items():
            sums[name] = value + sums[name] if name in sums else value
    except pint.DimensionalityError as error:
        raise InputError(f"units in {type(law).__name__}", str(error), "alike") from error
    except NumbaError:
        allowed = "arithmetic, without compiled functions that call others: they take no units"
        raise InputError(f"law {type(law).__name__}", law, allowed) from None
    yield from sums.items()


def _particle(dim: int, fields: Mapping[str, str], draw: random.Random) -> Values:
    """A particle whose values have units."""
    values: dict[str, Any] = {}
    for name, unit in {**SCALARS, **fields}.items():
        values[name] = _quantity(draw.uniform(1, 2), unit.format(p=3 - dim, d=dim))
    for name in ("equation", "fluid"):  # both particles are of one
        values[name] = _quantity(1.0, "")
    for name, unit in VECTORS.items():
        values[name] = Vector.of(name, [_quantity(draw.uniform(1, 2), unit) for _ in range(dim)])
    values["density"] = values["mass"] / values["volume"]
    values["specific_volume"] = 1 / values["density"]
    values["profile"] = np.linspace(1.0, 0.0, 41)  # of a wall's volume fraction, a table
    return Values(dim=dim, **values)
