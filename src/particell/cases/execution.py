"""Running a case in a directory, going on with it, and drawing its figures again."""

from __future__ import annotations

import contextlib
import copy
import os
import re
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from particell import cases
from particell.cases.base import Case, Context, Metric
from particell.errors import HealthWarning, InputError, unknown_name
from particell.health import Finding, beyond
from particell.output.checkpoint import read_checkpoint
from particell.output.files import prepare_directory, read_json, reason, write_json
from particell.output.run import CASE, CHECKPOINT, OWN_FILES, SUMMARY, TRAJECTORY, Run
from particell.output.summary import write_summary

if TYPE_CHECKING:
    from particell.simulation import Simulation


def execute(
    case: Case,
    out: str | Path,
    seed: int = 1,
    threads: int | None = None,
    backend: str = "cpu",
    precision: str = "float64",
    progress: bool = True,
    overwrite: bool = False,
    report: bool = True,
) -> int:
    """Run a case and leave trajectory, checkpoint, figures and summary in a directory.

    Parameters
    ----------
    case
        The case with its parameters.
    out
        The directory; it must be new or empty unless ``overwrite``.
    seed, threads, backend, precision
        As for :class:`~particell.cases.base.Context`.
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
    # Built first too: a case that refuses its parameters should leave no directory behind.
    simulation = case.build(context)
    directory = prepare_directory(out, *OWN_FILES)
    write_json(directory / CASE, identity(case, context))
    return _finish(case, context, simulation, directory, progress, report)


def resume(
    directory: str | Path, progress: bool = True, kind: type[Case] | str | None = None
) -> int:
    """Go on from the last checkpoint of a directory; returns as :func:`execute`.

    ``kind`` is the class of a case that is not built in, as for :func:`read_case`.

    Raises
    ------
    InputError, CheckpointError
        Where the directory holds no run, or its checkpoint cannot be read.
    """
    directory = Path(directory)
    case, context = read_case(directory, kind)
    return go_on(case, context, directory, progress)


def go_on(
    case: Case, context: Context, directory: Path, progress: bool = True, report: bool = True
) -> int:
    """:func:`resume` with the case and how it is run given."""
    started = not _stopped_at_once(directory)
    state, _ = read_checkpoint(directory / CHECKPOINT) if started else ({}, {})
    set_threads(context.threads)
    if not isinstance(context.seed, int):
        raise InputError("seed", context.seed, "a whole number")
    simulation = case.build(context)
    if started:
        simulation.restore(state)
    else:
        prepare_directory(directory, TRAJECTORY)
        if report:
            print("it was stopped before its first checkpoint: it starts anew")
    return _finish(case, context, simulation, directory, progress, report)


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


def replot(directory: str | Path, kind: type[Case] | str | None = None) -> list[Path]:
    """Draw the figures of a directory again; gives the paths of the PNG files.

    ``kind`` is the class of a case that is not built in, as for :func:`read_case`.
    """
    directory = Path(directory)
    case, _ = read_case(directory, kind)
    return case.figures(Run(directory), directory)


def read_case(directory: str | Path, kind: type[Case] | str | None = None) -> tuple[Case, Context]:
    """The case that a directory was made from, and how it was run.

    Parameters
    ----------
    directory
        Of a run. It is data: nothing that it names is imported but the program's own cases.
    kind
        The class of a case that is not built in, or its ``"module:Class"``.

    Raises
    ------
    InputError
        Where it holds no run, or one of a case that is neither built in nor given.
    """
    path = Path(directory) / CASE
    if not os.path.isfile(path):
        raise InputError("directory", str(directory), f"one with the output of a run ({CASE})")
    found = read_json(path, "case")
    try:
        name, reference = found["case"], found.get("class")
        parameters, context = dict(found["parameters"]), Context(**found["context"])
        described = cases.recorded(str(name), reference, kind)
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        allowed = f"a case file of particell ({type(error).__name__}: {reason(error)})"
        raise InputError("case", str(path), allowed) from None
    return described(**parameters), context


def read_case_file(path: str | Path) -> tuple[type[Case], dict[str, Any]]:
    """Class and parameters from a TOML file.

    It either has ``case = "name"`` and a table ``[parameters]``, or it describes a whole simulation
    (:mod:`particell.casefile`).

    Raises
    ------
    InputError
        Where the file cannot be read, is not TOML, or has other keys.
    """
    try:
        with open(path, "rb") as handle:
            content = tomllib.loads(handle.read().decode("utf-8-sig"))  # editors mark UTF-8
    except OSError as error:
        raise InputError("case file", str(path), f"a readable file ({reason(error)})") from None
    except RecursionError:
        raise InputError("case file", str(path), "nested less deeply") from None
    except ValueError as error:  # of TOML, of the text's encoding, of numbers too long
        raise InputError("case file", str(path), f"valid TOML ({reason(error)})") from None
    if not {"case", "parameters"} & set(content):
        from particell.casefile.case import FileCase
        from particell.casefile.networks import located

        return FileCase, {"name": _name_of(path), **located(content, Path(path).parent)}
    for key in content:
        if key not in ("case", "parameters"):
            raise unknown_name("key", key, ("case", "parameters"))
    name, parameters = content.get("case"), content.get("parameters", {})
    if not isinstance(name, str):
        raise InputError("case", name, "the name of a case")
    if not isinstance(parameters, Mapping):
        raise InputError("parameters", parameters, "a table")
    return cases.load(name), dict(parameters)


def _name_of(path: str | Path) -> str:
    """A file's name as one of a case."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", Path(path).stem).lstrip("_.-") or "case"


def with_settings(parameters: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters with others in their place; ``table.key`` and ``list.1.key`` (from 1) go deeper.

    Raises
    ------
    InputError
        Where there is no such table or item.
    """
    result: dict[str, Any] = copy.deepcopy(dict(parameters))
    for path, value in settings.items():
        *tables, last = path.split(".")
        place: Any = result
        for part in tables:
            key = _key_in(place, part, path)
            place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
        place[_key_in(place, last, path)] = value
    return result


def _key_in(place: Any, part: str, path: str) -> Any:
    """The key of a table, or the index in a list, that a part of a path means."""
    if isinstance(place, dict):
        return part
    if isinstance(place, list) and part.isdecimal() and 1 <= int(part) <= len(place):
        return int(part) - 1
    raise InputError("--set", path, "the path of a key, such as run.until or species.1.name")


def refuse_used_directory(out: str | Path, overwrite: bool) -> None:
    """Refuse an output directory that holds something, unless told to overwrite it."""
    directory = Path(out)
    # os.path has no exceptions for names that no file can have
    if os.path.isdir(directory) and any(directory.iterdir()) and not overwrite:
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


def identity(case: Case, context: Context) -> dict[str, Any]:
    """What it takes to build the same simulation again."""
    kind = type(case)
    reference = f"{kind.__module__}:{kind.__qualname__}"
    built_in = cases.CASES.get(case.name, ("",))[0] == reference
    return {
        "case": case.name,
        "class": None if built_in else reference,
        "parameters": case.model_dump(mode="json"),
        "context": {
            "seed": context.seed,
            "backend": context.backend,
            "precision": context.precision,
            "threads": context.threads,
        },
    }


def _finish(
    case: Case,
    context: Context,
    simulation: Simulation,
    directory: Path,
    progress: bool,
    report: bool,
) -> int:
    from particell.compute.threads import get_threads

    options = case.run_options()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HealthWarning)  # the report says the same
        simulation.run(
            until=case.until, every=case.every, out=directory, progress=progress, **options
        )
    # Read from the file, so that a resumed run is analysed as a whole.
    run = Run(directory)
    metrics = case.analyse(run, simulation)
    health = simulation.health()
    write_summary(
        directory / SUMMARY,
        case=case.name,
        parameters=case.parameters(),
        seed=context.seed,
        metrics={name: metric.as_dict() for name, metric in metrics.items()},
        health=health,
        conservation=simulation.conservation(),
        performance=simulation.performance,
        settings={
            "backend": context.backend,
            "precision": context.precision,
            "threads": get_threads(),
            **simulation.settings,
        },
    )
    if report:
        case.figures(run, directory)
        print_report(case, metrics, directory, health)
    sound = all(metric.passed for metric in metrics.values()) and not beyond(health)
    return 0 if sound else 1


def print_report(
    case: Case, metrics: Mapping[str, Metric], directory: Path, health: Sequence[Finding] = ()
) -> None:
    """Print the metrics, what is unhealthy, and where the output is."""
    lines = [f"{case.name}: {case.title}", metrics_table(metrics)]
    lines += [f"health: FAILED: {finding.line}" for finding in beyond(health)]
    with contextlib.suppress(BrokenPipeError):
        print("\n".join([*lines, f"output in {directory}"]))
