"""Chi-square metrics of molecules."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from particell.cases.scores import ALARM, poisson_metric


def test_poisson_numbers_pass_and_others_fail():
    means = np.linspace(10, 400, 200)
    counts = np.random.default_rng(1).poisson(means)
    metric = poisson_metric(counts, means)
    assert metric.value == pytest.approx(np.mean((counts - means) ** 2 / means), rel=1e-14)
    assert metric.limit == pytest.approx(stats.chi2.isf(ALARM, 200) / 200)
    assert metric.passed
    assert not poisson_metric(counts + 2 * np.sqrt(means), means).passed


def test_small_means_are_left_out():
    """One molecule where 1e-12 are expected is rare, but no normal number of 1e6 deviations."""
    means = np.array([1e-300, 1e-12, 9.99, 10.0, 100.0])
    counts = np.array([1, 1, 30, 12, 90])
    assert poisson_metric(counts, means).value == pytest.approx((0.4 + 1.0) / 2)
    nothing = poisson_metric(counts[:3], means[:3])
    assert math.isnan(nothing.value)
    assert nothing.limit is None
