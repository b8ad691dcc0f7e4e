"""The page of a validation: one table a case, figures, and the same numbers as JSON."""

from __future__ import annotations

import contextlib
import os
import platform
import shutil
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from particell.cases.base import Case, Metric
from particell.errors import InputError
from particell.output.files import read_json, replacing, write_json
from particell.output.run import SUMMARY
from particell.output.summary import commit
from particell.validation.rows import Row

#: Cases with more rows than this show the figure of the first row only.
FIGURES = 9
RESULTS = "results.json"


class Page:
    """A page that grows row by row.

    Parameters
    ----------
    place
        Its directory, with ``index.md``, ``results.json`` and figures.
    rows
        All rows that it will have.
    command
        What makes it.
    """

    def __init__(self, place: Path, rows: Sequence[Row], command: str):
        self.place, self.command, self.rows = place, command, list(rows)
        self._results: list[tuple[Row, dict[str, Any]]] = []
        kinds = [row.kind for row in rows]
        many = {kind for kind in kinds if kinds.count(kind) > FIGURES}
        self._drawn = [row for k, row in enumerate(rows) if row.kind not in many or k == 0
                       or kinds[k - 1] is not row.kind]  # fmt: skip

    def add(self, row: Row, status: int, run: Path) -> None:
        """Add a row that has been run in a directory, and write the page."""
        result: dict[str, Any] = {"case": row.kind.name, "status": status}
        result |= {"settings": row.settings, "command": row.command}
        if (run / SUMMARY).is_file():
            summary = read_json(run / SUMMARY, "summary")
            result |= {key: summary[key] for key in ("metrics", "performance", "version")}
            result["commit"] = summary["settings"]["versions"].get("commit")
            drawn = sorted(run.glob("*.png"), key=lambda path: path.stat().st_mtime_ns)
            self._take(row, result, drawn[:1])  # what the case draws first
        self._results.append((row, result))
        self._write()

    def keep(self, row: Row, result: Mapping[str, Any], where: Path) -> None:
        """Take a row over from the page in a directory, and write this page."""
        kept = {key: value for key, value in result.items() if key != "figure"}
        figures = [where / result["figure"]] if "figure" in result else []
        self._take(row, kept, [figure for figure in figures if figure.is_file()])
        self._results.append((row, kept))
        self._write()

    def _take(self, row: Row, result: dict[str, Any], figures: Sequence[Path]) -> None:
        """Copy a figure that the page shows."""
        self.place.mkdir(parents=True, exist_ok=True)
        for path in figures if row in self._drawn else []:
            head = f"{row.kind.name}_{row.slug}_"
            result["figure"] = head + path.name.removeprefix(head)
            with contextlib.suppress(shutil.SameFileError):  # of this page as it was before
                shutil.copyfile(path, self.place / result["figure"])

    def _write(self) -> None:
        self.place.mkdir(parents=True, exist_ok=True)
        lines = [*heading(self.command), ""]
        for kind in dict.fromkeys(row.kind for row, _ in self._results):
            lines += _of_case(kind, [pair for pair in self._results if pair[0].kind is kind])
        made = [row for row, _ in self._results]
        if missing := [row for row in self.rows if row not in made]:
            lines += ["## Not made yet", "", *(f"- `{row.command}`" for row in missing)]
        with replacing(self.place / "index.md") as partial:
            partial.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
        rows = [result for _, result in self._results]
        found = {"command": self.command, "machine": machine(), "rows": rows}
        write_json(self.place / RESULTS, found)


class Before:
    """The rows of a page that was made before.

    Raises
    ------
    InputError
        Where a directory holds no such page.
    """

    def __init__(self, place: Path, longest: float):
        self.place, self.longest = place, longest
        if not (place / RESULTS).is_file():
            raise InputError("before", str(place), f"a page of particell validate ({RESULTS})")
        found = read_json(place / RESULTS, "before")
        rows = found.get("rows") if isinstance(found, dict) else None
        if not isinstance(rows, list) or not all(map(_is_row, rows)):
            raise InputError("before", str(place / RESULTS), "the rows of a page, with their keys")
        self._rows = {row["command"]: row for row in rows}

    def longer(self, row: Row) -> dict[str, Any] | None:
        """The result of a row that took more than ``longest`` minutes then; else None."""
        found = self._rows.get(row.command, {})
        seconds = found.get("performance", {}).get("wall_seconds", 0.0)
        return found if seconds > 60.0 * self.longest else None


def _is_row(found: Any) -> bool:
    """Whether that is the result of a row, as a page holds it."""
    try:
        metrics = [Metric(**values) for values in found.get("metrics", {}).values()]
        numbers = [m.value for m in metrics if m.value is not None]
        if "performance" in found:
            numbers += [found["performance"][k] for k in ("particles", "steps", "wall_seconds")]
        figure = found.get("figure", "x")
        texts = (found["case"], found["command"], figure)
        whole = isinstance(found["status"], int) and all(isinstance(x, str) for x in texts)
    except (AttributeError, LookupError, TypeError):
        return False
    # a name, and no path to what belongs to somebody else
    named = whole and figure == Path(figure).name and figure not in ("", ".", "..")
    return named and all(isinstance(x, int | float) for x in numbers)


def machine() -> str:
    """The machine, in general words."""
    return f"{os.cpu_count()} processors ({platform.machine()}), {platform.system()}"


def heading(command: str) -> list[str]:
    """What the page is, and how it was made."""
    made = f" ({commit()})" if commit() else ""
    return [
        "# All rows",
        "",
        f"Made by `{command}` with version {version('particell')}{made} on {machine()}.",
        "A value with a limit is an error and passes if its magnitude is at most the limit;",
        "*paper* is what a publication printed for the same. Behind each command stand particles,",
        "steps, seconds, and the commit that it ran with.",
    ]


def _of_case(kind: type[Case], own: Sequence[tuple[Row, dict[str, Any]]]) -> list[str]:
    lines = [f"## {kind.name}", "", f"{kind.title}."]
    lines += [f"Reference: {kind.reference}."] if kind.reference else []
    lines += ["", "| run | metric | ours | paper | limit | passed |"]
    lines += ["| --- | --- | --- | --- | --- | --- |"]
    for row, result in own:
        if "metrics" in result:
            lines += table_rows(row, {k: Metric(**m) for k, m in result["metrics"].items()})
        else:
            lines.append(f"| {row.settings or 'default'} | did not finish | | | | no |")
    lines += ["", *(_how(result) for _, result in own if "performance" in result), ""]
    for row, result in own:
        if "figure" in result:
            lines.append(f"![{kind.name} {row.settings}]({result['figure']})")
    return [*lines, ""]


def _how(result: Mapping[str, Any]) -> str:
    """The command of a row, with particles, steps, seconds and the commit."""
    p = result["performance"]
    numbers = f"{p['particles']} particles, {p['steps']} steps, {p['wall_seconds']:.0f} s"
    by = f", {result['commit']}" if result.get("commit") else ""
    return f"- `{result['command']}` ({numbers}{by})"


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
