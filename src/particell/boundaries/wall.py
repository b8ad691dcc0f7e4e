r"""Solid walls made of layers of fixed particles.

Wall particle *j* carries the unit normal :math:`n_j` (into the fluid) and the curvature
:math:`k_j` of the wall's surface at the point :math:`s_j = x_j + d_j n_j` nearest to it, and its
depth :math:`d_j` below that surface. In a sum of fluid particle *i* a field with the surface value
:math:`f_w` is extrapolated through the surface along the profile of a steady layer that nothing
drives, :math:`f - f_w \propto s(d)` with :math:`(r^{D-1} s')' = 0`,

.. math:: f_j = f_w + \frac{s(-d_j)}{s(d_i)} (f_i - f_w), \qquad
          s(d) = \begin{cases} d & \text{planes}\\ \ln(1 + k d)/k & D = 2\\
          d/(1 + k d) & D = 3 \end{cases}

with :math:`d_i` the distance of *i* from the surface, bounded below: the difference is multiplied
by :math:`1 - s(-d_j)/s(d_i)`, on planes :math:`1 + d_j/d_i`. Without it everything near a wall is
first order (Morris, Fox & Zhu, J. Comput. Phys. 136 (1997) 214). A straight line instead of *s* has
the wrong second derivative, by :math:`-(D-1)k s'`: round a body of five spacings that costs 2 % of
the drag of cylinders and 4 % of that of spheres.

**What drives the layer** (pressure, body forces) bends its profile too:
:math:`v - v_w = \alpha s(d) + \frac12 L d^2` with :math:`L = \nabla^2 v` at the wall, and the
extrapolation misses :math:`L q_{ij}`, :func:`missed`,

.. math:: q_{ij} = \frac12 \left(d_j^2 - \frac{s(-d_j)}{s(d_i)}\,d_i^2\right) .

The sum over pairs, :math:`2\sum_j V_j F_{ij} (v_j - v_i)`, then is :math:`(1 - C_i) S_i L` with

.. math:: C_i = \frac{2}{S_i} \sum_{j \in \mathrm{walls}} V_j F_{ij}\, q_{ij}, \qquad
          S_i = \frac1D \sum_j V_j F_{ij}\, r_{ij}^2,

and the kernel sum :math:`S_i`, about 1, is the bulk's factor too. Both are known from places alone:
friction of fluid particles is divided by :math:`1 - C_i`. It is exact for quadratic profiles beside
plane walls, and the velocity between two plates has no error but that of the kernel sum. What is
added acts between particle and wall. C is at most 1/2 beside a plane, and no more is taken off in
corners. With radial friction it is that for shear along the wall
(:func:`particell.laws.viscosity.sheared`). With thermal noise it is left out, for equipartition
needs friction that is symmetric in all pairs.
"""

from __future__ import annotations

import math

from numba import njit

#: Smallest distance of a fluid particle from a wall's surface in d_j/d_i, in units of its support.
CLOSEST = 0.1
#: Smallest part of the radius of curvature at which s(d), which has its pole at zero, is taken.
LEAST_RADIUS = 0.2
#: Below this k d the surface is a plane.
FLAT = 1e-6
#: The most of C that is taken off, that of a plane wall.
MOST_MISSED = 0.5


@njit
def surface_distance(tx, ty, tz, nx, ny, nz, curvature):
    """Distance from a wall's surface of the point at t from the surface point with normal n.

    Exact for planes (curvature 0), circles and spheres (1/radius, positive for a convex body,
    negative for a cavity): with k the curvature, (2 n·t + k t²)/(1 + |n + k t|).
    """
    along = nx * tx + ny * ty + nz * tz
    square = tx * tx + ty * ty + tz * tz
    across = 1.0 + curvature * (2.0 * along + curvature * square)
    return (2.0 * along + curvature * square) / (1.0 + math.sqrt(max(across, 0.0)))


@njit
def layer_profile(distance, curvature, DIM):
    """s(d) at a distance d from a surface (negative inside the wall), in m."""
    if abs(curvature * distance) < FLAT or DIM == 1:
        return distance
    ratio = max(1.0 + curvature * distance, LEAST_RADIUS)
    if DIM == 2:
        return math.log(ratio) / curvature
    return (ratio - 1.0) / (ratio * curvature)


@njit
def extrapolation(distance, depth, support, curvature, DIM):
    """The factor 1 − s(−d_j)/s(d_i) by which a difference to the wall's value grows."""
    above = layer_profile(max(distance, CLOSEST * support), curvature, DIM)
    return 1.0 - layer_profile(-depth, curvature, DIM) / above


@njit
def missed(distance, depth, support, grow):
    """q_ij in m², with the factor ``grow`` of :func:`extrapolation`."""
    above = max(distance, CLOSEST * support)
    return 0.5 * (depth * depth + (grow - 1.0) * above * above)


@njit(inline="always")
def plane_distances(i, dx, dy, dz, wall_direction, wall_distance, DIM):
    """d_i and d_j for a wall particle at x_i − (dx, dy, dz) of a wall without a known surface.

    The direction and the distance d_i are those of :mod:`particell.boundaries.volume_fraction`; d_j
    is what is left of the way to the particle.
    """
    along = wall_direction[i, 0] * dx
    if DIM > 1:
        along += wall_direction[i, 1] * dy
    if DIM > 2:
        along += wall_direction[i, 2] * dz
    return wall_distance[i], max(along - wall_distance[i], 0.0)
