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

from dataclasses import dataclass
from typing import Any

from numba import njit

from particell.compute.expressions import Vector, call
from particell.laws.law import Adds, Law

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


class ConsistentContinuity(Law):
    """The density's rate with the first-order consistent gradient."""

    own = ("moments", "gradient")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """What the pair adds to T and to G."""
        flow = (-i.density * ij.weight) * ij.v
        if not ij.wall:
            flow = flow + (ij.weight * (i.density - j.density)) * i.shift_velocity
        return {"moments": ij.weight * ij.x.outer(ij.x), "gradient": flow.outer(ij.x)}

    def finish(self, i: Any, sums: Any) -> Adds:
        """tr(G T⁻¹) in kg/m³/s."""
        t, g = _six(sums.moments, i.dim, 1.0, 1.0), _six(sums.gradient, i.dim, 0.0, 2.0)
        return {"density_rate": call(consistent_trace, (*t, *g))}


def _six(tensor: Any, dim: int, missing: float, mixed: float) -> tuple[Any, ...]:
    """xx, yy, zz, xy, yz, zx, the latter ``mixed`` times; ``missing`` on the rest's diagonal."""
    values = tensor.values
    diagonal = [values.get((d, d), missing) for d in range(3)]
    return (*diagonal, *(mixed * values.get(k, 0.0) for k in ((0, 1), (1, 2), (0, 2))))


class TransportContinuity(Law):
    """The density's rate that tracks the arrangement, without T."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """−ρ_i V_j F ṽ_ij·x_ij − V_j F (ρ_i δv_i + ρ_j δv_j)·x_ij, in kg/m³/s."""
        own, its = i.shift_velocity.dot(ij.x), j.shift_velocity.dot(ij.x)
        along = ij.v.dot(ij.x) + (own - its) * ij.extrapolation
        rate = -i.density * (ij.weight * along)
        if not ij.wall:
            rate = rate - ij.weight * (i.density * own + j.density * its)
        return {"density_rate": rate}


#: Forms of :class:`MomentumFlux`.
FORMS = ("none", "uniform", "conserving")


@dataclass(frozen=True)
class MomentumFlux(Law):
    """The rate of velocity by δv; only fluid particles take part.

    Attributes
    ----------
    form
        ``"uniform"``, ``"conserving"`` or ``"none"``.
    """

    form: str

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """In m/s²."""
        zero = Vector.of("zero", [0.0] * i.dim)
        if ij.wall or self.form == "none":
            return {"flux": zero}
        ratio = j.density * i.specific_volume
        its = ij.weight * j.shift_velocity.dot(ij.x)
        if self.form == "uniform":
            return {"flux": (its * ratio) * ij.v}
        own = ij.weight * ratio * i.shift_velocity.dot(ij.x)
        return {"flux": -own * i.v + -its * (i.v - ij.v)}
