"""The trajectory of a run: an H5MD 1.1 file that grows by one frame at a time.

The file is written in HDF5's single-writer-multiple-readers (SWMR) mode. That mode orders every
write such that the file on disk is consistent at any moment: it can be read while it grows (open
it with ``h5py.File(path, "r", swmr=True)``, or through :class:`particell.output.run.Run`), and
killing the writer costs at most the frame that was being written. HDF5 refuses to open the file
of a killed writer in its ordinary modes, so :meth:`TrajectoryWriter.resume` reads it in SWMR mode
and copies the frames to keep into a new file, which then takes the old one's name.

The layout is in :mod:`particell.output.h5md`.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output.files import SLACK, SLACK_EACH, OutputError, reason, replacing, reserve
from particell.output.h5md import (
    CHUNK_BYTES,
    LIBVER,
    PARTICLES,
    complete_frames,
    copy_group,
    create_element,
    damaged,
    element_names,
    extend,
    open_trajectory,
    text,
    write_box,
    write_header,
    write_points,
    write_position,
    write_static,
)


class TrajectoryWriter:
    """Writes frames to an H5MD file.

    Parameters
    ----------
    path
        The file. It comes to be with the first frame; a file of that name is replaced then.
    domain
        The box.
    static
        What does not change: ``id`` (n,), ``group`` (n,), ``mass`` (n,) in kg and any more arrays
        of n rows.
    groups
        Names of the groups, in the order of their indices in ``static["group"]``.
    author
        Who made the file.
    parameters
        JSON text describing the run, kept under ``parameters/run``.
    units
        Of fields that have none by their names.
    points
        Where time averages are taken, by name.
    identity
        Attributes that tell which run it is.
    """

    def __init__(
        self,
        path: str | Path,
        domain: Domain,
        static: Mapping[str, np.ndarray],
        groups: Sequence[str],
        author: str = "",
        parameters: str = "{}",
        points: Mapping[str, np.ndarray] | None = None,
        units: Mapping[str, str] | None = None,
        identity: Mapping[str, Any] | None = None,
    ):
        self.path, self._units = Path(path), dict(units or {})
        self._identity = dict(identity or {})
        self._header = (domain, dict(static), list(groups), author, parameters, dict(points or {}))
        self._file: h5py.File | None = None
        self._frames = 0
        self._names: tuple[list[str], list[str]] = ([], [])

    def append(
        self,
        step: int,
        time: float,
        frame: Mapping[str, np.ndarray],
        observables: Mapping[str, Any],
    ) -> None:
        """Add a frame and flush it.

        Parameters
        ----------
        step, time
            Number of the time step, and time in s.
        frame
            Fields of n rows in the order of persistent ids; the same fields in every frame.
        observables
            Scalars, and means under ``averages/NAME/FIELD``; the same ones in every frame.

        Raises
        ------
        OutputError
            Where the file cannot be written.
        ValueError
            Where fields or observables are not those of the first frame.
        """
        try:
            self._reserve(frame, observables)
            if self._file is None:
                self._create(frame, observables)
            self._check(frame, observables)
            self._write(step, time, frame, observables)
        except OutputError:
            raise
        except (OSError, RuntimeError) as error:
            raise OutputError(f"cannot write {self.path}: {reason(error)}") from error

    def sync(self) -> None:
        """Wait until the frames are on the disk (before a checkpoint that relies on them)."""
        if self._file is not None:
            try:
                self._file.flush()
                os.fsync(self._file.id.get_vfd_handle())
            except (OSError, RuntimeError) as error:
                raise OutputError(f"cannot write {self.path}: {reason(error)}") from error

    def close(self) -> None:
        """Close the file; ordinary HDF5 programs can read it from now on."""
        if self._file is not None:
            file, self._file = self._file, None
            try:
                file.close()
            except (OSError, RuntimeError) as error:
                raise OutputError(f"cannot write {self.path}: {reason(error)}") from error

    def __enter__(self) -> TrajectoryWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @classmethod
    def resume(
        cls, path: str | Path, step: int, run: Mapping[str, Any] | None = None
    ) -> TrajectoryWriter:
        """Re-open a trajectory and drop the frames after a step.

        Parameters
        ----------
        path
            The file, closed properly or left by a killed process.
        step
            The last step to keep.
        run
            The run that it has to be of (``id`` and ``seed``), the ``frames`` that it has to have
            and the ``step`` of the last of these.

        Raises
        ------
        InputError
            Where the file is missing or foreign, or holds no frame up to that step.
        OutputError
            Where it cannot be written.
        """
        path = Path(path)
        with open_trajectory(path) as source:
            length, keep = complete_frames(source), 0
            if length:
                keep = int(
                    np.searchsorted(source[f"{PARTICLES}/position/step"][:length], step, "right")
                )
            if not keep:
                raise InputError("trajectory", str(path), f"a file with a frame up to step {step}")
            if run is not None:
                _check_run(path, source, keep, run)
            writer = cls.__new__(cls)
            writer.path, writer._file, writer._frames = path, None, keep
            reserve(path, path.stat().st_size + SLACK)
            try:
                with writer._replacing() as target:
                    try:
                        copy_group(source, target, keep, {})
                    except (OSError, RuntimeError) as error:
                        if "write" in str(error):
                            raise
                        raise damaged(path, error) from None  # the old file
            except (OSError, RuntimeError) as error:
                if isinstance(error, OutputError):
                    raise
                raise OutputError(f"cannot write {path}: {reason(error)}") from error
        return writer

    def _reserve(self, frame: Mapping[str, Any], observables: Mapping[str, Any]) -> None:
        """Refuse a frame that there is no room for: of every series a chunk may be new."""
        sizes = [np.asarray(values).nbytes for values in (*frame.values(), *observables.values())]
        begin = self.path.stat().st_size if self._file is not None else 0
        if self._file is None:
            fixed = (*self._header[1].values(), *self._header[5].values())
            sizes += [np.asarray(values).nbytes for values in fixed]
        chunks = sum(max(size, CHUNK_BYTES) + SLACK_EACH for size in sizes)
        reserve(self.path, chunks + 4 * SLACK, begin)

    def _create(self, frame: Mapping[str, np.ndarray], observables: Mapping[str, Any]) -> None:
        domain, static, groups, author, parameters, points = self._header
        if "position" not in frame:
            raise ValueError("a frame needs the field 'position'")
        # In SWMR mode nothing can be created, so everything is before it starts.
        with self._replacing() as file:
            write_header(file, author, parameters)
            file["parameters"].attrs.update(self._identity)
            particles = file.create_group(PARTICLES)
            write_static(particles, static, groups)
            clock = write_position(particles, np.asarray(frame["position"]))
            write_box(particles, domain, clock)
            for name, values in frame.items():
                if name != "position":
                    unit = self._units.get(name, "")
                    create_element(particles, name, np.asarray(values), clock, unit)
            for name, value in observables.items():
                create_element(file.require_group("observables"), name, np.asarray(value), clock)
            if points:
                write_points(file["observables"], points)
        self._frames = 0

    @contextlib.contextmanager
    def _replacing(self) -> Iterator[h5py.File]:
        """Make a file anew and go on with it in SWMR mode.

        Between opening a file for writing and the start of SWMR mode a kill would leave one that
        nobody can open, so it has another name until then (unless the system, Windows, cannot
        rename a file that is open).
        """
        try:
            with replacing(self.path) as partial:
                with h5py.File(partial, "w", libver=LIBVER) as file:
                    yield file
                if os.name == "posix":
                    self._open(partial)
        except BaseException:
            self.close()
            raise
        if self._file is None:
            self._open(self.path)

    def _open(self, path: Path) -> None:
        self._file = h5py.File(path, "r+", libver=LIBVER)
        observables = self._file.get("observables")
        self._names = (
            element_names(self._file[PARTICLES]),
            element_names(observables) if observables else [],
        )
        self._file.swmr_mode = True

    def _check(self, frame: Mapping[str, Any], observables: Mapping[str, Any]) -> None:
        for what, given, known in (
            ("fields", frame, self._names[0]),
            ("observables", observables, self._names[1]),
        ):
            if set(given) != set(known):
                raise ValueError(
                    f"{what} of a frame must be those of the first one, {sorted(known)}, "
                    f"not {sorted(given)}"
                )

    def _write(
        self, step: int, time: float, frame: Mapping[str, Any], observables: Mapping[str, Any]
    ) -> None:
        assert self._file is not None
        file, k = self._file, self._frames
        particles = file[PARTICLES]
        for name, values in frame.items():
            extend(particles[f"{name}/value"], k, values)
        edges = particles["box/edges/value"]
        extend(edges, k, particles["box"].attrs["upper"] - particles["box"].attrs["lower"])
        for name, value in observables.items():
            extend(file[f"observables/{name}/value"], k, value)
        file.flush()
        extend(particles["position/time"], k, time)
        file.flush()
        extend(particles["position/step"], k, step)  # last: this makes the frame count
        file.flush()
        self._frames = k + 1


def run_id(path: str | Path) -> str:
    """Which run a trajectory is of; nothing where it does not say.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    with open_trajectory(path) as file:
        found = file["parameters"].attrs.get("run_id", "") if "parameters" in file else ""
    return text(found)


def _check_run(path: Path, file: h5py.File, keep: int, run: Mapping[str, Any]) -> None:
    """Refuse the trajectory of another run, or one that does not reach up to the checkpoint."""
    found = file["parameters"].attrs if "parameters" in file else {}
    if text(found.get("run_id")) != run["id"] or found.get("seed") != run["seed"]:
        allowed = "of the same run as the checkpoint: it is of another one"
        raise InputError("trajectory", str(path), allowed)
    steps = file[f"{PARTICLES}/position/step"][:keep]
    if keep != run["frames"] or int(steps[-1]) != run["step"]:
        allowed = (
            f"as the checkpoint knows it, with {run['frames']} frames up to step {run['step']}; "
            f"it has {keep} up to step {int(steps[-1])}: an older copy, perhaps"
        )
        raise InputError("trajectory", str(path), allowed)
