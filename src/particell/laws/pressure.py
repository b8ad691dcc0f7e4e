r"""Pressure force.

.. math:: m_i a_i = \sum_j m_i m_j \left(\frac{P_i}{\rho_i^2} + \frac{P_j}{\rho_j^2}\right)
          F_{ij}\, x_{ij}

Antisymmetric in i and j: it conserves momentum, and angular momentum since it is central. With the
density summed it derives from the internal energy (Español & Revenga, Phys. Rev. E 67 (2003)
026705, Eq. 30, with :math:`d_i = \rho_i/m_i`).
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
    """

    form: str = "symmetric"

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """m_j (P_i/ρ_i² + P_j/ρ_j²) F x_ij, in m/s²."""
        own, its = i.pressure_over_square, j.pressure_over_square
        if self.form == "difference":
            own = -own
        elif self.form == "switched" and not ij.wall:
            own = where(own + its >= 0.0, own, -own)
        return {"a": (j.mass * (own + its) * ij.F) * ij.x}
