"""What any case file comes to: what is conserved, and how its fields look at the end."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from particell import plots
from particell.cases.base import Metric
from particell.output.run import Run
from particell.simulation import Simulation

#: Largest relative drift of an amount that no reaction changes: round-off of many steps.
DRIFT = 1e-9


def metrics(simulation: Simulation) -> dict[str, Metric]:
    """By how much conserved quantities drifted.

    Amounts have a limit. Momentum has none: walls, gravity and sponges change it too.
    """
    return {
        name: Metric(value, limit=DRIFT if name.startswith("amount") else None)
        for name, value in simulation.conservation().items()
    }


def figures(run: Run, directory: Path) -> list[Path]:
    """Pictures of the last frame's speed and concentrations, and of amounts over time."""
    made = []
    moving = bool(np.any(run.field("velocity")[-1]))
    names = ["velocity"] if moving else []
    names += [n for n in run.field_names if n.startswith("concentration/")]
    for name in names:
        made.append(plots.save(run.plot(name), directory / f"{name.replace('/', '_')}.png"))
    if len(run) < 2:
        return made
    for words, unit, chosen in _series(run):
        series = {name: run.observable(name) for name in chosen}
        series = {name: values for name, values in series.items() if np.any(values)}
        if series:
            figure = plots.time_series(run.times, series, ylabel=plots.label(words, unit))
            made.append(plots.save(figure, directory / f"{words.replace(' ', '_')}.png"))
    return made


def _series(run: Run) -> list[tuple[str, str, list[str]]]:
    """What is drawn against time: words, unit, and names of observables."""
    amounts = [n for n in run.observable_names if n.startswith("amount_")]
    whole = [n for n in amounts if f"count/{n.removeprefix('amount_')}" in run.field_names]
    energy = [n for n in run.observable_names if n == "kinetic_energy"]
    return [
        ("kinetic energy", "J", energy),
        ("amounts", "mol", [n for n in amounts if n not in whole]),
        ("molecules", "", whole),
    ]
