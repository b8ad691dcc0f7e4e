"""Fluids at rest: thermal equilibrium, and hydrostatic equilibrium."""

from __future__ import annotations

import numpy as np
import pytest

from particell.materials import density_of
from systems import UNIT_TEMPERATURE, channel, fluid_rows, periodic_lattice, unit_fluid


@pytest.mark.parametrize(
    ("side", "dim", "support", "steps"), [(16, 2, 3.0, 24000), (8, 3, 2.8, 8000)]
)
def test_equipartition(side, dim, support, steps):
    """⟨½ m v²⟩ = (D/2) k_B T within 1 % at the automatic time step, and no drift of momentum.

    The standard error is taken from 20 blocks and has to be so small that 1 % and the 0.3 % that
    the integrator is known to keep are five standard errors apart: a false alarm of 1e-6.
    """
    material = unit_fluid(viscosity=20.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
    simulation = periodic_lattice(
        side,
        dim,
        material,
        velocity=lambda x: np.random.default_rng(3).normal(size=x.shape),
        support=support,
        seed=4,
        fluctuations=True,
        density="summation",
    )
    simulation.advance(200)
    n, temperature = side**dim, []
    for _ in range(steps // 5):
        simulation.advance(5)
        v = simulation.particles.host("v")
        v = v - v.mean(axis=0)
        mass = simulation.particles.host("mass")[0]
        temperature.append(mass * (v**2).sum() / (dim * (n - 1)))
    blocks = np.array(temperature).reshape(20, -1).mean(axis=1)
    error = blocks.std(ddof=1) / np.sqrt(20)
    assert error < 1.4e-3
    assert blocks.mean() == pytest.approx(1, abs=0.01)
    assert simulation.conservation()["momentum"] < 1e-12


def test_hydrostatic_column_stays_as_it_is():
    """Between walls under gravity, the density profile keeps its shape and nothing moves."""
    gravity, height, sound = 0.01, 16, 10.0
    material = unit_fluid(viscosity=0.5, sound_speed=sound)
    simulation = channel((8, height), material, gravity=(0.0, -gravity), density_diffusion=0.1)
    p = simulation.particles

    def profile(y):
        exact = [density_of(gravity * (height / 2 - s), 1.0, sound, 7.0, 0.0) for s in y]
        return np.array(exact)

    inside = fluid_rows(simulation)
    density = np.array(p.host("density"))
    density[inside] = profile(p.host("x")[inside, 1])
    p.set("density", density)
    p.set("mass", density)
    simulation.advance(int(3 * height / sound / simulation.dt))
    inside = fluid_rows(simulation)
    y, found = p.host("x")[inside, 1], p.host("density")[inside]
    span = gravity * height / sound**2
    assert np.abs(found - profile(y)).max() < 0.03 * span
    speed = np.linalg.norm(p.host("v")[inside], axis=1).max()
    assert speed < 0.01 * np.sqrt(2 * gravity * height)  # of a fall through the column
