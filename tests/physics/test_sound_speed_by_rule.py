"""The sound speed that is chosen for a flow in which friction counts, and not inertia."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc


def test_a_slow_cavity_is_hardly_compressed():
    """Re = 1: with ten times the lid's velocity alone density changes by 23 %.

    (And with 20 particles across such a run breaks after 1.7 L/U.) Pressure is singular in the
    lid's corners; the particles next to them see some 8 μU/h.
    """
    domain, spacing = pc.Domain((0, 0), (1, 1)), 1 / 16
    water = pc.Fluid(density=1.0, viscosity=1.0)
    lid = {"y-upper": (1.0, 0.0)}
    simulation = pc.Simulation(
        domain,
        [pc.fluid(domain, water, spacing), *pc.box_walls(domain, water, spacing, sliding=lid)],
        pc.TransportVelocity(fixed_volume=True),
    )
    assert np.isclose(simulation.materials[0].sound_speed, 10 / np.sqrt(2.6 / 16))
    for _ in range(5):
        simulation.advance(100)
        mobile = simulation.particles.host("is_wall") == 0
        away = np.abs(simulation.particles.host("density")[mobile] - 1)
        assert away.max() < 0.1
        assert away.mean() < 0.01


WATER = pc.Fluid(density=1.0, viscosity=0.01)


def sound_of(domain, phases, gravity, **options):
    scheme = pc.SDPD(gravity=gravity, **options)
    return pc.Simulation(domain, phases, scheme).materials[0].sound_speed


def channel_of(domain, spacing, axis=1):
    walls = pc.channel_walls(domain, WATER, spacing, axis=axis)
    return [pc.fluid(domain, WATER, spacing), *walls]


@pytest.mark.parametrize("length", [1.0, 4.0])
@pytest.mark.parametrize("reynolds", [0.1, 10.0, 1000.0])
def test_a_driven_channel_has_the_speed_that_friction_allows(reynolds, length):
    """gH²/8ν, whatever the length of the period (which once counted as a head)."""
    domain, spacing = pc.Domain((0, 0), (length, 1), periodic="x"), 1 / 20
    speed = reynolds * 0.01
    gravity = (8 * 0.01 * speed, 0.0)
    friction = 0.01 * speed / (3 * spacing)
    expected = 10 * np.sqrt(max(speed**2, friction))
    assert sound_of(domain, channel_of(domain, spacing), gravity) == pytest.approx(expected)
    given = sound_of(domain, channel_of(domain, spacing), gravity, reference_speed=3.0)
    assert given == pytest.approx(30.0)


def test_turbulence_bounds_the_speed():
    domain = pc.Domain((0, 0), (1, 1), periodic="x")
    sound = sound_of(domain, channel_of(domain, 1 / 20), (1000.0, 0.0))
    assert sound == pytest.approx(10 * 25 * np.sqrt(1000 * 0.5))


def test_what_walls_hold_is_a_head():
    """Across a channel, in a box, and where a body stands in the way of a periodic flow."""
    domain, spacing = pc.Domain((0, 0), (1, 1), periodic="x"), 1 / 20
    assert sound_of(domain, channel_of(domain, spacing), (0.0, -0.5)) == pytest.approx(
        10 * np.sqrt(0.5)
    )
    around, ball = pc.Domain((0, 0), (1, 1), periodic="xy"), pc.Circle((0.5, 0.5), 0.2)
    points, areas = pc.rings(ball, 0.0, 0.2, spacing)
    body = pc.Phase("body", WATER, points, areas, kind="wall", spacing=spacing, surface=ball)
    phases = [pc.fluid(around, WATER, spacing, ~ball), body]
    assert sound_of(around, phases, (1e-4, 0.0)) == pytest.approx(10 * np.sqrt(1e-4))


def test_a_force_that_nothing_holds_needs_a_speed():
    domain = pc.Domain((0, 0), (1, 1), periodic="xy")
    filled = pc.fluid(domain, WATER, 1 / 10)
    with pytest.raises(pc.InputError, match="reference_speed"):
        sound_of(domain, filled, (1.0, 0.0))
    assert sound_of(domain, filled, (1.0, 0.0), reference_speed=0.5) == pytest.approx(5.0)
    moving = pc.fluid(domain, WATER, 1 / 10, velocity=(0.2, 0.0))
    assert sound_of(domain, moving, (1.0, 0.0)) == pytest.approx(2.0)
    kept = pc.Simulation(
        domain, filled, pc.SDPD(gravity=(1.0, 0.0)), boundaries=[pc.MeanVelocity(0.3)]
    )
    assert kept.materials[0].sound_speed == pytest.approx(6.0)


def test_a_channel_from_rest_ends_at_a_tenth_of_the_sound_speed():
    """Re = 20, where the length of the period as a head gave a third of that."""
    domain, spacing = pc.Domain((0, 0), (0.8, 1), periodic="x"), 1 / 10
    simulation = pc.Simulation(
        domain, channel_of(domain, spacing), pc.TransportVelocity(gravity=(0.016, 0.0))
    )
    run = simulation.run(until=50, progress=False)  # half of H²/ν: 99.3 % of the speed
    mach = run.observable("largest_speed")[-1] / simulation.materials[0].sound_speed
    assert 0.09 < mach < 0.11
