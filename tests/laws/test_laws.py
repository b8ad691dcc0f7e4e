"""Every law at once: what is claimed of it is proved with symbols, its dimension with units."""

from __future__ import annotations

import numpy as np
import pint
import pytest
import sympy

from particell.compute.expressions import Symmetric, Vector
from particell.laws.continuity import Continuity, DensityDiffusion
from particell.laws.fluctuations import ThermalNoise
from particell.laws.law import Values, pair_of
from particell.laws.pressure import PressureForce
from particell.laws.shifting import Crowding
from particell.laws.sums import DensityFilter, KernelSum, SummedDensity
from particell.laws.transport_velocity import (
    ConsistentContinuity,
    MomentumFlux,
    TransportContinuity,
)
from particell.laws.viscosity import Viscosity

VISCOUS = Viscosity(radial=True)
#: Forces that pairs exert on each other, by the name of what they add.
FORCES = [
    PressureForce(),
    PressureForce("switched"),
    PressureForce(contrast=True),
    Viscosity(radial=False),
    VISCOUS,
    Viscosity(radial=True, normalised=True),
    ThermalNoise(VISCOUS),
]
#: Laws that depend on differences of velocity alone.
GALILEAN = [
    *FORCES,
    PressureForce("difference"),
    Continuity(),
    DensityDiffusion(),
    ConsistentContinuity(),
    TransportContinuity(),
    MomentumFlux("uniform"),
    Crowding(),
]
#: What each law adds, and its unit in two dimensions (masses are per depth).
UNITS = [
    *((law, "m/s^2") for law in FORCES),
    (PressureForce("difference"), "m/s^2"),
    (Continuity(), "kg/m^3/s"),
    (DensityDiffusion(), "kg/m^3/s"),
    (TransportContinuity(), "kg/m^3/s"),
    (MomentumFlux("uniform"), "m/s^2"),
    (MomentumFlux("conserving"), "m/s^2"),
    (Crowding(), "m"),
    (KernelSum(), ""),
]
SCALARS = {
    "density": "kg/m^3",
    "mass": "kg/m",
    "volume": "m^2",
    "support": "m",
    "pressure_over_square": "Pa/(kg/m^3)^2",
    "transverse": "Pa*s",
    "radial": "Pa*s",
    "thermal": "J/m",
    "kernel_sum": "",
    "diffusion": "m/s",
    "equation": "",
    "fluid": "",
    "inverse_dt": "1/s",
    "reference": "kg/m^3",
}
VECTORS = {"x": "m", "v": "m/s", "shift_velocity": "m/s"}
IDS = [f"{type(law).__name__}{k}" for k, law in enumerate(GALILEAN)]


def symbols(side):
    """A particle whose values are symbols, in two dimensions."""
    values = {name: sympy.Symbol(f"{name}_{side}", positive=True) for name in SCALARS}
    values["inverse_dt"] = sympy.Symbol("inverse_dt", positive=True)
    for name in VECTORS:
        parts = [sympy.Symbol(f"{name}{axis}_{side}", real=True) for axis in "xy"]
        values[name] = Vector.of(name, parts)
    return Values(dim=2, specific_volume=values["volume"] / values["mass"], **values)


def swapped(i, j, **more):
    """The pair from both ends; numbers of a noise change sign."""
    kernel = {"F": sympy.Symbol("F", positive=True), "W": sympy.Symbol("W", positive=True)}
    numbers = [sympy.Symbol(f"xi_{axis}", real=True) for axis in "xy"]
    found = []
    for first, second, sign in ((i, j, 1), (j, i, -1)):
        noise = Vector.of("noise", [sign * n for n in numbers])
        found.append(pair_of(first, second, **kernel, noise=lambda _, noise=noise: noise, **more))
    return found


def parts(value):
    return value.parts(2) if hasattr(value, "parts") else (value,)


@pytest.mark.parametrize("law", FORCES, ids=IDS[: len(FORCES)])
def test_forces_are_antisymmetric(law):
    """Momentum is conserved: proved, for any values of two particles in units of one density.

    (Masses times accelerations; specific volumes are V/m.)
    """
    i, j = symbols("i"), symbols("j")
    ij, ji = swapped(i, j)
    on_i, on_j = law.pair(i, j, ij)["a"], law.pair(j, i, ji)["a"]
    for a, b in zip(parts(on_i), parts(on_j), strict=True):
        total = i.mass * a + j.mass * b
        if isinstance(law, PressureForce) and law.form == "switched":
            # only where the pair repels
            repels = i.pressure_over_square + j.pressure_over_square
            total = total.subs(sympy.GreaterThan(repels, 0), True)
        assert sympy.simplify(total) == 0


@pytest.mark.parametrize("law", GALILEAN, ids=IDS)
def test_laws_are_galilean(law):
    """The same for particles that all move faster by the same velocity."""
    i, j = symbols("i"), symbols("j")
    boost = Vector.of("boost", sympy.symbols("U V", real=True))
    ij, _ = swapped(i, j)
    moving = [p.replace(v=Vector.of("v", parts(p.v + boost))) for p in (i, j)]
    theirs, _ = swapped(*moving)
    rest, boosted = law.pair(i, j, ij), law.pair(*moving, theirs)
    for name, value in rest.items():
        values = value.values.values() if hasattr(value, "values") else parts(value)
        others = boosted[name]
        others = others.values.values() if hasattr(others, "values") else parts(others)
        for a, b in zip(values, others, strict=True):
            assert sympy.simplify(a - b) == 0


def test_dissipation_and_fluctuation_balance():
    """⟨F F⟩ Δt = 2 k_BT times the friction, component by component."""
    i, j = symbols("i"), symbols("j")
    same = {"transverse": i.transverse, "radial": i.radial, "thermal": i.thermal}
    j = j.replace(**same)
    ij, _ = swapped(i, j)
    noise = parts(ThermalNoise(VISCOUS).pair(i, j, ij)["a"])
    drag = parts(VISCOUS.pair(i, j, ij)["a"])
    numbers = sympy.symbols("xi_x xi_y", real=True)
    relative = [sympy.Symbol(f"v{axis}_i", real=True) for axis in "xy"]
    rate = i.inverse_dt
    for p in range(2):
        for q in range(2):
            product = sympy.expand(noise[p] * noise[q])
            covariance = sum(product.coeff(n, 2) for n in numbers)
            friction = -sympy.diff(drag[p], relative[q])
            expected = 2 * i.thermal * friction / i.mass * rate
            difference = sympy.nsimplify(covariance - expected, rational=True)
            assert sympy.ratsimp(sympy.expand(sympy.numer(sympy.together(difference)))) == 0


@pytest.fixture(scope="module")
def quantities():
    """Two particles with units, in two dimensions."""
    registry = pint.UnitRegistry()
    for kind in (Vector, Symmetric):  # which know better how to be multiplied by a quantity
        pint.compat.upcast_type_map[f"{kind.__module__}.{kind.__name__}"] = kind
    random = np.random.default_rng(1)

    def side():
        values = {n: random.uniform(1, 2) * registry(u or "1") for n, u in SCALARS.items()}
        for name, unit in VECTORS.items():
            values[name] = Vector.of(name, random.uniform(1, 2, 2) * registry(unit))
        return Values(dim=2, specific_volume=values["volume"] / values["mass"], **values)

    return registry, side(), side()


@pytest.mark.parametrize(("law", "unit"), UNITS)
def test_dimensions(law, unit, quantities):
    registry, i, j = quantities
    noise = Vector.of("noise", [0.3 * registry("1"), 0.4 * registry("1")])
    ij = pair_of(i, j, 2.0 * registry("1/m^4"), 1.0 * registry("1/m^2"), noise=lambda _: noise)
    for value in law.pair(i, j, ij).values():
        for part in parts(value):
            assert part.check(registry(unit or "1").dimensionality)


def test_own_sums_are_declared():
    """A law adds to fields and to the sums that it says are its own, and to nothing else."""
    fields = {"a", "density_rate", "shift", "flux", "kernel_sum"}
    i, j = symbols("i"), symbols("j")
    ij, _ = swapped(i, j)
    laws = [*GALILEAN, SummedDensity(), DensityFilter(False), KernelSum()]
    for law in laws:
        assert set(law.pair(i, j, ij)) <= fields | set(law.own)
