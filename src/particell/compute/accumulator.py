"""Numbers of double precision as whole numbers, which add up exactly in any order.

Each is put into an accumulator of bins of 32 bits that spans all of double precision (Kulisch);
bins are 64-bit integers.

References
----------
Kulisch, Computer Arithmetic and Validity (2008), chapter 8.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

#: Bin b counts 2^(32 b - 1088): a number of 53 bits lies in three, the largest in the 65th to 67th.
BINS = 70
#: What is no number has bins of its own: how often it was added.
INFINITE, MINUS_INFINITE, NOT_A_NUMBER = BINS, BINS + 1, BINS + 2
WIDTH = BINS + 3

_LOW = np.int64(0xFFFFFFFF)
_FRACTION = np.int64(0xFFFFFFFFFFFFF)
_HIDDEN = np.int64(1 << 52)
_32 = np.int64(32)
#: One, in units of the first bin.
UNIT = 1 << 1088


@njit(inline="always")
def carry(bins, row):
    """Bring the bins of a row between 0 and 2^32 - 1, but for the last, which has the sign."""
    for b in range(BINS - 1):
        over = bins[row, b] >> _32
        bins[row, b] -= over << _32
        bins[row, b + 1] += over


@njit(inline="always")
def whole_parts(number):
    """The lowest of three bins that hold a number, and what to add to each of them.

    What is no number counts itself in the bin that there is for it.
    """
    word = np.float64(number).view(np.int64)
    exponent = np.int64((word >> np.int64(52)) & np.int64(0x7FF))
    fraction = word & _FRACTION
    sign = np.int64(1) if word >= 0 else np.int64(-1)
    if exponent == 0x7FF:
        broken = np.int64(fraction != 0)
        infinite = np.int64((fraction == 0) & (word >= 0))
        return np.int64(INFINITE), infinite, np.int64(1) - broken - infinite, broken
    if exponent != 0:  # else a denormal number
        fraction |= _HIDDEN
    # the number is fraction 2^(max(exponent, 1) - 1075)
    place = max(exponent, np.int64(1)) + np.int64(13)
    shift = place & np.int64(31)
    low = (fraction & _LOW) << shift
    high = (fraction >> _32) << shift
    middle = (low >> _32) + (high & _LOW)
    return place >> np.int64(5), sign * (low & _LOW), sign * middle, sign * (high >> _32)


def rounded(bins: np.ndarray) -> float:
    """The number nearest to what a row of WIDTH bins holds (to the even one of two)."""
    infinite, minus_infinite, not_a_number = bins[BINS:]
    if not_a_number or (infinite and minus_infinite):
        return math.nan
    if infinite or minus_infinite:
        return math.inf if infinite else -math.inf
    low = (bins[:BINS] & 0xFFFFFFFF).astype("<u4").tobytes()
    over = bins[:BINS] >> 32
    high = over[:-1].astype("<u4").tobytes()
    whole = int.from_bytes(high, "little") + (int(over[-1]) << (32 * (BINS - 1)))
    whole = int.from_bytes(low, "little") + (whole << 32)
    try:
        return whole / UNIT
    except OverflowError:
        return math.inf if whole > 0 else -math.inf
