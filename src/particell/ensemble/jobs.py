"""One realisation of an ensemble: what is run in which directory, alone or in a worker process.

A realisation is an ordinary run in a directory of its own. It is finished when its summary is
there, half-finished when it has a checkpoint; either way the same call does what is left to do.
"""

from __future__ import annotations

import threading
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from particell.cases import execution
from particell.cases.base import Case, Context
from particell.compute.threads import kept_threads
from particell.errors import HealthWarning, InputError, Interrupted
from particell.output.checkpoint import read_checkpoint
from particell.output.files import prepare_directory
from particell.output.run import CHECKPOINT, OWN_FILES, SUMMARY
from particell.output.summary import write_summary

if TYPE_CHECKING:
    from particell.simulation import Simulation

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


class Job(Protocol):
    """What can be realised: a case, or a function that builds a simulation."""

    @property
    def threads(self) -> int | None:
        """CPU threads of one realisation."""
        ...

    def identity(self) -> dict[str, Any]:
        """What the ensemble is of, as JSON; the same for the same description."""
        ...

    def build(self, seed: int) -> Simulation:
        """The simulation, at its first moment."""
        ...

    @property
    def every(self) -> float | None:
        """Time between frames in s."""
        ...

    def start(self, seed: int, directory: Path) -> None:
        """Run from the beginning."""
        ...

    def resume(self, seed: int, directory: Path) -> None:
        """Go on from the checkpoint."""
        ...


@dataclass(frozen=True)
class CaseJob:
    """Realisations of a case: as ``particell run``, but without figures and report."""

    case: Case
    backend: str = "cpu"
    precision: str = "float64"
    threads: int | None = 1

    def context(self, seed: int) -> Context:
        """How one realisation is run."""
        return Context(seed, self.backend, self.precision, self.threads)

    def identity(self) -> dict[str, Any]:
        """See :class:`Job`."""
        found = execution.identity(self.case, self.context(0))
        context = found.pop("context")
        return {**found, "backend": context["backend"], "precision": context["precision"]}

    def build(self, seed: int) -> Simulation:
        """See :class:`Job`."""
        return self.case.build(self.context(seed))

    @property
    def every(self) -> float | None:
        """See :class:`Job`."""
        return self.case.every

    def start(self, seed: int, directory: Path) -> None:
        """See :class:`Job`."""
        execution.execute(
            self.case,
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
        """See :class:`Job`."""
        context = self.context(seed)
        execution.go_on(self.case, context, directory, progress=False, report=False)


@dataclass(frozen=True)
class FunctionJob:
    """Realisations of what a function ``build(seed)`` makes."""

    function: Callable[[int], Simulation]
    until: float
    every: float | None = None
    threads: int | None = 1

    def identity(self) -> dict[str, Any]:
        """See :class:`Job`."""
        return {"function": self.name, "until": self.until, "every": self.every}

    @property
    def name(self) -> str:
        """Name of the function, for messages and summaries."""
        return getattr(self.function, "__qualname__", type(self.function).__qualname__)

    def build(self, seed: int) -> Simulation:
        """See :class:`Job`."""
        simulation = self.function(seed)
        found = getattr(simulation, "seed", None)
        if found != seed:
            raise InputError("seed of the simulation", found, f"the one given to build, {seed}")
        return simulation

    def start(self, seed: int, directory: Path) -> None:
        """See :class:`Job`."""
        execution.set_threads(self.threads)
        simulation = self.build(seed)
        self._finish(simulation, seed, prepare_directory(directory, *OWN_FILES))

    def resume(self, seed: int, directory: Path) -> None:
        """See :class:`Job`."""
        execution.set_threads(self.threads)
        state, _ = read_checkpoint(directory / CHECKPOINT)
        simulation = self.build(seed)
        simulation.restore(state)
        self._finish(simulation, seed, directory)

    def _finish(self, simulation: Simulation, seed: int, directory: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", HealthWarning)  # the summary says the same
            simulation.run(self.until, self.every, directory, progress=False)
        write_summary(
            directory / SUMMARY,
            case=self.name,
            parameters={},
            seed=seed,
            metrics={},
            health=simulation.health(),
            conservation=simulation.conservation(),
            performance=simulation.performance,
            settings={"threads": self.threads, **simulation.settings},
        )


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
        simulation = job.build(seed)
        if compile_loops:
            simulation.plan(job.every or simulation.largest_step())
            simulation.advance(simulation.chemistry_every)
