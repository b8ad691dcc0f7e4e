"""Walls that are too thin for the support, or of another spacing than the fluid: before a run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from particell.geometry.domain import Domain
from particell.health.finding import Finding
from particell.simulated import Simulated

#: Part of the fluid next to walls whose support may reach beyond them (corners, odd bodies).
SEEN_THROUGH = 0.05
#: How much larger the spacing of walls may be than that of the fluid next to them, or smaller.
OTHER_SPACING = 1.2
#: Next to a wall is nearer than this to a wall particle, in spacings.
NEXT = 1.3
#: More fluid particles next to walls than are worth looking at.
SAMPLE = 20_000


def of_walls(simulation: Simulated) -> Iterator[Finding]:
    """Thickness and spacing of walls, as the phases describe them."""
    s = simulation
    fluids = [p for p in s.phases if p.kind == "fluid" and len(p.points)]
    walls = [p for p in s.phases if p.kind == "wall" and len(p.points)]
    if s.static or not fluids or not walls:
        return
    dim, support, domain = s.domain.dim, s.scheme.support, s.domain
    tree = domain.tree(np.concatenate([p.points for p in walls]))
    wall_spacing = np.repeat([p.particle_spacing for p in walls], [len(p.points) for p in walls])
    empty, ratios = [], []
    for phase in fluids:
        d = phase.particle_spacing
        x = domain.wrapped_from_zero(phase.points)
        distance, nearest = tree.query(x, distance_upper_bound=NEXT * d)
        near = np.flatnonzero(np.isfinite(distance))
        if not len(near):
            continue
        near = near[:: -(-len(near) // SAMPLE)]
        ratios.append(wall_spacing[nearest[near]] / d)
        ends = _far_end(tree, x[near], support * d, domain)
        beyond = domain.wrapped_from_zero(ends + domain.lower)
        room = (0.5 * np.sqrt(dim) + 0.05) * wall_spacing[nearest[near]]
        empty.append(tree.query(beyond)[0] > room)
    if not ratios:
        return
    yield Finding(
        "wall layers: part of the fluid beside walls that sees through them",
        float(np.mean(np.concatenate(empty))),
        SEEN_THROUGH,
        f"the support ({support:g} spacings) reaches beyond the wall particles: give walls at "
        f"least {int(np.ceil(support))} layers",
    )
    ratio = np.concatenate(ratios)
    yield Finding(
        "wall spacing over that of the fluid, or the inverse",
        float(np.median(np.maximum(ratio, 1 / ratio))),
        OTHER_SPACING,
        "walls and the fluid beside them weigh differently: give both the same spacing",
    )


def _far_end(tree: cKDTree, x: np.ndarray, h: float, domain: Domain) -> np.ndarray:
    """Where the support h of fluid at x ends, towards the wall particles in it."""
    ends = np.empty_like(x)
    for k, rows in enumerate(tree.query_ball_point(x, h)):
        normal = domain.shortest(tree.data[rows] - x[k]).mean(axis=0)
        ends[k] = x[k] + h * normal / max(np.linalg.norm(normal), 1e-300)
    return ends
