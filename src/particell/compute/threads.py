"""The CPU threads that loops run on, and how the particles are shared among them.

Each loop is compiled once, as serial code that lets go of Python's lock, and is called by every
thread for a range of particles. Numba's own parallel loops take twice as long to compile.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from itertools import count
from time import perf_counter
from typing import Any

import numpy as np

from particell.compute.cache import NUMBA_CONFIG

NONE = np.uint64(0)
#: A thread is woken for this much work at least: handing it over takes a tenth of a millisecond.
SECONDS_PER_THREAD = 5e-4
#: Each thread's work comes in pieces, so that one that is held up is not waited for.
PIECES_PER_THREAD = 4


def available_threads() -> int:
    """Threads that may be used: the cores of this process, or ``NUMBA_NUM_THREADS``."""
    return NUMBA_CONFIG.NUMBA_NUM_THREADS


class _InUse(threading.local):
    """Threads that loops started by this thread run on."""

    number = available_threads()


_in_use = _InUse()


def get_threads() -> int:
    """Number of threads in use."""
    return _in_use.number


def set_threads(threads: int | None) -> int:
    """Use ``threads`` threads (all of them if None) and return how many are in use.

    Raises
    ------
    ValueError
        Where there are not that many.
    """
    available = available_threads()
    if threads is not None and not 1 <= threads <= available:
        raise ValueError(f"threads = {threads} is not between 1 and {available}")
    _in_use.number = threads or available
    return _in_use.number


@contextmanager
def kept_threads() -> Iterator[None]:
    """Leave the number of threads as it was before the block."""
    before = get_threads()
    try:
        yield
    finally:
        set_threads(before)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, available_threads() - 1), thread_name_prefix="particell")


class Shared:
    """A compiled range of a loop, called for all particles by as many threads as are worth waking.

    Parameters
    ----------
    piece
        ``piece(first, last, thread, *arguments)``, which lets go of Python's lock. Indices are
        unsigned, which spares compiled code the question whether they count from the end.
    """

    def __init__(self, piece: Callable[..., None]):
        self.piece = piece
        self.cost = 0.0  # of a particle in s, as measured

    def __call__(self, n: int, *arguments: Any) -> None:
        """Do the work of n particles; threads in use do not change what comes out."""
        in_use = _in_use.number
        if in_use == 1:
            self.piece(NONE, np.uint64(n), NONE, *arguments)
            return
        threads = max(1, min(in_use, int(self.cost * n / SECONDS_PER_THREAD), n))
        begin = perf_counter()
        if threads == 1:
            self.piece(NONE, np.uint64(n), NONE, *arguments)
        else:
            self._on_threads(threads, n, arguments)
        if n > 0:
            self.cost += 0.2 * ((perf_counter() - begin) * threads / n - self.cost)

    def _on_threads(self, threads: int, n: int, arguments: tuple) -> None:
        pieces = min(n, threads * PIECES_PER_THREAD)
        ends = [np.uint64(n * k // pieces) for k in range(pieces + 1)]
        untaken = count()

        def work(thread: int) -> None:
            while (k := next(untaken)) < pieces:
                self.piece(ends[k], ends[k + 1], np.uint64(thread), *arguments)

        others = [_pool().submit(work, thread) for thread in range(1, threads)]
        try:
            work(0)
        finally:
            for other in others:
                other.result()
