r"""Pressure force.

.. math:: m_i a_i = \sum_j m_i m_j \left(\frac{P_i}{\rho_i^2} + \frac{P_j}{\rho_j^2}\right)
          F_{ij}\, x_{ij}

Antisymmetric in i and j: it conserves momentum, and angular momentum since it is central. With the
density summed it derives from the internal energy (Español & Revenga, Phys. Rev. E 67 (2003)
026705, Eq. 30, with :math:`d_i = \rho_i/m_i`).
"""

from __future__ import annotations

from numba import njit


@njit
def pressure_acceleration(mass_j, pressure_term_i, pressure_term_j, f):
    """What multiplies x_ij in the acceleration of i; the terms are P/ρ²."""
    return mass_j * (pressure_term_i + pressure_term_j) * f
