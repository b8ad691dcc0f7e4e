r"""Walls that nothing penetrates: the boundary volume fraction.

For fluid particle *i* and the wall particles *S* in its support

.. math:: \varphi_i = \sum_{j\in S} V_j W_{ij}, \qquad
          e_i = -\frac{\nabla\varphi}{|\nabla\varphi|}, \quad
          \nabla\varphi = \sum_{j\in S} V_j \nabla_i W_{ij},

φ is the share of the support that lies in the wall: 0 in the bulk, 1/2 on a plane surface, up to 1
inside; e points from the wall into the fluid. A particle with :math:`\varphi_i \ge 1/2` that still
moves into the wall, :math:`u\cdot e_i < 0` with :math:`u = v_i - v_w`, is bounced back,
:math:`v_i \leftarrow v_w - u`, and leaves the way it came. The wall's velocity :math:`v_w` is the
mean over *S* weighted by :math:`V_j W_{ij}`.

It needs no geometry. The sum is not divided by that over all neighbours, since then a lone particle
anywhere near a wall would look buried. At a corner φ = 1/2 lies about half a spacing off the edge.

Source: Jacob, "SPH-BVF" (2020), chapter 3, where the sum is divided and particles that leave are
turned too.
"""

from __future__ import annotations

import math

from particell.compute.loop import particle_loop
from particell.kernels import power, shape_f, shape_w
from particell.laws.pairs import image_offset

#: The volume fraction on a plane wall, from which on a particle is bounced back.
SURFACE = 0.5


@particle_loop
def bounce_back(
    i,
    x,
    v,
    is_wall,
    volume,
    support,
    split,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    wall_fraction,
    wall_direction,
    wall_speed,
    bounces,
    *,
    DIM,
    KERNEL,
):
    """φ, e and v_w of fluid particle i, and its velocity turned where it moves on into a wall.

    ``bounces[i]`` counts how often that happened.
    """
    if is_wall[i]:
        return
    fraction, square = 0.0, 0.0
    for d in range(DIM):
        wall_direction[i, d] = 0.0
        wall_speed[i, d] = 0.0
    wraps = crosses[i] != 0
    for k in range(split[i], stop[i]):
        j = neighbours[k]
        r2 = 0.0
        for d in range(DIM):
            s = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += s * s
        h = 0.5 * (support[i] + support[j])
        q = math.sqrt(r2) / h
        weight = volume[j] * alpha / power(h, DIM)
        share = weight * shape_w(q, KERNEL)
        fraction += share
        f = weight * shape_f(q, KERNEL) / (h * h)
        for d in range(DIM):
            s = image_offset(x, i, j, d, wraps, period, inverse_period)
            wall_direction[i, d] += f * s
            wall_speed[i, d] += share * v[j, d]
    wall_fraction[i] = fraction
    for d in range(DIM):
        square += wall_direction[i, d] * wall_direction[i, d]
    if square == 0.0 or fraction == 0.0:
        return
    size, approach = 1.0 / math.sqrt(square), 0.0
    for d in range(DIM):
        wall_direction[i, d] *= size
        wall_speed[i, d] /= fraction
        approach += (v[i, d] - wall_speed[i, d]) * wall_direction[i, d]
    if fraction < SURFACE or approach >= 0.0:
        return
    bounces[i] += 1
    for d in range(DIM):
        v[i, d] = 2.0 * wall_speed[i, d] - v[i, d]
