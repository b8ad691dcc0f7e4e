"""Finished realisations, and statistics over them: read one frame of one run at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from particell.analysis.statistics import Moments
from particell.ensemble.jobs import finished
from particell.errors import InputError, unknown_name
from particell.output.files import read_json
from particell.output.run import Run

ENSEMBLE, FAILURE = "ensemble.json", "failed.json"
#: Particles count as being at the same place within this part of the smallest support.
SAME_PLACE = 1e-3
#: Most bytes that quantiles keep in memory at a time.
QUANTILE_BYTES = 2**28

#: What statistics can be taken of: a field, an observable, or any function of a run.
Quantity = str | Callable[[Run], ArrayLike]


def member(directory: Path, index: int) -> Path:
    """Directory of a realisation."""
    return directory / f"run-{index:04d}"


class Realisations:
    """What pictures and metrics know of an :class:`~particell.ensemble.results.EnsembleRun`.

    Parameters
    ----------
    directory
        The ensemble's directory.
    """

    def __init__(self, directory: str | Path):
        self.directory = Path(directory)
        path = self.directory / ENSEMBLE
        if not path.is_file():
            allowed = f"one with the output of an ensemble ({ENSEMBLE})"
            raise InputError("directory", str(directory), allowed)
        self.settings: dict[str, Any] = read_json(path, "directory")

    @cached_property
    def indices(self) -> list[int]:
        """Numbers of the finished realisations."""
        total = int(self.settings["runs"])
        return [k for k in range(total) if finished(member(self.directory, k))]

    @cached_property
    def runs(self) -> list[Run]:
        """The finished realisations."""
        return [Run(member(self.directory, k)) for k in self.indices]

    @property
    def times(self) -> np.ndarray:
        """Times of the frames in s, (frames,)."""
        return self._times_of(self.first)

    def at(self, time: float) -> int:
        """Index of the frame nearest to a time in s."""
        return self.first.at(time)

    @property
    def field_names(self) -> list[str]:
        """The fields of a frame."""
        return self.first.field_names

    @property
    def observable_names(self) -> list[str]:
        """The recorded scalars."""
        return self.first.observable_names

    def __len__(self) -> int:
        return len(self.indices)

    # --- statistics --------------------------------------------------------------------------

    def moments(self, what: Quantity, frame: int | None = -1, **where: Any) -> Moments:
        """Mean, deviation (n - 1) and standard error over realisations.

        Parameters
        ----------
        what
            A field, an observable, or a function of a run.
        frame
            Which frame; None for all of them, as the first axis (a function has none).
        **where
            Of a field: ``groups`` (names; default all), and ``grid`` or ``points`` with the
            options of :meth:`particell.output.run.Run.on_points`.

        Returns
        -------
        Moments
            Arrays (n,), (n, D), … of a field; numbers of an observable. NaN where a realisation
            has no particle near a point.

        Raises
        ------
        InputError
            For unknown names, frames that differ in time, particles that are elsewhere, and where
            there are fewer than two realisations.
        """
        if frame is None and self._is_field(what):
            parts = [self.moments(what, k, **where) for k in range(len(self.times))]
            stacked = [np.stack([getattr(m, n) for m in parts]) for n in _MOMENTS]
            return Moments(stacked[0], stacked[1], stacked[2], len(self))
        count, mean, squares = 0, np.zeros(()), np.zeros(())
        for values in self._values(what, frame, where):
            count += 1
            change = values - mean  # Welford's update: one pass, no cancellation
            mean = mean + change / count
            squares = squares + change * (values - mean)
        if count < 2:
            raise InputError("realisations", count, "at least two that are finished")
        deviation = np.sqrt(squares / (count - 1))
        return Moments(mean, deviation, deviation / np.sqrt(count), count)

    def mean(self, what: Quantity, frame: int | None = -1, **where: Any) -> np.ndarray:
        """Mean over realisations; see :meth:`moments`."""
        return self.moments(what, frame, **where).mean

    def deviation(self, what: Quantity, frame: int | None = -1, **where: Any) -> np.ndarray:
        """Standard deviation of one realisation; see :meth:`moments`."""
        return self.moments(what, frame, **where).deviation

    def quantile(
        self, what: Quantity, q: ArrayLike, frame: int | None = -1, **where: Any
    ) -> np.ndarray:
        """Quantiles over realisations (linear between the sorted values, as NumPy's).

        Parameters
        ----------
        what, frame, **where
            As for :meth:`moments`.
        q
            One probability or several, 0 to 1; several make the first axis of the result.
        """
        probabilities = np.asarray(q, float)
        if not ((probabilities >= 0) & (probabilities <= 1)).all():
            raise InputError("q", q, "between 0 and 1")
        if frame is None and self._is_field(what):
            parts = [self.quantile(what, q, k, **where) for k in range(len(self.times))]
            return np.stack(parts, axis=probabilities.ndim)
        first = next(self._values(what, frame, where), None)
        if first is None:
            raise InputError("realisations", 0, "at least one that is finished")
        size = max(first.size, 1)
        block = max(1, QUANTILE_BYTES // (8 * len(self)))
        parts = []
        for start in range(0, size, block):
            rows = [v.ravel()[start : start + block] for v in self._values(what, frame, where)]
            parts.append(np.quantile(np.stack(rows), probabilities, axis=0))
        return np.concatenate(parts, axis=-1).reshape(probabilities.shape + first.shape)

    def histogram(
        self,
        what: Quantity,
        bins: int | ArrayLike = 20,
        frame: int | None = -1,
        limits: tuple[float, float] | None = None,
        **where: Any,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Histogram of all values in all realisations together.

        Parameters
        ----------
        what, frame, **where
            As for :meth:`moments`; particles are not matched, so they may be anywhere.
        bins
            Number of equal bins, or their edges.
        limits
            Ends of the bins; by default the least and the greatest value.

        Returns
        -------
        counts, edges
            As of :func:`numpy.histogram`; NaN is left out.
        """
        every = frame is None and self._is_field(what)
        frames = range(len(self.times)) if every else [frame]

        def everything() -> Iterator[np.ndarray]:
            for k in frames:
                for values in self.values(what, k, **where):
                    flat = values.ravel()
                    yield flat[np.isfinite(flat)]

        edges = np.asarray(bins, float)
        if edges.ndim == 0:
            if limits is None:
                ends = [(v.min(), v.max()) for v in everything() if v.size]
                if not ends:
                    raise InputError("realisations", len(self), "some with finite values")
                limits = (min(e[0] for e in ends), max(e[1] for e in ends))
            edges = np.histogram_bin_edges(np.zeros(0), int(edges), limits)
        counts = np.zeros(len(edges) - 1, np.int64)
        for values in everything():
            counts += np.histogram(values, edges)[0]
        return counts, edges

    # --- values ------------------------------------------------------------------------------

    @property
    def first(self) -> Run:
        """The first realisation that is finished."""
        if not self.runs:
            raise InputError("realisations", 0, "at least one that is finished")
        return self.runs[0]

    @cached_property
    def _clocks(self) -> dict[int, np.ndarray]:
        return {}

    def _times_of(self, run: Run) -> np.ndarray:
        """Times of a run's frames, read once: it is finished."""
        if id(run) not in self._clocks:
            self._clocks[id(run)] = run.times
        return self._clocks[id(run)]

    def _is_field(self, what: Quantity) -> bool:
        return isinstance(what, str) and what in self.field_names

    def values(self, what: Quantity, frame: int | None = -1, **where: Any) -> Iterator[np.ndarray]:
        """The values of one realisation after the other, wherever its particles are.

        Parameters as for :meth:`moments`.
        """
        return self._values(what, frame, where, matched=False)

    def _values(
        self, what: Quantity, frame: int | None, where: dict[str, Any], matched: bool = True
    ) -> Iterator[np.ndarray]:
        """The values of one realisation after the other."""
        if callable(what) or (not self._is_field(what) and what in self.observable_names):
            if where:
                raise InputError(next(iter(where)), "given", "left out: it is for fields only")
        elif not self._is_field(what):
            names = {*self.field_names, *self.observable_names}
            raise unknown_name("field or observable", what, names)
        reader = self._reader(what, frame, where, matched)
        shape: tuple[int, ...] | None = None
        for run in self.runs:
            values = np.asarray(reader(run), float)
            if shape is not None and values.shape != shape:
                allowed = f"of one shape in all realisations, not also {values.shape}"
                raise InputError("values", shape, allowed)
            shape = values.shape
            yield values

    def _reader(
        self, what: Quantity, frame: int | None, where: dict[str, Any], matched: bool
    ) -> Callable[[Run], ArrayLike]:
        if callable(what):
            return what
        if frame is None:  # of an observable
            return lambda run: self._series(run, what)
        first, options = self.first, dict(where)
        groups, places = options.pop("groups", None), options.keys() & {"grid", "points"}
        if len(places) > 1:
            raise InputError("points", "given", "left out where 'grid' is given")
        if options and not places:
            raise unknown_name("option", next(iter(options)), ("groups", "grid", "points"))
        self.same_time(first, frame)
        if not self._is_field(what):
            return lambda run: run.observable(what)[self.same_time(run, frame)]
        if "grid" in places:
            shape = options.pop("grid")
            return lambda run: run.on_grid(
                what, shape, self.same_time(run, frame), groups=groups, **options
            )
        if "points" in places:
            points = np.asarray(options.pop("points"), float)
            return lambda run: run.on_points(
                what, points, self.same_time(run, frame), groups=groups, **options
            )
        chosen = [groups] if isinstance(groups, str) else groups
        if matched:
            self._same_places(what, frame, chosen)

        def by_particle(run: Run) -> np.ndarray:
            values = run.field(what)[self.same_time(run, frame)]
            return values[run.group(*chosen)] if chosen else values

        return by_particle

    def _series(self, run: Run, what: str) -> np.ndarray:
        """An observable at all frames, which must be those of the first run."""
        for k in range(max(len(self.times), len(self._times_of(run)))):
            self.same_time(run, k)
        return run.observable(what)

    def same_time(self, run: Run, frame: int) -> int:
        """The frame, counted from the beginning, if it is of the same time as in the first run."""
        times, others = self.times, self._times_of(run)
        if not -len(times) <= frame < len(times):
            raise InputError("frame", frame, f"between {-len(times)} and {len(times) - 1}")
        k = frame % len(times)
        if k >= len(others) or abs(others[k] - times[k]) > 1e-9 * max(abs(times[-1]), 1e-300):
            found = f"{others[k]:g} s" if k < len(others) else "none"
            what = f"frame {k} of {run.directory.name if run.directory else 'a run'}"
            raise InputError(what, found, f"at {times[k]:g} s, as in the first realisation")
        return k

    def _same_places(self, what: str, frame: int, groups: Sequence[str] | None) -> None:
        """Refuse to match particles that are elsewhere in other realisations."""
        first = self.first
        mask = first.group(*groups) if groups else slice(None)
        place = first.field("position")[frame][mask]
        ids, supports = first.static["id"][mask], first.static["support"][mask]
        reach = SAME_PLACE * float(np.min(supports, initial=np.inf))
        for k, run in zip(self.indices, self.runs, strict=True):
            chosen = run.group(*groups) if groups else slice(None)
            if not np.array_equal(run.static["id"][chosen], ids):
                fault = f"realisation {k} has other particles"
            else:
                gap = run.field("position")[self.same_time(run, frame)][chosen] - place
                gap -= first.domain.lengths * np.rint(gap * first.domain.inverse_periods)
                if np.abs(gap).max(initial=0.0) <= reach:
                    continue
                fault = f"particles are elsewhere in realisation {k}"
            allowed = "compared place by place: give grid=(nx, …) or points=, or a function"
            raise InputError(f"{what} by particle", fault, allowed)


_MOMENTS = ("mean", "deviation", "error")
