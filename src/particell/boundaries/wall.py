r"""Solid walls made of layers of fixed particles.

Wall particle *j* carries the unit normal :math:`n_j` (into the fluid) and the curvature
:math:`k_j` of the wall's surface at the point :math:`s_j = x_j + d_j n_j` nearest to it, and its
depth :math:`d_j` below that surface. In a sum of fluid particle *i* a field with the surface value
:math:`f_w` is extrapolated linearly through the surface,

.. math:: f_j = f_w - \frac{d_j}{d_i} (f_i - f_w), \qquad f_i - f_j = (1 + d_j/d_i)(f_i - f_w),

with :math:`d_i` the distance of *i* from the surface, bounded below. Without it everything near a
wall is first order (Morris, Fox & Zhu, J. Comput. Phys. 136 (1997) 214).
"""

from __future__ import annotations

import math

from numba import njit

#: Smallest distance of a fluid particle from a wall's surface in d_j/d_i, in units of its support.
CLOSEST = 0.1
LEAST_RADIUS = 0.2


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
def shear(distance, curvature, DIM):
    """TODO."""
    bend = max(1.0 + curvature * distance, LEAST_RADIUS)
    if DIM == 2 and curvature != 0.0:
        return math.log(bend) / curvature
    if DIM == 3:
        return distance / bend
    return distance


@njit
def extrapolation(distance, depth, support, curvature, DIM):
    """The factor 1 + d_j/d_i by which a difference to the wall's value grows."""
    above = shear(max(distance, CLOSEST * support), curvature, DIM)
    return 1.0 - shear(-depth, curvature, DIM) / above


@njit(inline="always")
def plane_extrapolation(i, dx, dy, dz, wall_direction, wall_distance, support, DIM):
    """The same for a wall particle at x_i − (dx, dy, dz) of a wall without a known surface.

    With the direction and the distance d_i of :mod:`particell.boundaries.volume_fraction`, and
    what is left of the way to the particle as its depth.
    """
    along = wall_direction[i, 0] * dx
    if DIM > 1:
        along += wall_direction[i, 1] * dy
    if DIM > 2:
        along += wall_direction[i, 2] * dz
    return extrapolation(wall_distance[i], max(along - wall_distance[i], 0.0), support, 0.0, DIM)
