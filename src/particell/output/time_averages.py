"""Reading what :class:`~particell.averages.TimeAverage` recorded during a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from particell.errors import InputError, unknown_name
from particell.output.h5md import AVERAGES
from particell.output.sources import Source, known


def is_average(observable: str) -> bool:
    """Whether the path of an observable is that of a time average."""
    return observable.startswith(f"{AVERAGES}/")


def recorded(observables: Sequence[str]) -> dict[str, list[str]]:
    """The fields of each time average by its name."""
    found: dict[str, list[str]] = {}
    for path in filter(is_average, observables):
        _, name, field = path.split("/", 2)
        found.setdefault(name, []).append(field)
    return found


def mean(
    source: Source,
    averages: Mapping[str, list[str]],
    field: str,
    name: str | None,
    frames: slice | Sequence[int],
) -> np.ndarray:
    """See :meth:`particell.output.run.Run.average`; ``averages`` are those :func:`recorded`."""
    if not averages:
        raise InputError("average", name or field, "of a run that was given 'averages'")
    if name is None and len(averages) == 1:
        name = next(iter(averages))
    if name is None or name not in averages:
        raise unknown_name("average", str(name), averages)
    known("field", field, averages[name])
    number = len(source.steps)
    chosen = np.arange(number)[frames]
    if not chosen.size:
        raise InputError("frames", frames, f"some of the {number} frames")
    series = source.observable(f"{AVERAGES}/{name}/{field}")[chosen]
    there = ~np.isnan(series)
    total = np.where(there, series, 0.0).sum(axis=0)
    times = there.sum(axis=0)
    return np.where(times > 0, total / np.maximum(times, 1), np.nan)
