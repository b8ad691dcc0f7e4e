"""Batches of pairs: neighbours gathered into contiguous memory before laws act on them.

A loop over neighbours reads its fields from scattered places, which processors do one by one. So a
body first gathers up to ``BATCH`` neighbours inside the support, one after the other, and then
evaluates the laws in a loop over the batch, which the compiler turns into vector instructions:

>>> row = batch_row(i) * BATCH                            # doctest: +SKIP
>>> c = row
>>> for k in range(first, last):                          # doctest: +SKIP
...     buffer[c] = ...                                   # what the laws need of pair i, j
...     c += r2 < h2                                      # keep it only if it is inside
>>> for q in range(row, c): ...                           # the laws

Every thread has a row of the buffer of its own. On a GPU every particle has one, of a single pair.
Fields of a neighbour are first packed into one record, since it is the number of cache lines
touched that gathering costs; strides that are known when the loop is compiled are what lets the
compiler vectorise (so buffers are one-dimensional and widths are compile-time constants).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from particell.compute.threads import available_threads

#: Pairs of a batch on a CPU; 2D rows fit into one.
BATCH = 64
#: Batches are filled up to a multiple of this with pairs that do not act: whole vectors.
LANES = np.uint64(8)


def batch_size(device: Any) -> int:
    """Pairs of a batch on a device: the compile-time constant ``BATCH`` of loops."""
    return BATCH if device.backend == "cpu" else 1


def batch_rows(device: Any, n: int) -> int:
    """Rows of a buffer for n particles: one for each thread, or for each particle on a GPU."""
    return max(1, min(n, available_threads()) if device.backend == "cpu" else n)


def batch_buffer(device: Any, n: int, width: int = 1, dtype: type | None = None):
    """A buffer for batches of n particles with ``width`` numbers for each pair.

    One-dimensional, with ``batch_size(device)`` pairs a row; of one number where n is 0.
    """
    if n == 0:
        return device.zeros(1, dtype)
    return device.zeros(batch_rows(device, n) * batch_size(device) * width, dtype)


@njit
def batch_row(i, thread=0):
    """The row of the buffer that particle i may use now: that of this thread.

    Bodies of loops write ``batch_row(i)``; the thread is filled in where they are compiled.
    """
    return thread


@njit
def whole_lanes(number, BATCH):
    """``number`` of pairs rounded up to whole vectors (not for batches of one)."""
    if BATCH == 1:
        return number
    return (number + (LANES - np.uint64(1))) & ~(LANES - np.uint64(1))
