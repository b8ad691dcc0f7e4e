"""Rounding that compiles to the same few instructions on CPUs and GPUs."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

#: 1.5 * 2**52: next to it double-precision numbers are whole and round to even.
_WHOLE = 6755399441055744.0


@njit(fastmath=False)  # re-association would cancel the sum, and leave s
def nearest_integer(s):
    """The whole number nearest to s for abs(s) < 2**51, as a float (``rint``; NaN stays NaN).

    CUDA has no ``numpy.rint``.
    """
    return (s + _WHOLE) - _WHOLE


@njit
def nearest_whole(s):
    """The same for vectorised loops, where re-association is allowed; halves are rounded up."""
    return np.float64(math.floor(s + 0.5))
