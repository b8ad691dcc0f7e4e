"""How a command ends: its exit status, and the line that says why."""

from __future__ import annotations

import contextlib
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path

import click

from particell.errors import Interrupted, RunError

FAILED, WRONG_INPUT, BROKEN, UNFORESEEN, INTERRUPTED = 1, 2, 3, 70, 130


def guarded(directory: Path, action: Callable[[], int]) -> int:
    """Run something in a directory; where it breaks, say how to go on. Gives the exit status."""
    from particell.output.files import OutputError
    from particell.output.run import CASE, CHECKPOINT

    try:
        return action()
    except Interrupted as error:
        click.echo(one_line(error), err=True)  # says how to go on
        return INTERRUPTED
    except KeyboardInterrupt:
        if not (directory / CASE).exists():
            raise  # nothing has begun
        click.echo(f"interrupted; go on with: particell resume {directory}", err=True)
        return INTERRUPTED
    except (RunError, OutputError, MemoryError) as error:
        click.echo(f"the run broke: {one_line(error)}", err=True)
        checkpoint = directory / CHECKPOINT
        if checkpoint.exists():
            click.echo(f"last good checkpoint: {checkpoint}", err=True)
            if isinstance(error, RunError):  # the same again: every run has the same bits
                click.echo("from there the same would happen: change what it names", err=True)
            else:
                click.echo(f"go on from it with: particell resume {directory}", err=True)
        else:
            click.echo("no checkpoint had been written yet", err=True)
        return BROKEN


def complain(error: Exception) -> int:
    """Say in one line what is wrong with the input."""
    click.echo(f"error: {one_line(error)}", err=True)
    return WRONG_INPUT


def one_line(error: BaseException) -> str:
    words = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return f"out of memory ({words})" if words else "out of memory"
    return words


def unforeseen(error: BaseException) -> int:
    """Say in one line what nobody foresaw, and where the traceback is; gives the exit status."""
    where = ""
    with contextlib.suppress(OSError):
        name = tempfile.NamedTemporaryFile  # keeps the file
        with name("w", prefix="particell-", suffix=".txt", delete=False, encoding="utf-8") as file:
            file.write("".join(traceback.format_exception(error)))
            where = f"; the traceback, for a report of it: {file.name}"
    words = f"{type(error).__name__}: {one_line(error)}"[:300]
    click.echo(f"an error that nobody foresaw: {words}{where}", err=True)
    return UNFORESEEN
