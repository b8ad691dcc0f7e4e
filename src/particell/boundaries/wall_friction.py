r"""Friction with walls, taken implicitly: it is exact for flows at rest and limits no time step.

The friction with the wall particles in the support of fluid particle *i* is
:math:`-\Gamma_i (v_i - v_w)` with a positive D×D matrix (in 1/s)

.. math:: \Gamma_i = \sum_{j \in \mathrm{walls}} \left(1 + \frac{d_j}{d_i}\right) \left[a_{ij} I +
          b_{ij}\, e\,e\right] / m_i .

It grows without another bound than that of :math:`d_i` where a particle comes near a wall
(:mod:`particell.boundaries.wall`): in a corner to six times the friction of the bulk. But the
walls' velocities are given, so :math:`\Gamma_i` couples a particle to nothing but itself, and a
small system of equations a particle makes it implicit. With the acceleration *a* of all forces, in
which all friction is taken at the velocity V half a step ago, the implicit midpoint rule for the
friction with walls is

.. math:: V' = V + \Delta t\, M a, \qquad M = \left(I + \tfrac12 \Delta t\, \Gamma_i\right)^{-1},

which is made of two equal kicks :math:`\tfrac12\Delta t\, M a`. It is stable for any
:math:`\Gamma_i`, and steady where a = 0: steady flows do not depend on it nor on the step.

**With noise** V has the right variance whatever :math:`\Gamma_i` is. The velocity at whole steps,
the mean of V and V', would be too cold: what walls damp within a step of the thermal velocity is
missing in the mean, a variance of :math:`(I - M)\,k_BT/m`. It is drawn (:func:`draw_spread`), added
to v while it is looked at, and taken away before the next step (from velocities that are set
between steps nothing is taken): at whole steps equipartition is then exact, whatever the step. For
the proof write a step as half a kick of all forces but the walls' friction, that friction alone by
Cayley's form :math:`M(I - \tfrac12\Delta t\,\Gamma_i)` with its noise, and the other half of the
kick. In equilibrium the friction between fluid particles with its noise, taken explicitly from V,
leaves the kick uncorrelated with the velocity after its first half, whose covariance is
:math:`k_BT/m`; Cayley's form keeps that.

Splittings of this kind: Leimkuhler & Matthews, Appl. Math. Res. Express 2013, 34.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.loop import particle_loop
from particell.compute.philox import normal_pair, philox

#: What :math:`\Gamma` is: none, a number (friction without a radial part), a symmetric matrix.
FREE, ISOTROPIC, TENSOR = 0, 1, 2


def friction_width(held: int, dim: int) -> int:
    """Numbers of Γ a particle: of a matrix its upper triangle, row by row."""
    return dim * (dim + 1) // 2 if held == TENSOR else 1


@njit(inline="always")
def slowed(i, wall_friction, s, ax, ay, az, DIM, HELD):
    """(I + s Γ_i)⁻¹ (ax, ay, az), of which the first DIM components count."""
    if HELD == 1 or DIM == 1:
        m = 1.0 / (1.0 + s * wall_friction[i, 0])
        return m * ax, m * ay, m * az
    if DIM == 2:
        a = 1.0 + s * wall_friction[i, 0]
        b = s * wall_friction[i, 1]
        d = 1.0 + s * wall_friction[i, 2]
        inverse = 1.0 / (a * d - b * b)
        return inverse * (d * ax - b * ay), inverse * (a * ay - b * ax), 0.0
    a = 1.0 + s * wall_friction[i, 0]
    b = s * wall_friction[i, 1]
    c = s * wall_friction[i, 2]
    d = 1.0 + s * wall_friction[i, 3]
    e = s * wall_friction[i, 4]
    f = 1.0 + s * wall_friction[i, 5]
    xx, xy, xz = d * f - e * e, c * e - b * f, b * e - c * d
    yy, yz, zz = a * f - c * c, b * c - a * e, a * d - b * b
    inverse = 1.0 / (a * xx + b * xy + c * xz)
    return (
        inverse * (xx * ax + xy * ay + xz * az),
        inverse * (xy * ax + yy * ay + yz * az),
        inverse * (xz * ax + yz * ay + zz * az),
    )


@particle_loop
def draw_spread(
    i,
    id,
    is_wall,
    group,
    mass,
    thermal,
    wall_friction,
    v,
    velocity_spread,
    step,
    half_step,
    key0,
    key1,
    *,
    DIM,
    HELD,
):
    """Add to v what the mean of both half steps lacks beside walls, of variance (I − M) k_BT/m.

    It is L ξ with the Cholesky factor L of I − M and D normal numbers of particle and step.
    ``velocity_spread`` keeps it.
    """
    if is_wall[i] != 0 or wall_friction[i, 0] == 0.0:
        for d in range(DIM):
            velocity_spread[i, d] = 0.0
        return
    number = np.uint64(step)
    low, high = number & np.uint64(0xFFFFFFFF), number >> np.uint64(32)
    w0, w1, w2, w3 = philox(np.uint64(id[i]), np.uint64(0), low, high, key0, key1)
    n0, n1 = normal_pair(w0, w1)
    n2, _ = normal_pair(w2, w3)
    size = math.sqrt(thermal[group[i]] / mass[i])
    x0, x1, x2 = slowed(i, wall_friction, half_step, 1.0, 0.0, 0.0, DIM, HELD)
    first = math.sqrt(max(1.0 - x0, 0.0))
    velocity_spread[i, 0] = size * first * n0
    if DIM > 1:
        _, y1, y2 = slowed(i, wall_friction, half_step, 0.0, 1.0, 0.0, DIM, HELD)
        below = -x1 / first if first > 0.0 else 0.0
        second = math.sqrt(max(1.0 - y1 - below * below, 0.0))
        velocity_spread[i, 1] = size * (below * n0 + second * n1)
        if DIM > 2:
            _, _, z2 = slowed(i, wall_friction, half_step, 0.0, 0.0, 1.0, DIM, HELD)
            left = -x2 / first if first > 0.0 else 0.0
            middle = (-y2 - left * below) / second if second > 0.0 else 0.0
            third = math.sqrt(max(1.0 - z2 - left * left - middle * middle, 0.0))
            velocity_spread[i, 2] = size * (left * n0 + middle * n1 + third * n2)
    for d in range(DIM):
        v[i, d] += velocity_spread[i, d]


@particle_loop
def take_spread(i, v, velocity_spread, *, DIM):
    """Take away from v what :func:`draw_spread` added."""
    for d in range(DIM):
        v[i, d] -= velocity_spread[i, d]
