"""Fields and particles in the plane, in 3D in three planes through the middle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from particell.geometry.domain import Domain
from particell.plots.planes import (
    Plane,
    box_of,
    marker_area,
    panels,
    planes_of,
    spacing_of,
)
from particell.plots.style import COLOURS, new_figure, styled
from particell.units import length_scale

#: Colour of particles that carry no field: walls, bodies, other fluids.
GREY = "0.75"


@styled
def field_map(
    position: np.ndarray,
    values: np.ndarray,
    *,
    domain: Domain,
    others: np.ndarray | None = None,
    label: str = "",
    title: str = "",
    style: str = "scatter",
    limits: tuple[float, float] | None = None,
    colours: str = "viridis",
) -> Figure:
    """Map of a field of particles in a plane, or its graph on a line.

    In 3D three slices through the middle, one particle thick.

    Parameters
    ----------
    position
        (n, D), in m.
    values
        (n,).
    domain
        The box, which is what is shown, with what of ``others`` lies round it.
    others
        Particles that carry nothing of the field, (m, D): walls and bodies, grey.
    label
        Name and unit of the field.
    style
        ``"scatter"`` or ``"tripcolor"`` (in 2D).
    limits
        Least and greatest value of the colour scale.
    colours
        Name of a colour map.
    """
    factor, unit = length_scale(float(domain.lengths.max()))
    if domain.dim == 1:
        figure, axes = new_figure()
        axes.plot(position[:, 0] / factor, values, ".", markersize=3)
        axes.set(xlabel=f"x [{unit}]", ylabel=label, title=title)
        if limits:
            axes.set_ylim(*limits)
        return figure
    rest = np.zeros((0, domain.dim)) if others is None else others
    planes, spacing = (
        planes_of(domain),
        spacing_of(domain, within(position, domain) + within(rest, domain)),
    )
    figure, grid = panels(domain, planes, box_of(domain, rest, 0.5 * spacing))
    low, high = limits or _extremes(values)
    area = marker_area(grid[0], spacing, domain)
    options: dict[str, Any] = {"cmap": colours, "vmin": low, "vmax": high}
    for axes, plane in zip(grid, planes, strict=True):
        chosen = plane.within(position, spacing)
        x = plane.seen(position[chosen]) / factor
        if style == "tripcolor" and domain.dim == 2 and len(x) > 2:
            # Given x, y and values, matplotlib would first try the values as triangles.
            triangles = Triangulation(x[:, 0], x[:, 1])
            mesh: Any = axes.tripcolor(triangles, values[chosen], shading="gouraud", **options)
        else:
            mesh = axes.scatter(x[:, 0], x[:, 1], c=values[chosen], s=area, linewidths=0, **options)
        _draw_others(axes, plane, rest, spacing, area, factor)
    _scale(figure, grid[-1], mesh, label)
    _entitle(figure, grid, title)
    return figure


def within(position: np.ndarray, domain: Domain) -> int:
    """How many particles lie in a domain."""
    return int(np.all((position >= domain.lower) & (position <= domain.upper), axis=1).sum())


def _extremes(values: np.ndarray) -> tuple[float | None, float | None]:
    """One scale for all planes; None lets matplotlib choose."""
    finite = values[np.isfinite(values)] if len(values) else values
    return (float(finite.min()), float(finite.max())) if len(finite) else (None, None)


def _draw_others(
    axes: Axes, plane: Plane, others: np.ndarray, spacing: float, area: float, factor: float
) -> None:
    """Particles without the field, behind those with it."""
    if len(others):
        x = plane.seen(others[plane.within(others, spacing)]) / factor
        axes.scatter(x[:, 0], x[:, 1], s=area, color=GREY, linewidths=0, zorder=0.5)


def _entitle(figure: Figure, grid: Sequence[Axes], title: str) -> None:
    """A title over one plane, or over all."""
    if len(grid) == 1:
        grid[0].set_title(title)
    else:
        figure.suptitle(title, fontsize="medium")


def move_particles(
    figure: Figure,
    position: np.ndarray,
    values: np.ndarray,
    others: np.ndarray,
    domain: Domain,
    title: str,
) -> None:
    """Put the particles of a scattered :func:`field_map` elsewhere, with other values."""
    factor, planes = length_scale(float(domain.lengths.max()))[0], planes_of(domain)
    if domain.dim == 1:
        figure.axes[0].lines[0].set_data(position[:, 0] / factor, values)
    else:
        spacing = spacing_of(domain, within(position, domain) + within(others, domain))
        for axes, plane in zip(figure.axes, planes, strict=False):
            chosen = plane.within(position, spacing)
            axes.collections[0].set_offsets(plane.seen(position[chosen]) / factor)
            axes.collections[0].set_array(values[chosen])
            _move_others(axes, plane, others, spacing, factor)
    _entitle(figure, figure.axes[: len(planes)], title)


def _move_others(
    axes: Axes, plane: Plane, others: np.ndarray, spacing: float, factor: float
) -> None:
    if len(others):
        x = plane.seen(others[plane.within(others, spacing)]) / factor
        axes.collections[-1].set_offsets(x)


@styled
def grid_map(
    values: Sequence[np.ndarray],
    planes: Sequence[Plane],
    *,
    domain: Domain,
    others: np.ndarray | None = None,
    count: int = 0,
    label: str = "",
    title: str = "",
    limits: tuple[float, float] | None = None,
    colours: str = "viridis",
) -> Figure:
    """Map of the cells of regular grids that fill a domain, or planes across it.

    Parameters
    ----------
    values
        Of the cells of each plane, (nx, ny); NaN is left blank.
    planes
        Where they are.
    domain
        The box.
    others
        Particles that carry nothing of the field, (m, D) in m: grey where it is blank.
    count
        Number of all particles in the domain, by which those are as large as they are.
    label, title, limits, colours
        As for :func:`field_map`.
    """
    factor, _ = length_scale(float(domain.lengths.max()))
    rest = np.zeros((0, domain.dim)) if others is None else others
    spacing = spacing_of(domain, count)
    figure, grid = panels(domain, list(planes), box_of(domain, rest, 0.5 * spacing))
    low, high = limits or _extremes(np.concatenate([np.ravel(v) for v in values]))
    area = marker_area(grid[0], spacing, domain)
    for axes, plane, cells in zip(grid, planes, values, strict=True):
        seen = [plane.first, plane.second]
        box = np.stack([domain.lower[seen], domain.upper[seen]], axis=1).ravel()
        view = axes.get_xlim(), axes.get_ylim()
        image = axes.imshow(
            cells.T,
            origin="lower",
            extent=tuple(box / factor),
            cmap=colours,
            vmin=low,
            vmax=high,
            interpolation="nearest",
            zorder=1,
        )
        axes.set(xlim=view[0], ylim=view[1])
        _draw_others(axes, plane, rest, spacing, area, factor)
    _scale(figure, grid[-1], image, label)
    _entitle(figure, grid, title)
    return figure


def move_cells(
    figure: Figure,
    values: Sequence[np.ndarray],
    planes: Sequence[Plane],
    others: np.ndarray,
    count: int,
    domain: Domain,
    title: str,
) -> None:
    """Other values for the cells of a :func:`grid_map`, and other places for the grey particles."""
    factor = length_scale(float(domain.lengths.max()))[0]
    spacing = spacing_of(domain, count)
    for axes, plane, cells in zip(figure.axes, planes, values, strict=False):
        axes.images[0].set_data(cells.T)
        _move_others(axes, plane, others, spacing, factor)
    _entitle(figure, figure.axes[: len(values)], title)


def _scale(figure: Figure, axes: Axes, mesh: Any, label: str) -> None:
    """A colour scale: an inset is as high as the map, whatever the map's shape."""
    figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label=label)


@styled
def arrangement(
    position: np.ndarray, group: np.ndarray, names: Sequence[str], *, domain: Domain
) -> Figure:
    """The particles, coloured by group; in 3D three slices through the middle."""
    factor, _ = length_scale(float(domain.lengths.max()))
    planes = planes_of(domain)
    spacing = spacing_of(domain, within(position, domain))
    figure, grid = panels(domain, planes, box_of(domain, position, 0.5 * spacing))
    area = marker_area(grid[0], spacing, domain)
    shown: dict[str, Any] = {}
    for axes, plane in zip(grid, planes, strict=True):
        chosen = plane.within(position, spacing)
        for k, name in enumerate(names):
            x = plane.seen(position[chosen & (group == k)]) / factor
            if len(x):
                colour = COLOURS[k % len(COLOURS)]
                shown[name] = axes.scatter(
                    x[:, 0], x[:, 1], s=area, color=colour, linewidths=0, label=name
                )
    if shown:
        figure.legend(
            list(shown.values()),
            list(shown),
            loc="outside right upper",
            markerscale=float(np.sqrt(30 / area)),
        )
    return figure


@styled
def mark_zone(axes: Axes, low: float, high: float, name: str) -> None:
    """Mark what lies between two values of x (in the axes' unit): a hatched strip with a name."""
    axes.axvspan(
        low, high, facecolor="none", edgecolor="0.2", hatch="////", linewidth=0.6, alpha=0.5
    )
    axes.annotate(
        name,
        (0.5 * (low + high), 1.0),
        xycoords=axes.get_xaxis_transform(),
        xytext=(0, 2),
        textcoords="offset points",
        annotation_clip=False,
        ha="center",
        va="bottom",
        fontsize="small",
    )
