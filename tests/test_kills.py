"""A run that is killed at any moment goes on to the same bits; so does one that met a full disk.

Always with a case that computes nothing, so that all the time is spent in writing; among the long
tests also with flow between walls, concentrations and molecules (five minutes).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from casefile.case_files import document, small
from particell.output.checkpoint import read_checkpoint
from particell.output.run import Run

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs fork and POSIX signals")

#: What says how long something took, or how often a list was made larger.
CLOCKS = {"wall_seconds", "compile_seconds"}


def content() -> dict:
    """Flow between walls, concentrations and molecules, a checkpoint after every frame."""
    case = small()
    case["species"] += [
        {"name": "A", "diffusivity": "500 um^2/s", "molecules": True},
        {"name": "B", "molecules": True},
    ]
    case["reactions"].append({"equation": "A <-> B", "forward": "200 1/s", "backward": "100 1/s"})
    case["initial"].append({"species": "A", "count": 20})
    case["run"] = {"until": "4 ms", "every": "0.1 ms", "checkpoint_every": 1e-9}
    return case


class Killer:
    """The process of :mod:`killing`."""

    def __init__(self, directory: Path, case: str):
        self.directory = directory
        (directory / "channel.toml").write_text(document(content()))
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("killing.py")), directory, case],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "NUMBA_NUM_THREADS": "1"},
        )
        while not (line := self.process.stdout.readline()).startswith("ready"):
            assert line, "it did not come to be"
        assert line.split() == ["ready", "0"]
        self.whole = self.bits("WHOLE")

    def __call__(self, command: str) -> int:
        """Exit status of what a command did; -9 where it was killed."""
        self.process.stdin.write(f"{command}\n")
        self.process.stdin.flush()
        while not (line := self.process.stdout.readline()).startswith("ended"):
            assert line, "the process has ended"
        return int(line.split()[1])

    def said(self, name: str) -> str:
        """What the last process of a run wrote."""
        path = self.directory / f"{name}.log"
        text = path.read_text(encoding="utf-8")
        path.unlink()
        return text

    def bits(self, name: str) -> dict[str, bytes]:
        """Every number that a run left, clocks apart."""
        found: dict[str, bytes] = {}

        def keep(path: str, item: object) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf":
                found[path] = np.asarray(item[()]).tobytes()

        with h5py.File(self.directory / name / "run.h5", "r", swmr=True) as file:
            file.visititems(keep)
        flatten(read_checkpoint(self.directory / name / "checkpoint.h5")[0], "", found)
        summary = json.loads((self.directory / name / "summary.json").read_text())
        flatten(summary["conservation"] | summary["metrics"], "summary", found)
        return found

    def same(self, name: str) -> None:
        """Check that a run came to what the whole one did, and left nothing half-made."""
        found = self.bits(name)
        assert found.keys() == self.whole.keys()
        assert [key for key in found if found[key] != self.whole[key]] == []
        assert not [p.name for p in (self.directory / name).iterdir() if "partial" in p.name]
        shutil.rmtree(self.directory / name)

    def finish(self, name: str) -> None:
        """Go on to the end, and check what it came to."""
        assert self(f"resume {name}") == 0, self.said(name)
        self.same(name)


def flatten(value: object, path: str, found: dict[str, bytes]) -> None:
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in CLOCKS and f"{path}/{key}" != "/run/id":
                flatten(item, f"{path}/{key}", found)
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            flatten(item, f"{path}/{k}", found)
    else:
        found[path] = (
            np.asarray(value).tobytes() if hasattr(value, "dtype") else repr(value).encode()
        )


@pytest.fixture(
    scope="module", params=["walk", pytest.param("channel.toml", marks=pytest.mark.long)]
)
def killer(request, tmp_path_factory):
    made = Killer(tmp_path_factory.mktemp("kills"), request.param)
    yield made
    made.process.stdin.close()
    made.process.stdout.close()
    made.process.wait()


def test_twenty_random_kills(killer):
    """Along runs that are killed again and again, until one comes to its end."""
    begin = time.perf_counter()
    assert killer("run timed") == 0
    length = time.perf_counter() - begin
    killer.same("timed")
    random, kills, runs = np.random.default_rng(20), 0, 0
    while kills < 20:
        name = f"random-{runs}"
        runs += 1
        status = killer(f"run {name} after {random.uniform(0, 0.5 * length):.4f}")
        for _ in range(5):
            assert status in (-9, 0), killer.said(name)
            kills += status == -9
            if status == 0 or not (killer.directory / name / "case.json").exists():
                break
            status = killer(f"resume {name} after {random.uniform(0, 0.5 * length):.4f}")
        if (killer.directory / name / "case.json").exists():
            kills += status == -9
            killer.finish(name)
    assert runs < 20


@pytest.mark.parametrize(
    ("operation", "counts"),
    [
        ("frame-part", (1, 3, 7, 24, 25, 61, 200)),
        ("checkpoint", (1, 2, 30, 61)),
        ("fsync", (1, 2, 3, 5, 8)),
        ("rename", (1, 2, 3, 5)),
        ("directory", (1, 2, 4)),
    ],
)
def test_killed_while_it_writes(killer, operation, counts):
    for count in counts:
        name = f"{operation}-{count}"
        status = killer(f"run {name} at {operation} {count}")
        assert status in (-9, 0), killer.said(name)
        if not (killer.directory / name / "case.json").exists():
            continue  # nothing had begun
        if count % 3 == 0:
            status = killer(f"resume {name} at {operation} {count}")
            assert status in (-9, 0), killer.said(name)
        killer.finish(name)


@pytest.mark.parametrize("size", [2000, 20_000, 50_000, 90_000, 130_000, 170_000])
def test_killed_after_so_many_bytes(killer, size):
    name = f"bytes-{size}"
    status = killer(f"run {name} bytes {size}")
    if not (killer.directory / name / "case.json").exists():
        return  # not even that
    assert status < 0 or (status == 0 and size > 20_000), killer.said(name)
    status = killer(f"resume {name} bytes {size}") if status else 0
    assert status <= 0, killer.said(name)
    killer.finish(name)


@pytest.mark.parametrize("size", [100, 20_000, 200_000, 500_000, 900_000, 1_000_000, 1_500_000])
def test_full_disk(killer, size):
    name = f"full-{size}"
    status = killer(f"run {name} full {size}")
    said = killer.said(name)
    assert "Traceback" not in said
    if status == 0 and size > 20_000:  # it fits
        killer.same(name)
        return
    assert status == 3, said
    assert said.count("cannot write") == 1 and "File too large" in said
    if not (killer.directory / name / "case.json").exists():
        return  # not even that could be written
    if (killer.directory / name / "checkpoint.h5").exists():
        assert f"go on from it with: particell resume {name}" in said
    killer.finish(name)


def test_killed_before_the_first_checkpoint(killer):
    assert killer("run early at frame-part 3") == -9
    assert not (killer.directory / "early" / "checkpoint.h5").exists()
    killer.said("early")
    assert killer("resume early") == 0
    assert "before its first checkpoint: it starts anew" in killer.said("early")
    killer.same("early")


def test_frames_without_a_checkpoint_are_not_thrown_away(killer):
    assert killer("run lost at frame-part 80") == -9
    (killer.directory / "lost" / "checkpoint.h5").unlink()
    frames = len(Run(killer.directory / "lost"))
    assert frames > 1
    assert killer("resume lost") == 2
    said = killer.said("lost")
    assert "there is no checkpoint lost/checkpoint.h5" in said and "--overwrite" in said
    assert len(Run(killer.directory / "lost")) == frames
