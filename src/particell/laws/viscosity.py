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

from dataclasses import dataclass
from typing import Any

from numba import njit

from particell.boundaries.wall import MOST_MISSED
from particell.compute.expressions import Number, Symmetric, minimum, where
from particell.errors import InputError
from particell.laws.law import Adds, Law

TINY = 1e-150


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


def harmonic_mean(a: Number, b: Number) -> Number:
    """2ab/(a + b), and 0 where both are 0: the coefficient of a pair of two materials.

    It is taken of the transverse coefficient a and of the longitudinal one a + b, neither of which
    is negative, so that friction and noise exist for every pair of materials.
    """
    if a is b:
        return a
    total = a + b
    return where(total > 0.0, 2.0 * a * (b / where(total > 0.0, total, 1.0)), 0.0)


@dataclass(frozen=True)
class Viscosity(Law):
    """Friction of a pair, and of that with walls the matrix that makes it implicit.

    Attributes
    ----------
    radial
        Whether b is not zero.
    normalised
        Friction is divided by the mean of both kernel sums.
    exact_at_walls
        Friction beside walls is exact for quadratic profiles (:mod:`particell.boundaries.wall`).
    walls
        Whether there are any.
    """

    radial: bool
    normalised: bool = False
    exact_at_walls: bool = False
    walls: bool = False

    own = ("drag", "bend", "whole", "held", "held_along")

    def coefficients(self, i: Any, j: Any) -> tuple[Number, Number]:
        """a and b of the pair, in Pa s."""
        across = harmonic_mean(i.transverse, j.transverse)
        if i.radial is j.radial and i.transverse is j.transverse:
            return across, i.radial
        both = harmonic_mean(i.transverse + i.radial, j.transverse + j.radial)
        return across, both - across

    def friction(self, i: Any, j: Any, ij: Any) -> Number:
        """F/(d_i d_j m_i) = V_j F/ρ_i, by which the coefficients are multiplied."""
        friction = ij.weight * i.specific_volume
        if self.normalised:
            friction = friction / (0.5 * (i.kernel_sum + j.kernel_sum))
        return friction

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """−(a v_ij + b e e·v_ij) F/(d_i d_j m_i), in m/s²."""
        across, along = self.coefficients(i, j)
        friction = self.friction(i, j, ij)
        drag = -(across * friction) * ij.v
        if self.radial:
            drag = drag - (along * friction * ij.v.dot(ij.e)) * ij.e
        adds = {"drag" if self.exact_at_walls else "a": drag}
        if self.exact_at_walls:
            adds["whole"] = friction * ij.square
        if ij.wall:
            if self.exact_at_walls:
                adds["bend"] = friction * ij.missed
            held = friction * ij.extrapolation
            adds["held"] = held
            if self.radial:
                adds["held_along"] = held * ij.e.outer(ij.e)
        return adds

    def finish(self, i: Any, sums: Any) -> Adds:
        """What is missed beside walls is made up for; Γ in 1/s."""
        more: Number = 1.0
        adds: dict[str, Any] = {}
        dim = i.dim
        if self.exact_at_walls:
            missed = dim * sums.bend / where(sums.whole > 0.0, sums.whole, 1.0)
            more = 1.0 / (1.0 - minimum(missed, MOST_MISSED))
            adds["a"] = more * sums.drag
        if self.walls:
            held = (more * i.transverse) * sums.held
            if self.radial:
                held = Symmetric.unit(dim, held) + (more * i.radial) * sums.held_along
            adds["wall_friction"] = held
        return adds


@njit
def sheared(transverse, radial, along, DIM):
    """(a + b e_t²)/η, what a pair's friction counts for in shear along a wall; 2 without b.

    ``along`` is e_n², n the wall's normal, and e_t² the mean of the other squares (in one dimension
    e_n²); η is ½ (a + b/(D + 2)).
    """
    across = along if DIM == 1 else (1.0 - along) / (DIM - 1)
    shear = transverse + radial / (DIM + 2)
    return 2.0 * (transverse + radial * across) / shear if shear > 0.0 else 2.0
