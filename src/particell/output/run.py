"""What a simulation left behind: its frames, time series and summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.health.finding import Finding
from particell.output import time_averages
from particell.output.field import Field
from particell.output.files import read_json
from particell.output.sources import FileSource, MemorySource, Source, known
from particell.representation import block, shown, table
from particell.units import field_unit, length_scale, observable_unit, time_scale

if TYPE_CHECKING:
    import pyvista
    import xarray as xr

    from particell.output.run_plots import RunPlots

TRAJECTORY = "run.h5"
CHECKPOINT = "checkpoint.h5"
SUMMARY = "summary.json"
CASE = "case.json"
#: What a run leaves, figures apart.
OWN_FILES = (TRAJECTORY, CHECKPOINT, SUMMARY, CASE)


class Run:
    """A finished, running or broken-off simulation, as it was recorded.

    Parameters
    ----------
    directory
        The directory a run was written to, or its trajectory file.

    Raises
    ------
    InputError
        Where there is no trajectory.
    """

    def __init__(self, directory: str | Path):
        path = Path(directory)
        self.directory: Path | None = path if path.is_dir() else path.parent
        self.source: Source = FileSource(path / TRAJECTORY if path.is_dir() else path)

    @classmethod
    def from_memory(
        cls,
        domain: Domain,
        groups: Sequence[str],
        static: Mapping[str, np.ndarray],
        steps: Sequence[int],
        times: Sequence[float],
        frames: Sequence[Mapping[str, np.ndarray]],
        observables: Sequence[Mapping[str, Any]] = (),
        summary: Mapping[str, Any] | None = None,
        points: Mapping[str, np.ndarray] | None = None,
    ) -> Run:
        """A run that was not written to a directory.

        Parameters
        ----------
        domain, groups, static
            As for :class:`~particell.output.trajectory.TrajectoryWriter`.
        steps, times, frames, observables
            One entry a frame.
        summary
            What ``summary.json`` would hold.
        points
            Where time averages were taken, by name.
        """
        run = cls.__new__(cls)
        run.directory = None
        run.source = MemorySource(domain, groups, static, steps, times, frames, observables, points)
        run.__dict__["summary"] = dict(summary or {})
        return run

    @property
    def domain(self) -> Domain:
        """The box."""
        return self.source.domain

    @property
    def group_names(self) -> list[str]:
        """The groups of particles, in the order of the static field ``group``."""
        return self.source.groups

    @property
    def steps(self) -> np.ndarray:
        """Number of the time step of every frame, (frames,)."""
        return self.source.steps

    @property
    def times(self) -> np.ndarray:
        """Time of every frame in s, (frames,)."""
        return self.source.times

    @property
    def field_names(self) -> list[str]:
        """The fields of a frame."""
        return self.source.fields()

    @property
    def observable_names(self) -> list[str]:
        """The recorded scalars."""
        return [n for n in self.source.observables() if not time_averages.is_average(n)]

    @property
    def average_names(self) -> dict[str, list[str]]:
        """The fields of each time average by its name."""
        return time_averages.recorded(self.source.observables())

    @cached_property
    def average_points(self) -> dict[str, np.ndarray]:
        """The points (…, D) in m of each time average by its name."""
        return self.source.points()

    @cached_property
    def static(self) -> dict[str, np.ndarray]:
        """What does not change: ``id``, ``group``, ``mass``, …, each of n rows."""
        return self.source.static()

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The contents of ``summary.json``; empty while there is none."""
        path = self.directory / SUMMARY if self.directory else None
        return read_json(path, "summary") if path and path.exists() else {}

    @cached_property
    def health(self) -> list[Finding]:
        """What :meth:`.Simulation.run` found, or ``summary.json`` says; empty without either."""
        found = self.summary.get("health", {})
        return [
            Finding(name, f["value"], f["limit"], f.get("sentence", ""), f["kind"] == "least")
            for name, f in found.items()
        ]

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        times = self.times
        span = f", t = {times[0]:g} … {times[-1]:g} s" if len(times) else ""
        return f"Run({len(times)} frames{span}; fields: {', '.join(self.field_names)})"

    def _repr_html_(self) -> str:
        fields = [(n, field_unit(n), self.source.shape(n)[0][1:]) for n in self.field_names]
        observables = [(n, observable_unit(n, self.field_names)) for n in self.observable_names]
        times, lengths = self.times, self.domain.lengths
        factor, unit = length_scale(float(lengths.max()))
        span = f"{times[0]:.6g} … {times[-1]:.6g} s" if len(times) else "none yet"
        return block(
            f"Run {self.directory or 'in memory'}",
            table(
                [
                    ("case", self.summary.get("case")),
                    ("frames", len(times)),
                    ("times", span),
                    ("box", f"{' × '.join(shown(x / factor) for x in lengths)} {unit}"),
                    ("groups", self.group_names),
                ]
            ),
            table(fields, ("field", "unit", "shape")),
            table(observables, ("observable", "unit")),
        )

    def frame(self, k: int = -1) -> dict[str, np.ndarray]:
        """All fields of frame ``k``, rows in the order of persistent ids."""
        k = self.checked(k)
        return {name: self.source.read(name, k) for name in self.field_names}

    def field(self, name: str) -> Field:
        """One field over all frames, read as needed."""
        return Field(self, known("field", name, self.field_names))

    def observable(self, name: str) -> np.ndarray:
        """A recorded scalar at every frame, (frames,)."""
        return self.source.observable(known("observable", name, self.observable_names))

    def average(
        self,
        field: str = "velocity",
        name: str | None = None,
        frames: slice | Sequence[int] = slice(1, None),
    ) -> np.ndarray:
        """A field averaged in time by a :class:`.TimeAverage`.

        Parameters
        ----------
        field
            One of its fields.
        name
            Its name; not needed where the run has one only.
        frames
            Which frames: each holds the mean since the one before, and the first one the state at
            the start. They count alike.

        Returns
        -------
        numpy.ndarray
            (…) or (…, D), as its points; NaN where no particle was in reach in any of the frames.

        Raises
        ------
        InputError
            For unknown names, and where no frame is left.
        """
        return time_averages.mean(self.source, self.average_names, field, name, frames)

    def group(self, *names: str) -> np.ndarray:
        """Boolean mask (n,) of the particles of one or several groups."""
        chosen = [self.group_names.index(known("group", g, self.group_names)) for g in names]
        return np.isin(self.static["group"], chosen)

    def chosen(self, groups: str | Sequence[str] | None) -> np.ndarray:
        """As :meth:`group`, of one name or a list of them; None is all particles."""
        if groups is None:
            return np.ones(len(self.static["group"]), bool)
        return self.group(*([groups] if isinstance(groups, str) else groups))

    def at(self, time: float) -> int:
        """Index of the frame nearest to a time in s.

        Raises
        ------
        InputError
            Where the time is outside of what was recorded.
        """
        times = self.times
        slack = 1e-9 * max(abs(times[0]), abs(times[-1]))
        if not times[0] - slack <= time <= times[-1] + slack:
            raise InputError("time", time, f"between {times[0]:g} and {times[-1]:g} s")
        return int(np.argmin(np.abs(times - time)))

    def on_points(
        self,
        name: str,
        points: np.ndarray,
        frame: int = -1,
        groups: str | Sequence[str] | None = None,
        order: int = 1,
        kernel: str = "wendland-c2",
        support: float | None = None,
    ) -> np.ndarray:
        """Interpolate a field.

        Parameters
        ----------
        name
            The field.
        points
            Where, (m, D), in m.
        frame
            Which frame.
        groups
            The groups whose particles carry the field (default: all).
        order
            0: weights that add up to one (Shepard), exact on constants; 1: exact on linear fields.
        kernel
            Name of a kernel.
        support
            Its support in m (default: that of the particles).

        Returns
        -------
        numpy.ndarray
            (m,) or (m, D); NaN where there is no particle within the support.
        """
        from particell.output.sampling import on_points

        return on_points(self, name, points, frame, groups, order, kernel, support)

    def on_line(
        self, name: str, start, end, points: int = 101, frame: int = -1, **options: Any
    ) -> np.ndarray:
        """Interpolate a field at equally spaced points from ``start`` to ``end``, both included.

        Returns (points,) or (points, D). Options as for :meth:`on_points`.
        """
        from particell.analysis.fields import line

        return self.on_points(name, line(start, end, points), frame, **options)

    def on_grid(
        self, name: str, shape: int | Sequence[int], frame: int = -1, **options: Any
    ) -> np.ndarray:
        """Interpolate a field at the centres of a regular grid of cells that fills the domain.

        Returns (nx, ny, …) or (nx, ny, …, D). Options as for :meth:`on_points`.
        """
        from particell.analysis.fields import grid

        centres = grid(self.domain, shape)
        values = self.on_points(name, centres.reshape(-1, self.domain.dim), frame, **options)
        return values.reshape(centres.shape[:-1] + values.shape[1:])

    @property
    def plot(self) -> RunPlots:
        """Pictures and animations: ``run.plot("velocity")``, ``run.plot.map("velocity")``, …."""
        from particell.output.run_plots import RunPlots

        return RunPlots(self)

    def to_xarray(
        self,
        *names: str,
        frames: slice | Sequence[int] | None = None,
        groups: str | Sequence[str] | None = None,
        grid: int | Sequence[int] | None = None,
        line: tuple[Sequence[float], Sequence[float]] | None = None,
        points: int = 101,
        **options: Any,
    ) -> xr.Dataset:
        """Fields and observables as an xarray Dataset (extra ``xarray``).

        Fields are read, or interpolated, when their values are asked for and not kept: select
        first, then ``load()``. The units are in the variables' attributes; the slash of
        ``"concentration/L"`` becomes an underscore.

        Parameters
        ----------
        names
            The fields (default: all).
        frames
            Numbers, or a slice; by default all that there are now.
        groups
            A group of particles or several.
        grid
            Cells along each axis: dimensions (time, x, y, …) instead of (time, particle).
        line
            Its two ends in m: dimensions (time, distance), with ``points`` equally spaced ones.
        **options
            Of the interpolation, as for :meth:`on_points`.

        Raises
        ------
        InputError
            For unknown names, and where xarray is missing.
        """
        from particell.output.dataset import dataset

        return dataset(self, names, frames, groups, grid, line, points, options)

    def view(
        self,
        what: str | np.ndarray = "group",
        frame: int = -1,
        *,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        arrows: bool = False,
        limits: tuple[float, float] | None = None,
        colours: str = "viridis",
        path: str | Path | None = None,
        off_screen: bool | None = None,
    ) -> pyvista.Plotter:
        """The particles in 3D as spheres, or arrows along their velocities (extra ``viz``).

        Parameters
        ----------
        what, groups, component, limits, colours
            As for :class:`~particell.output.run_plots.RunPlots`.
        frame
            Which frame.
        arrows
            Whether to show velocities.
        path
            Write the picture to this PNG file.
        off_screen
            Whether no window is to be used (default: where there is a ``path``).

        Returns
        -------
        pyvista.Plotter
            Its ``show()`` opens a window, or the view in a notebook.

        Raises
        ------
        InputError
            For unknown names, and where pyvista is missing.
        """
        from particell.output.view import view

        return view(self, what, frame, groups, component, arrows, limits, colours, path, off_screen)

    def checked(self, frame: int) -> int:
        """The number of a frame, counted from the beginning.

        Raises
        ------
        InputError
            Where there is no such frame.
        """
        frames = len(self)
        if not frames:
            raise InputError("run", str(self.directory), "one with at least one frame")
        if not isinstance(frame, int | np.integer) or not -frames <= frame < frames:
            raise InputError("frame", frame, f"between {-frames} and {frames - 1}")
        return int(frame) % frames

    def title(self, frame: int) -> str:
        """``"t = 12.5 ms"``: the time of a frame, in a unit that suits the last one's."""
        times = self.times
        factor, unit = time_scale(float(np.abs(times).max()))
        return f"t = {times[frame] / factor:.4g} {unit}"
