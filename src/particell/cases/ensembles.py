"""Ensembles of a case: run, gone on with and drawn again; metrics, figures, ``summary.json``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click

from particell import cases
from particell.cases import execution
from particell.cases.base import Case, Metric
from particell.ensemble.ensemble import Ensemble, EnsembleInterrupted, recorded
from particell.ensemble.report import member_metrics
from particell.ensemble.results import EnsembleRun
from particell.errors import InputError
from particell.output.files import reason, write_json
from particell.output.run import SUMMARY
from particell.output.summary import versions

INTERRUPTED = 130


def run(
    case: Case,
    directory: Path,
    runs: int,
    seed: int,
    threads: int | None = None,
    backend: str = "cpu",
    precision: str = "float64",
    **options: Any,
) -> int:
    """Run an ensemble of a case; gives the exit status."""
    described = Ensemble(
        case, runs, seed, threads=threads or 1, backend=backend, precision=precision
    )
    return _run(described, case, directory, **options)


def read_ensemble(
    directory: str | Path, kind: type[Case] | str | None = None
) -> tuple[Ensemble, Case]:
    """The ensemble that a directory was made from, and its case.

    Parameters
    ----------
    directory
        Of an ensemble. It is data: nothing that it names is imported but the program's own cases.
    kind
        The class of a case that is not built in, or its ``"module:Class"``.

    Raises
    ------
    InputError
        Where it holds no ensemble, or one of a function, or of a case that is neither built in nor
        given.
    """
    found = recorded(Path(directory))
    what = found["description"]
    try:
        if "function" in what:
            allowed = "an ensemble of a case (this one is of a function: call its script again)"
            raise InputError("directory", str(directory), allowed)
        described = cases.recorded(str(what["case"]), what.get("class"), kind)
        parameters = dict(what["parameters"])
        options = {name: what[name] for name in ("backend", "precision")}
        threads = found["threads"]
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        allowed = f"one with an ensemble of particell ({type(error).__name__}: {reason(error)})"
        raise InputError("directory", str(directory), allowed) from None
    case = described(**parameters)
    return Ensemble(case, found["runs"], found["seed"], threads=threads, **options), case


def resume(directory: Path, progress: bool, kind: str | None = None) -> int:
    """Go on with the ensemble of a directory; gives the exit status."""
    described, case = read_ensemble(directory, kind)
    processes = EnsembleRun(directory).settings.get("processes")
    return _run(described, case, directory, processes, progress=progress)


def plot(directory: Path, kind: str | None = None) -> list[Path]:
    """Draw the figures of an ensemble again; gives their paths."""
    _, case = read_ensemble(directory, kind)
    result = EnsembleRun(directory)
    if not len(result):
        raise InputError("directory", str(directory), "one with at least one finished realisation")
    return case.ensemble_figures(result, result.directory)


def _run(
    described: Ensemble,
    case: Case,
    directory: Path,
    processes: int | None = None,
    client: str | None = None,
    progress: bool = True,
    overwrite: bool = False,
) -> int:
    try:
        result = described.run(directory, processes, client, progress, overwrite)
    except EnsembleInterrupted as error:
        click.echo(str(error), err=True)
        return INTERRUPTED
    return finish(case, described, result)


def finish(case: Case, ensemble: Ensemble, result: EnsembleRun) -> int:
    """Write summary and figures of an ensemble of a case, and print its metrics.

    Returns
    -------
    int
        3 where a realisation failed, else 1 where a metric of the ensemble is beyond its limit,
        else 0.
    """
    metrics = case.ensemble_metrics(result) if len(result) else {}
    _write_summary(case, ensemble, result, metrics)
    if len(result):
        case.ensemble_figures(result, result.directory)
        execution.print_report(case, metrics, result.directory)
    for name, metric in member_metrics(result).items():
        if metric["beyond"]:
            print(f"{name}: beyond its limit in {metric['beyond']} of {len(result)} realisations")
    print(f"{len(result)} of {ensemble.runs} realisations done")
    if len(result) < ensemble.runs:
        return 3
    return 0 if all(metric.passed for metric in metrics.values()) else 1


def _write_summary(
    case: Case, ensemble: Ensemble, result: EnsembleRun, metrics: Mapping[str, Metric]
) -> None:
    runs = [run.summary["performance"] for run in result.runs]
    last = {}
    if len(result) > 1:
        for name in result.observable_names:
            values = result.moments(name)
            last[name] = {"mean": float(values.mean), "deviation": float(values.deviation)}
    write_json(
        result.directory / SUMMARY,
        {
            "case": case.name,
            "version": version("particell"),
            "parameters": case.parameters(),
            "seed": ensemble.seed,
            "runs": ensemble.runs,
            "finished": result.indices,
            "failed": [
                {"run": k, "seed": ensemble.seeds[k], "error": error}
                for k, error in result.failed.items()
            ],
            "metrics": {name: metric.as_dict() for name, metric in metrics.items()},
            "members": member_metrics(result),
            "observables_at_the_end": last,
            "performance": {
                key: sum(run[key] for run in runs)
                for key in ("steps", "wall_seconds", "ssa_events", "diffusion_jumps")
                if runs and all(key in run for run in runs)
            },
            "settings": {**result.settings, "versions": versions()},
        },
    )
