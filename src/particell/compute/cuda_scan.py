"""Running sums and maxima on a GPU, by blocks of threads that share memory.

For what a :func:`~particell.compute.loop.particle_loop` cannot say: numbers that threads hand to
each other. Imported where there is a GPU, or its simulator, only.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numba import cuda as _module
from numba import from_dtype, int64

from particell.compute.loop import THREADS_PER_BLOCK

cuda: Any = _module  # its stubs know 'atomic' as a class only

THREADS = THREADS_PER_BLOCK  # a power of two
#: Numbers of which a thread makes the running sum by itself, and a block.
EACH = 8
TILE = EACH * THREADS
#: Most blocks of a maximum, as many as one block can compare again.
BLOCKS = 8 * THREADS


@cuda.jit
def sum_tiles(values, n, totals):
    """``values[k]`` becomes the sum of those before it in its tile, ``totals`` those of tiles."""
    shared = cuda.shared.array(THREADS, int64)
    t, tile = cuda.threadIdx.x, cuda.blockIdx.x
    first = tile * TILE + t * EACH
    last = min(first + EACH, n)
    own = 0
    for k in range(first, last):
        own += values[k]
    shared[t] = own
    cuda.syncthreads()
    gap = 1
    while gap < THREADS:
        before = 0
        if t >= gap:
            before = shared[t - gap]
        cuda.syncthreads()
        shared[t] += before
        cuda.syncthreads()
        gap *= 2
    before = shared[t] - own
    for k in range(first, last):
        value = values[k]
        values[k] = before
        before += value
    if t == THREADS - 1:
        totals[tile] = shared[t]


@cuda.jit
def add_totals(values, n, totals):
    """Add to each number the sum of the tiles before its own."""
    k = cuda.grid(1)
    if k < n:
        values[k] += totals[k // TILE]


class RunningSum:
    """Exclusive running sums of whole numbers (int64), in place.

    Parameters
    ----------
    device
        Where the numbers are.
    n
        How many there are.
    """

    def __init__(self, device: Any, n: int):
        self.n, self.tiles = n, -(-n // TILE)
        self._totals = device.zeros(self.tiles, np.int64)
        self._rest = RunningSum(device, self.tiles) if self.tiles > 1 else None

    def __call__(self, values: Any) -> None:
        """``values[k]`` becomes ``sum(values[:k])``."""
        sum_tiles[self.tiles, THREADS](values, self.n, self._totals)
        if self._rest is not None:
            self._rest(self._totals)
            add_totals[-(-self.n // THREADS), THREADS](values, self.n, self._totals)


@functools.cache
def maxima_of_blocks(kind: np.dtype) -> Any:
    """The kernel that finds the largest of each block's share of ``values[:n]``; NaN counts most.

    One for each type of numbers, since memory that a block shares has a type.
    """
    number = from_dtype(kind)

    @cuda.jit
    def largest_of_blocks(values, n, largest):
        shared = cuda.shared.array(THREADS, number)
        t = cuda.threadIdx.x
        best = values[0]
        for k in range(cuda.grid(1), n, cuda.gridsize(1)):
            value = values[k]
            if not value <= best:  # a NaN too, and then it stays: it compares with nothing
                best = value if best == best else best
        shared[t] = best
        half = THREADS // 2
        while half > 0:
            cuda.syncthreads()
            if t < half:
                value = shared[t + half]
                if not value <= best:
                    best = value if best == best else best
                shared[t] = best
            half //= 2
        if t == 0:
            largest[cuda.blockIdx.x] = best

    return largest_of_blocks


class Largest:
    """The largest of n numbers of a type, into an array of one; NaN where one is NaN.

    Parameters
    ----------
    device
        Where the numbers are.
    n, kind
        How many there are, of which type.
    """

    def __init__(self, device: Any, n: int, kind: Any):
        self.n, self.blocks = n, min(-(-n // THREADS), BLOCKS)
        self._find = maxima_of_blocks(np.dtype(kind))
        self._partial = device.zeros(self.blocks, kind)
        self.found = device.zeros(1, kind) if self.blocks > 1 else self._partial

    def __call__(self, values: Any) -> Any:
        """The array, which stays on the device."""
        self._find[self.blocks, THREADS](values, self.n, self._partial)
        if self.blocks > 1:
            self._find[1, THREADS](self._partial, self.blocks, self.found)
        return self.found
