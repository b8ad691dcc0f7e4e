"""A process that makes a small run again and again, in children that are killed.

``python killing.py DIRECTORY CASE`` makes the run WHOLE of a case (a file, or the ``walk`` of
fake_case.py), which compiles its loops. Then it reads a command a line, forks, and answers how the
child ended. The commands: ``run NAME`` and ``resume NAME``, followed by what ends it: ``after
SECONDS``, ``at OPERATION COUNT`` (just before the COUNT-th call of the operation), ``bytes NUMBER``
(by the system, where a file grows beyond that), ``full NUMBER`` (the same, as a full disk says it:
with an error), or nothing.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import time

from particell import cases
from particell.cli import call
from particell.output import checkpoint, files, trajectory


def bomb(operation: str, count: int) -> None:
    """Make the count-th call of an operation the process's last."""
    place, name = {
        "frame-part": (trajectory, "extend"),
        "checkpoint": (checkpoint.h5py.File, "create_dataset"),
        "fsync": (os, "fsync"),
        "rename": (os, "replace"),
        "directory": (files, "sync_directory"),
    }[operation]
    original, calls = getattr(place, name), iter(range(1, count + 1))

    def last(*args, **options):
        if next(calls) == count:
            os.kill(os.getpid(), signal.SIGKILL)
        return original(*args, **options)

    setattr(place, name, last)


def child(words: list[str]) -> None:
    how, name, *end = words
    os.dup2(os.open(f"{name}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND), 1)
    os.dup2(1, 2)
    if end and end[0] == "at":
        bomb(end[1], int(end[2]))
    if end and end[0] in ("bytes", "full"):
        killed = signal.SIG_DFL if end[0] == "bytes" else signal.SIG_IGN
        signal.signal(signal.SIGXFSZ, killed)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(end[1]), int(end[1])))
    what = ["run", sys.argv[2], "--out", name] if how == "run" else ["resume", name]
    status = call([*what, "--no-progress"])
    sys.stderr.flush()
    os._exit(status)


def answer(words: list[str]) -> int:
    pid = os.fork()
    if not pid:
        try:
            child(words)
        finally:
            os._exit(99)
    if words[2:3] == ["after"]:
        time.sleep(float(words[3]))
        os.kill(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


if __name__ == "__main__":
    os.chdir(sys.argv[1])
    if sys.argv[2] == "walk":
        cases.CASES = {"walk": ("fake_case:Walk", "Random walkers")}
    from particell.plots import save  # noqa: F401 - imported before it forks

    first = call(["run", sys.argv[2], "--out", "WHOLE", "--no-progress"])
    print("ready", first, flush=True)
    for line in sys.stdin:
        print("ended", answer(line.split()), flush=True)
