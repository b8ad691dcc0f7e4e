"""Chi-square metrics of molecules."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from particell.cases.scores import ALARM, density_drift, normal_scores, poisson_metric


def test_poisson_numbers_pass_and_others_fail():
    means = np.linspace(10, 400, 200)
    counts = np.random.default_rng(1).poisson(means)
    metric = poisson_metric(counts, means)
    # the normal scores are those of a normal law but for its skewness
    assert metric.value == pytest.approx(np.mean((counts - means) ** 2 / means), rel=0.05)
    assert metric.limit == pytest.approx(stats.chi2.isf(ALARM, 200) / 200)
    assert metric.passed
    assert not poisson_metric(counts + 2 * np.sqrt(means), means).passed


def test_small_means_are_left_out():
    """One molecule where 1e-12 are expected tells of the mean's error."""
    means = np.array([1e-300, 1e-12, 9.99, 10.0, 100.0])
    counts = np.array([1, 1, 30, 12, 90])
    assert poisson_metric(counts, means).value == poisson_metric(counts[3:], means[3:]).value
    nothing = poisson_metric(counts[:3], means[:3])
    assert math.isnan(nothing.value)
    assert nothing.limit is None


def test_scores_of_small_numbers_are_normal():
    """Kolmogorov and Smirnov's test, seeded; the false-alarm rate is 1e-6 for each law."""
    rng = np.random.default_rng(3)
    for law in (stats.poisson(0.3), stats.poisson(10.0), stats.binom(7, 0.9)):
        score = normal_scores(law.rvs(20_000, random_state=rng).astype(float), law)
        assert np.isfinite(score).all()
        assert stats.kstest(score, "norm").pvalue > 1e-6


def test_one_cell_of_ten_molecules_has_the_stated_alarm():
    """(N - λ)²/λ would have failed at N = 26, which comes 2e-5 of the time."""
    assert poisson_metric([26], [10.0]).passed
    assert not poisson_metric([32], [10.0]).passed


class Conserving:
    """A run whose mean density is off by 0.1 %, and what its scheme says that it put right."""

    def __init__(self, **counts):
        self.times = np.array([0.0, 4.0])
        self.counts = counts

    def field(self, _):
        return np.array([[1000.0, 1000.0, 7.0], [1002.0, 1000.0, 7.0]])

    def group(self, _):
        return np.array([True, True, False])

    def conservation(self):
        return self.counts


def test_density_drift_counts_what_was_put_right_as_a_rate():
    """12.5 times the volume over 157 units of time is 1.6 % in each: too much, kept or not."""
    free = Conserving()
    found = density_drift(free, free, 1000.0, 1.0)
    assert list(found) == ["density_drift"]
    assert found["density_drift"].value == pytest.approx(1e-3)
    kept = Conserving(**{"volume put right": math.expm1(-0.04)})
    found = density_drift(kept, kept, 1000.0, 2.0)
    assert found["volume_put_right_rate"].value == pytest.approx(-0.02)
    assert found["density_drift"].passed and not found["volume_put_right_rate"].passed
