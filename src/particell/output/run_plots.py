"""``run.plot``: pictures and animations of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from particell import plots
from particell.errors import InputError, unknown_name
from particell.output import movie
from particell.output.pictures import FramePicture, GridMap, Limits, Profile, Scatter
from particell.output.quantities import Quantity, Shown
from particell.output.recorded import Recorded
from particell.output.series import panels_of
from particell.plots.distributions import Expected, distribution

PICTURES: dict[str, Callable[..., FramePicture]] = {
    "scatter": Scatter,
    "map": GridMap,
    "line": lambda run, what, **options: Profile(run, _several(what), **options),
}


class RunPlots:
    """Pictures of a run: ``run.plot("velocity")``, ``run.plot.map("velocity")``, ….

    All give a :class:`matplotlib.figure.Figure`, which notebooks display, and write it to a file
    where they are given a ``path``. Called itself, it is :meth:`scatter`.

    Some parameters are the same everywhere:

    - ``what``: a field or what does not change (``"mass"``, ``"group"``, …) by its name, or
      ``"speed"``; for :meth:`scatter` and :meth:`histogram` also numbers of one's own, (n,) or
      (frames, n), in the order of the particles' ids.
    - ``component``: of a vector, 0, 1, 2 or ``"x"``, ``"y"``, ``"z"``; by default its magnitude.
    - ``frame``: which one; negative numbers count from the end.
    - ``groups``: a group of particles or several (default: those that carry the field).
    - ``limits``: least and greatest value on the scale; ``colours``: a colour map by name;
      ``label``: of the scale, instead of name and unit.

    Wrong names, frames and combinations are an :class:`~particell.errors.InputError`.
    """

    def __init__(self, run: Recorded):
        self.run = run

    def __call__(self, what: Quantity, frame: int = -1, **options: Any) -> Figure:
        """As :meth:`scatter`."""
        return self.scatter(what, frame, **options)

    def __repr__(self) -> str:
        names = [name for name in dir(self) if not name.startswith("_") and name != "run"]
        return f"plots of {self.run!r}: {', '.join(names)}"

    def scatter(
        self,
        what: Quantity,
        frame: int = -1,
        *,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        limits: Limits = None,
        colours: str = "viridis",
        label: str | None = None,
        path: str | Path | None = None,
    ) -> Figure:
        """The particles of a frame, coloured by a field; grey those that do not carry it.

        In 3D three slices through the middle, one particle thick; in 1D the field against x.
        """
        picture = Scatter(self.run, what, groups, component, label, colours)
        return _kept(picture.draw(self.run.checked(frame), limits), path)

    def map(
        self,
        what: str,
        frame: int = -1,
        *,
        cells: int | Sequence[int] | None = None,
        across: str | None = None,
        at: float | None = None,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        limits: Limits = None,
        colours: str = "viridis",
        label: str | None = None,
        path: str | Path | None = None,
        **options: Any,
    ) -> Figure:
        """A field on a regular grid that fills the domain, in 3D on planes across it.

        Bodies and walls are blank, with their particles in grey; see :meth:`.Run.on_points`.

        Parameters
        ----------
        cells
            Along the axes (default: 200 along the longer one of a plane).
        across, at
            In 3D: the axis that the plane is perpendicular to, and where on it in m (default: in
            the middle). Without them there are three planes, through the middle.
        **options
            Of the interpolation: ``order``, ``kernel`` and ``support``, as for
            :meth:`Run.on_points`. Without particles near a cell, it is left blank.
        """
        picture = GridMap(
            self.run, what, cells, across, at, groups, component, label, colours, **options
        )
        return _kept(picture.draw(self.run.checked(frame), limits), path)

    def line(
        self,
        *what: str,
        start: Sequence[float] | None = None,
        end: Sequence[float] | None = None,
        frames: int | Sequence[int] = -1,
        points: int = 101,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        reference: Mapping[str, Any] | None = None,
        limits: Limits = None,
        label: str | None = None,
        path: str | Path | None = None,
        **options: Any,
    ) -> Figure:
        """Fields along a straight line, at one time or several.

        Parameters
        ----------
        what
            One field, or several of the same unit.
        start, end
            Ends of the line in m; in 1D by default those of the domain.
        frames
            One or several.
        points
            How many equally spaced ones, ends included.
        reference
            What to compare with, by its name in the legend: values (points,) in SI units, one
            number, or a function of the coordinate in m (along an axis that axis's, else the
            distance from the start).
        **options
            Of the interpolation, as for :meth:`map`.
        """
        picture = Profile(self.run, what, start, end, points, groups, component, label, **options)
        chosen = [frames] if isinstance(frames, int | np.integer) else list(frames)
        if not chosen:
            raise InputError("frames", chosen, "at least one")
        expected = plots.expected_on(picture.coordinate, reference)
        frames_shown = [self.run.checked(k) for k in chosen]
        return _kept(picture.draw_all(frames_shown, limits, expected), path)

    def series(
        self,
        *names: str,
        reference: Mapping[str, np.ndarray | float] | None = None,
        logarithmic: bool = False,
        path: str | Path | None = None,
    ) -> Figure:
        """Observables in time; amounts, and others of one kind and unit, share a panel.

        Parameters
        ----------
        names
            By default all that were recorded.
        reference
            Values (frames,), or one number, by name: dashed lines; where there is one panel.
        logarithmic
            Whether the second axis is.
        """
        run = self.run
        run.checked(-1)
        panels = panels_of(names, run.observable_names, run.field_names)
        if reference and len(panels) > 1:
            raise InputError("reference", list(reference), "left out with several panels")
        times = run.times
        series = {name: run.observable(name)[: len(times)] for panel in panels for name in panel[1]}
        figure, axes = plots.new_panels(len(panels))
        for (label, members), part in zip(panels, axes, strict=True):
            shown = {text: series[name] for name, text in members.items()}
            plots.draw_series(part, times, shown, reference, label, logarithmic)
        return _kept(figure, path)

    def histogram(
        self,
        what: Quantity,
        frame: int = -1,
        *,
        bins: int | Sequence[float] | None = None,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        reference: Mapping[str, Expected] | None = None,
        label: str | None = None,
        path: str | Path | None = None,
    ) -> Figure:
        """How a field is distributed over the particles of a frame.

        Parameters
        ----------
        bins
            Their number or edges. By default one for each whole number where the values are such
            (and few enough), and 30 else.
        reference
            What is expected, by its name in the legend: a distribution of :mod:`scipy.stats` with
            its parameters, or a function. Of whole numbers it is a probability, else a density.
        """
        k = self.run.checked(frame)
        shown = Shown(self.run, what, component, label)
        values = shown.at(k)[self.run.chosen(groups)]
        figure = distribution(
            values, bins=bins, reference=reference, label=shown.label, title=self.run.title(k)
        )
        return _kept(figure, path)

    def animation(
        self,
        what: Quantity,
        path: str | Path,
        *,
        kind: str = "scatter",
        frames: Sequence[int] | slice | None = None,
        fps: float = 10,
        limits: Limits = None,
        dpi: float = 100,
        shades: int = 64,
        progress: bool = True,
        **options: Any,
    ) -> movie.Movie:
        """All frames, or some, one after the other in a file.

        Parameters
        ----------
        what
            As for the pictures of that kind (for a line: one field or a list of them).
        path
            A name that ends in ``.gif``, or ``.mp4`` (needs ffmpeg, or the extra ``viz``).
        kind
            ``"scatter"``, ``"map"`` or ``"line"``.
        frames
            Numbers, or a slice; by default all.
        fps
            Frames a second.
        limits
            Of the scale; by default those of all frames, which are looked through first.
        dpi, shades
            Pixels an inch, and colours of a frame of a GIF (at most 256): less makes it smaller.
        progress
            Whether to show a progress bar.
        **options
            Of the pictures.

        Returns
        -------
        Movie
            The file, which a notebook plays.
        """
        target = movie.checked(path, fps)
        if kind not in PICTURES:
            raise unknown_name("kind", kind, PICTURES)
        if not 2 <= shades <= 256:
            raise InputError("shades", shades, "from 2 to 256")
        self.run.checked(-1)
        count = len(self.run)
        wanted = range(count)[frames] if isinstance(frames, slice) else frames
        numbers = [self.run.checked(k) for k in (range(count) if wanted is None else wanted)]
        if not numbers:
            raise InputError("frames", frames, "at least one")
        picture = PICTURES[kind](self.run, what, **options)
        if limits is None:
            ends = [picture.extremes(k) for k in numbers]
            limits = _room(min(a for a, _ in ends), max(b for _, b in ends), kind)
        figure = picture.draw(numbers[0], limits)
        bar = tqdm(numbers, unit="frame", desc=target.name, disable=not progress)
        return movie.write_movie(figure, bar, picture.move, target, fps=fps, dpi=dpi, shades=shades)


def _several(what: Any) -> Sequence[Any]:
    return what if isinstance(what, list | tuple) else [what]


def _room(low: float, high: float, kind: str) -> Limits:
    """Limits of a scale for values from ``low`` to ``high``."""
    if not low <= high:  # nothing was finite
        return None
    room = 0.05 * (high - low) if kind == "line" else 0.0
    return (low - room, high + room) if high > low else None


def _kept(figure: Figure, path: str | Path | None) -> Figure:
    if path is not None:
        plots.save(figure, path)
    return figure
