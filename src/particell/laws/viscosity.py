r"""Viscous force with shear and bulk viscosity, right in D = 1, 2, 3 dimensions.

.. math::

   m_i a_i = -\sum_j \left[a_{ij} v_{ij} + b_{ij}\, e\,(e\cdot v_{ij})\right],\quad
   a = (2\eta-\lambda)\,\frac{F_{ij}}{d_i d_j},\quad b = (D+2)\,\lambda\,\frac{F_{ij}}{d_i d_j},
   \quad \lambda = \zeta + \eta\,(1 - 2/D)

with number densities :math:`d = \rho/m` and :math:`e = x_{ij}/r`. This is the form of Español &
Revenga (Phys. Rev. E 67 (2003) 026705, Eq. 30) written for any D: with D = 3 the coefficients are
5η/3 − ζ and 5(ζ + η/3). Using those in two dimensions would give 25/24 of the viscosity.
"""

from __future__ import annotations

from numba import njit

from particell.errors import InputError


def friction_coefficients(shear: float, bulk: float, dim: int) -> tuple[float, float]:
    """The factors 2η − λ and (D+2)λ of F/(d_i d_j), in Pa s.

    Raises
    ------
    InputError
        Where 2η < λ, for which the transverse friction would be negative.
    """
    lam = bulk + shear * (1.0 - 2.0 / dim)
    transverse, radial = 2.0 * shear - lam, (dim + 2) * lam
    if transverse < 0 or transverse + radial < 0:
        raise InputError("bulk_viscosity", bulk, f"such that 0 <= 2η − λ; here λ = {lam:g} Pa s")
    return transverse, radial


@njit
def pair_friction(weight, inverse_density):
    """F/(d_i d_j m_i) = V_j F_ij/ρ_i, what the :func:`friction_coefficients` are multiplied by."""
    return weight * inverse_density


@njit
def harmonic_mean(a, b):
    """2ab/(a + b), and 0 where both are 0: the coefficient of a pair of two materials.

    It is taken of the transverse coefficient a and of the longitudinal one a + b, neither of which
    is negative, so that friction and noise exist for every pair of materials.
    """
    total = a + b
    return 2.0 * a * (b / total) if total > 0.0 else 0.0


@njit
def sheared(transverse, radial, along, DIM):
    """(a + b e_t²)/η, what a pair's friction counts for in shear along a wall; 2 without b.

    ``along`` is e_n², n the wall's normal, and e_t² the mean of the other squares (in one dimension
    e_n²); η is ½ (a + b/(D + 2)).
    """
    across = along if DIM == 1 else (1.0 - along) / (DIM - 1)
    shear = transverse + radial / (DIM + 2)
    return 2.0 * (transverse + radial * across) / shear if shear > 0.0 else 2.0
