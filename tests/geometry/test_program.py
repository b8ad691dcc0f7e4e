"""Signed distances by a shape's program against those of the shape."""

from __future__ import annotations

import numpy as np
import pytest

from particell.geometry.program import program_distance, program_of, program_table
from particell.geometry.shapes import Ball, Box, HalfSpace, Shape


def shapes(dim):
    box = Box((-1.0,) * dim, np.arange(1, dim + 1) * 0.5)
    ball = Ball((0.2,) * dim, 0.8)
    plane = HalfSpace((0.1,) * dim, np.arange(1, dim + 1))
    slab = Box((-np.inf,) * (dim - 1) + (0.0,), (np.inf,) * (dim - 1) + (0.7,))
    return [
        box,
        ball,
        plane,
        slab,
        ~box,
        box | ball,
        box - ball,
        (plane & box) - ~(ball | slab),
        (box - ball) | (plane & ball),
    ]


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("which", range(9))
def test_distances_are_those_of_the_shape(dim, which):
    shape = shapes(dim)[which]
    first, codes, numbers = program_table([None, program_of(shape, dim), None], dim)
    assert first[0] == first[1] == 0 and first[2] == first[3] == len(codes)
    points = np.random.default_rng(which).uniform(-2, 2, (200, dim))
    padded = np.zeros((200, 3))
    padded[:, :dim] = points
    found = [program_distance(*p, first[1], first[2], codes, numbers, dim) for p in padded]
    np.testing.assert_allclose(found, shape.signed_distance(points), atol=1e-14)


def test_other_shapes_have_no_program():
    class Blob(Shape):
        def signed_distance(self, points):
            return points[:, 0]

    class Dented(Ball):
        def signed_distance(self, points):
            return points[:, 0]

    plane = HalfSpace((0, 0), (1, 0))
    for shape in (None, Blob(), Dented((0, 0), 1.0), plane | Blob(), ~Blob()):
        assert program_of(shape, 2) is None


def test_shapes_nested_too_deeply_have_none():
    """A stack of four numbers: chains of any length to the left, but few to the right."""
    plane = HalfSpace((0, 0), (1, 0))
    left = right = plane
    for _ in range(3):
        left, right = left | plane, plane | right
    assert program_of(left | plane, 2) is not None
    assert program_of(right, 2) is not None
    assert program_of(plane | right, 2) is None
