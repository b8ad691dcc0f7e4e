r"""How fast a body force drives a flow, and what pressure it builds up, from the description alone.

Along a periodic axis no wall holds a force back: the fluid moves until friction does. Between
plates a distance 2R apart that is at

.. math:: U = \frac{g R^2}{2\nu},

which is taken for walls of any shape, with R the largest distance of fluid from a wall: it is exact
for plates, and 1.7 times (square duct) and 2 times (pipe) what comes out there. Where U · 2R/ν is
above some 2500 such a flow is turbulent; U is then 25 friction velocities :math:`\sqrt{gR}`, the
same at that point and nearly constant beyond it.

Along other axes, and along a periodic one that walls stand across, the force is held: by a pressure
of up to ρgL.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from particell.geometry.domain import Domain
from particell.phases import Phase

#: Largest speed of turbulent flow between walls, in friction velocities.
TURBULENT = 25.0
#: More fluid particles than are worth looking at for the distance of walls.
SAMPLE = 20_000
#: Fluid has a wall before it where that is nearer than this in the cross-section, in spacings.
IN_THE_WAY = 0.5


def held_head(domain: Domain, phases: Sequence[Phase], gravity: np.ndarray) -> float:
    """Largest g L in m²/s² along axes where something holds the fluid."""
    held = [
        not periodic or (g > 0 and stand_across(domain, phases, axis))
        for axis, (periodic, g) in enumerate(zip(domain.periodic, gravity, strict=True))
    ]
    return float(np.max(np.where(held, gravity * domain.lengths, 0.0), initial=0.0))


def driven_speed(
    domain: Domain, phases: Sequence[Phase], gravity: np.ndarray, viscosity: float
) -> float:
    """The speed in m/s that a force per mass (dim,) along periodic axes drives the fluid to.

    Infinite where there is such a force and no wall. ``viscosity`` is ν in m²/s.
    """
    force = float(np.linalg.norm(gravity[domain.periodic]))
    if not force:
        return 0.0
    reach = distance_of_walls(domain, phases)
    turbulent = TURBULENT * math.sqrt(force * reach)
    return min(force * reach**2 / (2 * viscosity), turbulent) if viscosity else turbulent


def distance_of_walls(domain: Domain, phases: Sequence[Phase]) -> float:
    """Largest distance in m of fluid from the nearest wall particle; infinite without any."""
    fluid, wall = _points(phases, "fluid"), _points(phases, "wall")
    if not len(wall) or not len(fluid):
        return math.inf
    if len(fluid) > SAMPLE:
        fluid = np.random.default_rng(1).choice(fluid, SAMPLE, replace=False)
    return float(domain.tree(wall).query(domain.wrapped_from_zero(fluid))[0].max())


def stand_across(domain: Domain, phases: Sequence[Phase], axis: int) -> bool:
    """Whether a wall is in the way of fluid that moves along an axis."""
    fluid, wall = _points(phases, "fluid"), _points(phases, "wall")
    if not len(wall) or not len(fluid):
        return False
    if domain.dim == 1:
        return True
    rest = np.arange(domain.dim) != axis
    section = Domain(
        domain.lower[rest],
        domain.upper[rest],
        "".join(a for a, p in zip("xyz", domain.periodic[rest], strict=False) if p),
    )
    places = section.wrapped_from_zero(wall[:, rest])
    spacing = min(p.particle_spacing for p in phases if p.kind == "fluid" and len(p.points))
    return bool(section.tree(fluid[:, rest]).query(places)[0].min() < IN_THE_WAY * spacing)


def _points(phases: Sequence[Phase], kind: str) -> np.ndarray:
    dim = phases[0].dim
    return np.concatenate([np.empty((0, dim)), *(p.points for p in phases if p.kind == kind)])
