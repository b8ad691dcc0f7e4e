"""The geometry of a pair of particles: what every law over pairs begins with."""

from __future__ import annotations

import math

from numba import njit

from particell.compute.rounding import nearest_integer
from particell.kernels import shape_w


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
