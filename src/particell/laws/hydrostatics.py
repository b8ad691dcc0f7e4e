r"""The pressure of a fluid at rest, taken out of what pairs of particles exert.

Where a fluid fills the space between walls, its pressure is written as

.. math::

   P = P^H + P', \qquad P^H(s) = \int w\,ds, \qquad
   w(s) = \langle \rho\, f\cdot e \rangle_s, \qquad s = e\cdot x,

with f the body force per mass (gravity and buoyancy, along directions that are not periodic), e the
direction in which it acts and w(s) the mean weight per volume of what is at s: at the start, and
with fluids of several densities every few steps. Pairs
exert :math:`P'` alone, and the exact gradient of :math:`P^H` acts on each particle,

.. math::

   a_i = \sum_j m_j \Bigl(\frac{P'_i}{\rho_i^2} + \frac{P'_j}{\rho_j^2}\Bigr) F_{ij}\, x_{ij}
   + f_i - \frac{w(s_i)}{\rho_i}\, e + \ldots

Any smooth function of s could be taken out, another one at any time. With this one a fluid at rest
exerts nothing, whatever kernel, support and arrangement. With the whole pressure the sum over pairs
is a gradient only as far as :math:`\sum_j V_jF_{ij}\,x_{ij}x_{ij}^T = I`, which is off by up to 2
%; and it is a force of the arrangement besides, in proportion to P: where that is negative, as in
the upper half of a closed column, particles clump, and where it is positive they pair at some
supports. Both go on for ever where density diffuses (:mod:`particell.laws.continuity`), since it
then does not know the arrangement. Taking the weight out of the pressure is common in ocean models
and in well-balanced schemes for the shallow water equations.

w and its integral are tables over s at equal intervals. ``rest_axis`` holds e, the s where they
begin, the number of intervals per metre, and their length in m.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numba import njit

from particell.compute.expressions import Vector, call, symbol
from particell.laws.law import Adds, Law


@njit(inline="always")
def rest_height(i, x, rest_axis, DIM):
    """s of particle i in intervals of the table."""
    s = -rest_axis[DIM]
    for d in range(DIM):
        s += rest_axis[d] * x[i, d]
    return s * rest_axis[DIM + 1]


@njit
def rest_interval(height, rest_weight):
    """The number of the table's interval where s is; the last ones go on outside."""
    return min(max(int(height), 0), rest_weight.shape[0] - 2)


@njit
def rest_weight_at(height, rest_weight):
    """w in Pa/m."""
    k = rest_interval(height, rest_weight)
    return rest_weight[k] + (height - k) * (rest_weight[k + 1] - rest_weight[k])


@njit
def rest_pressure_at(height, interval, rest_weight, rest_pressure):
    """P^H in Pa: the integral of w, which is linear between the table's places."""
    k = rest_interval(height, rest_weight)
    t = height - k
    slope = 0.5 * (rest_weight[k + 1] - rest_weight[k])
    return rest_pressure[k] + interval * t * (rest_weight[k] + t * slope)


@dataclass(frozen=True)
class Weight(Law):
    """Gravity, and the gradient of the pressure at rest; with ``buoyancy`` that force too."""

    buoyancy: bool = False

    def finish(self, i: Any, sums: Any) -> Adds:
        """f_i − w(s_i) e/ρ_i, in m/s²."""
        force = i.gravity + i.buoyancy if self.buoyancy else i.gravity
        return {"a": force - (i.rest_weight * i.specific_volume) * i.rest_direction}


def _array(name: str) -> Any:
    return symbol("array", name)


def _interval(p: Any) -> Any:
    return symbol("array", "rest_axis", "", p.dim + 2)


def _place(p: Any) -> Any:
    """s of a particle, in intervals of the table."""
    return call(rest_height, (p.index, _array("x"), _array("rest_axis"), p.dim))


def _direction(p: Any) -> Vector:
    return Vector.of("e", [symbol("array", "rest_axis", "", d) for d in range(p.dim)])


def _pressure(p: Any) -> Any:
    tables = (_array("rest_weight"), _array("rest_pressure"))
    return call(rest_pressure_at, (_place(p), _interval(p), *tables))


#: What laws read of a fluid at rest: s in m (from where the table begins), w in Pa/m, P^H in Pa, e.
AT_REST = {
    "rest_height": lambda p: _place(p) * _interval(p),
    "rest_weight": lambda p: call(rest_weight_at, (_place(p), _array("rest_weight"))),
    "rest_pressure": _pressure,
    "rest_direction": _direction,
}
