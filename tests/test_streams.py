"""Streams that are closed or that nobody reads, what nobody foresaw, and wishes to stop."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest

import particell as pc
from particell import cli, observers
from particell.cli import call
from particell.output.run import Run
from particell.status import read_status
from small_cases import DIFFUSING_LINE
from systems import unit_fluid

PROGRAM = f"{shlex.quote(sys.executable)} -m particell"


@pytest.fixture
def place(tmp_path, monkeypatch) -> Path:
    (tmp_path / "my.toml").write_text(DIFFUSING_LINE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX shell")
@pytest.mark.parametrize(
    "streams",
    ["2>&-", "<&- >&- 2>&-", "2>&1 | head -c 1", ">/dev/full 2>&1"],
)
def test_a_run_goes_on_without_its_streams(place, streams):
    """With a progress bar; all is written as ever, and nothing into the files of the run."""
    command = f"( {PROGRAM} run my.toml --out one; echo $? > status ) {streams}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=300)
    assert (place / "status").read_text() == "0\n", done.stderr
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr
    assert len(Run("one")) == 3 and (place / "one" / "summary.json").exists()
    assert read_status("one")["state"] == "ended"


def test_a_stream_that_breaks_on_the_way(place, monkeypatch):
    """In Python too, where the streams are whoever's."""

    class Broken:
        encoding, closed = "utf-8", False

        def write(self, text: str) -> int:
            raise BrokenPipeError(32, "Broken pipe")

        flush = isatty = fileno = lambda self: self.write("")

    slow(0.0).run(0.1, 0.05, progress=False)  # compiles
    for stream in (Broken(), None):
        monkeypatch.setattr(sys, "stderr", stream)
        run = slow(0.0).run(0.1, 0.05, progress=True)
        assert len(run) == 3


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (KeyError("what"), 70, "an error that nobody foresaw: KeyError: 'what'"),
        (EOFError("no\nmore"), 70, "an error that nobody foresaw: EOFError: no more"),
        (MemoryError("Unable to allocate 8 TiB"), 3, "out of memory (Unable to allocate 8 TiB)"),
        (MemoryError(), 3, "out of memory"),
    ],
)
def test_what_nobody_foresaw(place, monkeypatch, capsys, error, status, words):
    """One line, a status of its own, and the traceback in a file."""
    monkeypatch.setattr("tempfile.tempdir", str(place))

    def broken(*_, **options):
        raise error

    assert call(["run", "my.toml", "--out", "one", "--no-progress"]) == 0
    monkeypatch.setattr("particell.cases.directories.execution.go_on", broken)
    capsys.readouterr()
    assert call(["resume", "one"]) == status
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said
    files = [*place.glob("particell-*.txt")]
    assert len(files) == (status == 70)
    if files:
        assert str(files[0]) in said and said.strip().count("\n") == 0
        assert "Traceback" in files[0].read_text() and "in broken" in files[0].read_text()
    else:
        assert "particell resume one" in said


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_sigterm_before_a_run_begins():
    code = (
        "import os, signal, click\n"
        "from particell import cli\n"
        "cli.cli.main = lambda **_: os.kill(os.getpid(), signal.SIGTERM)\n"
        "cli.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


def slow(seconds: float) -> pc.Simulation:
    """A simulation of which a step takes so long."""

    def wait(state) -> None:
        time.sleep(seconds)

    box = pc.Domain((0,), (10,), "x", depth=1.0)
    return pc.Simulation(
        box,
        pc.fluid(box, unit_fluid(), 1.0),
        pc.Static(),
        [pc.Species("C", 0.1)],
        dt=0.001,
        operations=[pc.Every(wait, steps=1)],
    )


def test_a_wish_to_stop_is_seen_within_a_second(tmp_path, monkeypatch):
    """However long a step takes, up to a second: the clock is looked at between a few."""
    simulation, chunks = slow(0.15), []
    advance = type(simulation).advance

    def counted(self, steps=1, check=True):
        chunks.append(steps)
        if len(chunks) == 3:
            os.kill(os.getpid(), cli.signal.SIGINT)
        advance(self, steps, check)

    monkeypatch.setattr(type(simulation), "advance", counted)
    begin = time.monotonic()
    with pytest.raises(pc.Interrupted):
        simulation.run(1.0, 1.0, tmp_path, progress=False)
    assert chunks[0] == 1 and max(chunks) <= observers.LOOK / 0.15 and len(chunks) == 3
    assert time.monotonic() - begin < 60
    found = read_status(tmp_path)
    assert found["state"] == "interrupted" and found["step"] == sum(chunks)
    assert found["checkpoint"]["step"] == sum(chunks) and found["until"] == 1.0


def test_a_killed_run_says_so(tmp_path):
    """What says that it runs, and has nobody who runs it, was killed."""
    slow(0.0).run(0.1, 0.05, tmp_path, progress=False)
    text = (tmp_path / "status.json").read_text()
    (tmp_path / "status.json").write_text(text.replace('"ended"', '"running"'))
    assert read_status(tmp_path)["state"] == "killed"
    assert set(os.listdir(tmp_path)) == {
        "run.h5",
        "checkpoint.h5",
        "checkpoint-previous.h5",
        "status.json",
    }


def test_a_run_that_breaks_says_so(tmp_path):
    def fail(state) -> None:
        if state.step == 30:
            raise RuntimeError("of the script's own")

    simulation = slow(0.0)
    simulation.operations.by_name["wait"].function = fail
    with pytest.raises(RuntimeError, match="script's own"):
        simulation.run(0.1, 0.05, tmp_path, progress=False)
    found = read_status(tmp_path)
    assert (found["state"], found["error"]) == ("failed", "RuntimeError: of the script's own")
