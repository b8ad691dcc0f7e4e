"""Where fluid can leave a domain: sides that are neither periodic nor closed by walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particell.boundaries.reflection import Reflection
from particell.geometry.domain import AXES, Domain
from particell.phases import Phase

#: A wall closes what of a side is nearer than that to one of its particles, in spacings; thinner
#: walls and their corners included.
CLOSED_BY = 1.5


def open_sides(
    domain: Domain, phases: Sequence[Phase], reflections: Sequence[Reflection]
) -> list[str]:
    """The sides that fluid touches and that nothing closes, such as ``"upper y"``.

    Looked at from each fluid particle within a spacing of the side: whether there is a wall's
    particle, or a reflecting surface, at the point across.
    """
    from scipy.spatial import cKDTree

    walls = [p.points for p in phases if p.kind == "wall" and len(p.points)]
    tree = cKDTree(np.concatenate(walls)) if walls else None
    found = []
    for axis in np.flatnonzero(~np.asarray(domain.periodic)):
        for side, edge, sign in (("lower", domain.lower, -1.0), ("upper", domain.upper, 1.0)):
            across = _across(phases, int(axis), float(edge[axis]), sign)
            if any(_open(points, spacing, tree, reflections) for points, spacing in across):
                found.append(f"{side} {AXES[axis]}")
    return found


def _across(
    phases: Sequence[Phase], axis: int, edge: float, sign: float
) -> list[tuple[np.ndarray, float]]:
    """Points half a spacing beyond a side, opposite the fluid particles next to it."""
    found = []
    for p in phases:
        if p.kind == "fluid" and len(p.points):
            spacing = p.particle_spacing
            points = p.points[sign * (edge - p.points[:, axis]) <= spacing].copy()
            points[:, axis] = edge + 0.5 * sign * spacing
            found.append((points, spacing))
    return [(points, spacing) for points, spacing in found if len(points)]


def _open(
    points: np.ndarray, spacing: float, tree: object, reflections: Sequence[Reflection]
) -> bool:
    """Whether most of the points are neither in a wall nor beyond a reflecting surface."""
    closed = np.zeros(len(points), bool)
    if tree is not None:
        closed |= tree.query(points)[0] <= CLOSED_BY * spacing  # type: ignore[attr-defined]
    for r in reflections:
        inside = r.body.signed_distance(points) < 0
        closed |= ~inside if r.inside else inside
    return bool(np.mean(closed) < 0.5)
