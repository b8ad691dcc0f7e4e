r"""Pressure force.

.. math:: m_i a_i = \sum_j m_i m_j \left(\frac{P_i}{\rho_i^2} + \frac{P_j}{\rho_j^2}\right)
          F_{ij}\, x_{ij}

Antisymmetric in i and j: it conserves momentum, and angular momentum since it is central. With the
density summed it derives from the internal energy (Español & Revenga, Phys. Rev. E 67 (2003)
026705, Eq. 30, with :math:`d_i = \rho_i/m_i`).

Where fluids of several reference densities :math:`\rho_0` meet, masses and densities are taken in
units of their own fluid's,

.. math:: m_i a_i = \sum_j V^0_i V^0_j
          \left(\frac{P_i}{\varrho_i^2} + \frac{P_j}{\varrho_j^2}\right) F_{ij}\, x_{ij},
          \qquad V^0 = \frac m{\rho_0}, \quad \varrho = \frac\rho{\rho_0},

which is the same with one fluid, and derives from the internal energy with
:math:`\varrho_i = \frac1s\sum_j V^0_j W_{ij}`. With masses and densities themselves a uniform
pressure P would press two particles whose densities are r to 1 apart with :math:`(r + 1/r)P`
where it presses others with 2P: a tension between the fluids, or, where P is negative, the
opposite of one, which tears them into each other. And a sum of masses would give particles beside
a denser fluid a density, and so a pressure, which is half of that one's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from particell.compute.expressions import where
from particell.laws.law import Adds, Law

#: What stands with P_j/ρ_j²: P_i/ρ_i², minus it, or the one whose pair repels.
FORMS = ("symmetric", "difference", "switched")


@dataclass(frozen=True)
class PressureForce(Law):
    """Acceleration by pressure, of what the fluid at rest does not have.

    Attributes
    ----------
    form
        ``"symmetric"`` as above. ``"difference"`` with P_j/ρ_j² − P_i/ρ_i²: nothing where that is
        uniform, whatever the arrangement, but momentum is conserved to the scheme's order only.
        ``"switched"``: a pair that attracts uses the difference (Jacob, thesis, UCSB 2020), which
        suppresses cavitation; where it acts momentum is not conserved.
    contrast
        Whether reference densities differ.
    """

    form: str = "symmetric"
    contrast: bool = False

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """m_j (P_i/ρ_i² + P_j/ρ_j²) F x_ij, in m/s²."""
        own, its, mass = i.pressure_over_square, j.pressure_over_square, j.mass
        if self.contrast:
            own, its = own * (i.reference * i.reference), its * (j.reference * j.reference)
            mass = (mass / j.reference) * (1.0 / i.reference)
        if self.form == "difference":
            own = -own
        elif self.form == "switched" and not ij.wall:
            own = where(own + its >= 0.0, own, -own)
        return {"a": (mass * (own + its) * ij.F) * ij.x}
