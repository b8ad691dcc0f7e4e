"""Pictures in one style: field maps, profiles against a reference, arrangements, time series.

Figures are made without pyplot, so that neither its state nor the user's backend is touched.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import matplotlib  # alone, not its pyplot
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from particell.geometry.domain import Domain
from particell.output.files import replacing
from particell.units import field_unit

# Okabe & Ito's colours, which people with any kind of colour vision can tell apart.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "osD^vP*"

STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.7,
    "axes.formatter.limits": (-2, 4),
    "axes.formatter.use_mathtext": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(color=COLOURS),
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "image.cmap": "viridis",
    "figure.dpi": 100,
    "savefig.dpi": 200,
}

_LENGTHS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
_TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"), (1e-12, "ps"))

_F = TypeVar("_F", bound=Callable[..., Any])


def styled(function: _F) -> _F:
    """Run a function under :data:`STYLE`, whatever the user's own settings are."""

    @functools.wraps(function)
    def wrapper(*args: Any, **options: Any) -> Any:
        with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
            return function(*args, **options)

    return wrapper  # type: ignore[return-value]


@styled
def new_figure(
    width: float = 4.2, height: float = 3.1, rows: int = 1, columns: int = 1
) -> tuple[Figure, Any]:
    """An empty figure (inches) and its axes, one or an array of them."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns)


@styled
def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure to a file (its kind is the name's ending), atomically."""
    path = Path(path)
    with replacing(path) as partial:
        figure.savefig(partial)
    return path


def length_scale(extent: float) -> tuple[float, str]:
    """Factor and name of the unit in which a length in m reads well: (1e-6, "µm")."""
    return _readable(extent, _LENGTHS)


def time_scale(extent: float) -> tuple[float, str]:
    """Factor and name of the unit in which a time in s reads well."""
    return _readable(extent, _TIMES)


def _readable(extent: float, units: Sequence[tuple[float, str]]) -> tuple[float, str]:
    for factor, name in units:
        if abs(extent) >= factor * 0.999:
            return factor, name
    return units[-1] if extent else units[0]


def field_label(name: str, component: int | None = None) -> str:
    """Axis label of a field: name and unit."""
    what = name.split("/")
    words = f"{what[0]} of {what[1]}" if len(what) == 2 else name
    if component is not None:
        words += f" {'xyz'[component]}"
    return label(words, field_unit(name))


def label(words: str, unit: str = "") -> str:
    """``"density [kg/m³]"``."""
    shown = unit.replace("^2", "²").replace("^3", "³").replace("*", " ")
    return f"{words} [{shown}]" if shown else words


@styled
def field_map(
    position: np.ndarray,
    values: np.ndarray,
    *,
    domain: Domain,
    label: str = "",
    title: str = "",
    style: str = "scatter",
    limits: tuple[float, float] | None = None,
    colours: str = "viridis",
) -> Figure:
    """Map of a field in a plane, or its graph on a line.

    Parameters
    ----------
    position
        (n, D), in m.
    values
        (n,).
    domain
        The box, which is what is shown.
    label
        Name and unit of the field.
    style
        ``"scatter"`` or ``"tripcolor"``.
    limits
        Least and greatest value of the colour scale.
    colours
        Name of a colour map.
    """
    factor, unit = length_scale(float(domain.lengths.max()))
    x = position / factor
    if domain.dim == 1:
        figure, axes = new_figure()
        axes.plot(x[:, 0], values, ".", markersize=3)
        axes.set(xlabel=f"x [{unit}]", ylabel=label, title=title)
        return figure
    figure, axes = _plane(domain, factor, unit)
    low, high = limits or (None, None)
    if style == "tripcolor" and len(x) > 2:
        # Given x, y and values, matplotlib would first try the values as triangles.
        triangles = Triangulation(x[:, 0], x[:, 1])
        mesh: Any = axes.tripcolor(
            triangles, values, shading="gouraud", cmap=colours, vmin=low, vmax=high
        )
    else:
        mesh = axes.scatter(
            x[:, 0],
            x[:, 1],
            c=values,
            s=_marker_area(figure, domain, len(x)),
            cmap=colours,
            vmin=low,
            vmax=high,
            linewidths=0,
        )
    # An inset is as high as the map, whatever the map's shape.
    figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label=label)
    axes.set_title(title)
    return figure


@styled
def arrangement(
    position: np.ndarray, group: np.ndarray, names: Sequence[str], *, domain: Domain
) -> Figure:
    """The particles, coloured by group (a 3D arrangement is seen along z)."""
    factor, unit = length_scale(float(domain.lengths.max()))
    figure, axes = _plane(domain, factor, unit)
    for k, name in enumerate(names):
        x = position[group == k] / factor
        if len(x):
            area = _marker_area(figure, domain, len(position))
            second = x[:, 1] if domain.dim > 1 else np.zeros(len(x))
            colour = COLOURS[k % len(COLOURS)]
            axes.scatter(x[:, 0], second, s=area, color=colour, linewidths=0, label=name)
    figure.legend(loc="outside right upper", markerscale=_legend_scale(figure, domain, position))
    return figure


def _legend_scale(figure: Figure, domain: Domain, position: np.ndarray) -> float:
    return float(np.sqrt(30 / _marker_area(figure, domain, len(position))))


def _plane(domain: Domain, factor: float, unit: str) -> tuple[Figure, Axes]:
    sides = domain.lengths[:2] if domain.dim > 1 else np.array([domain.lengths[0]] * 2) * (1, 0.2)
    width = 4.6
    # Room for the labels and, at the right, for the scale.
    height = float(np.clip((width - 1.4) * sides[1] / sides[0] + 0.8, 1.6, 7.0))
    figure, axes = new_figure(width, height)
    axes.set_aspect("equal")
    axes.set_xlim(domain.lower[0] / factor, domain.upper[0] / factor)
    axes.set_xlabel(f"x [{unit}]")
    if domain.dim > 1:
        axes.set_ylim(domain.lower[1] / factor, domain.upper[1] / factor)
        axes.set_ylabel(f"y [{unit}]")
    else:
        axes.set_yticks([])
    return figure, axes


def _marker_area(figure: Figure, domain: Domain, n: int) -> float:
    """Area in points² of a disc as wide as the spacing of n particles that fill the domain."""
    width, height = figure.get_size_inches() - (1.4, 0.8)
    if domain.dim == 1:
        return float((72 * width / max(n, 1)) ** 2)
    lengths = domain.lengths[:2]
    scale = min(width / lengths[0], height / lengths[1])
    spacing = (domain.volume / max(n, 1)) ** (1 / domain.dim)
    return float(np.clip(1.2 * (72 * spacing * scale) ** 2, 0.3, 400))


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
    axes.legend()
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
    factor, unit = time_scale(float(np.max(np.abs(time), initial=0.0)))
    figure, axes = new_figure()
    for name, values in series.items():
        axes.plot(np.asarray(time) / factor, values, label=name)
    for name, expected in (reference or {}).items():
        y = np.broadcast_to(expected, np.shape(time))
        axes.plot(np.asarray(time) / factor, y, "--", color="black", linewidth=1, label=name)
    axes.set(xlabel=f"t [{unit}]", ylabel=ylabel, title=title)
    if logarithmic:
        axes.set_yscale("log")
    axes.legend()
    return figure
