"""A run as an xarray Dataset, read as needed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.analysis.fields import grid as grid_points
from particell.errors import InputError, MissingExtra
from particell.geometry.domain import AXES
from particell.output.export import vtk_name
from particell.output.pictures import line_points
from particell.output.recorded import Recorded
from particell.output.sources import known
from particell.units import field_unit, observable_unit

if TYPE_CHECKING:
    import xarray as xr

#: Gives one field of one frame.
Reader = Callable[[], np.ndarray]


def dataset(
    run: Recorded,
    names: Sequence[str],
    frames: slice | Sequence[int] | None,
    groups: str | Sequence[str] | None,
    grid: int | Sequence[int] | None,
    line: tuple[Sequence[float], Sequence[float]] | None,
    points: int,
    options: dict[str, Any],
) -> xr.Dataset:
    """See :meth:`particell.output.run.Run.to_xarray`."""
    try:
        import xarray as xr
    except ImportError:
        raise MissingExtra("to_xarray", "xarray", "xarray") from None
    if grid is not None and line is not None:
        raise InputError("line", line, "left out where 'grid' is given")
    if grid is None and line is None and options:
        raise InputError(next(iter(options)), "given", "left out without 'grid' or 'line'")
    chosen = [known("field", name, run.field_names) for name in names or run.field_names]
    numbers = _numbers(run, frames)
    coordinates: dict[str, Any] = {
        "time": ("time", run.times[numbers], {"units": "s", "long_name": "time"}),
        "step": ("time", run.steps[numbers], {"long_name": "number of the time step"}),
        "axis": ("axis", list(AXES[: run.domain.dim]), {"long_name": "component of vectors"}),
    }
    if grid is None and line is None:
        where, places, read = _particles(run, groups)
    else:
        where, places, read = _interpolated(run, groups, grid, line, points, options)
    coordinates |= places
    count = len(next(iter(places.values()))[1]) if "particle" in where else None
    variables: dict[str, Any] = {}
    for name in chosen:
        shape, kind = run.source.shape(name)
        size = (count,) if count is not None else tuple(len(places[d][1]) for d in where)
        lazy = _lazy(
            [partial(read, name, k) for k in numbers],
            (len(numbers), *size, *shape[2:]),
            kind if count is not None else np.dtype(float),
        )
        dims = ("time", *where, *(["axis"] if len(shape) == 3 else []))
        attributes = {"long_name": name.replace("/", " of "), "field": name}
        variables[vtk_name(name)] = (dims, lazy, _with_unit(attributes, run.source.unit(name)))
    for name in run.observable_names:
        attributes = _with_unit(
            {"long_name": name.replace("_", " ")}, observable_unit(name, run.field_names)
        )
        values = run.observable(name)[numbers]
        variables.setdefault(vtk_name(name), ("time", values, attributes))
    return xr.Dataset(variables, coordinates, _attributes(run))


def _numbers(run: Recorded, frames: slice | Sequence[int] | None) -> list[int]:
    """The frames, counted from the beginning."""
    run.checked(-1)
    everything = range(len(run))
    if frames is None:
        return list(everything)
    if isinstance(frames, slice):
        return list(everything[frames])
    return [run.checked(k) for k in np.atleast_1d(frames).tolist()]


def _particles(
    run: Recorded, groups: str | Sequence[str] | None
) -> tuple[tuple[str, ...], dict[str, Any], Callable[[str, int], np.ndarray]]:
    """Dimensions, coordinates and reader of fields by particle."""
    chosen = run.chosen(groups)
    places: dict[str, Any] = {
        "particle": ("particle", run.static["id"][chosen], {"long_name": "persistent id"})
    }
    names = np.array(run.group_names)[run.static["group"][chosen]]
    places["group"] = ("particle", names, {"long_name": "group"})
    for name, values in run.static.items():
        if name not in ("id", "group") and values.ndim == 1 and name not in run.field_names:
            attributes = _with_unit({"long_name": name}, field_unit(name))
            places[name] = ("particle", values[chosen], attributes)
    return ("particle",), places, lambda name, k: run.source.read(name, k)[chosen]


def _interpolated(
    run: Recorded,
    groups: str | Sequence[str] | None,
    grid: int | Sequence[int] | None,
    line: tuple[Sequence[float], Sequence[float]] | None,
    points: int,
    options: dict[str, Any],
) -> tuple[tuple[str, ...], dict[str, Any], Callable[[str, int], np.ndarray]]:
    """Dimensions, coordinates and reader of fields on a grid or a line."""
    dim = run.domain.dim
    if line is None:
        assert grid is not None
        places = grid_points(run.domain, grid)
        where = tuple(AXES[:dim])
        corner: tuple[Any, ...] = (0,) * dim
        lines = [places[(*corner[:a], slice(None), *corner[a + 1 :], a)] for a in range(dim)]
        coordinates = {d: (d, x, _place(d)) for d, x in zip(where, lines, strict=True)}
    else:
        if not isinstance(line, tuple | list) or len(line) != 2:
            raise InputError("line", line, "two points in m")
        places, _, _ = line_points(run, line[0], line[1], points)
        where = ("distance",)
        distance = np.linalg.norm(places - places[0], axis=1)
        attributes = {"units": "m", "long_name": "distance from the start"}
        coordinates = {"distance": ("distance", distance, attributes)}
        for a in range(dim):
            coordinates[AXES[a]] = ("distance", places[:, a], _place(AXES[a]))
    flat = places.reshape(-1, dim)

    def read(name: str, frame: int) -> np.ndarray:
        values = run.on_points(name, flat, frame, groups=groups, **options)
        return values.reshape(*places.shape[:-1], *values.shape[1:])

    return where, coordinates, read


def _place(axis: str) -> dict[str, str]:
    return {"units": "m", "long_name": axis}


def _with_unit(attributes: dict[str, str], unit: str) -> dict[str, str]:
    return {**attributes, "units": unit} if unit else attributes


def _attributes(run: Recorded) -> dict[str, Any]:
    domain = run.domain
    periodic = "".join(a for a, p in zip(AXES, domain.periodic, strict=False) if p)
    found = {"lower": domain.lower, "upper": domain.upper, "periodic": periodic}
    if domain.depth is not None:
        found["depth"] = domain.depth
    return found


def _lazy(readers: Sequence[Reader], shape: tuple[int, ...], kind: np.dtype) -> Any:
    """An array whose frames are read, or interpolated, when they are asked for."""
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class Frames(BackendArray):
        """See xarray's "How to add a new backend"."""

        def __init__(self) -> None:
            self.shape, self.dtype = shape, kind

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(
                key, shape, indexing.IndexingSupport.BASIC, self.raw
            )

        def raw(self, key: tuple[Any, ...]) -> np.ndarray:
            first, rest = key[0], key[1:]
            if isinstance(first, slice):
                wanted = range(len(readers))[first]
                if not len(wanted):
                    return np.zeros(shape, kind)[key]
                return np.stack([readers[k]()[rest] for k in wanted])
            return readers[first]()[rest]

    return indexing.LazilyIndexedArray(Frames())
