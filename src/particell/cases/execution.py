"""Running a recipe in a directory, and going on with it."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from particell.errors import HealthWarning, InputError
from particell.health import Finding, beyond
from particell.output.checkpoint import previous, read_checkpoint, take_previous
from particell.output.files import CheckpointError, prepare_directory, read_json, write_json
from particell.output.ownership import LOCK, owned
from particell.output.run import CASE, CHECKPOINT, OWN_FILES, SUMMARY, TRAJECTORY, Run
from particell.output.summary import commit, write_summary
from particell.recipe import Context, Metric, Recipe
from particell.restored import StateError

if TYPE_CHECKING:
    from particell.simulation import Simulation


def execute(
    recipe: Recipe,
    out: str | Path,
    seed: int = 1,
    threads: int | None = None,
    backend: str = "cpu",
    precision: str = "float64",
    progress: bool = True,
    overwrite: bool = False,
    report: bool = True,
) -> int:
    """Run a recipe and leave trajectory, checkpoint, figures and summary in a directory.

    Parameters
    ----------
    recipe
        A case with its parameters, say.
    out
        The directory; it must be new or empty unless ``overwrite``.
    seed, threads, backend, precision
        As for :class:`~particell.recipe.Context`.
    progress
        Whether to show a progress bar.
    overwrite
        Whether to replace what an earlier run left in the directory.
    report
        Whether to draw the figures and print the metrics.

    Returns
    -------
    int
        0 where every metric is within its limit, 1 where one is not.

    Raises
    ------
    InputError
        Before anything runs, where the input is wrong.
    RunError
        Where the run broke; the directory holds the last good checkpoint.
    """
    if not isinstance(seed, int) or not 0 <= seed < 2**56:
        raise InputError("seed", seed, "an integer from 0 to 2^56 - 1")
    context = Context(seed, backend, precision, threads)
    _ = context.device  # refuses what this machine has not, before a directory is made
    set_threads(threads)
    refuse_used_directory(out, overwrite)
    # Built first too: what refuses its parameters should leave no directory behind.
    simulation = recipe.build(context)
    with owned(prepare_directory(out)):
        refuse_used_directory(out, overwrite)
        directory = prepare_directory(out, *OWN_FILES)
        record_case(recipe, context, simulation, directory)
        return _finish(recipe, context, simulation, directory, progress, report)


def record_case(recipe: Recipe, context: Context, simulation: Simulation, directory: Path) -> None:
    """Write what a run is made from, and which run it is, where data can say it."""
    if recipe.is_data:
        run = getattr(simulation, "run_id", None)
        content = {**recipe.identity(), "context": asdict(context), "run": run}
        write_json(directory / CASE, content)


def go_on(
    recipe: Recipe,
    context: Context,
    directory: Path,
    progress: bool = True,
    report: bool = True,
    before: bool = False,
    again: bool = False,
) -> int:
    """Go on from the last checkpoint of a directory, or from the one ``before`` it.

    Returns as :func:`execute`. ``again`` writes ``case.json`` again, of a recipe that has another
    end.

    Raises
    ------
    InputError, CheckpointError
        Where the checkpoint cannot be read, or is of another recipe.
    """
    with owned(directory):
        simulation = _restored(recipe, context, directory, report, before)
        if again:
            from particell.observers import check_end

            check_end(simulation, recipe.until, recipe.every, directory)
            record_case(recipe, context, simulation, directory)
        return _finish(recipe, context, simulation, directory, progress, report)


def _restored(
    recipe: Recipe, context: Context, directory: Path, report: bool, before: bool
) -> Simulation:
    """The simulation of a directory, as its checkpoint has it, or at its beginning."""
    started = before or not _stopped_at_once(directory)
    path = directory / CHECKPOINT
    older = previous(path)
    if before and not older.is_file():
        raise CheckpointError(f"there is no checkpoint before {path}")
    with offering_the_previous(path, before):
        state, meta = read_checkpoint(older if before else path) if started else ({}, {})
    recorded = _recorded_run(directory)
    if started and recorded and meta.get("run", recorded) != recorded:
        allowed = f"of the same run as {directory / CASE}: it is of another one"
        raise InputError("checkpoint", str(path), allowed)
    set_threads(context.threads)
    if not isinstance(context.seed, int):
        raise InputError("seed", context.seed, "a whole number")
    simulation = recipe.build(context)
    if started:
        with offering_the_previous(path, before):
            simulation.restore(state)
        if before:
            take_previous(path)
    else:
        if recorded:
            simulation.run_id = recorded
        prepare_directory(directory, TRAJECTORY)
        if report:
            print("it was stopped before its first checkpoint: it starts anew")
    return simulation


def _recorded_run(directory: Path) -> str:
    """Which run the record of a case is of; nothing where there is none, or it does not say."""
    path = directory / CASE
    found = read_json(path, "case").get("run") if path.is_file() else None
    return found if isinstance(found, str) else ""


@contextlib.contextmanager
def offering_the_previous(path: Path, before: bool) -> Iterator[None]:
    """Where a checkpoint is damaged, say how to go on from the one before it."""
    try:
        yield
    except (CheckpointError, StateError) as error:
        if before or not previous(path).is_file():
            raise
        how = f"particell resume {path.parent} --previous"
        raise CheckpointError(f"{error}; go on from the one before it with: {how}") from None


def _stopped_at_once(directory: Path) -> bool:
    """Whether a run was stopped before its first checkpoint, which follows its first frame."""
    if (directory / CHECKPOINT).exists():
        return False
    if not (directory / TRAJECTORY).exists():
        return True
    try:
        return len(Run(directory)) <= 1
    except InputError:  # it may hold anything
        return False


def refuse_used_directory(out: str | Path, overwrite: bool) -> None:
    """Refuse an output directory that holds something, unless told to overwrite it."""
    directory = Path(out)
    if overwrite or not os.path.isdir(directory):  # which has no exceptions, whatever the name
        return
    if any(path.name != LOCK for path in directory.iterdir()):
        raise InputError("out", str(out), "a new or empty directory (or give --overwrite)")


def set_threads(threads: int | None) -> None:
    """Set the number of CPU threads for all loops to come."""
    if threads is None:
        return
    from particell.compute import threads as compute_threads

    most = compute_threads.available_threads()
    if not isinstance(threads, int) or not 1 <= threads <= most:
        raise InputError("threads", threads, f"between 1 and {most} on this machine")
    compute_threads.set_threads(threads)


def metrics_table(metrics: Mapping[str, Metric]) -> str:
    """The metrics as text: value, limit, what the paper has, and whether it is within the limit."""
    rows: list[tuple[str, ...]] = [("metric", "value", "limit", "paper", "unit", "")]
    for name, metric in metrics.items():
        verdict = "" if metric.limit is None else ("ok" if metric.passed else "FAILED")
        numbers = [_number(x) for x in (metric.value, metric.limit, metric.paper)]
        rows.append((name, *numbers, metric.unit, verdict))
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _finish(
    recipe: Recipe,
    context: Context,
    simulation: Simulation,
    directory: Path,
    progress: bool,
    report: bool,
) -> int:
    from particell.compute.threads import get_threads

    options = recipe.run_options()
    commit()  # of the sources that run, which may be others when it has ended
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HealthWarning)  # the report says the same
        simulation.run(
            until=recipe.until, every=recipe.every, out=directory, progress=progress, **options
        )
    # Read from the file, so that a resumed run is analysed as a whole.
    run = Run(directory)
    metrics = recipe.analyse(run, simulation)
    health = simulation.health()
    device = {"backend": context.backend, "precision": context.precision} if recipe.is_data else {}
    write_summary(
        directory / SUMMARY,
        case=recipe.name,
        parameters=recipe.parameters(),
        seed=context.seed,
        metrics={name: metric.as_dict() for name, metric in metrics.items()},
        health=health,
        conservation=simulation.conservation(),
        performance=simulation.performance,
        settings={**device, "threads": get_threads(), **simulation.settings},
    )
    if report:
        recipe.figures(run, directory)
        print_report(recipe, metrics, directory, health)
    sound = all(metric.passed for metric in metrics.values()) and not beyond(health)
    return 0 if sound else 1


def print_report(
    recipe: Recipe, metrics: Mapping[str, Metric], directory: Path, health: Sequence[Finding] = ()
) -> None:
    """Print the metrics, what is unhealthy, and where the output is."""
    lines = [f"{recipe.name}: {recipe.title}", metrics_table(metrics)]
    lines += [f"health: FAILED: {finding.line}" for finding in beyond(health)]
    with contextlib.suppress(BrokenPipeError):
        print("\n".join([*lines, f"output in {directory}"]))
