"""Checkpoints: everything that a bit-for-bit restart needs, in one HDF5 file with a digest.

The tree of the state is JSON text, as bytes; its arrays are datasets below ``state/`` that the text
refers to by path. Python's JSON writes numbers such that they are read back exactly.

The file begins with a line of text, in HDF5's user block: what it is, and a digest of that and of
all bytes that follow. A file of which a single bit has changed is refused before HDF5 sees it. The
digest is no secret: what somebody may have made on purpose is looked at as well, array by array
here, and for what a simulation may hold in :mod:`particell.restored`.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from particell.output.contained import ForeignPart, check_contained, check_no_links
from particell.output.files import (
    SLACK,
    SLACK_EACH,
    CheckpointError,
    OutputError,
    reason,
    replacing,
    reserve,
)

FORMAT = "particell-checkpoint"
FORMAT_VERSION = 2
#: Bytes before HDF5's own, the least that it allows.
USER_BLOCK = 512
_FIRST_LINE = re.compile(
    rf"{FORMAT} (?P<number>\d{{1,9}}) (?P<program>\S{{1,60}}) (?P<digest>[0-9a-f]{{64}})\n\0*"
)
#: What an HDF5 file without a user block begins with.
SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Axes of an array, at most: NumPy's own limit.
MOST_AXES = 32

_ARRAY, _SCALAR, _TUPLE = "__array__", "__scalar__", "__tuple__"
_MARKS = {_ARRAY, _SCALAR, _TUPLE}


def write_checkpoint(
    path: str | Path, state: Mapping[str, Any], meta: Mapping[str, Any] | None = None
) -> None:
    """Write a checkpoint; at every moment there is a good one under this name.

    Parameters
    ----------
    path
        The file; when the new one is complete, an older checkpoint of that name becomes the
        :func:`previous` one.
    state
        Nested dictionaries (keys are strings), lists and tuples of NumPy arrays, NumPy and Python
        scalars, strings and None.
    meta
        What is worth knowing about it, of the same kinds.

    Raises
    ------
    OutputError
        Where it cannot be written; the older checkpoint is kept.
    TypeError
        Where the state holds something else.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = {
        "state": _encode(dict(state), "state", arrays),
        "meta": _encode(dict(meta or {}), "meta", arrays),
    }
    text = json.dumps(tree)
    size = sum(values.nbytes + SLACK_EACH for values in arrays.values())
    reserve(path, size + len(text) + SLACK)
    with replacing(path) as partial:
        try:
            with h5py.File(partial, "w", userblock_size=USER_BLOCK) as file:
                for name, values in arrays.items():
                    file.create_dataset(name, data=values)
                file.create_dataset("tree", data=np.frombuffer(text.encode(), np.uint8))
            seal(partial)
            _keep(Path(path))
        except (OSError, RuntimeError) as error:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error


def previous(path: str | Path) -> Path:
    """Where the checkpoint before the last one is kept."""
    path = Path(path)
    return path.with_name(f"{path.stem}-previous{path.suffix}")


def take_previous(path: str | Path) -> None:
    """Put the checkpoint before the last one in the place of the last one."""
    try:
        os.replace(previous(path), path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error)}") from error


def seal(path: str | Path) -> None:
    """Write the first line of a checkpoint, with the digest of all that follows it."""
    start = f"{FORMAT} {FORMAT_VERSION} {version('particell')}"
    with open(path, "rb+") as handle:
        line = f"{start} {_digest(handle, start)}\n".encode()
        handle.seek(0)
        handle.write(line.ljust(USER_BLOCK, b"\0"))


def _digest(handle: Any, start: str) -> str:
    """Of the beginning of the first line, and of all that follows the user block."""
    found = hashlib.blake2b(start.encode(), digest_size=32)
    handle.seek(USER_BLOCK)
    while block := handle.read(1 << 20):
        found.update(block)
    return found.hexdigest()


def _keep(path: Path) -> None:
    """Give the last checkpoint the name of the previous one too, before it is replaced."""
    if not path.is_file():
        return
    with replacing(previous(path)) as partial:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
            os.link(path, partial)
            return
        shutil.copyfile(path, partial)  # a file system without hard links


def read_checkpoint(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a checkpoint.

    Returns
    -------
    state, meta
        As they were given to :func:`write_checkpoint`.

    Raises
    ------
    CheckpointError
        Where the file is missing, damaged, foreign, or of a newer version of the format.
    """
    path = Path(path)
    if not path.is_file():
        how = "start the run again (particell run … --overwrite)"
        raise CheckpointError(f"there is no checkpoint {path}: {how}")
    try:
        _check_first_line(path)
        with h5py.File(path, "r") as file:
            check_contained(file)
            check_no_links(file)
            seen: set[str] = set()
            tree = json.loads(_array(file, "tree", seen)[()].tobytes())
            return _decode(tree["state"], file, seen), _decode(tree["meta"], file, seen)
    except CheckpointError:
        raise
    except ForeignPart as error:
        raise CheckpointError(f"checkpoint {path} is refused: {error}") from None
    except Exception as error:  # bytes that are anything make HDF5 and JSON say anything
        raise CheckpointError(
            f"checkpoint {path} is damaged or no checkpoint: {reason(error)}"
        ) from error


def _check_first_line(path: Path) -> None:
    """Refuse a file that is no checkpoint, of a newer version, or not as it was written."""
    with open(path, "rb") as handle:
        block = handle.read(USER_BLOCK)
        if block.startswith(SIGNATURE):
            what = "not a checkpoint of particell, or one of an earlier version"
            raise CheckpointError(f"{path} is {what}: start the run again")
        line = _FIRST_LINE.fullmatch(block.decode("ascii", "replace"))
        if line is None:
            raise ValueError("it does not begin as a checkpoint does")
        number, program = line["number"], line["program"]
        if int(number) > FORMAT_VERSION:
            raise CheckpointError(
                f"checkpoint {path} has format {number}, written by particell {program}; "
                f"this version reads up to {FORMAT_VERSION}"
            )
        if _digest(handle, f"{FORMAT} {number} {program}") != line["digest"]:
            raise ValueError("it is not as it was written (its digest differs)")


def _whole(file: h5py.File, name: object) -> h5py.Dataset:
    """A dataset whose numbers are all in the file, as they are."""
    found = file.get(name) if isinstance(name, str) else None
    if not isinstance(found, h5py.Dataset):
        raise ValueError(f"there is no array {name!r}"[:100])
    layout = found.id.get_create_plist()
    kinds = (h5py.h5d.CONTIGUOUS, h5py.h5d.COMPACT)
    if layout.get_layout() not in kinds or layout.get_nfilters() or found.ndim > MOST_AXES:
        raise ValueError(f"the array '{name}' is stored in another way")
    if found.id.get_storage_size() != found.size * found.id.get_type().get_size():
        raise ValueError(f"the numbers of the array '{name}' are missing")
    return found


def _encode(value: Any, path: str, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        return {_ARRAY: _store(value, path, arrays)}
    if isinstance(value, np.generic):  # before float, which np.float64 is too
        return {_SCALAR: _store(np.asarray(value), path, arrays)}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple):
        return {_TUPLE: [_encode(v, f"{path}/{k}", arrays) for k, v in enumerate(value)]}
    if isinstance(value, list):
        return [_encode(v, f"{path}/{k}", arrays) for k, v in enumerate(value)]
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str) or key in _MARKS:
                raise TypeError(f"{path}: {key!r} cannot be a key of a checkpoint")
        return {k: _encode(v, f"{path}/{k}", arrays) for k, v in value.items()}
    raise TypeError(f"{path}: a checkpoint cannot hold a {type(value).__name__}")


def _store(values: np.ndarray, path: str, arrays: dict[str, np.ndarray]) -> str:
    if values.dtype.hasobject or values.dtype.kind in "USMm":
        raise TypeError(f"{path}: a checkpoint cannot hold an array of {values.dtype}")
    # Keys may hold slashes or dots, which mean something in HDF5's paths.
    parts = [part if part.strip(".") else f"_{part}" for part in path.split("/")]
    name = "/".join(parts)
    while any(name == n or n.startswith(f"{name}/") or name.startswith(f"{n}/") for n in arrays):
        name += "_"
    arrays[name] = values
    return name


def _decode(value: Any, file: h5py.File, seen: set[str]) -> Any:
    if isinstance(value, list):
        return [_decode(v, file, seen) for v in value]
    if not isinstance(value, dict):
        return value
    if _ARRAY in value:
        return np.asarray(_array(file, value[_ARRAY], seen)[()])
    if _SCALAR in value:
        dataset = _array(file, value[_SCALAR], seen)
        return dataset.dtype.type(dataset[()])
    if _TUPLE in value:
        return tuple(_decode(v, file, seen) for v in value[_TUPLE])
    return {k: _decode(v, file, seen) for k, v in value.items()}


def _array(file: h5py.File, name: object, seen: set[str]) -> h5py.Dataset:
    """An array of numbers; each is asked for once."""
    found = _whole(file, name)
    if found.name in seen:
        raise ValueError(f"the array '{name}' is there twice")
    seen.add(found.name)
    if found.dtype.kind not in "biufc":
        raise ValueError(f"the array '{name}' holds no numbers")
    return found
