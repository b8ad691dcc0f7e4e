"""Sums over particles in a fixed order: the same bits for any number of threads.

On the CPU that is NumPy's pairwise sum; on a GPU blocks of a fixed number of particles are summed
independently and the block sums are added one after the other. Every global quantity (energy,
momentum, amounts) goes through :class:`Reduction`, which is where a sum over processes will be
added.
"""

from __future__ import annotations

import numpy as np

from particell.compute.device import Device
from particell.compute.loop import particle_loop

BLOCK = 256


@particle_loop
def block_sums(b, values, n_rows, partial, *, COLUMNS, BLOCK):
    """Sum rows ``b*BLOCK .. (b+1)*BLOCK`` of ``values`` (rows, COLUMNS) into ``partial[b]``."""
    first = b * BLOCK
    last = min(first + BLOCK, n_rows)
    for c in range(COLUMNS):
        total = values[first, c]
        for i in range(first + 1, last):
            total += values[i, c]
        partial[b, c] = total


@particle_loop
def block_maxima(b, values, n_rows, partial, *, BLOCK):
    """Largest of ``values[b*BLOCK : (b+1)*BLOCK]`` into ``partial[b, 0]``; NaN where one is NaN."""
    first = b * BLOCK
    last = min(first + BLOCK, n_rows)
    best = values[first]
    for i in range(first + 1, last):
        if not values[i] <= best:  # a NaN too, and then it stays: it compares with nothing
            best = values[i] if best == best else best
    partial[b, 0] = best


class Reduction:
    """Sums and maxima of per-particle values, in a fixed order."""

    def __init__(self, device: Device):
        self.device = device

    def _partial(self, rows: int, columns: int, dtype: np.dtype):
        return self.device.zeros((max(1, -(-rows // BLOCK)), columns), dtype)

    def sum(self, values) -> np.ndarray:
        """Column sums of an array of shape (n, columns); returns shape (columns,)."""
        if isinstance(values, np.ndarray):
            return values.sum(axis=0)  # pairwise and serial: a fixed order
        rows, columns = values.shape
        if rows == 0:
            return np.zeros(columns, values.dtype)
        partial = self._partial(rows, columns, values.dtype)
        loop = block_sums.specialise(self.device.backend, COLUMNS=columns, BLOCK=BLOCK)
        loop(len(partial), values, rows, partial)
        blocks = self.device.to_host(partial)
        total = np.zeros(columns, values.dtype)
        for row in blocks:
            total += row
        return total

    def max(self, values) -> float:
        """Largest of a non-empty array of shape (n,)."""
        if isinstance(values, np.ndarray):
            return float(values.max())
        partial = self._partial(len(values), 1, values.dtype)
        loop = block_maxima.specialise(self.device.backend, BLOCK=BLOCK)
        loop(len(partial), values, len(values), partial)
        return float(self.device.to_host(partial).max())
