"""What was recorded of a simulation: frames, time series and what does not change."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output import time_averages
from particell.output.sources import Source, known
from particell.roles import carriers
from particell.units import time_scale

if TYPE_CHECKING:
    from particell.analysis.bounded import Arrangement

#: What does not change of wall particles, by which their surfaces are known.
SURFACE = {"wall_normal", "wall_depth", "wall_curvature"}


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
        return np.isin(self.static["group"], self.indices(names))

    def chosen(self, groups: str | Sequence[str] | None) -> np.ndarray:
        """As :meth:`group`, of one name or a list of them; None is all particles."""
        if groups is None:
            return np.ones(len(self.static["group"]), bool)
        return self.group(*([groups] if isinstance(groups, str) else groups))

    def indices(self, groups: str | Sequence[str]) -> list[int]:
        """The numbers of groups, given by name, in the static field ``group``."""
        names = [groups] if isinstance(groups, str) else groups
        return [self.group_names.index(known("group", g, self.group_names)) for g in names]

    def carrying(self, name: str) -> np.ndarray:
        """Mask (n,) of the particles that carry a field: see :meth:`on_points`."""
        return np.isin(self.static["group"], carriers(self.source.roles(), name))

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

        By default it is carried by the groups that have it: of a species those that hold it, of
        the rest the fluids. Points inside solids, and in other fluids, have none. Walls that hold a
        value at their surface give it there: their velocity (no slip), or a concentration that is
        fixed. Particles know their wall's surface: planes, circles and spheres exactly.

        Parameters
        ----------
        name
            The field.
        points
            Where, (m, D), in m.
        frame
            Which frame.
        groups
            The groups whose particles are used, and nothing but these: no values of walls (points
            inside the solids of other groups have none all the same).
        order
            0: weights that add up to one (Shepard), exact on constants; 1: exact on linear fields.
        kernel
            Name of a kernel.
        support
            Its support in m (default: that of the particles).

        Returns
        -------
        numpy.ndarray
            (m,) or (m, D); NaN where there is no particle within the support, and in solids.
        """
        from particell.analysis.bounded import at_points

        frame = self.checked(frame)
        known("field", name, self.field_names)
        chosen = None if groups is None else self.indices(groups)
        return at_points(
            self.arrangement(frame),
            name,
            points,
            self.source.read(name, frame),
            self._volume(frame),
            groups=chosen,
            order=order,
            kernel=kernel,
            support=support,
        )

    def arrangement(self, frame: int) -> Arrangement:
        """The particles of a frame, and what is known of walls and of what holds which field."""
        from particell.analysis.bounded import Arrangement

        position, found = self.source.read("position", frame), self.static
        surface: tuple[Any, ...] = ()
        if set(found) >= SURFACE:
            surface = (self._normals(frame), found["wall_depth"], found["wall_curvature"])
        group, support = found["group"], self._given("support", frame)
        return Arrangement(self.domain, self.source.roles(), group, position, support, *surface)

    def _normals(self, frame: int) -> np.ndarray:
        """Normals of walls, which turn with bodies that turn."""
        from particell.analysis.surfaces import turned

        normal = np.array(self.static["wall_normal"])
        for g, role in enumerate(self.source.roles()):
            rows = np.flatnonzero(self.static["group"] == g)
            if role.kind == "wall" and len(rows) and normal[rows].any():
                first, now = (self._unwrapped(k)[rows] for k in (0, frame))
                normal[rows] = turned(normal[rows], first, now)
        return normal

    def _unwrapped(self, frame: int) -> np.ndarray:
        """Positions (n, D) without jumps across periodic faces."""
        position = self.source.read("position", frame)
        if "image" not in self.field_names:
            return position
        return position + self.source.read("image", frame) * self.domain.lengths

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
