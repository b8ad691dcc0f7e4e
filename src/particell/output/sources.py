"""Where the frames of a run lie: in a trajectory file, or in memory."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np

from particell.errors import InputError, unknown_name
from particell.geometry.domain import AXES, Domain
from particell.output.h5md import (
    AVERAGES,
    PARTICLES,
    UNIT_ATTRIBUTE,
    element_names,
    open_trajectory,
    text,
)
from particell.roles import Role
from particell.units import field_unit

# What indexes the frames of a series: as NumPy does.
Index = Any
#: Where a run's parameters say what its groups are to fields.
GROUPS = "groups"


class Source(Protocol):
    """What :class:`~particell.output.run.Run` reads from."""

    @property
    def domain(self) -> Domain: ...
    @property
    def groups(self) -> list[str]: ...
    @property
    def steps(self) -> np.ndarray: ...
    @property
    def times(self) -> np.ndarray: ...
    def fields(self) -> list[str]: ...
    def observables(self) -> list[str]: ...
    def shape(self, name: str) -> tuple[tuple[int, ...], np.dtype]: ...
    def unit(self, name: str) -> str: ...
    def read(self, name: str, index: Index) -> np.ndarray: ...
    def observable(self, name: str) -> np.ndarray: ...
    def points(self) -> dict[str, np.ndarray]: ...
    def static(self) -> dict[str, np.ndarray]: ...
    def parameters(self) -> dict[str, Any]: ...
    def roles(self) -> list[Role]: ...


class MemorySource:
    """Frames kept in lists, which may grow."""

    def __init__(
        self,
        domain: Domain,
        groups: Sequence[str],
        static: Mapping[str, np.ndarray],
        steps: Sequence[int],
        times: Sequence[float],
        frames: Sequence[Mapping[str, np.ndarray]],
        observables: Sequence[Mapping[str, Any]],
        points: Mapping[str, np.ndarray] | None = None,
        units: Mapping[str, str] | None = None,
        roles: Sequence[Role] | None = None,
    ):
        self.domain, self.groups, self._units = domain, list(groups), dict(units or {})
        self._roles = list(roles or map(Role, groups))
        self._static, self._points = dict(static), dict(points or {})
        self._steps, self._times = steps, times
        self._frames, self._observables = frames, observables

    @property
    def steps(self) -> np.ndarray:
        return np.array(self._steps, np.int64)

    @property
    def times(self) -> np.ndarray:
        return np.array(self._times, float)

    def fields(self) -> list[str]:
        return sorted(self._frames[0]) if self._frames else []

    def observables(self) -> list[str]:
        return sorted(self._observables[0]) if self._observables else []

    def shape(self, name: str) -> tuple[tuple[int, ...], np.dtype]:
        first = np.asarray(self._frames[0][name])
        return (len(self._frames), *first.shape), first.dtype

    def unit(self, name: str) -> str:
        return self._units.get(name) or field_unit(name)

    def read(self, name: str, index: Index) -> np.ndarray:
        frames, rest = (index[0], index[1:]) if isinstance(index, tuple) else (index, ())
        if isinstance(frames, int | np.integer):
            return np.asarray(self._frames[int(frames)][name])[rest]
        chosen = np.arange(len(self._frames))[frames]
        shape, dtype = self.shape(name)
        series = np.empty((len(chosen), *shape[1:]), dtype)
        for k, frame in enumerate(chosen):
            series[k] = self._frames[frame][name]
        return series[(slice(None), *rest)]

    def observable(self, name: str) -> np.ndarray:
        return np.array([values[name] for values in self._observables], float)

    def points(self) -> dict[str, np.ndarray]:
        return self._points

    def static(self) -> dict[str, np.ndarray]:
        return self._static

    def parameters(self) -> dict[str, Any]:
        return {}

    def roles(self) -> list[Role]:
        return self._roles


class FileSource:
    """Frames in an H5MD file, opened anew for every access, so that it may still be growing."""

    def __init__(self, path: Path):
        self.path = path
        with open_trajectory(path) as file:
            box = file[f"{PARTICLES}/box"].attrs
            boundary = [text(b) for b in box["boundary"]]
            self.domain = Domain(
                box["lower"],
                box["upper"],
                "".join(a for a, b in zip(AXES, boundary, strict=False) if b == "periodic"),
                float(box["depth"]) if "depth" in box else None,
            )
            kinds = h5py.check_enum_dtype(file[f"{PARTICLES}/species"].dtype)
            self.groups = sorted(kinds, key=kinds.__getitem__)
            self._fields = sorted(element_names(file[PARTICLES]))
            self._roles = _roles_in(file, self.groups)
            # In SWMR mode the observables are there from the start, though they grow later.
            known = file.get("observables")
            self._observables = sorted(element_names(known)) if known else []

    @contextmanager
    def _open(self) -> Iterator[tuple[h5py.File, int]]:
        with open_trajectory(self.path) as file:
            yield file, len(file[f"{PARTICLES}/position/step"])

    @property
    def steps(self) -> np.ndarray:
        with self._open() as (file, n):
            return file[f"{PARTICLES}/position/step"][:n]

    @property
    def times(self) -> np.ndarray:
        with self._open() as (file, n):
            return file[f"{PARTICLES}/position/time"][:n]

    def fields(self) -> list[str]:
        return self._fields

    def observables(self) -> list[str]:
        return self._observables

    def shape(self, name: str) -> tuple[tuple[int, ...], np.dtype]:
        with self._open() as (file, n):
            dataset = file[f"{PARTICLES}/{name}/value"]
            return (n, *dataset.shape[1:]), dataset.dtype

    def unit(self, name: str) -> str:
        with self._open() as (file, _):
            found = file[f"{PARTICLES}/{name}/value"].attrs.get(UNIT_ATTRIBUTE, "")
        return str(found) or field_unit(name)

    def read(self, name: str, index: Index) -> np.ndarray:
        with self._open() as (file, n):
            frames, rest = (index[0], index[1:]) if isinstance(index, tuple) else (index, ())
            dataset = file[f"{PARTICLES}/{name}/value"]
            # A row beyond the last step is one that is being written: never look at it.
            chosen = np.arange(n)[frames]
            if chosen.ndim == 0:
                return dataset[int(chosen)][rest]
            if not chosen.size:
                return np.zeros((0, *dataset.shape[1:]), dataset.dtype)[(slice(None), *rest)]
            first, last = int(chosen.min()), int(chosen.max())
            return dataset[first : last + 1][chosen - first][(slice(None), *rest)]

    def observable(self, name: str) -> np.ndarray:
        with self._open() as (file, n):
            return file[f"observables/{name}/value"][:n]

    def points(self) -> dict[str, np.ndarray]:
        with self._open() as (file, _):
            group = file.get(f"observables/{AVERAGES}", {})
            return {name: average["points"][()] for name, average in group.items()}

    def static(self) -> dict[str, np.ndarray]:
        with self._open() as (file, _):
            particles = file[PARTICLES]
            found = {k: v[()] for k, v in particles.items() if isinstance(v, h5py.Dataset)}
        if "species" in found:
            found["group"] = np.asarray(found.pop("species"), np.int32)
        return found

    def parameters(self) -> dict[str, Any]:
        with self._open() as (file, _):
            found = file.get("parameters/run")
            written = text(found[()]) if isinstance(found, h5py.Dataset) else "{}"
        try:
            content = json.loads(written)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            raise InputError("parameters of the trajectory", written, "JSON of a table")
        return content

    def roles(self) -> list[Role]:
        return self._roles


def _roles_in(file: h5py.File, groups: Sequence[str]) -> list[Role]:
    """What the run's parameters say of the groups; fluids of everything where they say nothing."""
    try:
        listed = json.loads(text(file["parameters/run"][()])).get(GROUPS, [])
        found = {role.name: role for role in map(Role.of, listed)}
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        found = {}
    return [found.get(name, Role(name)) for name in groups]


def known(what: str, name: str, names: Sequence[str]) -> str:
    """The name, if it is one of those; else an :class:`~particell.errors.InputError`."""
    if name not in names:
        raise unknown_name(what, name, names)
    return name
