"""One realisation of an ensemble: what is run in which directory, alone or in a worker process.

A realisation is an ordinary run in a directory of its own. It is finished when its summary is
there, half-finished when it has a checkpoint; either way the same call does what is left to do.
"""

from __future__ import annotations

import threading
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from particell.cases import execution
from particell.compute.threads import kept_threads
from particell.errors import Interrupted
from particell.output.run import CHECKPOINT, SUMMARY
from particell.recipe import Context, Recipe

DONE, STOPPED, FAILED = "done", "stopped", "failed"
#: Loops with several threads must not be entered from two threads of a process at once.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Outcome:
    """How a realisation ended: plain data, so that every executor can hand it back.

    Attributes
    ----------
    index
        Which realisation.
    status
        ``"done"``, ``"stopped"`` (by the user) or ``"failed"``.
    error
        What went wrong, in one line.
    details
        The traceback.
    """

    index: int
    status: str
    error: str = ""
    details: str = ""


@dataclass(frozen=True)
class Job:
    """What is realised, and how: as ``particell run`` does, but without figures and report.

    Attributes
    ----------
    recipe
        What is built and run.
    backend, precision
        As for :class:`~particell.recipe.Context`.
    threads
        CPU threads of one realisation.
    """

    recipe: Recipe
    backend: str = "cpu"
    precision: str = "float64"
    threads: int = 1

    def context(self, seed: int) -> Context:
        """How one realisation is run."""
        return Context(seed, self.backend, self.precision, self.threads)

    def identity(self) -> dict[str, Any]:
        """What the ensemble is of, as JSON; the same for the same description."""
        device = {"backend": self.backend, "precision": self.precision}
        return {**self.recipe.identity(), **(device if self.recipe.is_data else {})}

    def start(self, seed: int, directory: Path) -> None:
        """Run from the beginning."""
        execution.execute(
            self.recipe,
            directory,
            seed,
            self.threads,
            self.backend,
            self.precision,
            progress=False,
            overwrite=True,
            report=False,
        )

    def resume(self, seed: int, directory: Path) -> None:
        """Go on from the checkpoint."""
        execution.go_on(self.recipe, self.context(seed), directory, progress=False, report=False)


def finished(directory: Path) -> bool:
    """Whether the realisation in a directory is complete."""
    return (directory / SUMMARY).is_file()


def realise(job: Job, index: int, seed: int, directory: Path) -> Outcome:
    """Do what is left of a realisation; never raises, so that the others go on.

    Parameters
    ----------
    job
        What to realise.
    index, seed
        Number of the realisation and its seed.
    directory
        Where its output goes.
    """
    try:
        with _ONE_AT_A_TIME, kept_threads():
            if finished(directory):
                pass
            elif (directory / CHECKPOINT).is_file():
                job.resume(seed, directory)
            else:
                job.start(seed, directory)
    except (Interrupted, KeyboardInterrupt):
        return Outcome(index, STOPPED)
    except Exception as error:  # whatever it is, it concerns this realisation alone
        line = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(index, FAILED, line, traceback.format_exc())
    return Outcome(index, DONE)


def prepare(job: Job, seed: int, compile_loops: bool) -> None:
    """Build a simulation, so that wrong input is refused before anything runs.

    With ``compile_loops`` one step of everything is done and thrown away: the loops are then in
    the cache on the disk, and the processes that follow read them instead of compiling each.
    """
    with kept_threads():
        execution.set_threads(job.threads)
        simulation = job.recipe.build(job.context(seed))
        if compile_loops:
            simulation.plan(job.recipe.every or simulation.largest_step())
            simulation.advance(simulation.chemistry_every)
