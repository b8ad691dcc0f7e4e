"""Adding whole numbers to particles other than one's own.

CPU Numba has no public atomics: each thread adds to a row of its own and the rows are summed
afterwards. On a GPU there is one row and the addition is atomic. The sum of integers does not
depend on the order, so both give the same bits for any number of threads.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
from numba import njit


@njit
def scatter_add(buffer, column, value):
    """Add ``value`` to ``buffer[my thread, column]``; ``buffer`` has shape (threads, columns)."""
    buffer[numba.get_thread_id(), column] += value


@cache
def cuda_scatter_add():
    """The CUDA form of :func:`scatter_add`, made when first asked for."""
    from numba import cuda as module

    cuda: Any = module  # its stubs know 'atomic' as a class only

    @cuda.jit(device=True)
    def scatter(buffer, column, value):
        cuda.atomic.add(buffer, (0, column), value)

    return scatter
