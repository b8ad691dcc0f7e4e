"""Adding whole numbers to particles other than one's own.

CPU Numba has no public atomics: each thread adds to a row of its own and the rows are summed
afterwards. On a GPU there is one row and the addition is atomic. The sum of integers does not
depend on the order, so both give the same bits for any number of threads.
"""

from __future__ import annotations

import numba
from numba import njit


@njit
def scatter_add(buffer, column, value):
    """Add ``value`` to ``buffer[my thread, column]``; ``buffer`` has shape (threads, columns)."""
    buffer[numba.get_thread_id(), column] += value
