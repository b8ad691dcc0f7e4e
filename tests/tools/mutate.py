"""Mutate the lines that compute, one by one, and see whether a test notices.

    python tests/tools/mutate.py run --sample 60 --seed 1    # goes on where it was stopped
    python tests/tools/mutate.py run src/particell/boundaries --seed 1
    python tests/tools/mutate.py list --seed 1
    python tests/tools/mutate.py report

A copy of the package and of its tests lies in a directory of its own (``--work``), with a compile
cache of its own: compiled loops are kept by the content of the sources that they come from, so that
only those are compiled anew which a mutation touches. Tests run once without a mutation first. Each
mutant (:mod:`mutations`) is run against the tests that :mod:`mutated` names for its file, until the
first that fails. ``mutants.jsonl`` in that directory gets a line for each: file, line, before,
after, and what became of it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from mutated import PACKAGE, REFUSING, SOURCES, TEXT, tests_of
from mutations import Mutation, applied, chosen

ROOT = Path(__file__).resolve().parents[2]
#: Time limit of a mutant: seconds, and times that of its tests' first run without it.
SLACK, FACTOR = 180.0, 3.0
OUTCOMES = ("killed", "timed out", "survived")


class Workshop:
    """The copy of package and tests, and what has been found in it."""

    def __init__(self, directory: Path):
        self.directory = directory.resolve()
        self.cache = self.directory / "cache"
        self.log = self.directory / "mutants.jsonl"
        self.times = self.directory / "times.json"
        self.cache.mkdir(mode=0o700, parents=True, exist_ok=True)

    def refresh(self) -> None:
        """Bring the copy up to date; times of files stay, as Numba's cache looks at them."""
        for part in ("src", "tests"):
            fresh = [p for p in (ROOT / part).rglob("*") if p.is_file()]
            for path in fresh:
                copy = self.directory / path.relative_to(ROOT)
                if not copy.is_file() or copy.read_bytes() != path.read_bytes():
                    copy.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(path, copy)
        for path in ROOT.iterdir():  # pages, examples, settings: as they are
            link = self.directory / path.name
            if not path.name.startswith(".") and not link.exists():
                link.symlink_to(path)

    def run(self, tests: list[str], limit: float | None = None) -> tuple[str, str, float]:
        """Outcome of tests, which of them failed, and seconds."""
        added = {"PYTHONPATH": str(self.directory / "src"), "PARTICELL_CACHE_DIR": str(self.cache)}
        command = [sys.executable, "-B", "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
        start = time.monotonic()
        process = subprocess.Popen(
            [*command, *tests],
            cwd=self.directory,
            env=os.environ | {"MPLBACKEND": "Agg"} | added,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.communicate()
            return "timed out", "", time.monotonic() - start
        seconds = time.monotonic() - start
        if process.returncode == 0:
            return "survived", "", seconds
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", output, re.MULTILINE)
        return "killed", failed[1] if failed else output[-200:].strip(), seconds

    def warm(self, tests: Iterable[str]) -> dict[str, float]:
        """Run tests once without a mutation: they compile, and have to pass; their seconds."""
        known = json.loads(self.times.read_text()) if self.times.is_file() else {}
        for test in tests:
            if test not in known:
                outcome, failed, known[test] = self.run([test])
                if outcome != "survived":
                    raise SystemExit(f"{test} fails without a mutation: {failed}")
                self.times.write_text(json.dumps(known, indent=1))
                print(f"{known[test]:7.1f} s  {test}", flush=True)
        return known

    def done(self) -> list[dict]:
        """All that has been found."""
        return (
            [json.loads(x) for x in self.log.read_text().splitlines()] if self.log.exists() else []
        )

    def try_mutant(self, file: str, mutation: Mutation) -> dict:
        """Put a mutant in its file's place, run the tests, and take it away again."""
        path = self.directory / file
        source = path.read_bytes()
        mutant = applied(source, mutation)
        tests = tests_of(file)
        times = self.warm(tests)
        limit = SLACK + FACTOR * sum(times[t] for t in tests)
        kept = set(self.cache.iterdir())
        path.write_bytes(mutant)
        try:
            outcome, by, seconds = self.run(tests, limit)
        finally:
            shutil.copy2(ROOT / file, path)
            for new in set(self.cache.iterdir()) - kept:
                shutil.rmtree(new, ignore_errors=True)
        before, after = (_line(s, mutation.line) for s in (source, mutant))
        found = {"file": file, "line": mutation.line, "before": before, "after": after}
        return found | {"outcome": outcome, "by": by, "seconds": round(seconds, 1)}


def _line(source: bytes, number: int) -> str:
    return source.splitlines()[number - 1].decode().strip()


def _files(paths: list[str]) -> list[str]:
    """Source files below some paths; by default all that are mutated."""
    found: list[Path] = []
    for path in [ROOT / p for p in paths] or [ROOT / PACKAGE / s for s in SOURCES]:
        found += sorted(path.rglob("*.py")) if path.is_dir() else [path]
    names = [str(p.resolve().relative_to(ROOT)) for p in found]
    return [n for n in names if n.removeprefix(PACKAGE) not in TEXT and "__init__" not in n]


def mutants(paths: list[str], seed: int, sample: int | None) -> list[tuple[str, Mutation]]:
    """One mutant for each line, in an order that the seed shuffles; the first ``sample``."""
    found = [
        (file, mutation)
        for file in _files(paths)
        for mutation in chosen(
            (ROOT / file).read_bytes(), f"{seed}:{file}", file.removeprefix(PACKAGE) in REFUSING
        )
    ]
    random.Random(seed).shuffle(found)
    return found[:sample]


def report(found: list[dict]) -> str:
    """The share killed, and who survived."""
    count = {o: sum(f["outcome"] == o for f in found) for o in OUTCOMES}
    caught = count["killed"] + count["timed out"]
    lines = [
        f"{f['file']}:{f['line']}: {f['before']}  =>  {f['after']}" for f in found if not f["by"]
    ]
    share = f"{caught} of {len(found)} caught ({100 * caught / max(1, len(found)):.1f} %)"
    return "\n".join([share, ", ".join(f"{n} {o}" for o, n in count.items()), *lines])


def main() -> int:
    """See the top of the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("what", choices=("run", "warm", "list", "report"))
    parser.add_argument("paths", nargs="*", help="source files or directories")
    parser.add_argument("--sample", type=int, help="only so many, drawn by the seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=ROOT / ".cache" / "mutants")
    given = parser.parse_args()
    workshop = Workshop(given.work)
    if given.what == "warm":
        workshop.refresh()
        workshop.warm(dict.fromkeys(t for file in _files(given.paths) for t in tests_of(file)))
        return 0
    if given.what == "run":
        workshop.refresh()
        seen = {(f["file"], f["before"], f["after"]) for f in workshop.done()}
        for file, mutation in mutants(given.paths, given.seed, given.sample):
            source = (ROOT / file).read_bytes()
            before, after = (_line(s, mutation.line) for s in (source, applied(source, mutation)))
            if (file, before, after) not in seen:
                found = workshop.try_mutant(file, mutation)
                with open(workshop.log, "a", encoding="utf-8") as log:
                    log.write(json.dumps(found, ensure_ascii=False) + "\n")
                print(found["outcome"], f"{file}:{mutation.line}", found["by"], flush=True)
    if given.what == "list":
        for file, mutation in mutants(given.paths, given.seed, given.sample):
            source = (ROOT / file).read_bytes()
            print(f"{file}:{mutation.line}: {_line(applied(source, mutation), mutation.line)}")
    else:
        print(report(workshop.done()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
