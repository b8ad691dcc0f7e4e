"""The runs of a validation.

A *row* is one run: a case and its parameters. Rows have directories of their own, so that a row
that is finished is not run again, and one that was broken off goes on from its checkpoint, as long
as version, parameters and options are the same. The page and the same numbers as JSON are written
again after every row.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click

from particell.cases import directories, execution
from particell.cases.base import Metric
from particell.errors import InputError
from particell.exits import INTERRUPTED, complain, guarded
from particell.output.files import prepare_directory, read_json, write_json
from particell.output.ownership import owned
from particell.output.run import CHECKPOINT, OWN_FILES, SUMMARY
from particell.output.summary import commit
from particell.validation.page import Before, Page
from particell.validation.rows import Row, select

#: What a row's directory was made with.
MARK = "validation.json"


@contextmanager
def directory(out: Path | None) -> Iterator[Path]:
    """Where the rows go: below ``out``, or somewhere that is gone afterwards."""
    if out is not None:
        yield out
    else:
        with tempfile.TemporaryDirectory() as base:
            yield Path(base)


def validate(
    names: Sequence[str],
    full: bool,
    out: Path | None,
    overwrite: bool,
    before: Path | None = None,
    longest: float = 10.0,
    **options: Any,
) -> int:
    """Run rows and write the page.

    Parameters
    ----------
    names
        Cases and groups.
    full
        Whether at the papers' sizes.
    out
        Directory for the rows and the page (``page/index.md``), or None to keep nothing.
    overwrite
        Run finished rows again.
    before, longest
        Directory of a page made before: rows that took more than ``longest`` minutes then are taken
        from there.
    **options
        As for :func:`particell.cases.execution.execute`.

    Returns
    -------
    int
        The largest exit status of the rows.
    """
    rows = select(names, full)
    commit()  # of the sources that run, which may be others hours later
    earlier = None if before is None else Before(before, longest)
    command = " ".join(["particell validate", *(["--full"] if full else []), *names])
    status: list[int] = []
    with directory(out) as base:
        page = Page(base / "page", rows, command)
        for k, row in enumerate(rows):
            click.echo(f"[{k + 1}/{len(rows)}] {row.kind.name} {row.settings}".rstrip())
            kept = earlier.longer(row) if earlier else None
            if kept is not None and earlier is not None:
                click.echo(f"taken from {earlier.place}\n")
                status.append(kept["status"])
                page.keep(row, kept, earlier.place)
                continue
            place = base / row.kind.name / row.slug

            def one(row: Row = row, place: Path = place) -> int:
                return run_row(row, place, overwrite, **options)

            try:
                status.append(guarded(place, one))
            except InputError as error:  # the other rows can still tell something
                status.append(complain(error))
            page.add(row, status[-1], place)
            if status[-1] == INTERRUPTED:
                return INTERRUPTED
            click.echo()
    report(rows, status)
    if out is not None:
        click.echo(f"page in {page.place / 'index.md'}")
    return max(status, default=0)


def report(rows: Sequence[Row], status: Sequence[int]) -> None:
    """Say how many rows passed, and which did not."""
    good = sum(code == 0 for code in status)
    failed = [f"{r.kind.name} {r.settings}".strip() for r, c in zip(rows, status, strict=True) if c]
    click.echo(
        f"{good} of {len(rows)} runs passed" + (f"; not: {', '.join(failed)}" if failed else "")
    )


def run_row(row: Row, place: Path, overwrite: bool, **options: Any) -> int:
    """Run a row, go on with it, or take its result where it is finished; gives the status."""
    with owned(prepare_directory(place)):
        return _run_owned(row, place, overwrite, options)


def _run_owned(row: Row, place: Path, overwrite: bool, options: Mapping[str, Any]) -> int:
    case = row.kind(**row.parameters)
    mark = {
        "version": version("particell"),
        "case": row.kind.name,
        "parameters": case.model_dump(mode="json"),
        "options": {k: v for k, v in options.items() if k not in ("progress", "threads")},
    }
    same = (place / MARK).is_file() and read_json(place / MARK, "mark") == mark
    if same and not overwrite:
        if (place / SUMMARY).is_file():
            summary = read_json(place / SUMMARY, "summary")
            metrics = {name: Metric(**values) for name, values in summary["metrics"].items()}
            click.echo(f"{execution.metrics_table(metrics)}\nfinished before, in {place}")
            healthy = all(found["passed"] for found in summary["health"].values())
            return 0 if healthy and all(m.passed for m in metrics.values()) else 1
        if (place / CHECKPOINT).is_file():
            return directories.resume(place, progress=options.get("progress", True))
    prepare_directory(place, *OWN_FILES)
    write_json(place / MARK, mark)
    return execution.execute(case, place, overwrite=True, **options)
