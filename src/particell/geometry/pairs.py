"""Which points are near each other: for setting up and analysis, not for time steps."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from particell.geometry.domain import Domain


def neighbour_pairs(
    points: np.ndarray, domain: Domain, reach: float, first: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs (i, j, x_i − x_j) nearer than ``reach``, i among the first ``first`` points.

    For setting up and analysis; the simulation has its own neighbour list.
    """
    first = len(points) if first is None else first
    images = [points]
    sources = [np.arange(len(points))]
    for d in np.flatnonzero(domain.periodic):
        length = domain.lengths[d]
        before = len(images)  # images along this axis are not copied back
        for side, shift in ((0, length), (1, -length)):
            for k in range(before):
                x = images[k][:, d]
                edge = x < domain.lower[d] + reach if side == 0 else x > domain.upper[d] - reach
                copy = images[k][edge].copy()
                copy[:, d] += shift
                images.append(copy)
                sources.append(sources[k][edge])
    everything, source = np.concatenate(images), np.concatenate(sources)
    tree = cKDTree(everything)
    found = tree.query_ball_point(points[:first], reach)
    counts = np.array([len(f) for f in found])
    i = np.repeat(np.arange(first), counts)
    j = np.concatenate([np.asarray(f, dtype=np.int64) for f in found]) if first else i
    keep = ~((source[j] == i) & (j < len(points)))
    i, j = i[keep], j[keep]
    return i, source[j], points[i] - everything[j]
