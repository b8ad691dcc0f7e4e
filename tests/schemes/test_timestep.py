from __future__ import annotations

import math

import numpy as np
import pytest

from particell.errors import InputError
from particell.schemes.timestep import sound_speed_by_rule, step_limits
from systems import UNIT_TEMPERATURE, periodic_lattice, unit_fluid


def test_limits():
    limits = step_limits(3.0, 10.0, 2.0, 0.5, 4.0)
    assert limits.sound == pytest.approx(0.25 * 3 / 12)
    assert limits.viscosity == pytest.approx(0.05 * 9 / 0.5)
    assert limits.acceleration == pytest.approx(0.25 * math.sqrt(3 / 4))
    assert limits.smallest == limits.sound
    assert limits.reason == "sound"
    assert step_limits(3.0, 1.0, 0.0, 500.0, 0.0).reason == "viscosity"
    assert step_limits(3.0, 1e-9, 0.0, 0.0, 4.0).reason == "acceleration"
    assert step_limits(3.0, 1.0, 0.0, 0.0, 0.0).smallest == 0.75


def test_sound_speed():
    assert sound_speed_by_rule(2.0, 0.0, 1000.0, 0.0) == pytest.approx(20)
    assert sound_speed_by_rule(0.0, 90.0, 10.0, 0.0) == pytest.approx(30)
    assert sound_speed_by_rule(1.0, 1.0, 10.0, 16.0) == pytest.approx(40)
    for nothing in ((0.0, 0.0, 1.0, 0.0), (math.nan, 0.0, 1.0, 0.0)):
        with pytest.raises(InputError, match="sound_speed"):
            sound_speed_by_rule(*nothing)


def test_simulations_follow_the_rules():
    material = unit_fluid(sound_speed=None)
    simulation = periodic_lattice(
        10, 2, material, gravity=(0.0, -0.01), reference_speed=0.2, pressure_drop=0.05
    )
    sound = math.sqrt(100 * max(0.2**2, 0.05, 0.01 * 10))
    assert simulation.materials[0].sound_speed == pytest.approx(sound)
    limits = step_limits(3.0, sound, 0.2, 0.1, 0.01)
    assert simulation.dt == pytest.approx(limits.smallest)
    moving = periodic_lattice(10, 2, material, velocity=(3.0, 4.0))
    assert moving.materials[0].sound_speed == pytest.approx(50)
    bulk = periodic_lattice(
        10, 2, unit_fluid(viscosity=10.0, bulk_viscosity=20.0, sound_speed=1e-3)
    )
    assert bulk.dt == pytest.approx(0.05 * 9 / 20)


def test_noise_is_fast_and_the_trapezoidal_rule_needs_small_steps():
    material = unit_fluid(viscosity=5.0, temperature=UNIT_TEMPERATURE)
    quick = periodic_lattice(10, 2, material, fluctuations=True, density="summation")
    assert quick.dt == pytest.approx(0.25 * 3 / (10 + 3))  # three thermal speeds of a particle
    slow = periodic_lattice(
        10, 2, material, fluctuations=True, integrator="trapezoidal", density="summation"
    )
    assert slow.dt == pytest.approx(min(quick.dt, 0.005 * 9 / 5))
    assert np.isfinite(slow.dt)


def test_steps_divide_intervals():
    simulation = periodic_lattice(10, 2)
    largest = simulation.largest_step()
    for every in (0.3 * largest, largest, 1.01 * largest, 7.7 * largest):
        steps = simulation.plan(every)
        assert steps * simulation.dt == pytest.approx(every, rel=1e-14)
        assert simulation.dt <= largest * (1 + 1e-9)
        assert steps == math.ceil(every / largest - 1e-9)
    for wrong in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(InputError, match="every"):
            simulation.plan(wrong)
