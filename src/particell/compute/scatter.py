"""Adding whole numbers to particles other than one's own.

CPU Numba has no public atomics: each thread adds to a row of its own and the rows are summed
afterwards. On a GPU there is one row and the addition is atomic. The sum of integers does not
depend on the order, so both give the same bits for any number of threads.
"""

from __future__ import annotations

from numba import njit


@njit(inline="always")
def scatter_add(buffer, column, value, thread=0):
    """Add ``value`` to ``buffer[thread, column]``; ``buffer`` has shape (threads, columns).

    Bodies of loops write ``scatter_add(buffer, column, value)``; the thread is filled in where
    they are compiled.
    """
    buffer[thread, column] += value
