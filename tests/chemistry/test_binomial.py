"""The samplers against the exact laws, by chi-square."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy import stats

from particell.chemistry.binomial import binomial, poisson
from particell.chemistry.jumps import inflow_probabilities, resident_probabilities

SAMPLES = 100_000
# 26 chi-square tests in this file, each with the false-alarm rate 1e-8
LEVEL = 1e-8


@njit
def draw(kind, n, p, seed, out):
    one = np.uint64(1)
    for k in range(len(out)):
        c = np.uint64(k)
        if kind == 0:
            out[k], _ = binomial(n, p, c, one, one, 0, np.uint64(seed), one)
        else:
            out[k], _ = poisson(p, c, one, one, 0, np.uint64(seed), one)


def chi_square(values, law):
    """p-value of the values under a discrete law, in cells of at least ten expected."""
    low, high = int(law.ppf(1e-9)), int(law.ppf(1 - 1e-9)) + 1
    k = np.arange(low, high + 1)
    expected = len(values) * law.pmf(k)
    assert values.min() >= low
    assert values.max() <= high
    observed = np.bincount(values - low, minlength=len(k)).astype(float)
    cells = np.floor(np.cumsum(expected) / max(10.0, expected.sum() / 200)).astype(int)
    cells = np.unique(cells, return_inverse=True)[1]
    expected, observed = np.bincount(cells, expected), np.bincount(cells, observed)
    if len(expected) > 1 and expected[-1] < 10:
        expected[-2] += expected[-1]
        observed[-2] += observed[-1]
        expected, observed = expected[:-1], observed[:-1]
    if len(expected) == 1:
        return 1.0
    expected *= observed.sum() / expected.sum()
    return stats.chi2.sf(((observed - expected) ** 2 / expected).sum(), len(expected) - 1)


@pytest.mark.parametrize("n", [1, 7, 40, 1000, 1_000_000])
@pytest.mark.parametrize("p", [1e-5, 0.02, 0.3, 0.77])
def test_binomial(n, p):
    values = np.empty(SAMPLES, np.int64)
    draw(0, n, p, 11 + n, values)
    assert chi_square(values, stats.binom(n, p)) > LEVEL


@pytest.mark.parametrize("mean", [0.01, 2.0, 9.9, 10.1, 300.0, 1e5])
def test_poisson(mean):
    values = np.empty(SAMPLES, np.int64)
    draw(1, 0, mean, 5, values)
    assert chi_square(values, stats.poisson(mean)) > LEVEL


def test_sure_cases():
    values = np.empty(10, np.int64)
    for n, p, expected in [(5, 0.0, 0), (5, 1.0, 5), (0, 0.5, 0), (5, -1e-17, 0)]:
        draw(0, n, p, 1, values)
        assert (values == expected).all()


def test_probabilities_of_further_candidates():
    """Products of the conditional probabilities are the tails of the numbers of candidates."""
    mean, length = 2.5, 60
    tail = np.cumprod(resident_probabilities(mean, length))
    np.testing.assert_allclose(tail[:20], stats.poisson.sf(np.arange(20), mean), rtol=1e-12)
    tail = np.cumprod(inflow_probabilities(mean, length))
    k = np.arange(20)
    times = (np.arange(20000) + 0.5) / 20000 * mean
    exact = [stats.poisson.sf(m - 1, times).mean() for m in k]
    np.testing.assert_allclose(tail[:20], exact, rtol=1e-6)
