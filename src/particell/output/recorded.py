"""What was recorded of a simulation: frames, time series and what does not change."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output import time_averages
from particell.output.sources import Source, known
from particell.units import time_scale


class Recorded:
    """What pictures, exports and tables know of a :class:`~particell.output.run.Run`.

    Parameters
    ----------
    source
        Where the frames lie.
    directory
        Where the rest of what a run left lies, if it is on the disk.
    """

    def __init__(self, source: Source, directory: Path | None = None):
        self.source = source
        self.directory = directory

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

    def __len__(self) -> int:
        return len(self.steps)

    def frame(self, k: int = -1) -> dict[str, np.ndarray]:
        """All fields of frame ``k``, rows in the order of persistent ids."""
        k = self.checked(k)
        return {name: self.source.read(name, k) for name in self.field_names}

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
        from particell.analysis.fields import interpolate

        frame = self.checked(frame)
        known("field", name, self.field_names)
        chosen = self.chosen(groups)
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

    def _volume(self, frame: int) -> np.ndarray:
        """Volumes of the particles, up to a factor (particles at rest have no density field)."""
        mass = self._given("mass", frame)
        known_density = "density" in self.field_names or "density" in self.static
        return mass / self._given("density", frame) if known_density else mass

    def _given(self, name: str, frame: int) -> np.ndarray:
        """A field of a frame, or the static one where it does not change."""
        return self.source.read(name, frame) if name in self.field_names else self.static[name]
