"""Many realisations of diffusion across a slab: their mean against the deterministic solution."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.stats import chi2

from particell import plots
from particell.analysis.statistics import Moments, epsilon_error
from particell.cases.base import Metric
from particell.cases.scores import ALARM, FEWEST, poisson_metric
from particell.ensemble.figures import band
from particell.ensemble.results import EnsembleRun
from particell.output.run import Run


class Slab(Protocol):
    """What is read of a :class:`.Diffusion1D`, which says what it means."""

    molecules: int

    def profiles(self, run: Run, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    def exact(self, x: np.ndarray, time: float) -> np.ndarray: ...


def profile(
    case: Slab, ensemble: EnsembleRun, frame: int
) -> tuple[np.ndarray, np.ndarray, Moments]:
    """x/L, C/C₀ of the concentrations, and moments of C/C₀ of the molecules, in order of x."""
    x, values, _ = case.profiles(ensemble.runs[0], frame)
    return x, values, ensemble.moments(lambda run: case.profiles(run, frame)[2])


def metrics(case: Slab, ensemble: EnsembleRun, paper: float | None) -> dict[str, Metric]:
    """Of the molecules at the end: error of the mean, its chi-square, and the dispersion.

    The counts are independent Poisson numbers of the deterministic means λ. With R realisations
    and n particles, ``mean_chi2`` is Σ (N̄ - λ)² R/λ over n, and ``dispersion`` is
    Σ (N - N̄)²/λ over n (R - 1), less 1; both are chi-square distributed but for a factor.
    Particles are left out where R λ, or λ, is less than :data:`particell.cases.scores.FEWEST`.
    """
    runs = len(ensemble)
    if runs < 2:
        return {}
    frame = len(ensemble.times) - 1
    x, values, found = profile(case, ensemble, frame)
    expected = np.maximum(values * case.molecules, 1e-300)
    mean, variance = found.mean * case.molecules, (found.deviation * case.molecules) ** 2
    exact = case.exact(x, float(ensemble.times[frame]))
    return {
        "eps of the mean of molecules": Metric(epsilon_error(found.mean, exact, 1.0), paper),
        "mean_chi2": poisson_metric(runs * mean, runs * expected),
        "dispersion": _dispersion(variance, expected, runs - 1),
    }


def _dispersion(variance: np.ndarray, expected: np.ndarray, freedom: int) -> Metric:
    enough = expected >= FEWEST
    if not enough.any():
        return Metric(math.nan)
    freedom *= int(enough.sum())
    reach = max(
        chi2.isf(ALARM / 2, freedom) / freedom - 1, 1 - chi2.ppf(ALARM / 2, freedom) / freedom
    )
    return Metric(float(np.mean((variance / expected)[enough])) - 1, limit=float(reach))


def figures(case: Slab, ensemble: EnsembleRun, directory: Path) -> list[Path]:
    """Profiles of the mean with deviation, and the mean's deviation from the expectation."""
    if len(ensemble) < 2:
        return []
    made = {"mean": _profiles(case, ensemble), "mean_error": _scores(case, ensemble)}
    return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]


@plots.styled
def _profiles(case: Slab, ensemble: EnsembleRun):
    figure, axes = plots.new_figure(5.2, 3.4)
    end = float(ensemble.times[-1])
    for k, part in enumerate((0.04, 0.16, 0.4, 1.0)):
        frame = ensemble.at(part * end)
        x, values, found = profile(case, ensemble, frame)
        colour, label = plots.COLOURS[k], f"{ensemble.times[frame]:.3g} s"
        band(axes, x, found, color=colour, label=label)
        axes.plot(x, values, "o", color=colour, markerfacecolor="none", markersize=3)
    axes.plot([], [], "o", color="0.4", markerfacecolor="none", label="concentrations")
    axes.set(xlabel="x / L", ylabel="C / C₀", xlim=(0, 1), ylim=(-0.02, 1.02))
    axes.set_title(f"molecules, mean ± deviation of {len(ensemble)} realisations")
    plots.legend(axes)
    return figure


@plots.styled
def _scores(case: Slab, ensemble: EnsembleRun):
    figure, axes = plots.new_figure(5.2, 2.6)
    x, values, found = profile(case, ensemble, len(ensemble.times) - 1)
    expected = np.maximum(values * case.molecules, 1e-300)
    scores = (found.mean * case.molecules - expected) * np.sqrt(len(ensemble) / expected)
    axes.axhspan(-2, 2, color="0.92", label="95 %")
    axes.plot(x, scores, "o", color=plots.COLOURS[1], markerfacecolor="none")
    axes.axhline(0, color="black", linewidth=0.6)
    reach = max(4.2, 1.1 * math.ceil(float(np.abs(scores).max())))
    axes.set(xlabel="x / L", ylabel="(N̄ − λ) / √(λ/R)", ylim=(-reach, reach), xlim=(0, 1))
    axes.set_title(f"mean of R = {len(ensemble)} realisations, t = {ensemble.times[-1]:.3g} s")
    plots.legend(axes, loc="lower left")
    return figure
