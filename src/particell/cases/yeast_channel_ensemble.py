"""Many realisations of the yeast channel: the bound receptors' mean and how much they scatter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from particell import plots
from particell.analysis.statistics import relative_l2
from particell.cases import reference
from particell.cases import yeast_channel_results as results
from particell.cases.base import Metric
from particell.ensemble.figures import band
from particell.ensemble.results import EnsembleRun

_BOUND = "concentration/RL_molecules"


def _frames(case: results.Channel, ensemble: EnsembleRun) -> dict[float, int]:
    stars = [s for s in results.TIMES if s <= case.end * (1 + 1e-9)]
    return {s: ensemble.at(s * case.time_unit) for s in stars}


def _order(
    case: results.Channel, ensemble: EnsembleRun, frame: int
) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the membrane's particles in order, and that order."""
    run = ensemble.runs[0]
    offset = run.field("position")[frame][run.group("membrane")] - np.array(case.centre)
    angle = np.degrees(np.arctan2(offset[:, 1], offset[:, 0])) % 360
    order = np.argsort(angle)
    return angle[order], order


def metrics(case: results.Channel, ensemble: EnsembleRun) -> dict[str, Metric]:
    """Relative L2 errors of the mean of RL (molecules) around the membrane.

    Without limits: binding competes for the ligand that is there, so that the mean of whole
    molecules is not exactly the solution of the rate equations.
    """
    found: dict[str, Metric] = {}
    if case.chemistry == "concentrations" or len(ensemble) < 2:
        return found
    for star, frame in _frames(case, ensemble).items():
        angle, order = _order(case, ensemble, frame)
        mean = ensemble.mean(_BOUND, frame, groups="membrane")[order] / case.concentration
        expected = results.reference_around(angle, results.time_column("RL", star))
        name = f"RL_membrane_mean_of_molecules_t{star:g}"
        found[name] = Metric(relative_l2(mean, expected))
        if case.chemistry == "both":
            _, values = results.around_membrane(case, ensemble.runs[0], "concentration/RL", frame)
            error = relative_l2(mean, values / case.concentration)
            found[f"RL_mean_against_concentrations_t{star:g}"] = Metric(error)
    return found


def figures(case: results.Channel, ensemble: EnsembleRun, directory: Path) -> list[Path]:
    """RL around the membrane and in time, mean ± deviation, beside the finite elements."""
    if case.chemistry == "concentrations" or len(ensemble) < 2:
        return []
    made = {
        "membrane_mean": _membrane(case, ensemble),
        "binding_mean": _binding(case, ensemble),
    }
    return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]


@plots.styled
def _membrane(case: results.Channel, ensemble: EnsembleRun):
    figure, axes = plots.new_figure(5.2, 3.2)
    theta = np.linspace(0, 360, 241)
    for k, (star, frame) in enumerate(_frames(case, ensemble).items()):
        colour = plots.COLOURS[k]
        column = results.time_column("RL", star)
        axes.plot(
            theta,
            results.reference_around(theta, column),
            "--",
            color=colour,
            linewidth=1,
            label=f"finite elements, t* = {star:g}",
        )
        angle, order = _order(case, ensemble, frame)
        found = ensemble.moments(_BOUND, frame, groups="membrane")
        mean, deviation = found.mean[order], found.deviation[order]
        axes.errorbar(
            angle,
            mean / case.concentration,
            deviation / case.concentration,
            fmt="o",
            color=colour,
            markerfacecolor="none",
            elinewidth=0.8,
            label=f"molecules, t* = {star:g}",
        )
    axes.set_title(f"mean ± deviation of {len(ensemble)} realisations")
    results.finish_membrane(axes)
    return figure


@plots.styled
def _binding(case: results.Channel, ensemble: EnsembleRun):
    figure, axes = plots.new_figure(5.2, 3.2)
    table = reference.load("yeast_channel_mean")
    axes.plot(table["t_star"], table["RL_mean"], "--", color="black", label="finite elements")

    def share(run) -> np.ndarray:
        receptors = run.observable("amount_R_molecules") + run.observable("amount_RL_molecules")
        return run.observable("amount_RL_molecules") / receptors

    found = ensemble.moments(share)
    band(axes, ensemble.times / case.time_unit, found, label="molecules")
    axes.set(xlabel="t / t₀", ylabel="share of bound receptors")
    axes.set_title(f"mean ± deviation of {len(ensemble)} realisations")
    plots.legend(axes)
    return figure
