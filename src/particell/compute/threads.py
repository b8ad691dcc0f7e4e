"""The CPU threads that loops run on, and how the particles are shared among them.

Each loop is compiled once, as serial code that lets go of Python's lock, and is called by every
thread for a range of particles. Numba's own parallel loops take twice as long to compile.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from time import perf_counter
from typing import Any

import numpy as np

from particell.compute.cache import NUMBA_CONFIG

NONE = np.uint64(0)
#: A thread is woken for this much work at least: handing it over takes some 0.02 ms.
SECONDS_PER_THREAD = 5e-5
#: Weight of the last measurement in the mean of recent ones, and calls between two trials.
RECENT, TRY_OTHER = 0.2, 50
#: Each thread's work comes in pieces, so that one that is held up is not waited for, if they take
#: as long as this.
PIECES_PER_THREAD = 4
SECONDS_PER_PIECE = 2e-4


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


class _Worker:
    """A thread that waits for work; two locks hand it over in a fifth of what an executor takes."""

    def __init__(self) -> None:
        self._begin, self._done = threading.Lock(), threading.Lock()
        self._begin.acquire()
        self._done.acquire()
        self._error: BaseException | None = None
        threading.Thread(target=self._run, name="particell", daemon=True).start()

    def _run(self) -> None:
        while True:
            self._begin.acquire()
            try:
                self._work(self._thread)
            except BaseException as error:
                self._error = error
            del self._work  # and with it what it holds on to
            self._done.release()

    def give(self, work: Callable[[int], None], thread: int) -> None:
        """Let it call ``work(thread)``."""
        self._work, self._thread = work, thread
        self._begin.release()

    def wait(self) -> None:
        """Until the work is done, with the exception that it raised."""
        self._done.acquire()
        if self._error is not None:
            raise self._error


#: Workers without work. One that failed, or was not waited for, does not come back.
_idle: list[_Worker] = []
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)


def _worker() -> _Worker:
    try:
        return _idle.pop()
    except IndexError:
        return _Worker()


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
        self.called, self.calls = False, 0
        # seconds a particle, as measured: on one thread, and on several
        self.alone, self.together = 0.0, 0.0

    def __call__(self, n: int, *arguments: Any) -> None:
        """Do the work of n particles; threads in use do not change what comes out."""
        threads = self.worth(n)
        begin = perf_counter()
        if threads == 1:
            self.piece(NONE, np.uint64(n), NONE, *arguments)
        else:
            self._on_threads(threads, n, arguments)
        first, self.called = not self.called, True
        if n > 0 and not first:  # in which it is compiled
            seconds = (perf_counter() - begin) / n
            if threads == 1:
                self.alone += RECENT * (seconds - self.alone)
            else:
                self.together += RECENT * (seconds - self.together)

    def worth(self, n: int) -> int:
        """One thread or as many as have work enough, whichever was faster of late.

        Now and then the other is tried: which it is depends on what else the machine does.
        """
        in_use = _in_use.number
        if in_use == 1:
            return 1
        threads = max(1, min(in_use, int(self.alone * n / SECONDS_PER_THREAD), n))
        if threads > 1:
            self.calls += 1
            try_other = self.calls % TRY_OTHER == 0
            if (self.together <= self.alone) == try_other:
                return 1
        return threads

    def _on_threads(self, threads: int, n: int, arguments: tuple) -> None:
        pieces = max(1, min(PIECES_PER_THREAD, int(self.alone * n / threads / SECONDS_PER_PIECE)))
        pieces = min(n, threads * pieces)
        ends = [np.uint64(n * k // pieces) for k in range(pieces + 1)]
        untaken = count()

        def work(thread: int) -> None:
            while (k := next(untaken)) < pieces:
                self.piece(ends[k], ends[k + 1], np.uint64(thread), *arguments)

        team = [_worker() for _ in range(threads - 1)]
        for thread, worker in enumerate(team, start=1):
            worker.give(work, thread)
        try:
            work(0)
        finally:
            for worker in team:
                worker.wait()
            _idle.extend(team)
