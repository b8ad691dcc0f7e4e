"""The trajectory of a run: an H5MD 1.1 file that grows by one frame at a time.

The file is written in HDF5's single-writer-multiple-readers (SWMR) mode. That mode orders every
write such that the file on disk is consistent at any moment: it can be read while it grows (open
it with ``h5py.File(path, "r", swmr=True)``, or through :class:`particell.output.run.Run`), and
killing the writer costs at most the frame that was being written. HDF5 refuses to open the file
of a killed writer in its ordinary modes, so :meth:`TrajectoryWriter.resume` reads it in SWMR mode
and copies the frames to keep into a new file, which then takes the old one's name.

All elements share one ``step`` and one ``time`` (hard links), which are extended last: a frame
counts once its step has been written.

References
----------
P. de Buyl, P. Colberg, F. Höfling, Comput. Phys. Commun. 185 (2014) 1546; nongnu.org/h5md.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output.files import OutputError, reason, replacing

# The oldest format that has SWMR, so that programs with an older HDF5 library can read the file.
LIBVER = ("v110", "latest")
PARTICLES = "particles/all"
CHUNK_BYTES = 1 << 16

# Kept under an attribute of our own: H5MD's attribute "unit" would be the place, but MDAnalysis
# refuses a whole file whose lengths are in metres.
UNIT_ATTRIBUTE = "si_unit"
UNITS = {
    "position": "m",
    "velocity": "m/s",
    "density": "kg/m^3",
    "pressure": "Pa",
    "mass": "kg",
    "support": "m",
    "temperature": "K",
    "time": "s",
}


def unit_of(name: str) -> str:
    """SI unit of a field by its name; empty for numbers and for what is unknown."""
    if name.startswith("concentration/"):
        return "1/m^3"
    return UNITS.get(name, "")


def text(value: object) -> str:
    """An HDF5 string attribute or dataset as ``str``."""
    return value.decode() if isinstance(value, bytes) else str(value)


@contextlib.contextmanager
def open_trajectory(path: str | Path) -> Iterator[h5py.File]:
    """Open a trajectory for reading, whether finished, growing, or left by a killed process.

    Raises
    ------
    InputError
        Where there is no such file, or it is not an H5MD file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("trajectory", str(path), "an existing file")
    try:
        file = h5py.File(path, "r", libver=LIBVER, swmr=True)
    except OSError as error:
        raise InputError("trajectory", str(path), f"an HDF5 file ({reason(error)})") from None
    with file:
        if "h5md" not in file or PARTICLES not in file:
            raise InputError("trajectory", str(path), f"an H5MD file with a group '{PARTICLES}'")
        yield file


def element_names(group: h5py.Group) -> list[str]:
    """Names of the time-dependent elements below a group, such as ``concentration/L``."""
    names: list[str] = []

    def visit(name: str, item: object) -> None:
        if name.endswith("/value") and isinstance(item, h5py.Dataset):
            names.append(name.removesuffix("/value"))

    group.visititems(visit)
    return [name for name in names if not name.startswith("box/")]


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
    """

    def __init__(
        self,
        path: str | Path,
        domain: Domain,
        static: Mapping[str, np.ndarray],
        groups: Sequence[str],
        author: str = "",
        parameters: str = "{}",
    ):
        self.path = Path(path)
        self._header = (domain, dict(static), list(groups), author, parameters)
        self._file: h5py.File | None = None
        self._frames = 0
        self._names: tuple[list[str], list[str]] = ([], [])

    def append(
        self,
        step: int,
        time: float,
        frame: Mapping[str, np.ndarray],
        observables: Mapping[str, float],
    ) -> None:
        """Add a frame and flush it.

        Parameters
        ----------
        step, time
            Number of the time step, and time in s.
        frame
            Fields of n rows in the order of persistent ids; the same fields in every frame.
        observables
            Scalars; the same ones in every frame.

        Raises
        ------
        OutputError
            Where the file cannot be written.
        ValueError
            Where fields or observables are not those of the first frame.
        """
        try:
            if self._file is None:
                self._create(frame, observables)
            self._check(frame, observables)
            self._write(step, time, frame, observables)
        except (OSError, RuntimeError) as error:
            raise OutputError(f"cannot write {self.path}: {reason(error)}") from error

    def sync(self) -> None:
        """Wait until the frames are on the disk (before a checkpoint that relies on them)."""
        if self._file is not None:
            self._file.flush()
            os.fsync(self._file.id.get_vfd_handle())

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
    def resume(cls, path: str | Path, step: int) -> TrajectoryWriter:
        """Re-open a trajectory and drop the frames after a step.

        Parameters
        ----------
        path
            The file, closed properly or left by a killed process.
        step
            The last step to keep.

        Raises
        ------
        InputError
            Where the file is missing or foreign, or holds no frame up to that step.
        OutputError
            Where it cannot be written.
        """
        path = Path(path)
        with open_trajectory(path) as source:
            length, keep = _complete_frames(source), 0
            if length:
                keep = int(
                    np.searchsorted(source[f"{PARTICLES}/position/step"][:length], step, "right")
                )
            if not keep:
                raise InputError("trajectory", str(path), f"a file with a frame up to step {step}")
            with replacing(path) as partial, h5py.File(partial, "w", libver=LIBVER) as target:
                _copy_group(source, target, keep, {})
        writer = cls.__new__(cls)
        writer.path, writer._frames = path, keep
        writer._open()
        return writer

    def _create(self, frame: Mapping[str, np.ndarray], observables: Mapping[str, float]) -> None:
        domain, static, groups, author, parameters = self._header
        if "position" not in frame:
            raise ValueError("a frame needs the field 'position'")
        # In SWMR mode nothing can be created, so everything is before it starts; and under another
        # name, so that a file of this name always has all its parts.
        with replacing(self.path) as partial, h5py.File(partial, "w", libver=LIBVER) as file:
            _write_header(file, author, parameters)
            particles = file.create_group(PARTICLES)
            _write_static(particles, static, groups)
            clock = _write_position(particles, np.asarray(frame["position"]))
            _write_box(particles, domain, clock)
            for name, values in frame.items():
                if name != "position":
                    _create_element(particles, name, np.asarray(values), clock)
            for name in observables:
                _create_element(file.require_group("observables"), name, np.zeros(()), clock)
        self._frames = 0
        self._open()

    def _open(self) -> None:
        self._file = h5py.File(self.path, "r+", libver=LIBVER)
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
            _extend(particles[f"{name}/value"], k, values)
        edges = particles["box/edges/value"]
        _extend(edges, k, particles["box"].attrs["upper"] - particles["box"].attrs["lower"])
        for name, value in observables.items():
            _extend(file[f"observables/{name}/value"], k, value)
        file.flush()
        _extend(particles["position/time"], k, time)
        file.flush()
        _extend(particles["position/step"], k, step)  # last: this makes the frame count
        file.flush()
        self._frames = k + 1


def _write_header(file: h5py.File, author: str, parameters: str) -> None:
    h5md = file.create_group("h5md")
    h5md.attrs["version"] = np.array([1, 1], np.int32)
    h5md.create_group("author").attrs["name"] = author or "unknown"
    creator = h5md.create_group("creator")
    creator.attrs["name"] = "particell"
    creator.attrs["version"] = version("particell")
    file.create_group("parameters")["run"] = parameters


def _write_static(
    particles: h5py.Group, static: Mapping[str, np.ndarray], groups: Sequence[str]
) -> None:
    for name, values in static.items():
        if name == "group":
            # H5MD's name for it; the enumeration tells any HDF5 program what the numbers mean.
            kinds = h5py.enum_dtype({g: k for k, g in enumerate(groups)}, basetype=np.int32)
            particles.create_dataset("species", data=np.asarray(values, np.int32), dtype=kinds)
        else:
            dataset = particles.create_dataset(name, data=values)
            if unit_of(name):
                dataset.attrs[UNIT_ATTRIBUTE] = unit_of(name)


def _write_position(particles: h5py.Group, position: np.ndarray) -> h5py.Group:
    """The first element, and with it the step and the time that all others link to."""
    group = particles.create_group("position")
    for name, dtype in (("step", np.int64), ("time", np.float64)):
        group.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(1024,))
    group["time"].attrs[UNIT_ATTRIBUTE] = "s"
    _create_series(group, position, "m")
    return group


def _write_box(particles: h5py.Group, domain: Domain, clock: h5py.Group) -> None:
    box = particles.create_group("box")
    box.attrs["dimension"] = domain.dim
    box.attrs["boundary"] = ["periodic" if p else "none" for p in domain.periodic]
    box.attrs["lower"], box.attrs["upper"] = domain.lower, domain.upper
    if domain.depth is not None:
        box.attrs["depth"] = domain.depth
    # Constant, and yet a time series: MDAnalysis reads no other.
    _create_element(box, "edges", domain.lengths, clock)


def _create_element(parent: h5py.Group, name: str, sample: np.ndarray, clock: h5py.Group) -> None:
    group = parent.create_group(name)
    group["step"], group["time"] = clock["step"], clock["time"]
    _create_series(group, sample, unit_of(name))


def _create_series(group: h5py.Group, sample: np.ndarray, unit: str) -> None:
    rows = int(np.clip(CHUNK_BYTES // max(sample.nbytes, 1), 1, 1024))
    dataset = group.create_dataset(
        "value",
        (0, *sample.shape),
        sample.dtype,
        maxshape=(None, *sample.shape),
        chunks=(rows, *(max(n, 1) for n in sample.shape)),
    )
    if unit:
        dataset.attrs[UNIT_ATTRIBUTE] = unit


def _extend(dataset: h5py.Dataset, k: int, value: Any) -> None:
    value = np.asarray(value)
    if value.shape != dataset.shape[1:]:
        raise ValueError(f"{dataset.name}: shape {value.shape} instead of {dataset.shape[1:]}")
    if dataset.shape[0] <= k:
        dataset.resize(k + 1, axis=0)
    dataset[k] = value


def _complete_frames(file: h5py.File) -> int:
    """Number of frames of which every part was written."""
    return min(
        [len(file[f"{PARTICLES}/position/step"])]
        + [len(file[f"{PARTICLES}/{name}/value"]) for name in element_names(file[PARTICLES])]
    )


def _copy_group(source: h5py.Group, target: h5py.Group, keep: int, done: dict[Any, str]) -> None:
    """Copy a group, every time series cut to ``keep`` rows, hard links kept as links."""
    for name, value in source.attrs.items():
        target.attrs[name] = value
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            _copy_group(item, target.create_group(name), keep, done)
            continue
        address = h5py.h5o.get_info(item.id).addr
        if address in done:
            target[name] = target.file[done[address]]
            continue
        if item.maxshape and item.maxshape[0] is None:
            copy = target.create_dataset(
                name,
                (keep, *item.shape[1:]),
                item.dtype,
                maxshape=item.maxshape,
                chunks=item.chunks,
            )
            rows = max(1, (1 << 24) // max(1, copy.nbytes // keep))
            for k in range(0, keep, rows):
                copy[k : min(k + rows, keep)] = item[k : min(k + rows, keep)]
        else:
            copy = target.create_dataset(name, data=item[()], dtype=item.dtype)
        for key, value in item.attrs.items():
            copy.attrs[key] = value
        done[address] = copy.name
