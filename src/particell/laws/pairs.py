"""The geometry of a pair of particles: what every law over pairs begins with."""

from __future__ import annotations

import math

from numba import njit

from particell.compute.loop import FASTMATH
from particell.compute.rounding import nearest_integer
from particell.kernels import power, shape_f, shape_w


@njit(inline="always")
def image_offset(x, i, j, d, wraps, period, inverse_period):
    """Component d of x_i - x_j; of the nearest images where row i ``wraps`` around the domain."""
    s = x[i, d] - x[j, d]
    if wraps:
        s -= period[d] * nearest_integer(s * inverse_period[d])
    return s


@njit(inline="always")
def wall_weight(r2, support, i, j, KERNEL):
    """The kernel, without its normalisation, of fluid particle j for what wall particle i takes."""
    return shape_w(math.sqrt(r2) / (0.5 * (support[i] + support[j])), KERNEL)


@njit(error_model="numpy", fastmath=FASTMATH)
def separation_square(x, i, j, period, inverse_period, DIM):
    """Squared distance of particles i and j, nearest images, in m²."""
    dx = x[i, 0] - x[j, 0]
    dx -= period[0] * nearest_integer(dx * inverse_period[0])
    r2 = dx * dx
    if DIM > 1:
        dy = x[i, 1] - x[j, 1]
        dy -= period[1] * nearest_integer(dy * inverse_period[1])
        r2 += dy * dy
    if DIM > 2:
        dz = x[i, 2] - x[j, 2]
        dz -= period[2] * nearest_integer(dz * inverse_period[2])
        r2 += dz * dz
    return r2


@njit(error_model="numpy", fastmath=FASTMATH)
def pair_f(r2, h, alpha, DIM, KERNEL):
    """F = -W'(r)/r of a pair with mean support h; alpha is the kernel's normalisation."""
    inverse = 1.0 / h
    scale = alpha * power(inverse, DIM) * inverse * inverse
    return scale * shape_f(math.sqrt(r2) * inverse, KERNEL)
