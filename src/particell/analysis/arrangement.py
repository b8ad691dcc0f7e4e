"""How evenly points are spread: clumps and voids."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particell.geometry.domain import Domain
from particell.geometry.shapes import Box, Shape


class Evenness(NamedTuple):
    """Extremes of an arrangement, in particle spacings.

    Attributes
    ----------
    closest
        Smallest distance of two points: 1 on a square lattice, 1.07 on a hexagonal one.
    void
        Radius of the largest circle (sphere) without a point in it: 0.71 on a square lattice, 0.62
        on a hexagonal one, and 1.07 where one point of that is missing.
    """

    closest: float
    void: float


def evenness(points: np.ndarray, spacing: float, within: Domain | Shape) -> Evenness:
    """Closest pair, and largest void with its centre inside a region without periodic faces.

    Parameters
    ----------
    points
        (n, D), D = 2 or 3, in m; wall particles included, else the walls count as voids.
    spacing
        Distance of neighbours in m.
    within
        Where to look for voids.
    """
    from scipy.spatial import Delaunay, cKDTree

    distance, _ = cKDTree(points).query(points, k=2)
    # the largest empty circle is centred at a vertex of the Voronoi diagram
    corners = points[Delaunay(points).simplices]
    edges = corners[:, 1:] - corners[:, :1]
    size = np.abs(np.linalg.det(edges))
    flat = size < 1e-9 * spacing ** points.shape[1]
    right = 0.5 * (edges[~flat] ** 2).sum(axis=2)
    offset = np.linalg.solve(edges[~flat], right[..., None])[..., 0]
    centre = corners[~flat, 0] + offset
    shape: Shape = (
        Box(list(within.lower), list(within.upper)) if isinstance(within, Domain) else within
    )
    inside = shape.contains(centre)
    radius = np.linalg.norm(offset[inside], axis=1).max(initial=0.0)
    return Evenness(float(distance[:, 1].min() / spacing), float(radius / spacing))
