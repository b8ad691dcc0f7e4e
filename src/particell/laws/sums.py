r"""Sums of the kernel: density, its filter, the kernel's own moment.

.. math::

   \rho_i = \frac1s \sum_j m_j W_{ij}, \qquad
   \hat\rho_i = \frac{\sum_j m_j W_{ij}}{\sum_j V_j W_{ij}}, \qquad
   n_i = \frac1D \sum_j V_j F_{ij} r_{ij}^2,

the particle itself included where W is summed. The first is the density of SDPD with
``density="summation"`` (s: :mod:`particell.schemes.summation`), over walls too. The second, over
the particles of one fluid, is Shepard's filter. The third is 1 in the continuum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from particell.compute.expressions import where
from particell.laws.continuity import HeadOfRest
from particell.laws.law import Adds, Law


@dataclass(frozen=True)
class SummedDensity(Law):
    """The density that the arrangement has.

    Attributes
    ----------
    contrast
        Whether reference densities differ: masses are then those of the fluid of i.
    """

    contrast: bool = False

    own = ("total",)

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """m_j W, in kg/m³."""
        mass = j.mass * (i.reference / j.reference) if self.contrast else j.mass
        return {"total": mass * ij.W}

    def finish(self, i: Any, sums: Any) -> Adds:
        """With what the particle itself adds, over s."""
        return {"density": (sums.total + i.mass * i.own_kernel) / i.density_sum}


class KernelSum(Law):
    """The kernel's second moment over all neighbours."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """V_j F r²/D."""
        return {"kernel_sum": (ij.weight * ij.square) * (1.0 / i.dim)}


@dataclass(frozen=True)
class DensityFilter(Law):
    """Shepard's filter; a uniform density stays uniform.

    Masses of neighbours are taken at the height of i: what their density differs by in a fluid at
    rest is no noise, and beside walls, where neighbours are on one side, it would be smoothed away.

    Attributes
    ----------
    several
        Whether there are several fluids, each of which is filtered by itself.
    head
        Of a fluid at rest.
    """

    several: bool
    head: HeadOfRest | None = None

    own = ("above", "below")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """m_j W and V_j W."""
        mass = j.mass
        if self.head:
            mass = mass + j.volume * self.head.difference(i, j, ij)
        weight = ij.W
        if self.several:
            weight = where(j.fluid == i.fluid, weight, 0.0)
        return {"above": mass * weight, "below": j.volume * weight}

    def finish(self, i: Any, sums: Any) -> Adds:
        """With what the particle itself adds."""
        own = i.own_kernel
        return {"density_half": (sums.above + i.mass * own) / (sums.below + i.volume * own)}
