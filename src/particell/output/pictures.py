"""Pictures of one frame of a run that can be moved on to another one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure

from particell import plots
from particell.analysis.fields import line, plane
from particell.errors import InputError
from particell.geometry.domain import AXES
from particell.output.quantities import Quantity, Shown
from particell.output.recorded import Recorded
from particell.plots.maps import move_particles

Limits = tuple[float, float] | None
#: Cells along the longer side of a map.
CELLS = 200


class FramePicture(Protocol):
    """A picture of any frame."""

    def draw(self, frame: int, limits: Limits) -> Figure:
        """Make the figure."""
        ...

    def move(self, figure: Figure, frame: int) -> None:
        """Let a figure that was drawn show another frame."""
        ...

    def extremes(self, frame: int) -> tuple[float, float]:
        """Least and greatest value that is shown of a frame."""
        ...


class Scatter:
    """The particles, coloured by a field."""

    def __init__(
        self,
        run: Recorded,
        what: Quantity,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        label: str | None = None,
        colours: str = "viridis",
    ):
        self.run, self.colours = run, colours
        self.shown = Shown(run, what, component, label)
        self.chosen = run.chosen(groups)

    def values(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions (m, D) and values (m,)."""
        position = self.run.source.read("position", frame)[self.chosen]
        return position, self.shown.at(frame)[self.chosen]

    def extremes(self, frame: int) -> tuple[float, float]:
        """See :class:`FramePicture`."""
        return _extremes(self.shown.at(frame)[self.chosen])

    def draw(self, frame: int, limits: Limits) -> Figure:
        """See :class:`FramePicture`."""
        position, values = self.values(frame)
        return plots.field_map(
            position,
            values,
            domain=self.run.domain,
            label=self.shown.label,
            title=self.run.title(frame),
            limits=limits,
            colours=self.colours,
        )

    def move(self, figure: Figure, frame: int) -> None:
        """See :class:`FramePicture`."""
        move_particles(figure, *self.values(frame), self.run.domain)
        figure.axes[0].set_title(self.run.title(frame))


class GridMap:
    """A field on a regular grid, or on a plane across a 3D domain.

    ``across`` is the axis that the plane is perpendicular to, ``at`` its coordinate in m.
    """

    def __init__(
        self,
        run: Recorded,
        what: str,
        cells: int | Sequence[int] | None = None,
        across: str | None = None,
        at: float | None = None,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        label: str | None = None,
        colours: str = "viridis",
        **options: Any,
    ):
        self.run, self.colours, self.options = run, colours, {"groups": groups, **options}
        self.shown = _field(run, what, component, label)
        self.points, self.axes = _places(run, cells, across, at)

    def values(self, frame: int) -> np.ndarray:
        """Of the cells, (nx, ny)."""
        points = self.points.reshape(-1, self.run.domain.dim)
        found = self.run.on_points(self.shown.name, points, frame, **self.options)
        return self.shown.scalar(found).reshape(self.points.shape[:-1])

    def extremes(self, frame: int) -> tuple[float, float]:
        """See :class:`FramePicture`."""
        return _extremes(self.values(frame))

    def draw(self, frame: int, limits: Limits) -> Figure:
        """See :class:`FramePicture`."""
        return plots.grid_map(
            self.values(frame),
            domain=self.run.domain,
            axes=self.axes,
            label=self.shown.label,
            title=self.run.title(frame),
            limits=limits,
            colours=self.colours,
        )

    def move(self, figure: Figure, frame: int) -> None:
        """See :class:`FramePicture`."""
        figure.axes[0].images[0].set_data(self.values(frame).T)
        figure.axes[0].set_title(self.run.title(frame))


class Profile:
    """Fields along a straight line; by default along the domain of a run in 1D."""

    def __init__(
        self,
        run: Recorded,
        names: Sequence[str],
        start: Sequence[float] | None = None,
        end: Sequence[float] | None = None,
        points: int = 101,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        label: str | None = None,
        **options: Any,
    ):
        if not names:
            raise InputError("fields", names, f"some of {', '.join(run.field_names)}")
        self.run, self.options = run, {"groups": groups, **options}
        self.shown = [_field(run, name, component, None) for name in names]
        labels = list(dict.fromkeys(s.label for s in self.shown))
        self.label = label if label is not None else _common(labels)
        self.points, self.coordinate, self.axis = line_points(run, start, end, points)

    def values(self, frame: int) -> list[np.ndarray]:
        """Along the line, (points,) of each field."""
        found = [self.run.on_points(s.name, self.points, frame, **self.options) for s in self.shown]
        return [s.scalar(v) for s, v in zip(self.shown, found, strict=True)]

    def extremes(self, frame: int) -> tuple[float, float]:
        """See :class:`FramePicture`."""
        return _extremes(np.concatenate(self.values(frame)))

    def draw(self, frame: int, limits: Limits) -> Figure:
        """See :class:`FramePicture`."""
        return self.draw_all([frame], limits)

    def draw_all(
        self, frames: Sequence[int], limits: Limits, reference: dict[str, np.ndarray] | None = None
    ) -> Figure:
        """Several frames in one picture."""
        computed = {}
        for frame in frames:
            for shown, values in zip(self.shown, self.values(frame), strict=True):
                times = [self.run.title(frame)] if len(frames) > 1 else []
                names = [str(shown.what)] if len(self.shown) > 1 or not times else []
                computed[", ".join(names + times)] = values
        factor, unit = plots.length_scale(float(np.abs(self.coordinate).max()))
        figure = plots.curves(
            self.coordinate / factor,
            computed,
            reference=reference,
            xlabel=f"{self.axis} [{unit}]",
            ylabel=self.label,
            title=self.run.title(frames[0]) if len(frames) == 1 else "",
        )
        if limits:
            figure.axes[0].set_ylim(*limits)
        return figure

    def move(self, figure: Figure, frame: int) -> None:
        """See :class:`FramePicture`."""
        for drawn, values in zip(figure.axes[0].lines, self.values(frame), strict=False):
            drawn.set_ydata(values)
        figure.axes[0].set_title(self.run.title(frame))


def _field(run: Recorded, what: str, component: int | str | None, label: str | None) -> Shown:
    """What is to be interpolated, which has to be a recorded field."""
    shown = Shown(run, what, component, label)
    if not shown.is_field:
        raise InputError("field", what, f"one of {', '.join(run.field_names)}")
    return shown


def _common(labels: Sequence[str]) -> str:
    """One label for several fields: their unit, if they have the same one."""
    if len(labels) == 1:
        return labels[0]
    units = {text.partition(" [")[2] for text in labels}
    if len(units) > 1:
        raise InputError("fields", list(labels), "of one unit, to share an axis")
    return f"[{units.pop()}" if all(units) else ""


def _places(
    run: Recorded, cells: int | Sequence[int] | None, across: str | None, at: float | None
) -> tuple[np.ndarray, tuple[int, int]]:
    """Centres of the cells of a map, (nx, ny, D), and the two axes that are seen."""
    domain = run.domain
    if domain.dim == 1:
        raise InputError("run", "in 1D", "in 2D or 3D for a map (in 1D: plot.line)")
    if domain.dim == 2:
        if across is not None or at is not None:
            raise InputError("across", across, "left out in 2D")
        normal = None
    else:
        across = "z" if across is None else across
        if across not in tuple(AXES):
            raise InputError("across", across, "'x', 'y' or 'z'")
        normal = AXES.index(across)
    seen = tuple(a for a in range(domain.dim) if a != normal)
    sides = domain.lengths[list(seen)]
    if cells is None:
        cells = [max(1, round(CELLS * side / sides.max())) for side in sides]
    return plane(domain, cells, normal, at), (seen[0], seen[1])


def line_of(
    run: Recorded,
    what: str,
    start: Sequence[float] | None,
    end: Sequence[float] | None,
    points: int,
    component: int | str | None,
) -> tuple[Shown, np.ndarray, np.ndarray, str]:
    """A field and :func:`line_points`."""
    return _field(run, what, component, None), *line_points(run, start, end, points)


def line_points(
    run: Recorded, start: Sequence[float] | None, end: Sequence[float] | None, points: int
) -> tuple[np.ndarray, np.ndarray, str]:
    """Points of a line, what is shown of them, and how that is called."""
    domain = run.domain
    if (start is None or end is None) and domain.dim > 1:
        raise InputError("start, end", (start, end), f"points in m, {domain.dim} numbers each")
    first = np.atleast_1d(np.asarray(domain.lower if start is None else start, float))
    last = np.atleast_1d(np.asarray(domain.upper if end is None else end, float))
    for key, corner in (("start", first), ("end", last)):
        if corner.shape != (domain.dim,):
            raise InputError(key, corner.tolist(), f"a point in m, {domain.dim} numbers")
    if not isinstance(points, int) or points < 2:
        raise InputError("points", points, "a whole number >= 2")
    places = line(first.tolist(), last.tolist(), points)
    along = np.flatnonzero(first != last)
    if not len(along):
        raise InputError("end", last.tolist(), "another point than the start")
    if len(along) == 1:
        return places, places[:, along[0]], AXES[along[0]]
    return places, np.linalg.norm(places - first, axis=1), "distance"


def _extremes(values: np.ndarray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (np.inf, -np.inf)
