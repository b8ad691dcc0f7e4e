from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import (
    around,
    fitting_spacing,
    jittered,
    lattice,
    packed,
    rings,
    shells,
)
from particell.geometry.pairs import neighbour_pairs
from particell.geometry.shapes import Ball, Box, Circle, HalfSpace, Sphere

POINTS = np.random.default_rng(1).uniform(-2, 2, (300, 2))


def test_distances():
    inf = math.inf
    assert Circle((1, 1), 0.5).signed_distance(np.array([[1, 1], [3, 1.0]])).tolist() == [-0.5, 1.5]
    assert HalfSpace((0, 1), (0, 2)).signed_distance(np.array([[5, 3.0]])).tolist() == [2]
    box = Box((0, 0), (2, 1))
    points = np.array([[1, 0.5], [1, 0.9], [3, 0.5], [5, 5], [2, 1.0]])
    assert box.signed_distance(points) == pytest.approx([-0.5, -0.1, 1, 5, 0])
    assert Box((-inf, 0), (inf, 1)).signed_distance(np.array([[9, 0.25]])).tolist() == [-0.25]


def test_combinations():
    a, b = Circle((0, 0), 1.0), Box((-0.5, -2), (0.5, 2))
    in_a, in_b = a.contains(POINTS), b.contains(POINTS)
    assert ((a | b).contains(POINTS) == (in_a | in_b)).all()
    assert ((a & b).contains(POINTS) == (in_a & in_b)).all()
    assert ((a - b).contains(POINTS) == (in_a & ~in_b)).all()
    assert ((~a).contains(POINTS) == ~in_a).all()
    assert "Circle" in repr(a - b)


@pytest.mark.parametrize("ball", [Circle((0.3, 0.1), 0.7), Sphere((0.3, 0.1, 0), 0.7)])
def test_normal_and_curvature(ball):
    dim = len(ball.center)
    direction = np.random.default_rng(2).normal(size=(50, dim))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    surface = ball.center + ball.radius * direction
    assert ball.normal(surface, 1e-4) == pytest.approx(direction, abs=1e-7)
    assert ball.curvature(surface, 1e-2) == pytest.approx(1 / 0.7, rel=1e-3)
    assert (~ball).curvature(surface, 1e-2) == pytest.approx(-1 / 0.7, rel=1e-3)
    plane = HalfSpace((0,) * dim, (1,) * dim)
    assert plane.curvature(surface, 1e-2) == pytest.approx(0, abs=1e-9)


def test_lattices_fill_the_domain():
    domain = Domain((0, -1), (2, 2), periodic="x")
    assert fitting_spacing(domain, 0.49).tolist() == [0.5, 0.5]
    points = lattice(domain, 0.49)
    assert len(points) == 24
    assert points.min(axis=0).tolist() == [0.25, -0.75]
    kept = lattice(domain, 0.1, Circle((1, 0), 0.5))
    assert len(kept) * 0.01 == pytest.approx(math.pi / 4, rel=0.05)
    hexagonal = lattice(Domain((0, 0), (10, 10), periodic="xy"), 1.0, kind="hexagonal")
    _, _, offset = neighbour_pairs(hexagonal, Domain((0, 0), (10, 10), periodic="xy"), 1.3)
    assert len(offset) == 6 * len(hexagonal)
    assert lattice(Domain((0,), (1,)), 0.25).ravel().tolist() == [0.125, 0.375, 0.625, 0.875]


def test_rings_have_the_area_of_the_ring():
    for inner in (0.0, 0.4):
        points, volumes = rings(Circle((1, 2), 1.0), inner, 1.0, 0.1)
        r = np.linalg.norm(points - np.array([1, 2]), axis=1)
        assert volumes.sum() == pytest.approx(math.pi * (1 - inner**2), rel=1e-12)
        assert inner <= r.min() and r.max() < 1
        assert volumes == pytest.approx(0.01, rel=0.3)


@pytest.mark.parametrize("inner", [0.0, 0.2, 0.71])
def test_shells_have_the_volume_of_the_shell(inner):
    centre = np.array([1.0, 2.0, 3.0])
    points, volumes = shells(Sphere(centre, 1.0), inner, 1.0, 0.1)
    r = np.linalg.norm(points - centre, axis=1)
    assert volumes.sum() == pytest.approx(4 / 3 * math.pi * (1 - inner**3), rel=1e-12)
    assert inner <= r.min() and r.max() < 1
    assert volumes == pytest.approx(1e-3, rel=0.35)
    outer = r > 0.9  # of one sphere all are alike, and the whole is balanced
    assert np.ptp(r[outer]) < 1e-12 and np.ptp(volumes[outer]) < 1e-18
    assert np.abs((volumes[:, None] * (points - centre)).sum(axis=0)).max() < 1e-3 * volumes.sum()


def test_shells_are_evenly_spread():
    """Nearest neighbours on a sphere: those of a hexagonal lattice (1.07) but for its defects."""
    for radius in (2.0, 5.0, 12.0):
        points, _ = shells(Sphere((0, 0, 0), radius), radius - 1, radius, 1.0)
        nearest = cKDTree(points).query(points, 2)[0][:, 1]
        spacing = math.sqrt(4 * math.pi * np.linalg.norm(points[0]) ** 2 / len(points))
        assert nearest.min() > 0.93 * spacing
        assert nearest.max() < 1.09 * spacing


def test_kernel_sums_beside_a_sphere_of_shells():
    """Σ V W over body and fluid is 1 where they meet, as near as in the packed fluid itself.

    With a body cut out of a lattice its spread there is twice as large.
    """
    domain, ball = Domain([-4.5] * 3, [4.5] * 3, periodic="xyz"), Sphere((0, 0, 0), 2.5)
    body, volumes = shells(ball, 0.0, 2.5, 1.0)
    points = around(domain, 1.0, ball, body)
    each = (9**3 - ball.volume(3)) / len(points)
    sites = lattice(domain, 1.0)
    gap = ball.signed_distance(sites)
    sums = {}
    for name, inside, weight, outside, w in (
        ("shells", body, volumes, points, each),
        ("lattice", sites[gap < 0], 1.0, sites[gap >= 0], each),
    ):
        everything = np.concatenate([outside, inside])
        volume = np.concatenate([np.full(len(outside), w), np.broadcast_to(weight, len(inside))])
        i, j, offset = neighbour_pairs(everything, domain, 2.6, len(outside))
        q = np.linalg.norm(offset, axis=1) / 2.6
        kernel = 105 / (16 * math.pi * 2.6**3) * (1 + 3 * q) * (1 - q) ** 3
        found = np.bincount(i, volume[j] * kernel, len(outside))
        found += volume[: len(outside)] * 105 / (16 * math.pi * 2.6**3)
        beside = ball.signed_distance(outside) < 1.0
        sums[name] = found[beside]
    print({k: (v.mean(), v.std()) for k, v in sums.items()})
    assert sums["shells"].mean() == pytest.approx(1.0, abs=0.01)
    assert sums["shells"].std() < 0.02


def test_packing_evens_out():
    domain = Domain((0, 0), (12, 12), periodic="xy")
    points = jittered(lattice(domain, 1.0), 0.25, seed=3) % 12
    even = packed(points, domain, 1.0)

    def closest(x):
        i, _, offset = neighbour_pairs(x, domain, 2.5)
        nearest = np.full(len(x), np.inf)
        np.minimum.at(nearest, i, np.linalg.norm(offset, axis=1))
        return nearest

    assert closest(even).min() > 0.8 > closest(points).min()
    assert ((even >= 0) & (even <= 12)).all()
    with_shape = packed(points, domain, 1.0, keep_inside=Circle((6, 6), 9.0), iterations=5)
    assert Circle((6, 6), 9.0).signed_distance(with_shape).max() < 0


def test_pairs_meet_periodic_images():
    domain = Domain((0, 0), (10, 10), periodic="x")
    points = np.array([[0.2, 5], [9.9, 5], [5, 0.1], [5, 9.9]])
    i, j, offset = neighbour_pairs(points, domain, 1.0)
    assert sorted(zip(i.tolist(), j.tolist(), strict=True)) == [(0, 1), (1, 0)]
    assert offset[i == 0] == pytest.approx(np.array([[0.3, 0]]))


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Domain((0, 0), (1,)), "upper"),
        (lambda: Domain((), ()), "lower"),
        (lambda: Domain((0,) * 4, (1,) * 4), "lower"),
        (lambda: Domain((0, 0), (1, math.inf)), "upper"),
        (lambda: Domain((0, 0), (1, 0)), "upper"),
        (lambda: Domain((0, 0), (1, 1), periodic="z"), "periodic"),
        (lambda: Domain((0, 0), (1, 1), depth=0), "depth"),
        (lambda: Circle((0, 0), 0), "radius"),
        (lambda: HalfSpace((0, 0), (0, 0)), "normal"),
        (lambda: Box((0, 0), (0, 1)), "upper"),
        (lambda: lattice(Domain((0, 0), (1, 1)), 0.0), "spacing"),
        (lambda: lattice(Domain((0, 0), (1, 1)), 3.0), "spacing"),
        (lambda: lattice(Domain((0, 0), (1, 1)), 0.1, kind="cubic"), "kind"),
        (lambda: lattice(Domain((0,), (1,)), 0.1, kind="hexagonal"), "kind"),
        (lambda: rings(Ball((0, 0), 1.0), 1.0, 0.5, 0.1), "inner"),
        (lambda: shells(Ball((0, 0, 0), 1.0), 1.0, 0.5, 0.1), "inner"),
        (lambda: shells(Ball((0, 0), 1.0), 0.5, 1.0, 0.1), "ball"),
        (lambda: shells(Ball((0, 0, 0), 1.0), 0.5, 1.0, 0.0), "spacing"),
    ],
)
def test_refused_in_one_line(make, key):
    with pytest.raises(InputError) as error:
        make()
    assert error.value.key == key
    assert "\n" not in str(error.value)
