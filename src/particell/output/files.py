"""Writing files so that a crash, a full disk or a kill leaves the last good one."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from particell.errors import InputError, ParticellError


class OutputError(ParticellError, OSError):
    """A file could not be written (full disk, no permission): one line that says which and why."""


class CheckpointError(ParticellError, ValueError):
    """A checkpoint that cannot be read: one line that says which and why."""


def reason(error: BaseException) -> str:
    """The cause of a failed file operation in a few words."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    # HDF5 wraps the system's own words in many of its own.
    if found := re.search(r"error message = '([^']+)'", str(error)):
        return found.group(1)
    return (str(error) or type(error).__name__).splitlines()[0]


#: What an HDF5 file needs beside its numbers, at most, and for each of its datasets.
SLACK, SLACK_EACH = 1 << 16, 1 << 12


def reserve(path: str | Path, size: int, begin: int = 0) -> None:
    """Refuse to write where there is no room, before HDF5 begins: it may crash where it ends.

    The room is taken by another file for a moment (where the system has a call for it).

    Parameters
    ----------
    path
        The file that is to be written.
    size
        Bytes that it is to grow by, at most.
    begin
        Its size now.

    Raises
    ------
    OutputError
        Where the disk, a quota or a limit of the process has not that much.
    """
    path = Path(path)
    if not hasattr(os, "posix_fallocate"):
        return
    room = path.with_name(f".{path.stem}.room")
    try:
        create_anew(room)
        handle = os.open(room, os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0))
        try:
            os.posix_fallocate(handle, begin, size)
        finally:
            os.close(handle)
            room.unlink()
    except OSError as error:
        if error.errno in (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL):
            return  # a file system without such a call
        raise OutputError(f"cannot write {path}: {reason(error)}") from error


def create_anew(path: Path) -> None:
    """Make an empty file; what stood there is removed, and a link is not followed.

    A name that is known beforehand may be a link to a file that is precious.
    """
    path.unlink(missing_ok=True)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    os.close(os.open(path, flags, 0o666))


def sync_directory(directory: Path) -> None:
    """Make renames in a directory survive a power failure (where the system has this call)."""
    if os.name != "posix":
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def prepare_directory(out: str | Path, *names: str) -> Path:
    """Make a directory for output, without the files of some names in it.

    Raises
    ------
    InputError
        Where it cannot be written to.
    """
    directory = Path(out)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        if not os.access(directory, os.W_OK | os.X_OK):
            raise PermissionError("no permission to write")
        for name in names:
            (directory / name).unlink(missing_ok=True)
    except (OSError, ValueError) as error:  # a ValueError for a zero byte in the name
        allowed = f"a directory that can be written to ({reason(error)})"
        raise InputError("out", str(out), allowed) from None
    return directory


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Write a file anew without ever leaving a half-written one under its name.

    Gives the path of a new file beside ``path``; at the end of the block that file is flushed to
    the disk and takes the name. Where the block fails the new file is removed and the old one is
    left as it was.

    Raises
    ------
    OutputError
        Where the operating system refuses.
    """
    path = Path(path)
    # Always the same name, so that what a killed process left is overwritten by the next one; the
    # suffix stays last, as some libraries go by it.
    partial = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        create_anew(partial)
        yield partial
        with open(partial, "rb+") as handle:
            os.fsync(handle.fileno())
        os.replace(partial, path)
        sync_directory(path.parent)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"cannot write {path}: {reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


def write_json(path: str | Path, content: Any) -> None:
    """Write JSON (standard JSON: non-finite numbers become null) atomically."""
    text = json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def read_json(path: str | Path, key: str) -> Any:
    """Read JSON; a missing or damaged file is an :class:`InputError` about ``key``."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(key, str(path), f"a readable JSON file ({reason(error)})") from None
    except RecursionError:
        raise InputError(key, str(path), "nested less deeply") from None


def plain(value: Any) -> Any:
    """The same content in the types that JSON has."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return plain(value.tolist())
    if isinstance(value, float):
        return value if value - value == 0 else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)
