r"""The pressure of walls, extrapolated from the fluid.

.. math:: P_w = P^H_w + \frac{\sum_f \left(P_f - P^H_f - w_f\,(s_w - s_f)
          + \rho_f\,(g - a_w)\cdot x_{wf}\right) W_{wf}}{\sum_f W_{wf}},

with the acceleration :math:`a_w` of walls that move, and the background pressure where no fluid is.
What :mod:`particell.laws.hydrostatics` takes out of P, and its weight, are not extrapolated: they
are known at the wall.

Source: Adami, Hu & Adams, J. Comput. Phys. 231 (2012) 7057, Eq. 27.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from particell.compute.expressions import Vector, symbol, where
from particell.laws.hydrostatics import height_of, rest_pressure_of, rest_weight_of
from particell.laws.law import Adds, Law


@dataclass(frozen=True)
class WallPressure(Law):
    """Pressure of a wall particle from its fluid neighbours; ``moving`` for walls that move."""

    moving: bool

    own = ("total", "weights")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """What a fluid particle j shows the wall particle i."""
        force = Vector.of("gravity", [symbol("array", "gravity", "", d) for d in range(i.dim)])
        if self.moving:
            force = force - i.wall_acceleration
        interval = symbol("array", "rest_axis", "", i.dim + 2)
        rise = (height_of(i) - j.rest_height) * (interval * j.rest_weight)
        excess = j.pressure_excess - rise + j.density * force.dot(ij.x)
        return {"total": ij.W * excess, "weights": ij.W}

    def finish(self, i: Any, sums: Any) -> Adds:
        """P in Pa, and P/ρ²."""
        some = sums.weights > 0.0
        mean = sums.total / where(some, sums.weights, 1.0)
        pressure = where(some, rest_pressure_of(i) + mean, i.background)
        square = i.density * i.density * i.density_sum
        return {"pressure": pressure, "pressure_term": (pressure + i.confinement) / square}


def excess_names() -> dict[str, Any]:
    """What :class:`WallPressure` reads of the fluid, made of fields."""
    return {
        "rest_height": height_of,
        "rest_weight": rest_weight_of,
        "pressure_excess": lambda p: p.pressure - rest_pressure_of(p),
    }
