"""Streams of a program that may be closed, or that nobody reads any more."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import Any, TextIO


def mend_streams() -> None:
    """Give a process whose stdin, stdout or stderr was closed the system's empty device there.

    Else the next file that is opened has their number, and what is said is written into it.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            mode = "r" if number == 0 else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


class Heedless:
    """A stream for which it does not matter that nobody listens any more, or that a disk is full.

    Parameters
    ----------
    stream
        What is written to.
    """

    def __init__(self, stream: TextIO):
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, where that is possible."""
        with contextlib.suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush, where that is possible."""
        with contextlib.suppress(OSError, ValueError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
