"""Sums and maxima over particles that depend on the values alone.

Real numbers are summed exactly and rounded once: whatever the order in memory, the number of
threads or the split among processes, the result is that of :func:`math.fsum`. Each number is put
as an integer into an accumulator of bins of 32 bits that spans all of double precision (Kulisch);
bins are 64-bit integers, whose sum depends on no order. Every global quantity (energy, momentum,
amounts, and means that feed back into the motion) goes through :class:`Reduction`.

References
----------
Kulisch, Computer Arithmetic and Validity (2008), chapter 8.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numba import njit

from particell.compute.communicator import Alone, Communicator
from particell.compute.device import Device
from particell.compute.loop import particle_loop

#: Bin b counts 2^(32 b - 1088): a number of 53 bits lies in three, the largest in the 65th to 67th.
BINS = 70
#: What is no number has bins of its own: how often it was added.
INFINITE, MINUS_INFINITE, NOT_A_NUMBER = BINS, BINS + 1, BINS + 2
WIDTH = BINS + 3
#: Lanes in which numbers are added, so that threads share the work; a lane takes less than 2^29.
LANES = 64
FEW = 512

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


@particle_loop
def accumulate(lane, values, lanes, bins):
    """Add one lane's share of the rows of a table of reals to its bins, column by column.

    ``bins`` has shape (lanes columns, WIDTH).
    """
    rows, columns = values.shape
    first, last = lane * rows // lanes, (lane + 1) * rows // lanes
    for c in range(columns):
        row = lane * columns + c
        for b in range(WIDTH):
            bins[row, b] = 0
        for i in range(first, last):
            b, low, middle, high = whole_parts(values[i, c])
            bins[row, b] += low
            bins[row, b + 1] += middle
            bins[row, b + 2] += high
        carry(bins, row)


@particle_loop
def sum_integers(lane, values, lanes, bins):
    """Sum one lane's share of the rows of a table of whole numbers; ``bins`` (lanes columns, 1)."""
    rows, columns = values.shape
    for c in range(columns):
        total = 0
        for i in range(lane * rows // lanes, (lane + 1) * rows // lanes):
            total += values[i, c]
        bins[lane * columns + c, 0] = total


@particle_loop
def gather_lanes(k, bins, lanes, total):
    """Sum bin k of all lanes; k counts the bins of all columns."""
    columns, width = total.shape
    c, b = k // width, k % width
    found = 0
    for lane in range(lanes):
        found += bins[lane * columns + c, b]
    total[c, b] = found


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


class Reduction:
    """Sums and maxima of per-particle values: arrays of the device, or NumPy's.

    Parameters
    ----------
    device
        Where loops run.
    communicator
        Who else holds particles.
    """

    def __init__(self, device: Device, communicator: Communicator | None = None):
        self.device = device
        self.communicator: Communicator = communicator or Alone()
        self._host = device if device.backend == "cpu" else Device()
        self._most_lanes = LANES
        self._work: dict[tuple, Any] = {}

    @functools.cached_property
    def _on_gpu(self) -> Any:
        from particell.compute.cuda_reduce import DeviceReduction

        return DeviceReduction(self.device)

    def _array(self, *shape: int):
        """Room to work in, made once."""
        if shape not in self._work:
            self._work[shape] = self._host.zeros(shape, np.int64)
        return self._work[shape]

    def sum(self, values) -> np.ndarray:
        """Column sums of an array of shape (n, columns); returns shape (columns,).

        Of real numbers they are exact and rounded once, to float64; whole numbers are int64.
        """
        here = isinstance(values, np.ndarray)
        total = self._sum_here(values) if here else self.device.to_host(self._on_gpu.sum(values))
        found = self.communicator.sum(total)
        real = values.dtype.kind == "f"
        return np.array([rounded(row) for row in found]) if real else np.array(found[:, 0])

    def _sum_here(self, values: np.ndarray) -> np.ndarray:
        """Bins (columns, WIDTH) of real numbers, sums (columns, 1) of whole ones."""
        rows, columns = values.shape
        real = values.dtype.kind == "f"
        width = WIDTH if real else 1
        lanes = max(1, min(self._most_lanes, rows // FEW))
        bins, total = self._array(lanes * columns, width), self._array(columns, width)
        add = (accumulate if real else sum_integers).specialise("cpu")
        add(lanes, values, lanes, bins)
        gather_lanes.specialise("cpu")(columns * width, bins, lanes, total)
        return total

    def max(self, values) -> float:
        """Largest of a non-empty array of shape (n,); NaN where one is NaN."""
        here = isinstance(values, np.ndarray)
        return self.communicator.maximum(float(values.max()) if here else self._on_gpu.max(values))
