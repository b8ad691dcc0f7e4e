"""Loops find their arrays by name: no name means two things."""

from __future__ import annotations

import pytest

import particell as pc


@pytest.mark.parametrize(
    "scheme", [pc.SDPD(shifting=0.5), pc.TransportVelocity()], ids=["sdpd", "transport-velocity"]
)
def test_names_are_given_once(scheme):
    box = pc.Domain((0, 0), (8, 8), periodic="x")
    water = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    walls = pc.channel_walls(box, water, 1.0, axis=1)
    simulation = pc.Simulation(box, [pc.fluid(box, water, 1.0), *walls], scheme)
    names = [*simulation.solver.flow.constants, *simulation.neighbours.fields]
    names += simulation.particles.fields
    assert len(names) == len(set(names))
