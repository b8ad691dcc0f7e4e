r"""Fluxes between particles that move with another velocity than that of their momentum.

Particles are moved by the transport velocity :math:`\tilde v = v + \delta v` and carry the momentum
of :math:`v`; :math:`\delta v` is that of :mod:`particell.laws.shifting`. Along the path of a
particle (arbitrary Lagrangian-Eulerian form) the density follows

.. math::

   \frac{\tilde d\rho}{dt} = -\rho\,\nabla\cdot v + \delta v\cdot\nabla\rho ,

by default with the first-order consistent gradient (Randles & Libersky, Comput. Methods Appl. Mech.
Eng. 139 (1996) 375), exact for linear v and ρ on any arrangement of particles,

.. math::

   \frac{\tilde d\rho_i}{dt} = \mathrm{tr}\,(G\,T^{-1}), \qquad
   G = \sum_j V_j F_{ij}\,[-\rho_i v_{ij} + (\rho_i - \rho_j)\,\delta v_i]\,x_{ij}^T, \qquad
   T = \sum_j V_j F_{ij}\,x_{ij} x_{ij}^T ,

or in the form without T that tracks the arrangement, with the divergence of the velocity that
particles move with,

.. math::

   \frac{\tilde d\rho_i}{dt} = -\rho_i \sum_j V_j F_{ij}\,\tilde v_{ij}\cdot x_{ij}
   + \sum_j V_j\,(\rho_i\,\delta v_i + \rho_j\,\delta v_j)\cdot\nabla_i W_{ij},
   \qquad \nabla_i W_{ij} = -F_{ij}\,x_{ij}.

(The first form without T lets the density climb without end. The second form with T is unstable:
δv points along the sum over ∇W, and its two terms balance only if both have the same gradient.)
For the momentum one of

.. math::

   \left.\frac{\tilde dv_i}{dt}\right|_{\delta v}
   = \sum_j V_j \frac{\rho_j}{\rho_i}\,(v_j - v_i)\,\delta v_j\cdot\nabla_i W_{ij}
   \qquad\text{or}\qquad
   \sum_j m_j\left(\frac{v_i\,\delta v_i}{\rho_i} + \frac{v_j\,\delta v_j}{\rho_j}\right)
   \cdot\nabla_i W_{ij},

both of which stand for :math:`\delta v\cdot\nabla v`. The first ("uniform") leaves a uniform
velocity uniform to round-off, the second ("conserving") is antisymmetric and conserves momentum;
neither does both. Only fluid particles take part in what δv carries.

Units: ρ in kg/m³, v and δv in m/s, V in m^D, F in 1/m^(D+2), x in m.

References
----------
Adami, Hu & Adams, J. Comput. Phys. 241 (2013) 292, Eqs. 8 and 13 (the conserving form); Jacob,
thesis, UCSB 2020, whose continuity equation is the first form without T.
"""

from __future__ import annotations

from numba import njit

#: Determinant of T below which there are too few neighbours on some side to divide by T.
SMALLEST = 0.05


@njit(inline="always")
def consistent_trace(txx, tyy, tzz, txy, tyz, tzx, gxx, gyy, gzz, gxy, gyz, gzx):
    """tr(G T⁻¹), or tr G where T is nearly singular.

    ``gxy`` is G_xy + G_yx, and so on; T is symmetric. In fewer than three dimensions give 1 for
    the missing diagonal elements of T and 0 for all else.
    """
    cxx = tyy * tzz - tyz * tyz
    cyy = tzz * txx - tzx * tzx
    czz = txx * tyy - txy * txy
    cxy = tyz * tzx - txy * tzz
    cyz = tzx * txy - tyz * txx
    czx = txy * tyz - tzx * tyy
    determinant = txx * cxx + txy * cxy + tzx * czx
    total = gxx * cxx + gyy * cyy + gzz * czz + gxy * cxy + gyz * cyz + gzx * czx
    return total / determinant if determinant > SMALLEST else gxx + gyy + gzz


@njit
def mass_flux(weight, density_i, density_j, shift_dot_x_i, shift_dot_x_j):
    """The pair's part of the density's rate by δv, in kg/m³/s; ``weight`` is V_j F_ij.

    ``shift_dot_x_i`` and ``…_j`` are δv_i·x_ij and δv_j·x_ij.
    """
    return -weight * (density_i * shift_dot_x_i + density_j * shift_dot_x_j)


@njit
def uniform_flux(weight, density_ratio, shift_dot_x_j):
    """What multiplies v_ij = v_i − v_j in the uniform form, in 1/s; the ratio is ρ_j/ρ_i."""
    return weight * density_ratio * shift_dot_x_j


@njit
def conserving_flux(weight, density_ratio, shift_dot_x_i):
    """What multiplies v_i in the conserving form, in 1/s; the ratio is ρ_j/ρ_i.

    For the part of v_j give δv_j·x_ij and the ratio 1: m_j/ρ_j is V_j.
    """
    return -weight * density_ratio * shift_dot_x_i


@njit
def switched_term(term_i, term_j):
    """P_i/ρ_i², with its sign changed where the pair attracts: what suppresses cavitation.

    A pair with P_i/ρ_i² + P_j/ρ_j² < 0 uses P_j/ρ_j² − P_i/ρ_i² instead (Jacob, thesis, UCSB 2020).
    That is not symmetric: momentum is not conserved where it acts.
    """
    return term_i if term_i + term_j >= 0.0 else -term_i
