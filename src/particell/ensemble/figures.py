"""Pictures of an ensemble: mean and deviation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell import plots
from particell.errors import InputError, unknown_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from particell.analysis.statistics import Moments
    from particell.ensemble.results import EnsembleRun

#: Most observables that one picture shows.
MOST = 12


def band(axes: Axes, x: np.ndarray, values: Moments, *, scale: float = 1.0, **style: Any) -> None:
    """A mean as a line, and mean ± deviation as a band around it."""
    mean, deviation = values.mean * scale, values.deviation * scale
    (line,) = axes.plot(x, mean, **style)
    axes.fill_between(
        x, mean - deviation, mean + deviation, color=line.get_color(), alpha=0.25, linewidth=0
    )


@plots.styled
def observables(
    ensemble: EnsembleRun, names: Sequence[str] | None = None, path: str | Path | None = None
) -> Figure:
    """Mean ± deviation of observables in time, one panel each.

    Parameters
    ----------
    ensemble
        The realisations.
    names
        Which observables; by default all that vary in time or between realisations (at most 12).
    path
        Also write it to this file.
    """
    for name in names or ():
        if name not in ensemble.observable_names:
            raise unknown_name("observable", name, ensemble.observable_names)
    found = {n: ensemble.moments(n, None) for n in names or ensemble.observable_names}
    if names is None:
        varying = {n: m for n, m in found.items() if np.ptp(m.mean) or m.deviation.any()}
        found = dict(list((varying or found).items())[:MOST])
    if not found:
        raise InputError("observables", [], "at least one that was recorded")
    columns = min(3, len(found))
    rows = math.ceil(len(found) / columns)
    figure, grid = plots.new_figure(3.4 * columns, 2.5 * rows, rows, columns)
    factor, unit = plots.time_scale(float(ensemble.times[-1]))
    panels = np.atleast_1d(grid).ravel()
    for axes, (name, values) in zip(panels, found.items(), strict=False):
        band(axes, ensemble.times / factor, values)
        axes.set(xlabel=f"t [{unit}]", ylabel=name.replace("_", " "))
    for axes in panels[len(found) :]:
        axes.set_axis_off()
    figure.suptitle(f"mean ± deviation of {len(ensemble)} realisations")
    if path is not None:
        plots.save(figure, path)
    return figure
