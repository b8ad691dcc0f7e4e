"""Files that are damaged, foreign, newer or in the way: one line, which file, and status 2 or 3."""

from __future__ import annotations

import errno
import json
import os
import shlex
import subprocess
import sys

import h5py
import numpy as np
import pytest

from particell import cases
from particell.cli import call
from particell.errors import InputError
from particell.output import h5md, trajectory
from particell.output.checkpoint import read_checkpoint, write_checkpoint
from particell.output.run import Run


@pytest.fixture(autouse=True)
def walk(monkeypatch, tmp_path):
    monkeypatch.setattr(cases, "CASES", {"walk": ("fake_case:Walk", "Random walkers")})
    monkeypatch.chdir(tmp_path)


def says(capsys, line: str, status: int) -> str:
    """What a command line writes to stderr, which is one line without a traceback."""
    capsys.readouterr()
    assert call(shlex.split(line)) == status
    error = capsys.readouterr().err.strip()
    assert error and "\n" not in error and "Traceback" not in error
    return error


@pytest.fixture
def half(tmp_path):
    """The directory of a run that stopped in the middle, and what its files hold."""
    assert call(["run", "walk", "--out", "half", "--set", "interrupt_at=6"]) == 130
    place = tmp_path / "half"
    case = json.loads((place / "case.json").read_text())
    case["parameters"]["interrupt_at"] = -1
    (place / "case.json").write_text(json.dumps(case))
    return place, {p.name: p.read_bytes() for p in place.iterdir()}


def lengths(whole: bytes, number: int = 25):
    """Lengths to cut a file to, small ones and almost all of it among them."""
    return sorted(
        {0, 1, 8, 100, len(whole) - 1, *np.linspace(0, len(whole) - 2, number).astype(int)}
    )


def test_truncated_checkpoints(half, capsys):
    place, files = half
    for length in lengths(files["checkpoint.h5"]):
        (place / "checkpoint.h5").write_bytes(files["checkpoint.h5"][:length])
        assert "checkpoint half/checkpoint.h5 is damaged" in says(capsys, "resume half", 2)
    assert (place / "run.h5").read_bytes() == files["run.h5"]  # and nothing else was touched
    (place / "checkpoint.h5").write_bytes(files["checkpoint.h5"])
    assert call(["resume", "half"]) == 0


def test_truncated_trajectories(half, capsys):
    """With a good checkpoint: refused, or whole up to the checkpoint; never a wrong frame."""
    place, files = half
    assert call(["run", "walk", "--out", "whole"]) == 0
    whole = Run("whole").field("position")[:]
    for length in lengths(files["run.h5"]):
        (place / "run.h5").write_bytes(files["run.h5"][:length])
        (place / "checkpoint.h5").write_bytes(files["checkpoint.h5"])
        capsys.readouterr()
        status = call(["resume", "half"])
        error = capsys.readouterr().err
        assert status in (0, 2) and "Traceback" not in error
        if status == 2:
            assert "trajectory = 'half/run.h5'" in error and error.count("\n") == 1
            assert (place / "checkpoint.h5").read_bytes() == files["checkpoint.h5"]
        else:
            assert np.array_equal(Run(place).field("position")[:], whole)


@pytest.fixture
def killed(half, monkeypatch):
    """As ``half``, with the trajectory that a killed process leaves: HDF5 has it open for ever."""
    place, files = half
    extend, calls = trajectory.extend, iter(range(1000))

    def remember(*args):
        if next(calls) == 80:
            files["run.h5"] = (place.parent / "other" / "run.h5").read_bytes()
        extend(*args)

    monkeypatch.setattr(trajectory, "extend", remember)
    assert call(["run", "walk", "--out", "other"]) == 0
    assert files["run.h5"][11] == 5  # open, in the mode for files that grow
    return place, files


def test_truncated_trajectories_of_killed_runs(killed, capsys, monkeypatch):
    """Refused, or whole up to the checkpoint, as those that were closed; and nobody waits."""
    monkeypatch.setattr(h5md, "READ_ATTEMPTS", 20)
    place, files = killed
    whole = Run("other").field("position")[:]
    statuses = []
    for length in [*lengths(files["run.h5"]), len(files["run.h5"])]:
        (place / "run.h5").write_bytes(files["run.h5"][:length])
        (place / "checkpoint.h5").write_bytes(files["checkpoint.h5"])
        capsys.readouterr()
        try:
            frames = Run(place).field("position")[:]
            assert np.array_equal(frames, whole[: len(frames)])
        except InputError as error:
            assert "half/run.h5" in str(error)
        statuses.append(call(["resume", "half"]))
        error = capsys.readouterr().err
        if statuses[-1] == 2:
            assert "trajectory = 'half/run.h5'" in error and error.count("\n") == 1
        else:
            assert np.array_equal(Run(place).field("position")[:], whole)
    assert set(statuses) == {0, 2} and statuses[-1] == 0


def test_what_is_missing_of_a_growing_trajectory_is_no_zeros(killed, monkeypatch):
    """HDF5 believes a header that says that the file ends where it was cut."""
    place, files = killed
    monkeypatch.setattr(h5md, "READ_ATTEMPTS", 20)
    whole = Run("other").field("position")[:]
    plain, refused = h5py.File, 0

    def left_open(path, *args, **options):
        raise OSError("file is already open for write/SWMR write")

    for length in lengths(files["run.h5"]):
        (place / "run.h5").write_bytes(files["run.h5"][:length])
        with monkeypatch.context() as patch:
            patch.setattr(h5md.h5py, "File", lambda f, *a: plain(f) if not a else left_open(f))
            try:
                frames = Run(place).field("position")[:]
                assert np.array_equal(frames, whole[: len(frames)])
            except InputError as error:
                refused += "half/run.h5" in str(error)
    assert refused > 20


def test_nobody_waits_for_a_damaged_trajectory(killed):
    """One byte of a group in a file that was left open: HDF5 would wait for the right one."""
    place, files = killed
    broken = bytearray(files["run.h5"])
    with h5py.File(place.parent / "other" / "run.h5") as file:
        address = h5py.h5o.get_info(file["particles/all/position"].id).addr
    broken[address + 32] ^= 0xFF
    (place / "run.h5").write_bytes(broken)
    code = "from particell.output.run import Run; Run('half')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 1 and "after all read attempts" in done.stderr


@pytest.mark.parametrize("name", ["checkpoint.h5", "run.h5"])
def test_foreign_files(half, capsys, name):
    place, _ = half
    for foreign in (b"", b"some text\n" * 100, b"\x89HDF\r\n\x1a\n" + bytes(500), b"{}"):
        (place / name).write_bytes(foreign)
        assert f"half/{name}" in says(capsys, "resume half", 2)
    with h5py.File(place / name, "w") as file:
        file["x"] = np.arange(3)
    assert f"half/{name}" in says(capsys, "resume half", 2)
    (place / name).unlink()
    (place / name).mkdir()
    assert f"half/{name}" in says(capsys, "resume half", 2)


def test_a_damaged_checkpoint_and_the_one_before(half, capsys):
    """The older one is offered, and takes the other's place."""
    place, files = half
    assert call(["run", "walk", "--out", "whole"]) == 0
    (place / "checkpoint.h5").write_bytes(files["checkpoint.h5"][:-1] + b"?")
    assert "particell resume half --previous" in says(capsys, "resume half", 2)
    assert call(["resume", "half", "--previous", "--no-progress"]) == 0
    whole = Run("whole").field("position")[:]
    assert np.array_equal(Run(place).field("position")[:], whole)
    read_checkpoint(place / "checkpoint-previous.h5")
    (place / "checkpoint-previous.h5").unlink()
    assert "there is no checkpoint before" in says(capsys, "resume half --previous", 2)


def test_trajectories_of_newer_versions(half, capsys):
    place, _ = half
    with h5py.File(place / "run.h5", "r+") as file:
        file["h5md"].attrs["version"] = np.array([2, 0], np.int32)
    for command in ("resume", "plot", "export"):
        assert "version 1 of H5MD" in says(capsys, f"{command} half", 2)


def test_damaged_trajectories_that_are_only_read(half, capsys):
    place, files = half
    for length in (0, 100, len(files["run.h5"]) // 2):
        (place / "run.h5").write_bytes(files["run.h5"][:length])
        for command in ("plot", "export"):
            assert "half/run.h5" in says(capsys, f"{command} half", 2)
        with pytest.raises(InputError, match="trajectory"):
            Run(place)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "\x00",
        '{"case": "walk"}',
        '{"case": "walk", "parameters": 3, "context": {}}',
        '{"case": "walk", "parameters": {"sid": 1}, "context": {}}',
        '{"case": "wlak", "parameters": {}, "context": {}}',
        '{"case": "walk", "parameters": {}, "context": {"sed": 1}}',
        '{"case": "walk", "parameters": {}, "context": {"seed": "x"}}',
        '{"case": "walk", "parameters": {}, "context": {"threads": "many"}}',
        '{"case": "walk", "class": "no.such:Thing", "parameters": {}, "context": {}}',
        '{"case": "walk", "class": "json:Thing", "parameters": {}, "context": {}}',
        '{"case": "walk", "class": 3, "parameters": {}, "context": {}}',
    ],
)
def test_case_files_of_runs_that_are_wrong(half, capsys, text):
    place, files = half
    (place / "case.json").write_text(text)
    says(capsys, "resume half", 2)
    assert (place / "checkpoint.h5").read_bytes() == files["checkpoint.h5"]
    (place / "case.json").unlink()
    assert "case.json" in says(capsys, "resume half", 2)


@pytest.mark.parametrize(
    "out", ["file", "file/below", "/proc/nothing/here", "/dev/null/x", "x" * 300]
)
def test_what_cannot_be_written_to(capsys, tmp_path, out):
    (tmp_path / "file").write_text("precious")
    assert "out = " in says(capsys, f"run walk --out {out}", 2)
    assert (tmp_path / "file").read_text() == "precious"


def test_other_commands_that_cannot_write(half, capsys, tmp_path):
    (tmp_path / "file").touch()
    assert "cannot write" in says(capsys, "export half --out file/run.vtkhdf", 3)
    assert "cannot write" in says(capsys, "export half --out /dev/full/x.vtkhdf", 3)
    assert "a new file" in says(capsys, "new file/case.toml", 2)


def test_a_gpu_where_there_is_none(capsys, monkeypatch, tmp_path):
    from numba import cuda

    monkeypatch.setattr(cuda, "is_available", lambda: False)
    assert "no CUDA GPU" in says(capsys, "run walk --backend cuda", 2)
    (tmp_path / "my.toml").write_text('case = "walk"\n')
    assert "no CUDA GPU" in says(capsys, "run my.toml --backend cuda", 2)
    assert "no CUDA GPU" in says(capsys, "ensemble walk --runs 2 --backend cuda", 2)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("where", ["summary.json", "spread.png", "case.json"])
def test_no_room_for_one_file(monkeypatch, capsys, tmp_path, where):
    """The disk is full just as this file is written; with room again the run is finished."""
    replace = os.replace

    def full(source, target):
        if str(target).endswith(where):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    capsys.readouterr()
    assert call(["run", "walk", "--out", "a"]) == 3
    error = capsys.readouterr().err
    assert f"cannot write a/{where}: No space left on device" in error
    assert "Traceback" not in error and "partial" not in "".join(os.listdir("a"))
    monkeypatch.setattr(os, "replace", replace)
    if where == "case.json":
        assert call(["run", "walk", "--out", "a"]) == 0
        return
    assert "particell resume a" in error
    assert call(["resume", "a"]) == 0
    assert (tmp_path / "a" / where).stat().st_size > 0


def test_interrupted_while_it_is_set_up(monkeypatch, capsys):
    """Before there is a directory, and in it: status 130, and one line that says how to go on."""
    import fake_case

    def interrupted(*_, **options):
        raise KeyboardInterrupt

    build = fake_case.Walk.build
    monkeypatch.setattr(fake_case.Walk, "build", interrupted)
    assert says(capsys, "run walk --out a", 130) == "interrupted"
    assert not os.path.exists("a")
    monkeypatch.setattr(fake_case.Walk, "build", build)
    run = fake_case.WalkSimulation.run
    monkeypatch.setattr(fake_case.WalkSimulation, "run", interrupted)
    assert "go on with: particell resume a" in says(capsys, "run walk --out a", 130)
    monkeypatch.setattr(fake_case.WalkSimulation, "run", run)
    assert call(["resume", "a"]) == 0


def test_links_in_the_way_are_not_followed(tmp_path):
    good = tmp_path / "c.h5"
    write_checkpoint(good, {"a": np.arange(3)})
    (tmp_path / "precious").write_text("precious")
    (tmp_path / ".c.partial.h5").symlink_to("precious")
    (tmp_path / ".c.room").symlink_to("precious")
    write_checkpoint(good, {"a": np.arange(100_000)})
    assert len(read_checkpoint(good)[0]["a"]) == 100_000
    assert (tmp_path / "precious").read_text() == "precious"
    assert not good.is_symlink()
