from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from particell.errors import InputError
from particell.kernels import CODES, kernel_code, normalisation, power, shape_f, shape_w
from systems import lattice_offsets, lucy_sums

SURFACE = {1: 2.0, 2: 2 * math.pi, 3: 4 * math.pi}


def w(r, h, code, dim):
    return normalisation(code, dim) / h**dim * shape_w.py_func(r / h, code)


def f(r, h, code, dim):
    return normalisation(code, dim) / h ** (dim + 2) * shape_f.py_func(r / h, code)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("name", CODES)
def test_integral_is_one(name, dim):
    h, code = 1.7, CODES[name]
    joints = [h / 3, h / 2, 2 * h / 3]
    total, _ = quad(
        lambda r: SURFACE[dim] * r ** (dim - 1) * w(r, h, code, dim), 0, h, points=joints
    )
    assert total == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("name", CODES)
def test_slope_is_that_of_w(name, dim):
    h, code, step = 1.7, CODES[name], 1e-5
    for r in np.linspace(0.02, 0.99, 41) * h:
        slope = (w(r + step, h, code, dim) - w(r - step, h, code, dim)) / (2 * step)
        assert f(r, h, code, dim) == pytest.approx(-slope / r, abs=1e-8 * f(0.1 * h, h, code, dim))


@pytest.mark.parametrize("name", CODES)
def test_compact_support_and_finite_at_zero(name):
    code = CODES[name]
    for q in (1.0, 1.0 + 1e-12, 1.5, 1e6):
        assert shape_w.py_func(q, code) == pytest.approx(0, abs=1e-15)
        assert shape_f.py_func(q, code) == pytest.approx(0, abs=1e-15)
    assert 0 < shape_f.py_func(0.0, code) < math.inf
    q = np.linspace(0, 1, 101)
    assert np.all(np.diff([shape_w.py_func(s, code) for s in q]) <= 0)
    assert min(shape_f.py_func(s, code) for s in q) >= 0


@pytest.mark.parametrize("name", CODES)
def test_compiled_form_is_the_same(name):
    for q in (0.0, 0.2, 0.4, 0.6, 0.8, 1.1):
        assert shape_w(q, CODES[name]) == pytest.approx(shape_w.py_func(q, CODES[name]), rel=1e-14)
        assert shape_f(q, CODES[name]) == pytest.approx(shape_f.py_func(q, CODES[name]), rel=1e-8)


def test_slope_at_zero():
    """-W''(0) of the shapes: 12, 20, 12 (M4 of support 2) and 1080 (M6 of support 3)."""
    exact = {"lucy": 12, "wendland-c2": 20, "cubic-spline": 12, "quintic-spline": 1080}
    for name, value in exact.items():
        for q in (0.0, 1e-15, 1e-9):
            assert shape_f.py_func(q, CODES[name]) == pytest.approx(value, rel=2e-6)


def test_moment_that_makes_operators_consistent():
    """(1/D) ∫ F r² = 1 for every kernel, so that Σ V F x xᵀ -> I."""
    for code in CODES.values():
        for dim in (1, 2, 3):
            total, _ = quad(
                lambda r, c=code, d=dim: SURFACE[d] * r ** (d + 1) * f(r, 1.0, c, d) / d, 0, 1
            )
            assert total == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("row", lucy_sums(), ids=lambda row: f"{row['D']}D-{row['h']:g}")
def test_lattice_sums_of_lucy(row):
    """Σ V F x xᵀ is isotropic on square and cubic lattices and has the tabulated value."""
    offsets, weight = lattice_offsets(row["D"], row["h"])
    tensor = np.einsum("n,na,nb->ab", weight, offsets, offsets)
    assert tensor == pytest.approx(row["kappa"] * np.eye(row["D"]), abs=1.1e-6)


def test_lattice_error_at_three_spacings():
    errors = {row["D"]: abs(row["kappa"] - 1) for row in lucy_sums() if row["h"] == 3.0}
    assert errors == pytest.approx({1: 12e-3, 2: 0.8e-3, 3: 6.5e-3}, rel=0.04)


def test_power():
    assert [power(1.5, dim) for dim in (1, 2, 3)] == [1.5, 2.25, 3.375]


def test_unknown_kernel():
    assert kernel_code("lucy") == 0
    with pytest.raises(InputError, match="did you mean 'lucy'"):
        kernel_code("lucky")
