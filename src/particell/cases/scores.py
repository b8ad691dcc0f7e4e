"""Metrics that several cases share: chi-squares of molecules, and the density's drift."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binom, chi2, norm, poisson

from particell.cases.base import Metric
from particell.output.run import Run

if TYPE_CHECKING:
    from particell.simulation import Simulation

#: Largest drift of the mean density over a run, and largest part of the volume that keeping it puts
#: right in a unit of time of the flow.
DRIFT = 5e-3
#: False-alarm rate of a metric.
ALARM = 1e-6
#: Poisson numbers of a smaller mean are left out: there the error of the mean would be seen.
FEWEST = 10.0
#: Seed of the numbers that spread each count over its step of the distribution.
SEED = 20190101


def chi_square_metric(square: float, freedom: int, alarm: float = ALARM) -> Metric:
    """A chi-square over its degrees of freedom; passes below the quantile of a false-alarm rate.

    Not a number, and without a limit, where there is no degree of freedom.
    """
    if freedom == 0:
        return Metric(math.nan)
    return Metric(square / freedom, limit=float(chi2.isf(alarm, freedom) / freedom))


def density_drift(
    run: Run, simulation: Simulation, density: float, time_unit: float
) -> dict[str, Metric]:
    """How far the fluid's mean density is from ``density`` in kg/m³ at the end.

    Where the scheme keeps the fluid's volume, there is also the rate at which that was put right,
    ln(1 + drift) per unit of time (s). What is put right does not add up: it acts as a source of
    volume of that rate, a divergence of the flow that is not there.
    """
    mean = float(run.field("density")[-1][run.group("fluid")].mean())
    found = {"density_drift": Metric(mean / density - 1, limit=DRIFT)}
    put_right = simulation.conservation().get("volume put right")
    if put_right is not None:
        rate = math.log1p(put_right) * time_unit / run.times[-1]
        found["volume_put_right_rate"] = Metric(float(rate), limit=DRIFT)
    return found


def poisson_metric(
    counts: ArrayLike, means: ArrayLike, alarm: float = ALARM, fewest: float = FEWEST
) -> Metric:
    """Reduced chi-square of independent Poisson numbers of known means, by their normal scores.

    Those with a mean below ``fewest`` are left out.
    """
    number, mean = np.asarray(counts, float), np.asarray(means, float)
    enough = mean >= fewest
    score = normal_scores(number[enough], poisson(mean[enough]))
    return chi_square_metric(float(score @ score), score.size, alarm)


def binomial_metric(counts: ArrayLike, trials: ArrayLike, share: ArrayLike) -> Metric:
    """Reduced chi-square of independent binomial numbers of known chances, by normal scores."""
    score = normal_scores(np.asarray(counts, float), binom(trials, share))
    return chi_square_metric(float(score @ score), score.size)


def normal_scores(number: np.ndarray, law: Any) -> np.ndarray:
    """Whole numbers of a frozen ``scipy.stats`` law, made standard normal: Φ⁻¹ of the rank.

    Each is spread evenly over its step of the distribution, which makes ranks uniform and scores
    normal exactly, however small the mean: (N - λ)²/λ has too long a tail for a chi-square where
    few numbers of a mean of some ten are added up.
    """
    part = np.random.default_rng(SEED).uniform(size=number.shape) * law.pmf(number)
    below = law.cdf(number - 1) + part
    above = law.sf(number) + law.pmf(number) - part
    return np.where(below < 0.5, norm.ppf(below), norm.isf(above))
