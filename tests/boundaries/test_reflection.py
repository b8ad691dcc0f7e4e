from __future__ import annotations

import numpy as np
import pytest

from particell.boundaries.reflection import Reflection, reflect, surface_table
from particell.errors import InputError
from particell.geometry.shapes import Box, Circle, HalfSpace


def fire(reflections, x, v, steps, dt, period=(0.0, 0.0)):
    """Free flight with reflections; returns how often each particle was reflected."""
    run = reflect.specialise(DIM=2)
    table, count = surface_table(reflections, 2), np.zeros(len(x), np.int64)
    period = np.array(period)
    inverse = np.divide(1.0, period, out=np.zeros(2), where=period > 0)
    for _ in range(steps):
        x += dt * v
        run(len(x), x, v, np.zeros(len(x), np.uint8), table, len(table), period, inverse, count)
        for r in reflections:
            x_near = x - period * np.rint((x - getattr(r.body, "center", 0)) * inverse)
            distance = r.body.signed_distance(x_near if hasattr(r.body, "center") else x)
            assert ((-distance if r.inside else distance) > -1e-12).all()
    return count


def test_half_space_is_a_mirror():
    random = np.random.default_rng(1)
    x, v = random.uniform(0.01, 2, (200, 2)), random.normal(size=(200, 2))
    body = HalfSpace((0, 0), (0, 1))
    start, speed = x.copy(), v.copy()
    count = fire([Reflection(body)], x, v, 40, 0.05)
    free = start + 2.0 * speed
    hit = free[:, 1] < 0
    assert count.tolist() == hit.astype(int).tolist()
    assert x[:, 0] == pytest.approx(free[:, 0], abs=1e-12)
    assert x[:, 1] == pytest.approx(np.abs(free[:, 1]), abs=1e-12)
    assert v == pytest.approx(np.where(hit[:, None], speed * [1, -1], speed), abs=1e-13)


@pytest.mark.parametrize("inside", [False, True])
def test_fired_at_a_circle(inside):
    random = np.random.default_rng(2)
    angle, r = random.uniform(0, 2 * np.pi, 300), random.uniform(0.2, 0.9, 300)
    r = r if inside else 1 / r
    x = np.stack([r * np.cos(angle), r * np.sin(angle)], -1) + 3
    v = random.normal(size=(300, 2))
    speed = np.linalg.norm(v, axis=1)
    count = fire([Reflection(Circle((3, 3), 1.0), inside=inside)], x, v, 200, 0.02)
    assert count.sum() > 50
    assert np.linalg.norm(v, axis=1) == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize("inside", [False, True])
def test_at_a_circle_the_normal_velocity_is_turned(inside):
    """At the place in the direction n = (3, 4)/5 that it would be at: v − 2 (v·n) n."""
    side = 1.0 if inside else -1.0
    v = side * np.array([[1.0, 2.0]])
    x = (1.0 + 0.1 * side) * np.array([[0.6, 0.8]]) - 0.1 * v
    assert fire([Reflection(Circle((0, 0), 1.0), inside=inside)], x, v, 1, 0.1)[0] == 1
    assert v == pytest.approx(side * np.array([[-1.64, -1.52]]), rel=1e-14)
    assert x == pytest.approx((1.0 - 0.1 * side) * np.array([[0.6, 0.8]]), rel=1e-14)


def test_periodic_image_of_a_circle_reflects():
    x, v = np.array([[9.0, 0.5]]), np.array([[1.0, 0.0]])
    count = fire([Reflection(Circle((0.5, 0.5), 1.0))], x, v, 20, 0.1, period=(10.0, 0.0))
    assert count[0] == 1
    assert v[0, 0] == -1
    assert x[0, 0] == pytest.approx(8.0)


def test_speed_away_from_the_surface_is_kept():
    """What is inside already and moves outwards is put outside and not turned around."""
    x, v = np.array([[0.0, -0.1]]), np.array([[0.0, 1.0]])
    assert fire([Reflection(HalfSpace((0, 0), (0, 1)))], x, v, 1, 0.01)[0] == 1
    assert v[0, 1] == 1
    assert x[0, 1] == pytest.approx(0.09)


def test_refused():
    with pytest.raises(InputError, match="body"):
        Reflection(Box((0, 0), (1, 1)))
    with pytest.raises(InputError, match="inside"):
        Reflection(HalfSpace((0, 0), (0, 1)), inside=True)
