"""Fields and particles in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from particell.geometry.domain import AXES, Domain
from particell.plots.style import COLOURS, new_figure, styled
from particell.units import length_scale


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
        if limits:
            axes.set_ylim(*limits)
        return figure
    figure, axes = _plane(domain, factor, unit)
    if domain.dim == 3:  # what is nearer to the eye is drawn later
        order = np.argsort(x[:, 2], kind="stable")
        x, values = x[order], values[order]
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
    _scale(figure, axes, mesh, label)
    axes.set_title(title)
    return figure


def move_particles(figure: Figure, position: np.ndarray, values: np.ndarray, domain: Domain):
    """Put the particles of a scattered :func:`field_map` elsewhere, with other values."""
    x = position / length_scale(float(domain.lengths.max()))[0]
    (axes, *_) = figure.axes
    if domain.dim == 1:
        axes.lines[0].set_data(x[:, 0], values)
        return
    order = np.argsort(x[:, 2], kind="stable") if domain.dim == 3 else slice(None)
    axes.collections[0].set_offsets(x[order, :2])
    axes.collections[0].set_array(values[order])


@styled
def grid_map(
    values: np.ndarray,
    *,
    domain: Domain,
    axes: tuple[int, int] = (0, 1),
    label: str = "",
    title: str = "",
    limits: tuple[float, float] | None = None,
    colours: str = "viridis",
) -> Figure:
    """Map of the cells of a regular grid that fills a domain, or a plane across it.

    Parameters
    ----------
    values
        Of the cells, (nx, ny); NaN is left blank.
    domain
        The box.
    axes
        Which two of its axes are seen.
    label, title, limits, colours
        As for :func:`field_map`.
    """
    factor, unit = length_scale(float(domain.lengths.max()))
    figure, panel = _plane(domain, factor, unit, axes)
    low, high = limits or (None, None)
    first, second = axes
    box = [domain.lower[first], domain.upper[first], domain.lower[second], domain.upper[second]]
    image = panel.imshow(
        values.T,
        origin="lower",
        extent=tuple(np.array(box) / factor),
        cmap=colours,
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    _scale(figure, panel, image, label)
    panel.set_title(title)
    return figure


def _scale(figure: Figure, axes: Axes, mesh: Any, label: str) -> None:
    """A colour scale: an inset is as high as the map, whatever the map's shape."""
    figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label=label)


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


def _plane(
    domain: Domain, factor: float, unit: str, seen: tuple[int, int] = (0, 1)
) -> tuple[Figure, Axes]:
    first, second = seen
    lengths, lower, upper = domain.lengths, domain.lower / factor, domain.upper / factor
    sides = lengths[list(seen)] if domain.dim > 1 else lengths[[0, 0]] * (1, 0.2)
    width = 4.6
    # Room for the labels and, at the right, for the scale.
    height = float(np.clip((width - 1.4) * sides[1] / sides[0] + 0.8, 1.6, 7.0))
    figure, axes = new_figure(width, height)
    axes.set_aspect("equal")
    axes.set_xlim(lower[first], upper[first])
    axes.set_xlabel(f"{AXES[first]} [{unit}]")
    if domain.dim > 1:
        axes.set_ylim(lower[second], upper[second])
        axes.set_ylabel(f"{AXES[second]} [{unit}]")
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
