"""Many realisations of one description, each with a seed of its own."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

from particell.compute.threads import kept_threads
from particell.ensemble import pool
from particell.ensemble.jobs import (
    DONE,
    FAILED,
    Job,
    Outcome,
    finished,
    prepare,
)
from particell.ensemble.realisations import ENSEMBLE, FAILURE, member
from particell.ensemble.results import EnsembleRun
from particell.errors import InputError, MissingExtra, ParticellError
from particell.observers import stop_requests
from particell.output.files import plain, prepare_directory, read_json, write_json
from particell.output.ownership import LOCK, owned
from particell.output.run import OWN_FILES
from particell.recipe import FunctionRecipe, Recipe

if TYPE_CHECKING:
    from particell.simulation import Simulation

LARGEST_SEED = 2**56 - 1
MOST_RUNS = 1_000_000


def realisation_seed(seed: int, index: int) -> int:
    """Seed of realisation ``index`` of an ensemble with the given master seed.

    The upper 56 bits of the first 64-bit word of
    ``numpy.random.SeedSequence(seed).spawn(index + 1)[index]``: it depends on the master seed and
    the index only, not on how many realisations there are or where they run.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=(index,))
    return int(sequence.generate_state(1, np.uint64)[0]) >> 8


class EnsembleInterrupted(ParticellError):  # noqa: N818 - the user's wish, not an error
    """The user stopped an ensemble; calling it again with the same directory goes on.

    Parameters
    ----------
    directory
        The ensemble's directory.
    done, runs
        How many realisations are complete, and of how many.
    """

    def __init__(self, directory: Path, done: int, runs: int):
        self.directory, self.done, self.runs = directory, done, runs
        how = f"particell resume {directory}, or the same call again"
        super().__init__(f"stopped with {done} of {runs} realisations done; go on with: {how}")


class Ensemble:
    """N realisations of one description.

    Parameters
    ----------
    description
        A :class:`~particell.cases.base.Case` (or another :class:`~particell.recipe.Recipe`), or a
        function ``build(seed)`` that gives a :class:`~particell.simulation.Simulation` with that
        seed.
    runs
        How many.
    seed
        Master seed, 0 to 2⁵⁶ - 1; realisation k has :func:`realisation_seed` of it, and so the
        same bits alone or among others, whatever the number of processes.
    until, every
        As for :meth:`particell.simulation.Simulation.run`; only with a function (a case has its
        own).
    threads
        CPU threads of one realisation.
    backend, precision
        As for :class:`~particell.recipe.Context`; only with a case.

    Raises
    ------
    InputError
        Where one of these is wrong.

    Examples
    --------
    >>> import particell as pc
    >>> from particell.cases.diffusion_1d import Diffusion1D
    >>> ensemble = pc.Ensemble(Diffusion1D(resolution=16), runs=100, seed=7)
    >>> result = ensemble.run(out="out/slab")                                  # doctest: +SKIP
    >>> result.mean("concentration/C_molecules", frame=-1)                     # doctest: +SKIP
    """

    def __init__(
        self,
        description: Recipe | Callable[[int], Simulation],
        runs: int,
        seed: int = 1,
        *,
        until: float | None = None,
        every: float | None = None,
        threads: int = 1,
        backend: str = "cpu",
        precision: str = "float64",
    ):
        self.runs = _whole("runs", runs, 1, MOST_RUNS)
        self.seed = _whole("seed", seed, 0, LARGEST_SEED)
        threads = _whole("threads", threads, 1, 4096)
        if isinstance(description, Recipe):
            if until is not None or every is not None:
                key, value = ("until", until) if until is not None else ("every", every)
                raise InputError(key, value, "left out: a case has its own")
            recipe = description
        elif callable(description):
            if (backend, precision) != ("cpu", "float64"):
                raise InputError("backend", backend, "left out: the function chooses the device")
            if not isinstance(until, int | float) or not until > 0:
                raise InputError("until", until, "a positive time in s, with a function")
            recipe = FunctionRecipe(description, until, every)
        else:
            allowed = "a case or a function build(seed) that gives a simulation"
            raise InputError("description", description, allowed)
        self.description = description
        self.job = Job(recipe, backend, precision, threads)
        _ = self.job.context(0).device  # refuses what this machine has not
        self.seeds = [realisation_seed(self.seed, k) for k in range(self.runs)]
        if len(set(self.seeds)) < self.runs:  # 7e-6 for a million of them
            raise InputError("seed", seed, "another one: two realisations would have the same")

    def run(
        self,
        out: str | Path | None = None,
        processes: int | None = None,
        client: Any = None,
        progress: bool = True,
        overwrite: bool = False,
    ) -> EnsembleRun:
        """Run what is not finished yet.

        Parameters
        ----------
        out
            Directory; a realisation's output is in ``run-0000``, ``run-0001``, … below it. Where
            it already holds this ensemble, finished realisations are kept and half-finished ones
            go on from their checkpoints; ``runs`` may have grown. By default a temporary
            directory, which lives as long as the result.
        processes
            Local processes (default: one per core); 1 runs in this process.
        client
            A ``dask.distributed.Client``, or the address of a scheduler, to run there instead.
            Its workers have to see ``out`` under the same name and have one thread each.
        progress
            Whether to show a progress bar.
        overwrite
            Whether to replace what the directory holds of another ensemble.

        Returns
        -------
        EnsembleRun
            The finished realisations; :attr:`EnsembleRun.failed` says which failed, and why.

        Raises
        ------
        InputError
            Before anything runs, where the input is wrong.
        EnsembleInterrupted
            After Ctrl-C.
        """
        if processes is not None:
            _whole("processes", processes, 1, 4096)
        if client is not None and out is None:
            raise InputError("out", out, "given: a directory that the cluster's workers see too")
        client, own = _client(client)
        with own:
            directory = Path(out or tempfile.mkdtemp(prefix="particell-")).absolute()
            self._refuse_other(directory, overwrite)
            tasks = [
                (k, seed, member(directory, k))
                for k, seed in enumerate(self.seeds)
                if overwrite or not finished(member(directory, k))
            ]
            width = min(processes or pool.default_processes(), max(len(tasks), 1))
            if tasks:
                prepare(self.job, tasks[0][1], compile_loops=width > 1 or client is not None)
            with owned(prepare_directory(directory)):
                self._refuse_other(directory, overwrite)
                self._claim(directory, overwrite, processes)
                stopped = self._run(tasks, width, client, progress, directory)
        result = EnsembleRun(directory)
        if out is None and not stopped:
            weakref.finalize(result, shutil.rmtree, directory, ignore_errors=True)
        if stopped:
            raise EnsembleInterrupted(directory, len(result), self.runs)
        return result

    def _run(
        self, tasks: list[pool.Task], width: int, client: Any, progress: bool, directory: Path
    ) -> bool:
        """Run the tasks; gives whether the user stopped them."""
        bar = tqdm(
            total=self.runs,
            initial=self.runs - len(tasks),
            unit="run",
            disable=not progress,
            desc="realisations",
        )
        counts = {DONE: 0, FAILED: 0}

        def report(outcome: Outcome) -> None:
            failure = member(directory, outcome.index) / FAILURE
            if outcome.status == FAILED:
                failure.parent.mkdir(parents=True, exist_ok=True)
                content = {"error": outcome.error, "traceback": outcome.details}
                write_json(failure, content)
                line = f"realisation {outcome.index} failed: {outcome.error}"
                tqdm.write(line, sys.stderr)
            elif outcome.status == DONE:
                failure.unlink(missing_ok=True)
            if outcome.status in counts:
                counts[outcome.status] += 1
                bar.update()
                if counts[FAILED]:
                    bar.set_postfix_str(f"{counts[FAILED]} failed")

        with bar, kept_threads(), stop_requests() as asked:
            if client is not None:
                pool.run_cluster(self.job, tasks, client, asked, report)
            elif width == 1:
                pool.run_here(self.job, tasks, asked, report)
            else:
                pool.run_processes(self.job, tasks, width, asked, report)
        return sum(counts.values()) < len(tasks)

    def _identity(self) -> dict[str, Any]:
        return plain({"description": self.job.identity(), "seed": self.seed})

    def _refuse_other(self, directory: Path, overwrite: bool) -> None:
        if overwrite or not directory.is_dir():
            return
        if all(path.name == LOCK for path in directory.iterdir()):
            return
        if (directory / ENSEMBLE).is_file():
            found = recorded(directory)
            if {key: found.get(key) for key in ("description", "seed")} == self._identity():
                return
        allowed = "a new or empty directory, or one of this very ensemble (or overwrite it)"
        raise InputError("out", str(directory), allowed)

    def _claim(self, directory: Path, overwrite: bool, processes: int | None) -> None:
        if overwrite:
            for old in directory.glob("run-[0-9]*"):
                prepare_directory(old, *OWN_FILES)
                (old / FAILURE).unlink(missing_ok=True)
        prepare_directory(directory, *OWN_FILES)
        content = {
            **self._identity(),
            "runs": self.runs,
            "seeds": "numpy SeedSequence.spawn",
            "processes": processes,
            "threads": self.job.threads,
        }
        write_json(directory / ENSEMBLE, content)


def is_ensemble(directory: str | Path) -> bool:
    """Whether a directory holds an ensemble."""
    return os.path.isfile(Path(directory) / ENSEMBLE)


def recorded(directory: Path) -> dict[str, Any]:
    """What the directory of an ensemble says of it.

    Raises
    ------
    InputError
        Where there is no ensemble.
    """
    found = read_json(directory / ENSEMBLE, "directory")
    if not isinstance(found, dict) or not {"description", "seed", "runs"} <= set(found):
        raise InputError("directory", str(directory), "one with an ensemble of particell")
    return found


def _client(client: Any) -> tuple[Any, Any]:
    """A client (connected to, if it is an address), and what closes it in the end."""
    from contextlib import nullcontext

    if not isinstance(client, str):
        if client is not None and not hasattr(client, "get_executor"):
            raise InputError("client", client, "a dask.distributed.Client or an address")
        return client, nullcontext()
    try:
        from dask.distributed import Client
    except ImportError:
        raise MissingExtra("a client of a cluster", "dask", "cluster") from None
    try:
        connected = Client(client, timeout=10)
    except (OSError, ValueError) as error:
        allowed = f"the address of a scheduler that answers ({' '.join(str(error).split())})"
        raise InputError("client", client, allowed) from None
    return connected, closing(connected)


def _whole(key: str, value: object, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InputError(key, value, f"a whole number from {least} to {most}")
    if not least <= value <= most:
        raise InputError(key, value, f"a whole number from {least} to {most}")
    return int(value)
