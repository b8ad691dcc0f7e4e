"""Chi-square metrics: numbers of molecules against what they should be."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from particell.cases.base import Metric

#: False-alarm rate of a metric.
ALARM = 1e-6
#: Poisson numbers of a smaller mean are too far from normal ones for their chi-square.
FEWEST = 10.0


def chi_square_metric(square: float, freedom: int, alarm: float = ALARM) -> Metric:
    """A chi-square over its degrees of freedom; passes below the quantile of a false-alarm rate.

    Not a number, and without a limit, where there is no degree of freedom.
    """
    if freedom == 0:
        return Metric(math.nan)
    return Metric(square / freedom, limit=float(chi2.isf(alarm, freedom) / freedom))


def poisson_metric(
    counts: ArrayLike, means: ArrayLike, alarm: float = ALARM, fewest: float = FEWEST
) -> Metric:
    """Reduced chi-square Σ (N - λ)²/λ of independent Poisson numbers N of known means λ.

    Those with a mean below ``fewest`` are left out.
    """
    number, mean = np.asarray(counts, float), np.asarray(means, float)
    enough = mean >= fewest
    number, mean = number[enough], mean[enough]
    return chi_square_metric(float(np.sum((number - mean) ** 2 / mean)), mean.size, alarm)
