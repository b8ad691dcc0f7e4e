"""The volume of fluid that fills its space is kept where nobody says otherwise."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc

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
    """Left to itself it shrinks by 1e-3 and more here; between builds it may do that."""
    simulation = cavity(scheme)
    simulation.advance(400)
    simulation.solver.build_list()
    assert volume(simulation) == pytest.approx(6.0**3, rel=1e-12)
    assert abs(simulation.conservation()["volume put right"]) > 1e-4


def test_of_compressed_fluid_it_is_that_of_the_start():
    simulation = cavity(pc.TransportVelocity(), dim=2)
    fluid = simulation.particles.host("is_wall") == 0
    density = np.where(fluid, 1.01, simulation.particles.host("density"))
    simulation.particles.set("density", density)
    simulation.advance(50)
    simulation.solver.build_list()
    assert volume(simulation) == pytest.approx(36.0 / 1.01, rel=1e-12)


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
