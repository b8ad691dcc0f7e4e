"""A directory belongs to one process: a lock that dies with it.

The lock is the operating system's, on a small file in the directory: it ends with the process
however that ends. (Libraries for it fall back to files that outlive a killed process, where a file
system has no locks; here such a directory is not guarded at all. NFS has locks from version 4 on.)
Who only reads needs none.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from particell.errors import InputError
from particell.output.files import reason

LOCK = ".particell.lock"
#: Seconds after which a directory counts as taken: who asks whether it is holds it for a moment.
PATIENCE = 0.5
#: Where the lock is in the file for Windows, where nobody can read what is locked.
_BEYOND = 1 << 20
_WITHOUT = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL}


#: Who has a directory, where that cannot be told.
UNKNOWN = "nobody knows who"


class _Held:
    """A lock of this process: its file once it is had, and which thread has it how often."""

    def __init__(self) -> None:
        self.handle: int | None = None
        self.thread, self.depth = threading.get_ident(), 1


_held: dict[str, _Held] = {}
_guard = threading.Lock()


def _forget() -> None:
    """What a process has that was forked is its parent's; so is a guard that a thread there has."""
    global _guard
    _guard = threading.Lock()
    for held in _held.values():
        if held.handle is not None:
            with contextlib.suppress(OSError):
                os.close(held.handle)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


@contextlib.contextmanager
def owned(directory: str | Path) -> Iterator[None]:
    """Have a directory for this thread alone; within the block it may be asked for again.

    Raises
    ------
    InputError
        Where another process, or another thread, has it: naming both.
    """
    key = os.path.realpath(directory)
    with _guard:
        held = _held.get(key)
        if held is not None and held.thread != threading.get_ident():
            raise _taken(directory, f"process {os.getpid()}, in another thread,")
        if held is None:
            mine = _held[key] = _Held()
        else:
            mine, mine.depth = held, held.depth + 1
    try:
        if held is None:  # another process may let it wait, but no other thread
            mine.handle = _acquire(Path(directory))
        yield
    finally:
        with _guard:
            mine.depth -= 1
            if not mine.depth and _held.get(key) is mine:
                del _held[key]
                if mine.handle is not None:
                    _release(Path(key) / LOCK, mine.handle)


def owner(directory: str | Path) -> str | None:
    """The process that has a directory, in words; None where nobody has.

    :data:`UNKNOWN` where the lock cannot be read, or there are none here.
    """
    path = Path(directory) / LOCK
    held = _held.get(os.path.realpath(directory))
    if held is not None and held.handle is not None:
        return f"process {os.getpid()}"
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    except FileNotFoundError:
        return None
    except OSError:
        return UNKNOWN
    try:
        free = _lock(handle, shared=True)
        if free is None:
            return UNKNOWN
        return None if free else _name(handle)
    finally:
        os.close(handle)


def _acquire(directory: Path) -> int:
    path, deadline = directory / LOCK, time.monotonic() + PATIENCE
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
    while True:
        try:
            handle = os.open(path, flags, 0o644)
        except OSError as error:
            allowed = f"a directory that can be written to ({reason(error)})"
            raise InputError("out", str(directory), allowed) from None
        if _lock(handle) is not False:
            if _is_at(handle, path):
                break
            os.close(handle)  # its owner has ended, and taken the file along
            continue
        if time.monotonic() > deadline:
            name = _name(handle)
            os.close(handle)
            raise _taken(directory, name)
        os.close(handle)
        time.sleep(0.05)
    with contextlib.suppress(OSError):  # a full disk: then nobody is told who it is
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()} {socket.gethostname()}".encode())
    return handle


def _release(path: Path, handle: int) -> None:
    with contextlib.suppress(OSError):  # Windows removes no file that is open
        if _is_at(handle, path):  # and not another's, where the directory was made anew
            os.unlink(path)
    os.close(handle)


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except OSError:
        return False


def _lock(handle: int, shared: bool = False) -> bool | None:
    """Whether the lock could be had; None where there are none here."""
    try:
        if os.name == "nt":
            import msvcrt

            os.lseek(handle, _BEYOND, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
            os.lseek(handle, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        return None if error.errno in _WITHOUT and os.name != "nt" else False
    return True


def _name(handle: int) -> str:
    """Who has the lock, by what is written in its file."""
    with contextlib.suppress(OSError):
        os.lseek(handle, 0, os.SEEK_SET)
        words = os.read(handle, 300).decode(errors="replace").split()
        if len(words) == 2 and words[0].isdecimal():
            here = "" if words[1] == socket.gethostname() else f" on {words[1]}"
            return f"process {words[0]}{here}"
    return "another process"


def _taken(directory: str | Path, whose: str) -> InputError:
    allowed = f"a directory that nobody else runs in ({whose} does)"
    return InputError("directory", str(directory), allowed)
