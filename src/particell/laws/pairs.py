"""The geometry of a pair of particles: what every law over pairs begins with."""

from __future__ import annotations

from numba import njit

from particell.compute.rounding import nearest_integer


@njit(inline="always")
def image_offset(x, i, j, d, wraps, period, inverse_period):
    """Component d of x_i - x_j; of the nearest images where row i ``wraps`` around the domain."""
    s = x[i, d] - x[j, d]
    if wraps:
        s -= period[d] * nearest_integer(s * inverse_period[d])
    return s
