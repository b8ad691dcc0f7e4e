from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad

from particell.cases.base import Context
from particell.cases.equilibrium import Equilibrium2D, Equilibrium3D
from particell.cases.equilibrium_structure import (
    kernel_transform,
    mean_field,
    shortest_waves,
    structure_factor,
)
from particell.kernels import kernel_code, normalisation, shape_w


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [(Equilibrium2D, {"resolution": 16, "samples": 100}), (Equilibrium3D, {"resolution": 9})],
)
def test_small_box_has_the_temperature_of_its_noise(kind, parameters, tmp_path):
    case = kind(**{"samples": 40, **parameters})
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    metrics = case.analyse(run, simulation)
    error = metrics["temperature_standard_error"].value
    assert 0 < error < 0.01
    assert abs(metrics["temperature_deviation"].value) < 5 * error
    assert metrics["momentum_drift"].passed
    assert metrics["maxwell_chi2"].passed
    assert 1e-4 < metrics["density_variance"].value < 1e-3
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_structure_factor_of_random_points_is_one():
    random = np.random.default_rng(1)
    waves = shortest_waves(2, 1)
    assert len(waves) == 2
    assert len(shortest_waves(3, 1)) == 3
    values = [structure_factor(random.random((100, 2)), waves) for _ in range(2000)]
    assert np.mean(values) == pytest.approx(1.0, abs=5 / np.sqrt(4000))


def test_kernel_transform_agrees_with_an_integral_over_the_plane():
    code, q = kernel_code("lucy"), 1.7

    def integrand(y, x):
        return shape_w.py_func(np.hypot(x, y), code) * np.cos(q * x)

    value = 4 * normalisation(code, 2) * dblquad(integrand, 0, 1, 0, 1, epsabs=1e-7)[0]
    assert kernel_transform(q, "lucy", 2) == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_long_waves_have_the_ideal_compressibility(dim):
    assert kernel_transform(1e-6, "wendland-c2", dim) == pytest.approx(1, abs=1e-8)
    assert mean_field(1e-6, 99.0, "lucy", dim) == pytest.approx(0.01)
