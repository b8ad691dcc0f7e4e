"""Clumps and voids of arrangements for which both are known."""

from __future__ import annotations

import numpy as np
import pytest

from particell.analysis.arrangement import evenness
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.geometry.shapes import Circle

BOX = Domain((0, 0), (10, 10))


def test_square_lattice():
    found = evenness(lattice(BOX, 0.5), 0.5, BOX)
    assert found.closest == pytest.approx(1.0)
    assert found.void == pytest.approx(np.sqrt(0.5))


def test_a_missing_point_is_a_void_and_a_pair_a_clump():
    points = lattice(BOX, 1.0)
    away = points[~np.all(np.isclose(points, 4.5), axis=1)]
    assert evenness(away, 1.0, BOX).void == pytest.approx(1.0)
    twice = np.concatenate([points, [[4.6, 4.5]]])
    assert evenness(twice, 1.0, BOX).closest == pytest.approx(0.1)


def test_voids_are_sought_within_a_shape():
    points = lattice(BOX, 1.0)
    away = points[~np.all(np.isclose(points, 4.5), axis=1)]
    far = Circle((8, 8), 1.5)
    assert evenness(away, 1.0, far).void == pytest.approx(np.sqrt(0.5))


def test_cubic_lattice():
    box = Domain((0, 0, 0), (5, 5, 5))
    noise = 1e-6 * np.random.default_rng(1).normal(size=(125, 3))
    found = evenness(lattice(box, 1.0) + noise, 1.0, box)
    assert found.void == pytest.approx(np.sqrt(0.75), abs=1e-4)
