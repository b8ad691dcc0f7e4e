"""Volumes and spacings that do not fit the space, and arrangements that do."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.filling import check_filling
from particell.geometry.fill import arranged, lattice

WATER = pc.Fluid(1.0, 0.1, sound_speed=10.0)
BOX = pc.Domain((0, 0), (20, 20), periodic="xy")
POINTS = lattice(BOX, 1.0)


@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize(
    ("volume", "spacing", "word"),
    [
        (4.0, 2.0, "volumes of fluid"),  # those of a lattice twice as coarse
        (1.0, 2.0, "spacing of 'fluid' = 2.0.*points, 1 m"),
        (4.0, 1.0, "volumes of fluid"),
        (0.25, 1.0, "volume of 'fluid' = 0.25.*empty"),
    ],
)
def test_points_of_another_lattice_are_refused(volume, spacing, word, static):
    phase = pc.Phase("fluid", WATER, POINTS, volume, spacing=spacing)
    if static and volume < 1:  # compartments
        check_filling(BOX, [phase], static)
        return
    with pytest.raises(pc.InputError, match=word) as error:
        pc.Simulation(BOX, phase, pc.Static() if static else pc.SDPD(reference_speed=1.0))
    assert "\n" not in str(error.value)


def test_overlapping_bodies_are_refused_where_the_total_is_small():
    box, ball = pc.Domain((0, 0), (40, 40), periodic="xy"), pc.Circle((20, 20), 4.5)
    points, areas = pc.rings(ball, 0.0, 4.5, 1.0)
    points += np.array([0.3, 0.2])  # no two particles at the same place
    inside = pc.Phase("inside", WATER, points, areas, spacing=1.0)
    with pytest.raises(pc.InputError, match="fluid and inside"):
        check_filling(box, [pc.fluid(box, WATER, 1.0), inside], False)
    check_filling(box, [pc.fluid(box, WATER, 1.0, ~ball), inside], False)


def test_only_what_lies_inside_counts():
    """Walls outside, a wall that begins beyond a periodic face, and one that is in the domain."""
    box = pc.Domain((0, 0), (20, 20), periodic="x")
    phases = [pc.fluid(box, WATER, 1.0), *pc.channel_walls(box, WATER, 1.0, axis=1, layers=9)]
    check_filling(box, phases, False)
    extra = pc.Phase(
        "extra", WATER, lattice(box, 1.0)[:160] + np.array([20.5, 0.5]), 1.0, kind="wall"
    )
    with pytest.raises(pc.InputError, match="volumes of fluid and wall-lower"):
        check_filling(box, [*phases, extra], False)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("side", [1, 5, 12])
def test_what_fits_is_accepted(dim, side):
    """Lattices of any size, packed, jittered and random points, corners and edges."""
    for periodic in ("", "xyz"[:dim]):
        box = pc.Domain((0,) * dim, (side,) * dim, periodic=periodic)
        kinds = ["square", "jittered", *(["hexagonal"] if dim == 2 and side > 1 else [])]
        for kind in kinds:
            points = arranged(box, 1.0, kind, 1)
            volume = box.volume / len(points)
            for spacing in (1.0, 1.3):
                check_filling(box, [pc.Phase("f", WATER, points, volume, spacing=spacing)], False)
        for seed in range(5):
            points = np.random.default_rng(seed).random((side**dim, dim)) * side
            check_filling(box, [pc.Phase("f", WATER, points, 1.0)], False)


@pytest.mark.parametrize("radius", [1.4, 2.0, 3.3, 7.7])
def test_lattices_cut_at_shapes_and_rings_are_accepted(radius):
    box = pc.Domain((0, 0), (18, 18))
    for centre in ((9, 9), (9.3, 8.6), (9.5, 9.5)):
        ball = pc.Circle(centre, radius)
        points, areas = pc.rings(ball, 0.0, radius, 1.0)
        body = pc.Phase("body", WATER, points, areas, kind="wall", spacing=1.0, surface=ball)
        check_filling(box, [pc.fluid(box, WATER, 1.0, ~ball), body], False)
        check_filling(box, [pc.fluid(box, WATER, 1.0, ball)], False)


def test_layers_that_are_thin_and_compartments_are_accepted():
    """A membrane of one layer, a single cell, and volumes smaller than their spacing at rest."""
    angle = np.linspace(0, 2 * np.pi, 31, endpoint=False)
    ring = 10 + 5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    check_filling(BOX, [pc.Phase("membrane", WATER, ring, 1.0)], False)
    check_filling(BOX, [pc.Phase("cell", WATER, POINTS[:1], 300.0)], True)
    check_filling(BOX, [pc.Phase("cells", WATER, POINTS, 1e-3, spacing=1.0)], True)
