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

from particell.compute.expressions import where
from particell.laws.law import Adds, Law


@dataclass(frozen=True)
class WallPressure(Law):
    """Pressure of a wall particle from its fluid neighbours.

    Attributes
    ----------
    moving
        Whether walls may move.
    buoyancy
        Whether there is a body force besides gravity.
    """

    moving: bool
    buoyancy: bool = False

    own = ("total", "weights")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """What a fluid particle j shows the wall particle i."""
        force = i.gravity - i.wall_acceleration if self.moving else i.gravity
        if self.buoyancy:
            force = force + j.buoyancy
        rise = (i.rest_height - j.rest_height) * j.rest_weight
        excess = j.pressure - j.rest_pressure - rise + j.density * force.dot(ij.x)
        return {"total": ij.W * excess, "weights": ij.W}

    def finish(self, i: Any, sums: Any) -> Adds:
        """P in Pa, and P/ρ²."""
        some = sums.weights > 0.0
        mean = sums.total / where(some, sums.weights, 1.0)
        pressure = where(some, i.rest_pressure + mean, i.background)
        square = i.density * i.density * i.density_sum
        return {"pressure": pressure, "pressure_term": (pressure + i.confinement) / square}
