"""Checkpoints: everything that a bit-for-bit restart needs, in one HDF5 file.

The tree of the state is JSON text; its arrays are datasets below ``state/`` that the text refers
to by path. Python's JSON writes numbers such that they are read back exactly.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from particell.output.contained import ForeignPart, check_contained
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
FORMAT_VERSION = 1

_ARRAY, _SCALAR, _TUPLE = "__array__", "__scalar__", "__tuple__"
_MARKS = {_ARRAY, _SCALAR, _TUPLE}


def write_checkpoint(
    path: str | Path, state: Mapping[str, Any], meta: Mapping[str, Any] | None = None
) -> None:
    """Write a checkpoint; at every moment there is a good one under this name.

    Parameters
    ----------
    path
        The file; an older checkpoint of that name is replaced when the new one is complete.
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
            with h5py.File(partial, "w") as file:
                file.attrs["format"] = FORMAT
                file.attrs["format_version"] = FORMAT_VERSION
                file.attrs["program_version"] = version("particell")
                for name, values in arrays.items():
                    file.create_dataset(name, data=values)
                # Last, so that a file without it is incomplete.
                file["tree"] = text
        except (OSError, RuntimeError) as error:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error


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
        with h5py.File(path, "r") as file:
            _check_format(path, file)
            check_contained(file)
            tree = json.loads(file["tree"][()])
            return _decode(tree["state"], file), _decode(tree["meta"], file)
    except CheckpointError:
        raise
    except ForeignPart as error:
        raise CheckpointError(f"checkpoint {path} is refused: {error}") from None
    except Exception as error:  # bytes that are anything make HDF5 and JSON say anything
        raise CheckpointError(
            f"checkpoint {path} is damaged or no checkpoint: {reason(error)}"
        ) from error


def _check_format(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT:
        raise CheckpointError(f"{path} is not a checkpoint of particell")
    found = int(file.attrs["format_version"])
    if found > FORMAT_VERSION:
        raise CheckpointError(
            f"checkpoint {path} has format {found}, written by particell "
            f"{file.attrs.get('program_version')}; this version reads up to {FORMAT_VERSION}"
        )


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


def _decode(value: Any, file: h5py.File) -> Any:
    if isinstance(value, list):
        return [_decode(v, file) for v in value]
    if not isinstance(value, dict):
        return value
    if _ARRAY in value:
        return np.asarray(file[value[_ARRAY]][()])
    if _SCALAR in value:
        dataset = file[value[_SCALAR]]
        return dataset.dtype.type(dataset[()])
    if _TUPLE in value:
        return tuple(_decode(v, file) for v in value[_TUPLE])
    return {k: _decode(v, file) for k, v in value.items()}
