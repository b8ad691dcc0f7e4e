"""What a simulation left behind: its frames, time series and summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output.files import read_json
from particell.output.sources import FileSource, Index, MemorySource, Source, known

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRAJECTORY = "run.h5"
CHECKPOINT = "checkpoint.h5"
SUMMARY = "summary.json"
CASE = "case.json"
#: What a run leaves, figures apart.
OWN_FILES = (TRAJECTORY, CHECKPOINT, SUMMARY, CASE)


class Field:
    """One field over all frames: an array (frames, n) or (frames, n, D) that is read as needed.

    ``run.field("velocity")[-1]`` reads the last frame, ``field[10:, mask]`` some particles of
    some frames, ``numpy.asarray(field)`` everything.
    """

    def __init__(self, run: Run, name: str):
        self.run, self.name = run, name

    @property
    def shape(self) -> tuple[int, ...]:
        """(frames, n) or (frames, n, D)."""
        return self.run.source.shape(self.name)[0]

    @property
    def dtype(self) -> np.dtype:
        """Type of the values."""
        return self.run.source.shape(self.name)[1]

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Index) -> np.ndarray:
        return self.run.source.read(self.name, index)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[:], dtype)

    def __repr__(self) -> str:
        return f"Field({self.name!r}, shape={self.shape}, dtype={self.dtype})"

    def on_line(self, start, end, points: int = 101, frame: int = -1, **options: Any) -> np.ndarray:
        """As :meth:`Run.on_line`."""
        return self.run.on_line(self.name, start, end, points, frame, **options)

    def on_grid(self, shape, frame: int = -1, **options: Any) -> np.ndarray:
        """As :meth:`Run.on_grid`."""
        return self.run.on_grid(self.name, shape, frame, **options)

    def plot(self, frame: int = -1, **options: Any) -> Figure:
        """As :meth:`Run.plot`."""
        return self.run.plot(self.name, frame, **options)


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
        observables: Sequence[Mapping[str, float]] = (),
        summary: Mapping[str, Any] | None = None,
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
        """
        run = cls.__new__(cls)
        run.directory = None
        run.source = MemorySource(domain, groups, static, steps, times, frames, observables)
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
        return self.source.observables()

    @cached_property
    def static(self) -> dict[str, np.ndarray]:
        """What does not change: ``id``, ``group``, ``mass``, …, each of n rows."""
        return self.source.static()

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The contents of ``summary.json``; empty while there is none."""
        path = self.directory / SUMMARY if self.directory else None
        return read_json(path, "summary") if path and path.exists() else {}

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        times = self.times
        span = f", t = {times[0]:g} … {times[-1]:g} s" if len(times) else ""
        return f"Run({len(times)} frames{span}; fields: {', '.join(self.field_names)})"

    def frame(self, k: int = -1) -> dict[str, np.ndarray]:
        """All fields of frame ``k``, rows in the order of persistent ids."""
        self._frame(k)
        return {name: self.source.read(name, k) for name in self.field_names}

    def field(self, name: str) -> Field:
        """One field over all frames, read as needed."""
        return Field(self, known("field", name, self.field_names))

    def observable(self, name: str) -> np.ndarray:
        """A recorded scalar at every frame, (frames,)."""
        return self.source.observable(known("observable", name, self.observable_names))

    def group(self, *names: str) -> np.ndarray:
        """Boolean mask (n,) of the particles of one or several groups."""
        chosen = [self.group_names.index(known("group", g, self.group_names)) for g in names]
        return np.isin(self.static["group"], chosen)

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
        groups: Sequence[str] | None = None,
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
        from particell.analysis.fields import interpolate

        self._frame(frame)
        known("field", name, self.field_names)
        chosen = self.group(*groups) if groups else np.ones(len(self.static["group"]), bool)
        return interpolate(
            points,
            self.source.read("position", frame)[chosen],
            self.source.read(name, frame)[chosen],
            volume=self._volume(frame)[chosen],
            support=self._given("support", frame)[chosen] if support is None else support,
            domain=self.domain,
            kernel=kernel,
            order=order,
        )

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

    def plot(
        self,
        name: str,
        frame: int = -1,
        *,
        groups: Sequence[str] | None = None,
        component: int | None = None,
        style: str = "scatter",
        path: str | Path | None = None,
    ) -> Figure:
        """Picture of a field in 1D or 2D (a 3D one is seen along z).

        Parameters
        ----------
        name
            The field; of a vector, its magnitude, or one ``component``.
        frame
            Which frame.
        groups
            The groups to show (default: all).
        style
            ``"scatter"`` (a disc a particle) or ``"tripcolor"`` (a continuous map).
        path
            Also write it to this file.
        """
        from particell import plots

        self._frame(frame)
        known("field", name, self.field_names)
        chosen = self.group(*groups) if groups else np.ones(len(self.static["group"]), bool)
        values = self.source.read(name, frame)[chosen]
        if values.ndim > 1:
            values = np.linalg.norm(values, axis=1) if component is None else values[:, component]
        figure = plots.field_map(
            self.source.read("position", frame)[chosen],
            values,
            domain=self.domain,
            label=plots.field_label(name, component),
            title=f"t = {self.times[frame]:.4g} s",
            style=style,
        )
        if path is not None:
            plots.save(figure, path)
        return figure

    def _volume(self, frame: int) -> np.ndarray:
        """Volumes of the particles, up to a factor (particles at rest have no density field)."""
        mass = self._given("mass", frame)
        known_density = "density" in self.field_names or "density" in self.static
        return mass / self._given("density", frame) if known_density else mass

    def _given(self, name: str, frame: int) -> np.ndarray:
        """A field of a frame, or the static one where it does not change."""
        return self.source.read(name, frame) if name in self.field_names else self.static[name]

    def _frame(self, k: int) -> None:
        frames = len(self)
        if not -frames <= k < frames:
            raise InputError("frame", k, f"between {-frames} and {frames - 1}")
