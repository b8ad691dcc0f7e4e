"""Exact sums on a GPU, the bits of which are those of a CPU's: whole numbers in any order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import cuda as _module
from numba import int64

from particell.compute.accumulator import WIDTH, carry, whole_parts
from particell.compute.cuda_scan import BLOCKS, THREADS, Largest
from particell.compute.device import Device, clear
from particell.compute.loop import particle_loop

cuda: Any = _module  # its stubs know 'atomic' as a class only


@cuda.jit
def add_reals(values, bins):
    """Add a column of ``values``, block by block, to its row of bins (< 2³¹ numbers)."""
    shared = cuda.shared.array(WIDTH, int64)
    t, c = cuda.threadIdx.x, cuda.blockIdx.y
    for b in range(t, WIDTH, THREADS):
        shared[b] = 0
    cuda.syncthreads()
    first, step = cuda.blockIdx.x * THREADS + t, cuda.gridDim.x * THREADS
    for i in range(first, values.shape[0], step):
        b, low, middle, high = whole_parts(values[i, c])
        cuda.atomic.add(shared, b, low)
        cuda.atomic.add(shared, b + 1, middle)
        cuda.atomic.add(shared, b + 2, high)
    cuda.syncthreads()
    for b in range(t, WIDTH, THREADS):
        if shared[b] != 0:
            cuda.atomic.add(bins, (c, b), shared[b])


@cuda.jit
def add_integers(values, bins):
    """Add a column of whole numbers to ``bins[column, 0]``."""
    c = cuda.blockIdx.y
    first = cuda.blockIdx.x * THREADS + cuda.threadIdx.x
    own = 0
    for i in range(first, values.shape[0], cuda.gridDim.x * THREADS):
        own += values[i, c]
    cuda.atomic.add(bins, (c, 0), own)


@particle_loop
def carry_all(c, bins):
    """Bring the bins of column c between 0 and 2³² - 1, but for the last, which has the sign."""
    carry(bins, c)


class DeviceReduction:
    """Sums and maxima of arrays of a GPU.

    Parameters
    ----------
    device
        Where they are.
    """

    def __init__(self, device: Device):
        self.device = device
        self._bins: dict[tuple[int, int], Any] = {}
        self._largest: dict[tuple[int, np.dtype], Largest] = {}
        self._clear, self._carry = clear.specialise("cuda"), carry_all.specialise("cuda")

    def sum(self, values: Any) -> Any:
        """Bins (columns, WIDTH) of real numbers, sums (columns, 1) of whole ones; on the GPU."""
        rows, columns = values.shape
        real = values.dtype.kind == "f"
        key = (columns, WIDTH if real else 1)
        if key not in self._bins:
            self._bins[key] = self.device.zeros(key, np.int64)
        bins = self._bins[key]
        self._clear(bins.size, bins.reshape(bins.size))
        blocks = min(-(-rows // THREADS), BLOCKS)
        if blocks:
            (add_reals if real else add_integers)[(blocks, columns), THREADS](values, bins)
        if real:
            self._carry(columns, bins)
        return bins

    def max(self, values: Any) -> float:
        """Largest of a non-empty array (n,); NaN where one is NaN."""
        key = (len(values), values.dtype)
        if key not in self._largest:
            self._largest[key] = Largest(self.device, *key)
        return float(self.device.to_host(self._largest[key](values))[0])
