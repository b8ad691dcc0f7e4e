from __future__ import annotations

import math

import numpy as np
import pytest

from particell.errors import InputError, RunError
from particell.output.checkpoint import read_checkpoint
from particell.schemes.friction_limit import stiffest
from particell.schemes.sdpd import SDPD
from particell.schemes.timestep import sound_speed_by_rule, step_limits
from systems import UNIT_TEMPERATURE, periodic_lattice, same_bits, unit_fluid


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
    assert sound_speed_by_rule(1.0, 1.0, 10.0, 16.0, 25.0) == pytest.approx(50)
    for nothing in ((0.0, 0.0, 1.0, 0.0), (math.nan, 0.0, 1.0, 0.0)):
        with pytest.raises(InputError, match="sound_speed"):
            sound_speed_by_rule(*nothing)


def test_simulations_follow_the_rules():
    material = unit_fluid(sound_speed=None)
    simulation = periodic_lattice(
        10, 2, material, gravity=(0.0, -0.01), reference_speed=0.2, pressure_drop=0.05
    )
    sound = math.sqrt(100 * max(0.2**2, 0.05))  # nothing holds gravity along a periodic axis
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
    sound = quick.timing.materials[0].sound_speed
    assert sound > 10.2
    assert quick.dt == pytest.approx(0.25 * 3 / (sound + 3))  # three thermal speeds of a particle
    slow = periodic_lattice(
        10, 2, material, fluctuations=True, integrator="trapezoidal", density="summation"
    )
    viscosity = slow.timing.materials[0].viscosity
    assert slow.dt == pytest.approx(min(quick.dt, 0.005 * 9 / viscosity))
    assert np.isfinite(slow.dt)


def test_what_particles_are_given_limits_the_step():
    """With noise their friction is not the fluid's: 9 % more with this kernel's short support."""
    hot = unit_fluid(viscosity=400.0, sound_speed=10.0, temperature=0.1 * UNIT_TEMPERATURE)
    noise = {"kernel": "wendland-c2", "support": 2.0, "density": "summation", "fluctuations": True}
    how = ("wendland-c2", 2.0, 2, False)
    asked = 2.0**2 / stiffest(SDPD.friction(hot, 2), [SDPD.friction(hot, 2)], *how)
    given = periodic_lattice(8, 2, hot, **noise).timing.materials[0]
    assert 1.08 < given.viscosity / hot.viscosity < 1.11
    assert periodic_lattice(8, 2, hot, **noise).dt == pytest.approx(
        min(1.3 * asked * hot.viscosity / given.viscosity, 0.05 * 4 / given.viscosity)
    )
    with pytest.raises(InputError, match="viscosity makes the step unstable"):
        periodic_lattice(8, 2, hot, dt=1.98 * asked, **noise)


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


def fall():
    """Free fall in a periodic box, from rest: at t = 12 s faster than sound (10 m/s)."""
    return periodic_lattice(8, 2, jitter=0.1, gravity=(0.0, -1.0))


def test_the_step_follows_a_flow_that_becomes_faster(tmp_path):
    whole = fall()
    first = whole.dt
    run = whole.run(until=12, every=1.0, out=tmp_path / "whole", progress=False)
    np.testing.assert_allclose(run.times, np.arange(13.0), rtol=1e-12)
    speed = run.observable("largest_speed")
    assert speed[-1] == pytest.approx(12, rel=0.01)
    assert whole.dt < 0.6 * first
    assert whole.dt <= 1.05 * whole.largest_step(speed[-2])  # that of the last choice
    # 5 % of the step are 0.5 m/s at first: several frames make no choice
    steps = np.diff(run.steps)
    assert (np.diff(steps) >= 0).all()
    assert 3 < len(set(steps)) < 12


def test_a_resumed_run_has_the_same_steps(tmp_path):
    def broken(time, observables):
        if time > 6.5:
            raise RunError("stop", step=0, time=time, field="v", particle=0)
        return False

    whole = fall()
    whole.run(until=12, every=1.0, progress=False)
    options = {"until": 12, "every": 1.0, "out": tmp_path, "progress": False}
    with pytest.raises(RunError, match="stop"):
        fall().run(**options, checkpoint_every=0.0, stop=broken)
    resumed = fall()
    state, _ = read_checkpoint(tmp_path / "checkpoint.h5")
    resumed.restore(state)
    assert 5 < resumed.time < 7
    assert resumed.dt < 0.9 * fall().dt
    run = resumed.run(**options)
    assert same_bits(whole, resumed) == []
    assert (resumed.step, resumed.time, resumed.dt) == (whole.step, whole.time, whole.dt)
    np.testing.assert_allclose(run.times, np.arange(13.0), rtol=1e-12)


def test_a_flow_too_fast_for_its_step_is_an_error():
    simulation = periodic_lattice(8, 2, gravity=(0.0, -10.0))
    with pytest.raises(RunError, match="reference_speed") as error:
        simulation.run(until=20.0, every=20.0, progress=False)
    assert (error.value.field, error.value.step) == ("v", 50)
    given = periodic_lattice(8, 2, gravity=(0.0, -10.0), dt=simulation.dt)
    given.advance(50)  # a time step of one's own is one's own
