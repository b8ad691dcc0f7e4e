from __future__ import annotations

import numpy as np
import pytest

from particell.analysis.fields import grid, interpolate, line
from particell.errors import InputError
from particell.geometry.domain import Domain

LOWER, UPPER = (-1.0, 2.0, 0.5), (1.0, 5.0, 2.0)


def scattered(dim: int, periodic: str = "", n: int = 1500):
    """Particles at random, with different volumes and supports."""
    random = np.random.default_rng(dim)
    domain = Domain(LOWER[:dim], UPPER[:dim], periodic)
    n = 200 if dim == 1 else n
    position = domain.lower + random.random((n, dim)) * domain.lengths
    spacing = (domain.volume / n) ** (1 / dim)
    support = spacing * random.uniform(3.0, 4.5, n)
    return domain, position, {"volume": random.uniform(0.5, 2, n), "support": support}


def inside(domain: Domain, n: int = 300) -> np.ndarray:
    return domain.lower + np.random.default_rng(9).random((n, domain.dim)) * domain.lengths


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("kernel", ["lucy", "wendland-c2", "cubic-spline", "quintic-spline"])
@pytest.mark.parametrize("order", [0, 1])
def test_exact_on_constants(dim, kernel, order):
    domain, position, weights = scattered(dim, "x")
    values = np.full(len(position), 7.25)
    points = inside(domain)
    found = interpolate(
        points, position, values, domain=domain, kernel=kernel, order=order, **weights
    )
    assert found == pytest.approx(np.full(len(points), 7.25), rel=1e-13)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_order_1_is_exact_on_linear_fields_up_to_the_boundary(dim):
    domain, position, weights = scattered(dim)
    gradient = np.array([[1.0, -2.0], [0.5, 3.0], [-4.0, 0.25]])[:dim]
    points = np.concatenate([inside(domain), line(domain.lower, domain.upper, 11)])
    found = interpolate(points, position, 3.0 + position @ gradient, domain=domain, **weights)
    assert found.shape == (len(points), 2)
    assert np.allclose(found, 3.0 + points @ gradient, atol=1e-10)


def test_periodic_axes():
    domain, position, weights = scattered(2, "x", n=4000)
    wave = 2 * np.pi / domain.lengths[0]
    values = np.sin(wave * position[:, 0])
    seam = line((-1.0, 3.0), (-1.0, 4.0), 20)
    found = interpolate(seam, position, values, domain=domain, **weights)
    assert np.abs(found - np.sin(wave * seam[:, 0])).max() < 2e-3
    # The same place, named from either side or a period off, has the same value.
    for shift in (domain.lengths[0], -3 * domain.lengths[0], 1e-17):
        moved = interpolate(seam + np.array([shift, 0]), position, values, domain=domain, **weights)
        assert np.allclose(moved, found, atol=1e-12)
    # So has a linear field across the open axis, and particles given outside of the box.
    outside = position + np.array([domain.lengths[0], 0])
    found = interpolate(seam, outside, position[:, 1], domain=domain, **weights)
    assert np.allclose(found, seam[:, 1], atol=1e-10)


def test_nothing_in_reach_is_nan_and_few_particles_fall_back():
    domain = Domain((0, 0), (10, 10))
    position = np.array([[1.0, 1.0], [1.5, 1.0]])
    given = {"volume": np.ones(2), "support": 1.0, "domain": domain}
    found = interpolate([(5, 5), (1.25, 1.0), (0.45, 1.0)], position, np.array([2.0, 4.0]), **given)
    assert np.isnan(found[0])
    assert found[1:] == pytest.approx([3.0, 2.0])
    none = interpolate(
        [(5, 5)], position[:0], np.zeros(0), volume=np.ones(0), support=1.0, domain=domain
    )
    assert np.isnan(none).all()


def test_grid_and_refusals():
    domain = Domain((0, 0), (4, 2))
    centres = grid(domain, (4, 2))
    assert centres.shape == (4, 2, 2)
    assert centres[0, 0].tolist() == [0.5, 0.5]
    assert centres[-1, -1].tolist() == [3.5, 1.5]
    given = {"volume": np.ones(1), "domain": domain}
    with pytest.raises(InputError, match="positive number, or 2"):
        grid(domain, (4, 2, 1))
    with pytest.raises(InputError, match="0 or 1"):
        interpolate([(1, 1)], np.ones((1, 2)), np.ones(1), support=1.0, order=2, **given)
    with pytest.raises(InputError, match="kernel"):
        interpolate([(1, 1)], np.ones((1, 2)), np.ones(1), support=1.0, kernel="box", **given)
    with pytest.raises(InputError, match="shape"):
        interpolate([(1, 1, 1)], np.ones((1, 2)), np.ones(1), support=1.0, **given)
    with pytest.raises(InputError, match="support"):
        interpolate([(1, 1)], np.ones((1, 2)), np.ones(1), support=0.0, **given)
