"""``particell validate``: cases against their references, one page of numbers and figures.

A *row* is one run: a case and its parameters. Rows have directories of their own, so that a row
that is finished is not run again, and one that was broken off goes on from its checkpoint, as long
as version, parameters and options are the same. The page and the same numbers as JSON are written
again after every row.
"""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click

from particell import cases
from particell.cases import directories, execution
from particell.cases.base import Case, Metric
from particell.errors import InputError
from particell.output.files import prepare_directory, read_json, replacing, write_json
from particell.output.run import CHECKPOINT, OWN_FILES, SUMMARY

#: Named groups of cases; a case that this version does not have is left out.
GROUPS = {
    "sdpd-ssa": (
        "diffusion-1d",
        "diffusion-2d",
        "annihilation-1d",
        "natural-convection",
        "yeast-channel",
        "equilibrium-2d",
        "equilibrium-3d",
        "thermal-modes",
    ),
    "stochastic": ("birth-death", "isomerisation", "turing", "min-oscillation"),
    "transport-velocity": (
        "poiseuille",
        "couette",
        "lid-driven-cavity",
        "rotating-cylinder",
        "drag-array",
        "taylor-green",
        "natural-convection",
    ),
}
#: What a group wants of cases that have such parameters: other rows of these are left out.
GROUP_PARAMETERS: dict[str, Mapping[str, Any]] = {
    "sdpd-ssa": {"scheme": "sdpd"},
    "transport-velocity": {"scheme": "transport-velocity"},
}
#: What a row's directory was made with.
MARK = "validation.json"
#: Cases with more rows than this show the figure of the first row only.
FIGURES = 9
INTERRUPTED = 130


@dataclass(frozen=True)
class Row:
    """One run of the validation.

    Attributes
    ----------
    kind
        The case.
    parameters
        Those that are not the default.
    """

    kind: type[Case]
    parameters: Mapping[str, Any]

    @property
    def settings(self) -> str:
        """The parameters as text, ``key=value`` separated by spaces."""
        return " ".join(f"{key}={toml(value)}" for key, value in self.parameters.items())

    @property
    def slug(self) -> str:
        """Name of the row's directory and of its figures."""
        return self.settings.replace(" ", "_").replace("=", "-").replace('"', "") or "default"

    @property
    def command(self) -> str:
        """The command that makes the same run."""
        settings = "".join(f" --set {part}" for part in self.settings.split())
        return f"particell run {self.kind.name}{settings}"


def toml(value: Any) -> str:
    """A parameter as it is written on the command line."""
    return str(value).lower() if isinstance(value, bool) else f"{value}"


def select(names: Sequence[str], full: bool) -> list[Row]:
    """The rows of cases and groups (default: every case once).

    Raises
    ------
    InputError
        Where a name is neither a case nor a group.
    """
    found: list[Row] = []
    for name in names or cases.names():
        wanted = GROUP_PARAMETERS.get(name, {})
        known = [n for n in GROUPS.get(name, ()) if n in cases.CASES] or [name]
        for kind in map(cases.load, known):
            rows = [Row(kind, parameters) for parameters in sizes(kind, full, wanted)]
            found += [row for row in rows if row not in found]
    # the rows of a case one after another, for the page
    kinds = list(dict.fromkeys(row.kind for row in found))
    return sorted(found, key=lambda row: kinds.index(row.kind))


def sizes(kind: type[Case], full: bool, wanted: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Parameters of a case's rows, the default ones or those of the papers, with those wanted."""
    defaults = {k: info.get_default() for k, info in kind.model_fields.items()}
    wanted = {k: v for k, v in wanted.items() if k in defaults}
    if not full:
        return [{k: v for k, v in wanted.items() if defaults[k] != v}]
    given = [kind.full] if isinstance(kind.full, Mapping) else list(kind.full)
    return [row for row in given if all({**defaults, **row}[k] == v for k, v in wanted.items())]


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
    guarded: Callable[[Path, Callable[[], int]], int],
    complain: Callable[[Exception], int],
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
    guarded, complain
        How the command line runs something in a directory, and how it says that input is wrong.
    **options
        As for :func:`particell.cases.execution.execute`.

    Returns
    -------
    int
        The largest exit status of the rows.
    """
    rows = select(names, full)
    command = " ".join(["particell validate", *(["--full"] if full else []), *names])
    status: list[int] = []
    with directory(out) as base:
        for k, row in enumerate(rows):
            click.echo(f"[{k + 1}/{len(rows)}] {row.kind.name} {row.settings}".rstrip())
            place = base / row.kind.name / row.slug

            def one(row: Row = row, place: Path = place) -> int:
                return run_row(row, place, overwrite, **options)

            try:
                status.append(guarded(place, one))
            except InputError as error:  # the other rows can still tell something
                status.append(complain(error))
            if out is not None:
                write_page(base, rows[: k + 1], status, command)
            if status[-1] == INTERRUPTED:
                return INTERRUPTED
            click.echo()
    good = sum(code == 0 for code in status)
    failed = [f"{r.kind.name} {r.settings}".strip() for r, c in zip(rows, status, strict=True) if c]
    click.echo(
        f"{good} of {len(rows)} runs passed" + (f"; not: {', '.join(failed)}" if failed else "")
    )
    if out is not None:
        click.echo(f"page in {base / 'page' / 'index.md'}")
    return max(status, default=0)


def run_row(row: Row, place: Path, overwrite: bool, **options: Any) -> int:
    """Run a row, go on with it, or take its result where it is finished; gives the status."""
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
            metrics = metrics_of(place)
            click.echo(f"{execution.metrics_table(metrics)}\nfinished before, in {place}")
            return 0 if all(m.passed for m in metrics.values()) else 1
        if (place / CHECKPOINT).is_file():
            return directories.resume(place, progress=options.get("progress", True))
    prepare_directory(place, *OWN_FILES)
    write_json(place / MARK, mark)
    return execution.execute(case, place, overwrite=True, **options)


def metrics_of(place: Path) -> dict[str, Metric]:
    """The metrics that a run has left."""
    found = read_json(place / SUMMARY, "summary")["metrics"]
    return {name: Metric(**values) for name, values in found.items()}


# --- the page --------------------------------------------------------------------------------


def write_page(base: Path, rows: Sequence[Row], status: Sequence[int], command: str) -> Path:
    """Write ``page/index.md`` with its figures, and ``page/results.json``; gives the page."""
    page = base / "page"
    page.mkdir(parents=True, exist_ok=True)
    results, lines = [], [*heading(command), ""]
    for kind in dict.fromkeys(row.kind for row in rows):
        own = [(r, s) for r, s in zip(rows, status, strict=True) if r.kind is kind]
        lines += [f"## {kind.name}", "", f"{kind.title}."]
        lines += [f"Reference: {kind.reference}."] if kind.reference else []
        lines += ["", *table_head()]
        pictures = []
        for row, code in own:
            place = base / kind.name / row.slug
            result: dict[str, Any] = {"case": kind.name, "status": code}
            result |= {"settings": row.settings, "command": row.command}
            if (place / SUMMARY).is_file():
                summary = read_json(place / SUMMARY, "summary")
                result |= {key: summary[key] for key in ("metrics", "performance", "version")}
                lines += table_rows(row, metrics_of(place))
                drawn = sorted(place.glob("*.png"), key=lambda path: path.stat().st_mtime_ns)
                pictures += [(row, path) for path in drawn[:1]]  # what the case draws first
            else:
                lines.append(f"| {row.settings or 'default'} | did not finish | | | | no |")
            results.append(result)
        lines += ["", *(times(own, base)), ""]
        for row, path in pictures if len(own) <= FIGURES else pictures[:1]:
            name = f"{kind.name}_{row.slug}_{path.name}"
            shutil.copyfile(path, page / name)
            lines += [f"![{kind.name} {row.settings}]({name})"]
        lines.append("")
    with replacing(page / "index.md") as partial:
        partial.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    write_json(page / "results.json", {"command": command, "machine": machine(), "rows": results})
    return page / "index.md"


def machine() -> str:
    """The machine, in general words."""
    return f"{os.cpu_count()} processors ({platform.machine()}), {platform.system()}"


def heading(command: str) -> list[str]:
    """What the page is, and how it was made."""
    return [
        "# Validation",
        "",
        f"Made by `{command}` with version {version('particell')} on {machine()}.",
        "A value with a limit is an error and passes if its magnitude is at most the limit;",
        "*paper* is what a publication printed for the same.",
    ]


def table_head() -> list[str]:
    """Head of a case's table."""
    return [
        "| run | metric | ours | paper | limit | passed |",
        "| --- | --- | --- | --- | --- | --- |",
    ]


def table_rows(row: Row, metrics: Mapping[str, Metric]) -> list[str]:
    """One line a metric."""
    lines = []
    for k, (name, m) in enumerate(metrics.items()):
        run = (row.settings or "default") if k == 0 else ""
        verdict = "" if m.limit is None else ("yes" if m.passed else "**no**")
        ours, paper, limit = (
            "–" if x is None else f"{x:.3g}" + (f" {m.unit}" if m.unit else "")
            for x in (m.value, m.paper, m.limit)
        )
        lines.append(f"| {run} | {name} | {ours} | {paper} | {limit} | {verdict} |")
    return lines


def times(own: Sequence[tuple[Row, int]], base: Path) -> list[str]:
    """The commands of the rows, with particles, steps and seconds."""
    lines = []
    for row, _ in own:
        path = base / row.kind.name / row.slug / SUMMARY
        if path.is_file():
            p = read_json(path, "summary")["performance"]
            numbers = f"{p['particles']} particles, {p['steps']} steps, {p['wall_seconds']:.0f} s"
            lines.append(f"- `{row.command}` ({numbers})")
    return lines
