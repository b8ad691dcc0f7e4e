"""Histograms of what is random, against what is expected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from particell.errors import InputError
from particell.plots.curves import histogram

#: What a histogram is compared with: a distribution of scipy.stats with its parameters, or a
#: function of the values: probabilities of whole numbers, else densities.
Expected = Callable[[np.ndarray], np.ndarray] | Any
#: Bins by default of values that are no whole numbers, and the most of those that are.
BINS, MOST_WHOLE = 30, 200


def bin_edges(
    low: float, high: float, whole: bool, bins: int | Sequence[float] | None
) -> np.ndarray:
    """Edges of the bins of values from ``low`` to ``high``.

    Whole numbers have bins that are whole numbers wide, with their ends half way between two, as
    others would hold more of them here and less there.
    """
    if bins is not None and np.ndim(bins):
        edges = np.asarray(bins, float)
        if edges.ndim != 1 or len(edges) < 2 or not np.all(np.diff(edges) > 0):
            raise InputError("bins", np.shape(bins), "a number, or edges that increase")
        return edges
    if bins is not None and not (isinstance(bins, int | np.integer) and bins >= 1):
        raise InputError("bins", bins, "a positive whole number, or edges that increase")
    if not whole:
        return np.histogram_bin_edges(np.zeros(0), BINS if bins is None else int(bins), (low, high))
    count = high - low + 1
    # As few as were asked for, and at most MOST_WHOLE by default.
    width = np.ceil(count / (MOST_WHOLE if bins is None else int(bins)))
    return low - 0.5 + width * np.arange(np.ceil(count / width) + 1)


def distribution(
    values: np.ndarray,
    *,
    bins: int | Sequence[float] | None = None,
    reference: Mapping[str, Expected] | None = None,
    label: str,
    title: str = "",
) -> Figure:
    """Histogram of values, of which those that are not finite are left out."""
    values = np.asarray(values, float).ravel()
    values = values[np.isfinite(values)]
    if not values.size:
        raise InputError("values", "none", "some that are finite")
    whole = bool(np.all(values == np.rint(values)))
    edges = bin_edges(float(values.min()), float(values.max()), whole, bins)
    counts = np.histogram(values, edges)[0]
    return drawn(counts, edges, len(values), whole, reference, label, title)


def drawn(
    counts: np.ndarray,
    edges: np.ndarray,
    total: int,
    whole: bool,
    reference: Mapping[str, Expected] | None,
    label: str,
    title: str,
) -> Figure:
    """The picture: probability of each whole number, or density.

    Where bins hold several whole numbers, the probability is the mean over them.
    """
    widths = np.diff(edges)
    compared = {name: _expected(r, edges, whole) for name, r in (reference or {}).items()}
    return histogram(
        counts / (total * widths),
        edges,
        reference=compared,
        xlabel=label,
        ylabel="probability" if whole else "probability density",
        title=title,
    )


def _expected(reference: Expected, edges: np.ndarray, whole: bool) -> tuple[np.ndarray, np.ndarray]:
    method = getattr(reference, "pmf" if whole else "pdf", reference)
    if not callable(method):
        kind = "pmf" if whole else "pdf"
        raise InputError("reference", reference, f"a function, or a distribution with a {kind}")
    if whole:
        x = np.arange(np.ceil(edges[0]), np.floor(edges[-1]) + 1)
    else:
        x = np.linspace(edges[0], edges[-1], 301)
    return x, np.broadcast_to(np.asarray(method(x), float), x.shape)
