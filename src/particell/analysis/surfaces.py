r"""Surfaces of walls as their particles know them, seen from points anywhere.

Wall particle *j* knows the point :math:`s_j = x_j + d_j n_j` of its wall's surface that is nearest
to it, the normal :math:`n_j` there (into the fluid) and the curvature :math:`k_j`
(:mod:`particell.boundaries.wall`). What a point sees of a wall is the part round the nearest
:math:`s_j`: exact for planes, circles and spheres, and for what is made of such faces.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from particell.boundaries.wall import surface_distance
from particell.compute.elementwise import elementwise
from particell.geometry.domain import Domain

#: How far inside a surface a point counts as on it, in supports: round-off of places and, of
#: curved surfaces, of their curvature.
ON_SURFACE = 1e-4
#: Distance in supports up to which a wall is looked for, from points to surface points.
SIGHT = 2.0


@dataclass(frozen=True)
class Seen:
    """A wall seen from some of m points.

    Attributes
    ----------
    points
        Which points see it, (k,).
    distance
        Their distances from its surface in m, negative inside the solid, (k,).
    offset
        From each of them to the nearest point of the surface, (k, D), in m.
    nearest
        The wall's particle whose part of the surface it is, (k,).
    """

    points: np.ndarray
    distance: np.ndarray
    offset: np.ndarray
    nearest: np.ndarray


class Surface:
    """The surface of one wall.

    Parameters
    ----------
    position, normal
        Of its particles, (n, D).
    depth, curvature
        (n,), in m and 1/m.
    domain
        The box; distances are the shortest ones over its periodic axes.
    """

    def __init__(
        self,
        position: np.ndarray,
        normal: np.ndarray,
        depth: np.ndarray,
        curvature: np.ndarray,
        domain: Domain,
    ):
        self.known = np.any(normal != 0.0, axis=1)
        self.rows = np.flatnonzero(self.known)
        self.normal, self.curvature = normal[self.rows], curvature[self.rows]
        self.feet = position[self.rows] + depth[self.rows, None] * self.normal
        self.domain = domain

    def __len__(self) -> int:
        """Number of particles that know the surface."""
        return len(self.rows)

    def seen(self, points: np.ndarray, sight: float) -> Seen:
        """The surface from points (m, D) that are nearer than ``sight`` (m) to one of its own."""
        gap, row = nearest(self.feet, points, self.domain)
        near = np.flatnonzero(gap <= sight)
        row = row[near]
        t = self.domain.shortest(points[near] - self.feet[row])
        normal, k = self.normal[row], self.curvature[row]
        none = ((0, 3 - t.shape[1]), (0, 0))
        distance = elementwise(surface_distance)(*np.pad(t.T, none), *np.pad(normal.T, none), k)
        radial = normal + k[:, None] * t
        length = np.linalg.norm(radial, axis=1, keepdims=True)
        out = np.where(length > 0, radial / np.where(length > 0, length, 1.0), normal)
        return Seen(near, distance, -distance[:, None] * out, self.rows[row])


def nearest(places: np.ndarray, points: np.ndarray, domain: Domain) -> tuple[np.ndarray, ...]:
    """Distance from each point (m, D) to the nearest of the places (n, D), and which that is."""
    if not len(places):
        return np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    return domain.tree(places).query(domain.wrapped_from_zero(points))


def turned(normal: np.ndarray, first: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Normals (n, D) of a rigid body whose particles have gone from ``first`` to ``now``, (n, D).

    Both without jumps across periodic faces. The rotation is the one that fits best (Kabsch, Acta
    Cryst. A32 (1976) 922); of a body that has not turned the normals are what they were.
    """
    before, after = first - first.mean(axis=0), now - now.mean(axis=0)
    if normal.shape[1] == 1 or np.abs(after - before).max() <= 1e-9 * np.abs(before).max():
        return normal
    left, _, right = np.linalg.svd(before.T @ after)
    fix = np.ones(len(left))
    fix[-1] = np.sign(np.linalg.det(left @ right))
    return normal @ (left * fix) @ right


def inside(surfaces: Mapping[int, Seen], count: int, tolerance: float) -> np.ndarray:
    """Mask (count,) of the points that lie in one of the solids, deeper than ``tolerance``."""
    found = np.zeros(count, bool)
    for seen in surfaces.values():
        found[seen.points[seen.distance < -tolerance]] = True
    return found
