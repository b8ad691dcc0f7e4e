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
from typing import Any

import numpy as np

from particell.compute.cache import NUMBA_CONFIG

PARTICLES_PER_THREAD = 1000


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


@contextmanager
def suitable_threads(particles: int) -> Iterator[None]:
    """Use no more threads inside the block than the number of particles keeps busy.

    Threads that wait for each other after a few microseconds of work cost more than they bring,
    above all on a machine that does other things too. Results do not depend on it.
    """
    with kept_threads():
        set_threads(max(1, min(get_threads(), particles // PARTICLES_PER_THREAD)))
        yield


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, available_threads() - 1), thread_name_prefix="particell")


def share(piece: Callable[..., None], n: int, *arguments: Any) -> None:
    """Call ``piece(first, last, thread, *arguments)`` on every thread for its part of n particles.

    The first part is this thread's own. Indices are unsigned, which spares compiled code the
    question whether they count from the end.
    """
    threads = max(1, min(get_threads(), n))
    ends = [np.uint64(n * k // threads) for k in range(threads + 1)]
    others = [
        _pool().submit(piece, ends[k], ends[k + 1], np.uint64(k), *arguments)
        for k in range(1, threads)
    ]
    try:
        piece(ends[0], ends[1], np.uint64(0), *arguments)
    finally:
        for other in others:
            other.result()
