"""Quantities along a line, in time, and how they are distributed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from particell.errors import InputError
from particell.plots.style import COLOURS, MARKERS, legend, new_figure, styled
from particell.units import time_scale

DASHES = ("--", ":", "-.")


@styled
def profile(
    coordinate: np.ndarray,
    computed: Mapping[str, np.ndarray],
    *,
    reference: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
    xlabel: str,
    ylabel: str,
    title: str = "",
) -> Figure:
    """Computed profiles as symbols against references as lines.

    Parameters
    ----------
    coordinate
        (m,), of all computed profiles.
    computed
        Values (m,) by their name in the legend.
    reference
        Coordinates and values by their name.
    xlabel, ylabel
        With units.
    """
    figure, axes = new_figure()
    for k, (name, (x, y)) in enumerate((reference or {}).items()):
        colour = "black" if len(reference or {}) == 1 else COLOURS[k % len(COLOURS)]
        axes.plot(x, y, "-", color=colour, label=name, zorder=1)
    for k, (name, values) in enumerate(computed.items()):
        axes.plot(
            coordinate,
            values,
            MARKERS[k % len(MARKERS)],
            color=COLOURS[k % len(COLOURS)],
            markerfacecolor="none",
            label=name,
            zorder=2,
        )
    axes.set(xlabel=xlabel, ylabel=ylabel, title=title)
    legend(axes)
    return figure


@styled
def time_series(
    time: np.ndarray,
    series: Mapping[str, np.ndarray],
    *,
    reference: Mapping[str, np.ndarray | float] | None = None,
    ylabel: str,
    title: str = "",
    logarithmic: bool = False,
) -> Figure:
    """Quantities against time (in s; the axis chooses a readable unit).

    Parameters
    ----------
    time
        (frames,), in s.
    series
        Values (frames,) by their name in the legend.
    reference
        Values (frames,), or one number, by name: dashed lines.
    ylabel
        With unit.
    logarithmic
        Whether the second axis is.
    """
    figure, axes = new_figure()
    draw_series(axes, time, series, reference, ylabel, logarithmic)
    axes.set_title(title)
    return figure


@styled
def draw_series(
    axes: Axes,
    time: np.ndarray,
    series: Mapping[str, np.ndarray],
    reference: Mapping[str, np.ndarray | float] | None,
    ylabel: str,
    logarithmic: bool = False,
) -> None:
    """What :func:`time_series` shows, in axes that there are."""
    factor, unit = time_scale(float(np.max(np.abs(time), initial=0.0)))
    for name, values in series.items():
        axes.plot(np.asarray(time) / factor, values, label=name)
    _dashed(axes, np.asarray(time) / factor, reference or {})
    axes.set(xlabel=f"t [{unit}]", ylabel=ylabel)
    if logarithmic:
        axes.set_yscale("log")
    if len(series) + len(reference or {}) > 1 or not ylabel.startswith(tuple(series)):
        legend(axes)  # the label alone does not say what it is


@styled
def curves(
    coordinate: np.ndarray,
    computed: Mapping[str, np.ndarray],
    *,
    reference: Mapping[str, np.ndarray] | None = None,
    xlabel: str,
    ylabel: str,
    title: str = "",
) -> Figure:
    """Computed profiles as coloured lines, references as dashed black ones.

    Parameters
    ----------
    coordinate
        (m,), of all.
    computed, reference
        Values (m,) by their name in the legend.
    xlabel, ylabel
        With units.
    """
    figure, axes = new_figure()
    for name, values in computed.items():
        axes.plot(coordinate, values, label=name)
    _dashed(axes, coordinate, reference or {})
    axes.set(xlabel=xlabel, ylabel=ylabel, title=title)
    if len(computed) + len(reference or {}) > 1:
        legend(axes)
    return figure


@styled
def histogram(
    counts: np.ndarray,
    edges: np.ndarray,
    *,
    reference: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
    xlabel: str,
    ylabel: str,
    title: str = "",
) -> Figure:
    """Bars, and what is expected of them.

    Parameters
    ----------
    counts, edges
        Heights (m,) and ends (m + 1,) of the bars.
    reference
        Coordinates and values by their name in the legend: as many as bars are drawn as points on
        the bars, others as a line.
    xlabel, ylabel
        With units.
    """
    figure, axes = new_figure()
    axes.stairs(counts, edges, fill=True, color=COLOURS[5], alpha=0.6, label="computed")
    for k, (name, (x, y)) in enumerate((reference or {}).items()):
        dots = "o-" if len(x) == len(counts) else "-"
        colour = "black" if k == 0 else COLOURS[k]
        axes.plot(x, y, dots, color=colour, markersize=3, linewidth=1, label=name)
    axes.set(xlabel=xlabel, ylabel=ylabel, title=title)
    axes.set_ylim(bottom=0)
    if reference:
        legend(axes)
    return figure


def expected_on(coordinate: np.ndarray, reference: Mapping[str, Any] | None) -> dict[str, Any]:
    """References, which may be functions of the coordinate, as values on it.

    Raises
    ------
    InputError
        Where the values of one are not as many as the coordinates.
    """
    found = {}
    for name, given in (reference or {}).items():
        values = np.asarray(given(coordinate) if callable(given) else given, float)
        if values.shape not in ((), coordinate.shape):
            allowed = f"a function, a number, or values of shape {coordinate.shape}"
            raise InputError(f"reference '{name}'", f"of shape {values.shape}", allowed)
        found[name] = values
    return found


def _dashed(axes: Axes, x: np.ndarray, reference: Mapping[str, np.ndarray | float]) -> None:
    """References against which something is seen, one dash pattern each."""
    for k, (name, expected) in enumerate(reference.items()):
        y = np.broadcast_to(expected, np.shape(x))
        axes.plot(x, y, DASHES[k % len(DASHES)], color="black", linewidth=1, label=name)
