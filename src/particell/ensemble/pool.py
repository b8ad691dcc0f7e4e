"""Running realisations: in this process, in local processes (loky), or on a dask cluster.

There is no scheduler here: an executor of :mod:`concurrent.futures` is given the realisations,
and their outcomes are handed on as they come.
"""

from __future__ import annotations

import _thread
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from particell.ensemble.jobs import FAILED, STOPPED, Job, Outcome, realise
from particell.errors import InputError

#: One realisation to run: index, seed and directory.
Task = tuple[int, int, Path]
Report = Callable[[Outcome], None]
#: Seconds between looks at the user's wish to stop.
PATIENCE = 0.2


def default_processes() -> int:
    """The cores that this process may use (affinity and containers' limits counted in)."""
    import loky

    return int(loky.cpu_count())


def run_here(job: Job, tasks: Iterable[Task], asked: list[bool], report: Report) -> None:
    """One after the other in this process, until the user stops it (``asked``)."""
    for task in tasks:
        outcome = realise(job, *task)
        report(outcome)
        if asked[0] or outcome.status == STOPPED:
            return


def run_processes(
    job: Job, tasks: Iterable[Task], processes: int, asked: list[bool], report: Report
) -> None:
    """In local processes, which are started anew should one of them die.

    Parameters
    ----------
    job, tasks
        What to run.
    processes
        How many at a time.
    asked
        Its item becomes true when the user wants to stop; what runs then writes a checkpoint.
    report
        Called in this thread with every outcome.
    """
    waiting = deque(tasks)
    while waiting and not asked[0]:
        for task in _round(job, waiting, processes, asked, report):
            # Alone, so that one that kills its process takes no other with it.
            alone = deque([task])
            if not asked[0] and _round(job, alone, 1, asked, report):
                text = "its process died twice (killed by the system, out of memory?)"
                report(Outcome(task[0], FAILED, text))


def run_cluster(
    job: Job, tasks: Iterable[Task], client: Any, asked: list[bool], report: Report
) -> None:
    """On a cluster, through a ``dask.distributed.Client``; its scheduler sees to lost workers."""
    threads = {int(number) for number in client.nthreads().values()}
    if threads - {1}:
        raise InputError(
            "client",
            f"workers with {max(threads)} threads",
            "one whose workers have a single thread each (threads_per_worker=1, --nthreads 1)",
        )
    waiting = deque(tasks)
    executor = client.get_executor(pure=False)
    try:
        _drain(executor, realise, job, waiting, len(waiting), asked, report)
    finally:
        executor.shutdown(wait=False)


def _round(
    job: Job, waiting: deque[Task], processes: int, asked: list[bool], report: Report
) -> list[Task]:
    """Run what is waiting until all is done or a process dies; gives what was lost with it."""
    with _local_executor(min(processes, len(waiting))) as (executor, stop):
        return _drain(executor, _realise_here, job, waiting, processes, asked, report, stop)


def _drain(
    executor: Executor,
    function: Callable[..., Outcome],
    job: Job,
    waiting: deque[Task],
    width: int,
    asked: list[bool],
    report: Report,
    stop: Any = None,
) -> list[Task]:
    """Keep ``width`` tasks in the executor; gives those that were in it when it broke."""
    running: dict[Future, Task] = {}
    lost: list[Task] = []
    while running or (waiting and not lost and not asked[0]):
        while waiting and len(running) < width and not lost and not asked[0]:
            task = waiting.popleft()
            try:
                running[executor.submit(function, job, *task)] = task
            except BrokenExecutor:
                lost.append(task)
        done, _ = wait(running, timeout=PATIENCE, return_when=FIRST_COMPLETED)
        for future in done:
            task = running.pop(future)
            try:
                report(future.result())
            except BrokenExecutor:
                lost.append(task)
            except Exception as error:  # the executor's own: not picklable, worker lost, …
                line = " ".join(f"{type(error).__name__}: {error}".split())
                report(Outcome(task[0], FAILED, line))
        if asked[0] and stop is not None:
            stop.set()
        elif asked[0]:  # what already runs on a cluster runs on; its checkpoints are kept
            for future in running:
                future.cancel()
            return lost
    return lost


@contextmanager
def _local_executor(processes: int) -> Iterator[tuple[Executor, Any]]:
    import loky

    context = loky.backend.get_context("loky")
    stop = context.Event()
    executor = loky.ProcessPoolExecutor(
        processes, context=context, initializer=_listen, initargs=(stop,)
    )
    try:
        yield executor, stop
    except BaseException:
        executor.shutdown(wait=True, kill_workers=True)
        raise
    executor.shutdown(wait=True)


# --- in a worker process ---------------------------------------------------------------------

_worker: dict[str, Any] = {"stop": None, "busy": False}


def _listen(stop: Any) -> None:
    """Make the parent's event arrive as Ctrl-C does, and nothing else.

    The terminal sends Ctrl-C to a whole process group: a worker of a group of its own does not get
    it, and the parent tells each worker once (a second signal would be taken as impatience).
    """
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    _worker["stop"] = stop
    signal.signal(signal.SIGINT, _interrupted)

    def tell() -> None:
        stop.wait()
        _thread.interrupt_main()

    threading.Thread(target=tell, daemon=True).start()


def _interrupted(number: int, frame: object) -> None:
    """The signal outside of a time loop (which has a handler of its own)."""
    if _worker["busy"]:
        raise KeyboardInterrupt


def _realise_here(job: Job, index: int, seed: int, directory: Path) -> Outcome:
    if _worker["stop"].is_set():
        return Outcome(index, STOPPED)
    _worker["busy"] = True
    try:
        return realise(job, index, seed, directory)
    except KeyboardInterrupt:  # between the lines of the above
        return Outcome(index, STOPPED)
    finally:
        _worker["busy"] = False
