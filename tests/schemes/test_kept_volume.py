"""The volume of fluid that fills its space is kept where nobody says otherwise."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.operations.kept_volume import EVERY
from systems import vortices

WATER = pc.Fluid(density=1.0, viscosity=20.0, sound_speed=10.0)


def cavity(scheme, dim=3, side=6, boundaries=()):
    box = pc.Domain((0,) * dim, (side,) * dim)
    sliding = {"y-upper": (0.1,) + (0.0,) * (dim - 1)}
    walls = pc.box_walls(box, WATER, 1.0, sliding={} if boundaries else sliding)
    return pc.Simulation(box, [pc.fluid(box, WATER, 1.0), *walls], scheme, boundaries=boundaries)


def volume(simulation):
    p = simulation.particles
    fluid = p.host("is_wall") == 0
    return float((p.host("mass") / p.host("density"))[fluid].sum())


@pytest.mark.parametrize(
    "scheme", [pc.TransportVelocity(), pc.SDPD(shifting=0.5)], ids=["transport-velocity", "sdpd"]
)
def test_in_a_closed_cavity(scheme):
    """Left to itself it shrinks by 1e-3 and more here; between corrections it may do that.

    What is left after a step that corrects is what the volume has changed by in that step.
    """
    simulation = cavity(scheme)
    for steps in (400, 404):
        simulation.advance(steps - simulation.step)
        drift = simulation.conservation()["volume put right"]
        assert abs(drift) > 1e-3
        since = 1 + steps % EVERY
        assert abs(volume(simulation) / 6.0**3 - 1) < 3 * since * abs(drift) / steps


@pytest.mark.parametrize(
    "scheme",
    [pc.TransportVelocity, lambda **given: pc.SDPD(shifting=0.5, **given)],
    ids=["transport-velocity", "sdpd"],
)
def test_the_skin_changes_nothing(scheme):
    """Lists are built at other steps then, and densities put right in the same ones."""
    found = []
    for skin in (0.05, 0.3):
        box = pc.Domain((0, 0), (12, 12), periodic="xy")
        water = pc.Fluid(density=1.0, viscosity=0.2, sound_speed=10.0)
        vortex = pc.fluid(box, water, 1.0, velocity=vortices(12))
        simulation = pc.Simulation(box, [vortex], scheme(skin=skin))
        simulation.advance(100)
        assert abs(simulation.conservation()["volume put right"]) > 1e-4
        found.append((simulation.neighbours.builds, simulation.particles.by_id("v")))
    assert found[0][0] > 2 * found[1][0]
    assert np.abs(found[0][1] - found[1][1]).max() < 1e-11 * np.abs(found[0][1]).max()


def test_of_compressed_fluid_it_is_that_of_the_start():
    simulation = cavity(pc.TransportVelocity(), dim=2)
    fluid = simulation.particles.host("is_wall") == 0
    density = np.where(fluid, 1.01, simulation.particles.host("density"))
    simulation.particles.set("density", density)
    simulation.advance(50)
    assert volume(simulation) == pytest.approx(36.0 / 1.01, rel=1e-5)


def test_not_of_a_drop_nor_where_it_is_refused():
    box = pc.Domain((0, 0), (20, 20), periodic="xy")
    drop = pc.fluid(box, WATER, 1.0, pc.Ball((10.0, 10.0), 5.0))
    free = pc.Simulation(box, [drop], pc.TransportVelocity())
    refused = cavity(pc.TransportVelocity(fixed_volume=False), dim=2)
    for simulation in (free, refused):
        simulation.advance(2)
        assert simulation.solver.flow.kept_volume.volume == 0.0
        assert "volume put right" not in simulation.conservation()


def test_not_where_walls_move_by_themselves():
    lid = pc.WallMotion("wall-y-upper", velocity=(0.0, -0.01))
    simulation = cavity(pc.TransportVelocity(), dim=2, boundaries=[lid])
    simulation.advance(2)
    assert simulation.solver.flow.kept_volume.volume == 0.0


@pytest.mark.parametrize("steps", [5, 7])
def test_a_continuation_puts_right_in_the_same_steps(steps):
    """Where the volume at the reference density is kept: it is not put right by going on."""
    whole, first, second = (
        cavity(pc.TransportVelocity(fixed_volume=True), dim=2) for _ in range(3)
    )
    whole.advance(steps + 6)
    first.advance(steps)
    second.restore(first.state())
    second.advance(6)
    assert second.conservation() == whole.conservation()
    for name in ("x", "v", "density", "pressure"):
        assert np.array_equal(second.particles.by_id(name), whole.particles.by_id(name)), name
