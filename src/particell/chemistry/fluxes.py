r"""Walls with a flux: how it is shared among the fluid particles, and booked exactly.

Particle j of the wall gives particle i of the fluid the share

.. math:: a_{ij} = 2 \lambda V_i V_j F_{ij} s_{ij} (d_i + d_j),

which the law of diffusion itself asks for (:mod:`particell.laws.diffusion`). In the continuum
Σ a_ij is the area of the wall; λ makes it exact, so that q times the area times the time comes in.

The area is that of the wall's surface, found from its layers: with the depth d_j, the spacing
:math:`t_j = V_j^{1/D}` and the surface's curvature k,

.. math:: A = \sum_j \frac{V_j}{t_j} \max\left(0, 1 - \frac{d_j}{2 t_j}\right)
    \frac{1}{(1 - k\,d_j)^{D-1}},

exact for layers at depths t/2, 3t/2, …, and to second order in their thickness for others. The sum
is over the wall's particles that have fluid within their reach in the beginning; there must be two
layers. Otherwise the area is given (:class:`~particell.chemistry.reservoirs.FluxWall`).

Of molecules those that leave do so by jumps, at the rate a_ij/(1/k + d_i/κ_i)/V_i each, and those
that enter are a Poisson stream (:mod:`particell.chemistry.jumps`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from particell.chemistry.reservoirs import FluxWall
from particell.compute.expressions import where
from particell.compute.sweep import Sweep
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.laws.diffusion import WEIGHED_WALLS
from particell.laws.law import Adds, Law
from particell.particles import Particles
from particell.sources.source import Names


class FacingArea(Law):
    """The part of the area of wall group ``wanted`` that a particle faces, before scaling."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """a_ij/λ, in m^(D−1)."""
        area = ij.kept("exchange") * (ij.above + ij.depth)
        return {"facing": where(j.group == i.wanted, area, 0.0)}


def facing_area(dim: int, kernel: int) -> Sweep:
    """The sum of :class:`FacingArea`, zero for walls."""
    fields: dict[str, int | str] = {"x": dim, "support": 0, "group": 0, "facing": 0}
    names = Names(dim, fields, numbers=frozenset({"wanted"}))
    return Sweep(
        "facing_area",
        (FacingArea(),),
        (WEIGHED_WALLS,),
        names,
        kernel,
        uniform=True,
        zeroed=("facing",),
        exact=True,
    )


def wall_areas(
    particles: Particles, domain: Domain, walls: Sequence[FluxWall], depth: float
) -> dict[int, float]:
    """Area (per depth of missing dimensions) of each flux wall, by the number of its group.

    Raises
    ------
    InputError
        For a wall whose particles know no surface, or that no fluid touches.
    """
    found: dict[int, float] = {}
    if not walls:
        return found
    dim = particles.dim
    names = [g.name for g in particles.groups]
    x = particles.host("x")
    fluid = domain.tree(x[particles.host("is_wall") == 0])
    reach = float(particles.host("support").max())
    for wall in walls:
        g = names.index(wall.group)
        chosen = particles.host("group") == g
        places = domain.wrapped_from_zero(x[chosen])
        chosen[chosen] = fluid.query(places, distance_upper_bound=reach)[0] < reach
        volume = particles.host("mass")[chosen] / particles.host("density")[chosen]
        d = particles.host("wall_depth")[chosen]
        spacing = volume ** (1.0 / dim)
        curved = 1.0 - particles.host("wall_curvature")[chosen] * d
        parts = volume / spacing * np.maximum(0.0, 1.0 - 0.5 * d / spacing)
        area = float((parts / np.maximum(curved, 1e-3) ** (dim - 1)).sum())
        directed = np.abs(particles.host("wall_normal")[chosen]).sum() > 0
        if wall.area is not None:
            area = wall.area / depth
        if not (directed and area > 0):
            raise InputError(
                "group of FluxWall", wall.group, "a wall with a surface that fluid touches"
            )
        found[g] = area
    return found
