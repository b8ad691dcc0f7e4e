"""Particles at the same place, within a phase, between phases and across edges: one line."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.errors import InputError
from particell.geometry.fill import arranged
from systems import unit_fluid

BOX = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
WATER = unit_fluid()
SCHEMES = [pc.SDPD(), pc.TransportVelocity(), pc.Static()]


def phase(points, name="fluid", **options) -> pc.Phase:
    return pc.Phase(name, WATER, np.asarray(points, float), 1.0, **options)


def refused(scheme, phases, *words) -> None:
    with pytest.raises(InputError) as error:
        pc.Simulation(BOX, phases, scheme)
    message = str(error.value)
    assert "\n" not in message and "on top of each other" in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda s: type(s).__name__)
def test_overlap_is_refused_by_every_scheme(scheme):
    water = pc.fluid(BOX, WATER, 1.0)
    refused(scheme, [water, pc.fluid(BOX, WATER, 1.0, name="again")], "'again and fluid'", "500")
    shifted = phase(water.points[:5] + np.array([0.1, 0.0]), "again")
    refused(scheme, [water, shifted], "'again and fluid'")
    wall = phase([(4.5, 4.6)], "wall", kind="wall")
    refused(scheme, [water, wall], "'fluid and wall'")
    refused(scheme, [phase([(0.05, 4)]), phase([(7.95, 4)], "b")], "'b and fluid'", "4) m")
    refused(scheme, phase([(1, 1), (3, 3), (1, 1 + 1e-9)]), "'fluid'", "(1, 1) m")
    refused(scheme, phase([(0, 4), (8, 4)]), "'fluid'")
    many = [phase([(1, 1), (1.05, 1)]), phase([(1.1, 1)], "b")]  # the nearest are of one phase
    refused(scheme, many, "'b and fluid'")


@pytest.mark.parametrize(
    "phases",
    [
        [phase([(1, 0.05)]), phase([(1, 7.95)], "b")],  # y is not periodic
        [phase([(1, 1)]), phase([(1.21, 1)], "b")],
        # a large support is no large particle
        [phase([(1, 1)], spacing=1.3), phase([(1.25, 1)], "b", spacing=1.3)],
        phase(np.random.default_rng(1).random((64, 2)) * 8),  # a phase may be at random
        [pc.fluid(BOX, WATER, 1.0), *pc.channel_walls(BOX, WATER, 1.0, axis=1)],
        *(phase(arranged(BOX, 1.0, kind, 3)) for kind in ("hexagonal", "jittered", "packed")),
    ],
)
def test_what_does_not_overlap(phases):
    pc.Simulation(BOX, phases, pc.Static())
