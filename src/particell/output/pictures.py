"""Pictures of one frame of a run that can be moved on to another one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure

from particell import plots
from particell.analysis.fields import line
from particell.analysis.fields import plane as plane_cells
from particell.errors import InputError
from particell.geometry.domain import AXES, Domain
from particell.output.quantities import Quantity, Shown
from particell.output.recorded import Recorded
from particell.plots.maps import move_cells, move_particles
from particell.plots.planes import Plane, plane_across, planes_of

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
    """The particles, coloured by a field; grey those that do not carry it."""

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
        if groups is None and self.shown.is_field:
            self.chosen = run.carrying(self.shown.name) | self._moving_walls()

    def _moving_walls(self) -> np.ndarray:
        """Mask (n,) of walls that move, which have a velocity of their own."""
        run, nothing = self.run, np.zeros(len(self.chosen), bool)
        if self.shown.name != "velocity" or not len(run):
            return nothing
        for g, role in enumerate(run.source.roles()):
            rows = run.static["group"] == g
            if role.kind == "wall" and np.any(run.source.read("velocity", -1)[rows]):
                nothing |= rows
        return nothing

    def values(self, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (m, D) and values (m,), and the positions of the others."""
        position = self.run.source.read("position", frame)
        values = self.shown.at(frame)[self.chosen]
        return position[self.chosen], values, position[~self.chosen]

    def extremes(self, frame: int) -> tuple[float, float]:
        """See :class:`FramePicture`."""
        return _extremes(self.shown.at(frame)[self.chosen])

    def draw(self, frame: int, limits: Limits) -> Figure:
        """See :class:`FramePicture`."""
        position, values, others = self.values(frame)
        return plots.field_map(
            position,
            values,
            domain=self.run.domain,
            others=others,
            label=self.shown.label,
            title=self.run.title(frame),
            limits=limits,
            colours=self.colours,
        )

    def move(self, figure: Figure, frame: int) -> None:
        """See :class:`FramePicture`."""
        move_particles(figure, *self.values(frame), self.run.domain, self.run.title(frame))


class GridMap:
    """A field on a regular grid, in 3D on planes across the domain.

    ``across`` is the axis that a plane is perpendicular to, ``at`` its coordinate in m; without it
    three through the middle are shown.
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
        self.planes = _planes(run.domain, across, at)
        self.points = [_cells(run.domain, plane, cells, len(self.planes)) for plane in self.planes]
        carried = run.chosen(groups) if groups is not None else run.carrying(self.shown.name)
        self.others = np.flatnonzero(~carried)

    def values(self, frame: int) -> list[np.ndarray]:
        """Of the cells of each plane, (nx, ny)."""
        return [self._values(points, frame) for points in self.points]

    def _values(self, cells: np.ndarray, frame: int) -> np.ndarray:
        points = cells.reshape(-1, self.run.domain.dim)
        found = self.run.on_points(self.shown.name, points, frame, **self.options)
        return self.shown.scalar(found).reshape(cells.shape[:-1])

    def extremes(self, frame: int) -> tuple[float, float]:
        """See :class:`FramePicture`."""
        return _extremes(np.concatenate([np.ravel(v) for v in self.values(frame)]))

    def draw(self, frame: int, limits: Limits) -> Figure:
        """See :class:`FramePicture`."""
        position = self.run.source.read("position", frame)
        return plots.grid_map(
            self.values(frame),
            self.planes,
            domain=self.run.domain,
            others=position[self.others],
            count=plots.within(position, self.run.domain),
            label=self.shown.label,
            title=self.run.title(frame),
            limits=limits,
            colours=self.colours,
        )

    def move(self, figure: Figure, frame: int) -> None:
        """See :class:`FramePicture`."""
        position = self.run.source.read("position", frame)
        count = plots.within(position, self.run.domain)
        others, domain = position[self.others], self.run.domain
        values, title = self.values(frame), self.run.title(frame)
        move_cells(figure, values, self.planes, others, count, domain, title)


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


def _planes(domain: Domain, across: str | None, at: float | None) -> list[Plane]:
    """The planes that a map shows."""
    if domain.dim == 1:
        raise InputError("run", "in 1D", "in 2D or 3D for a map (in 1D: plot.line)")
    if domain.dim == 2:
        if across is not None or at is not None:
            raise InputError("across", across, "left out in 2D")
        return planes_of(domain)
    if across is None:
        if at is not None:
            raise InputError("at", at, "given with 'across', the axis that it is on")
        return planes_of(domain)
    if across not in tuple(AXES):
        raise InputError("across", across, "'x', 'y' or 'z'")
    normal = AXES.index(across)
    middle = 0.5 * float(domain.lower[normal] + domain.upper[normal])
    return [plane_across(domain, normal, middle if at is None else at)]


def _cells(
    domain: Domain, plane: Plane, cells: int | Sequence[int] | None, count: int
) -> np.ndarray:
    """Centres of the cells of a plane, (nx, ny, D)."""
    seen = [plane.first, plane.second]
    if cells is None:
        sides = domain.lengths[seen]
        cells = [max(1, round(CELLS * side / sides.max())) for side in sides]
    elif count > 1 and not isinstance(cells, int):
        if len(cells) != domain.dim:
            raise InputError("cells", cells, "a positive number, or one for each axis")
        cells = [cells[axis] for axis in seen]
    return plane_cells(domain, cells, plane.normal, plane.at if plane.normal is not None else None)


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
