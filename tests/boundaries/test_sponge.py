from __future__ import annotations

import numpy as np
import pytest

from particell.boundaries.sponge import Sponge, relax_velocity, share_of_target
from particell.errors import InputError

OPEN = (0.0, 2.0, 0.0)  # where the period begins, its length, 1/length: none
X = np.stack([np.linspace(-0.5, 1.5, 41), np.zeros(41)], -1)


def relax(steps, time=1.0):
    v = np.random.default_rng(1).normal(size=X.shape)
    target = np.zeros_like(X)
    target[:, 0] = 2.0
    walls = np.zeros(len(X), np.uint8)
    walls[20] = 1
    run = relax_velocity.specialise(DIM=2, AXIS=0)
    for _ in range(steps):
        run(len(X), X, v, walls, 0.0, 1.0, 3.0, *OPEN, time / steps, target)
    return v


def test_strength_does_not_depend_on_the_step():
    coarse, fine = relax(1), relax(10)
    assert fine == pytest.approx(coarse, abs=1e-13)
    before = np.random.default_rng(1).normal(size=X.shape)
    sponge = Sponge(0.0, 1.0, time=1.0)
    share = sponge.strength(X)
    share[20] = 0  # a wall particle keeps its velocity
    assert coarse == pytest.approx(before - share[:, None] * (before - [2.0, 0.0]), abs=1e-13)


def test_profile():
    strength = Sponge(0.0, 1.0, time=1.0).strength(X)
    s = X[:, 0]
    assert strength == pytest.approx(np.where((s > 0) & (s <= 1), s**3, 0))
    backwards = Sponge(1.0, 0.0, time=1.0, exponent=1.0).strength(X)
    assert backwards == pytest.approx(np.where((s >= 0) & (s < 1), 1 - s, 0), abs=1e-12)


def test_share_for_species_is_the_same():
    share = np.zeros(len(X))
    share_of_target.specialise(AXIS=0)(len(X), X, 0.0, 1.0, 3.0, *OPEN, 0.1, share)
    phi = Sponge(0.0, 1.0, time=1.0).strength(X)
    assert share == pytest.approx(1 - (1 - phi) ** 0.1, abs=1e-14)


def test_refused():
    with pytest.raises(InputError, match="time"):
        Sponge(0.0, 1.0, time=0.0)
    with pytest.raises(InputError, match="end"):
        Sponge(1.0, 1.0, time=1.0)
