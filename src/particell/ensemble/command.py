"""The command ``particell ensemble``, and ``resume`` and ``plot`` for its directories."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from particell.cases.base import Case
from particell.ensemble.ensemble import Ensemble, EnsembleInterrupted
from particell.ensemble.report import finish
from particell.ensemble.results import EnsembleRun
from particell.errors import InputError

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


def resume(directory: Path, progress: bool, kind: str | None = None) -> int:
    """Go on with the ensemble of a directory; gives the exit status."""
    described = Ensemble.read(directory, kind)
    assert isinstance(described.description, Case)
    processes = EnsembleRun(directory).settings.get("processes")
    return _run(described, described.description, directory, processes, progress=progress)


def plot(directory: Path, kind: str | None = None) -> list[Path]:
    """Draw the figures of an ensemble again; gives their paths."""
    case = Ensemble.read(directory, kind).description
    assert isinstance(case, Case)
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
