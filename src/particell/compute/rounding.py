"""Rounding that compiles to the same few instructions on CPUs and GPUs."""

from __future__ import annotations

from numba import njit

#: 1.5 * 2**52: next to it double-precision numbers are whole and round to even.
_WHOLE = 6755399441055744.0


@njit
def nearest_integer(s):
    """The whole number nearest to s for abs(s) < 2**51, as a float (``rint``; NaN stays NaN).

    CUDA has no ``numpy.rint``. Loops leave re-association out, so that compilers keep the sums.
    """
    return (s + _WHOLE) - _WHOLE
