"""The layout of a trajectory file: H5MD 1.1, with what H5MD leaves open.

Below ``particles/all`` every element is a group of ``step``, ``time`` and ``value``. All share one
step and one time (hard links), which are extended last: a frame counts once its step is there.
The attribute ``si_unit`` holds units; H5MD's own is ``unit``, but MDAnalysis refuses a whole file
whose lengths are in metres.

References
----------
P. de Buyl, P. Colberg, F. Höfling, Comput. Phys. Commun. 185 (2014) 1546; nongnu.org/h5md.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output.contained import ForeignPart, check_contained
from particell.output.files import OutputError, reason
from particell.units import field_unit

# The oldest format that has SWMR, so that programs with an older HDF5 library can read the file.
LIBVER = ("v110", "latest")
PARTICLES = "particles/all"
#: Below ``observables``: a group for each :class:`.TimeAverage`, with its points and its fields.
AVERAGES = "averages"
CHUNK_BYTES = 1 << 16
#: Of series of which a chunk is one frame. A chunk of several is written again with each of them,
#: and where its compressed size changes, elsewhere: files would grow.
COMPRESSION: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}

UNIT_ATTRIBUTE = "si_unit"
#: How often HDF5 looks at a part of a growing file before it takes it for damaged. Each wait is
#: twice the one before, of 1 ns: half a second in all. (Its own number of 100 is for ever.)
READ_ATTEMPTS = 29


def text(value: object) -> str:
    """An HDF5 string attribute or dataset as ``str``."""
    return value.decode() if isinstance(value, bytes) else str(value)


def _open(path: Path) -> h5py.File:
    """A file opened in the ordinary mode if it was closed, else in that for files that grow."""
    try:
        return h5py.File(path, "r")
    except OSError as error:
        words = str(error)
        if not any(w in words for w in ("SWMR", "open for write", "lock file", "truncated")):
            raise
        try:
            return _open_growing(path)
        except OSError:
            if "truncated" in words:  # it was closed, and cut later
                raise error from None
            raise


def _open_growing(path: Path) -> h5py.File:
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_LATEST)
    _limit_attempts(access)
    flags = h5py.h5f.ACC_RDONLY | h5py.h5f.ACC_SWMR_READ
    file = h5py.File(h5py.h5f.open(os.fsencode(path), flags, access))
    try:
        _check_length(file, path)
    except BaseException:
        file.close()
        raise
    return file


def _limit_attempts(access: h5py.h5p.PropFAID) -> None:
    """Set :data:`READ_ATTEMPTS`, for which h5py has no function."""
    try:
        # of the library that h5py has loaded; Windows does not find it there
        function = ctypes.CDLL(h5py.h5p.__file__).H5Pset_metadata_read_attempts
    except (OSError, AttributeError):
        return
    function(ctypes.c_int64(access.id), ctypes.c_uint(READ_ATTEMPTS))


def _check_length(file: h5py.File, path: Path) -> None:
    """Refuse a growing file that ends before its numbers do: HDF5 reads zeros there."""
    needed = 0

    def visit(_: str, item: object) -> None:
        nonlocal needed
        if not isinstance(item, h5py.Dataset):
            return
        ends = [info.byte_offset + info.size for info in _chunks(item)]
        if (offset := item.id.get_offset()) is not None:
            ends.append(offset + item.id.get_storage_size())
        needed = max([needed, *ends])

    file.visititems(visit)
    for wait in (0.0, 0.1, 0.4):  # it may be about to grow
        time.sleep(wait)
        size = path.stat().st_size
        if size >= needed:
            return
    raise OSError(f"its end is missing: {size} bytes of at least {needed}")


def _chunks(dataset: h5py.Dataset) -> list[Any]:
    found: list[Any] = []
    if dataset.chunks:
        dataset.id.chunk_iter(found.append)
    return found


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
        file = _open(path)
    except (OSError, RuntimeError) as error:
        raise InputError("trajectory", str(path), f"an HDF5 file ({reason(error)})") from None
    with file:
        try:
            check_contained(file)
            if "h5md" not in file or PARTICLES not in file:
                allowed = f"an H5MD file with a group '{PARTICLES}'"
                raise InputError("trajectory", str(path), allowed)
            if int(file["h5md"].attrs["version"][0]) > 1:
                raise InputError("trajectory", str(path), "of version 1 of H5MD, not a newer one")
            yield file
        except (InputError, OutputError):
            raise
        except ForeignPart as error:
            raise InputError("trajectory", str(path), f"one file with all in it: {error}") from None
        except (OSError, RuntimeError, KeyError) as error:  # an IndexError is the caller's
            raise damaged(path, error) from None


def damaged(path: Path, error: BaseException) -> InputError:
    """That a trajectory cannot be read."""
    return InputError("trajectory", str(path), f"whole: it is damaged ({reason(error)})")


def element_names(group: h5py.Group) -> list[str]:
    """Names of the time-dependent elements below a group, such as ``concentration/L``."""
    names: list[str] = []

    def visit(name: str, item: object) -> None:
        if name.endswith("/value") and isinstance(item, h5py.Dataset):
            names.append(name.removesuffix("/value"))

    group.visititems(visit)
    return [name for name in names if not name.startswith("box/")]


def write_header(file: h5py.File, author: str, parameters: str) -> None:
    """The group ``h5md`` and the JSON text of the parameters."""
    h5md = file.create_group("h5md")
    h5md.attrs["version"] = np.array([1, 1], np.int32)
    h5md.create_group("author").attrs["name"] = author or "unknown"
    creator = h5md.create_group("creator")
    creator.attrs["name"] = "particell"
    creator.attrs["version"] = version("particell")
    file.create_group("parameters")["run"] = parameters


def write_static(
    particles: h5py.Group, static: Mapping[str, np.ndarray], groups: Sequence[str]
) -> None:
    """What does not change: one dataset each, the group as H5MD's ``species``."""
    for name, values in static.items():
        if name == "group":
            # H5MD's name for it; the enumeration tells any HDF5 program what the numbers mean.
            kinds = h5py.enum_dtype({g: k for k, g in enumerate(groups)}, basetype=np.int32)
            particles.create_dataset("species", data=np.asarray(values, np.int32), dtype=kinds)
        else:
            dataset = particles.create_dataset(name, data=values)
            if field_unit(name):
                dataset.attrs[UNIT_ATTRIBUTE] = field_unit(name)


def write_position(particles: h5py.Group, position: np.ndarray) -> h5py.Group:
    """The first element, and with it the step and the time that all others link to."""
    group = particles.create_group("position")
    for name, dtype in (("step", np.int64), ("time", np.float64)):
        group.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(1024,))
    group["time"].attrs[UNIT_ATTRIBUTE] = "s"
    create_series(group, position, "m")
    return group


def write_box(particles: h5py.Group, domain: Domain, clock: h5py.Group) -> None:
    """The box: H5MD's attributes, and our corners and depth."""
    box = particles.create_group("box")
    box.attrs["dimension"] = domain.dim
    box.attrs["boundary"] = ["periodic" if p else "none" for p in domain.periodic]
    box.attrs["lower"], box.attrs["upper"] = domain.lower, domain.upper
    if domain.depth is not None:
        box.attrs["depth"] = domain.depth
    # Constant, and yet a time series: MDAnalysis reads no other.
    create_element(box, "edges", domain.lengths, clock)


def create_element(
    parent: h5py.Group, name: str, sample: np.ndarray, clock: h5py.Group, unit: str = ""
) -> None:
    """A time series that shares step and time with all others; an average has its field's unit."""
    group = parent.create_group(name)
    group["step"], group["time"] = clock["step"], clock["time"]
    field = name.split("/", 2)[-1]
    known = field_unit(field if name.startswith(f"{AVERAGES}/") else name)
    create_series(group, sample, unit or known)


def write_points(observables: h5py.Group, points: Mapping[str, np.ndarray]) -> None:
    """Where time averages are taken."""
    for name, places in points.items():
        dataset = observables.create_dataset(f"{AVERAGES}/{name}/points", data=places)
        dataset.attrs[UNIT_ATTRIBUTE] = "m"


def create_series(group: h5py.Group, sample: np.ndarray, unit: str) -> None:
    """The values of a time series, without a row yet."""
    rows = int(np.clip(CHUNK_BYTES // max(sample.nbytes, 1), 1, 1024))
    dataset = group.create_dataset(
        "value",
        (0, *sample.shape),
        sample.dtype,
        maxshape=(None, *sample.shape),
        chunks=(rows, *(max(n, 1) for n in sample.shape)),
        **(COMPRESSION if rows == 1 else {}),
    )
    if unit:
        dataset.attrs[UNIT_ATTRIBUTE] = unit


def extend(dataset: h5py.Dataset, k: int, value: Any) -> None:
    """Write row ``k`` of a time series, which may be a new one."""
    value = np.asarray(value)
    if value.shape != dataset.shape[1:]:
        raise ValueError(f"{dataset.name}: shape {value.shape} instead of {dataset.shape[1:]}")
    if dataset.shape[0] <= k:
        dataset.resize(k + 1, axis=0)
    dataset[k] = value


def complete_frames(file: h5py.File) -> int:
    """Number of frames of which every part was written."""
    return min(
        [len(file[f"{PARTICLES}/position/step"])]
        + [len(file[f"{PARTICLES}/{name}/value"]) for name in element_names(file[PARTICLES])]
    )


def copy_group(source: h5py.Group, target: h5py.Group, keep: int, done: dict[Any, str]) -> None:
    """Copy a group, every time series cut to ``keep`` rows, hard links kept as links."""
    for name, value in source.attrs.items():
        target.attrs[name] = value
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            copy_group(item, target.create_group(name), keep, done)
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
                compression=item.compression,
                compression_opts=item.compression_opts,
                shuffle=item.shuffle,
            )
            rows = max(1, (1 << 24) // max(1, copy.nbytes // keep))
            for k in range(0, keep, rows):
                copy[k : min(k + rows, keep)] = item[k : min(k + rows, keep)]
        else:
            copy = target.create_dataset(name, data=item[()], dtype=item.dtype)
        for key, value in item.attrs.items():
            copy.attrs[key] = value
        done[address] = copy.name
