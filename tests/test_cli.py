"""The command line, on a case that takes no time."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from particell import bench, cases
from particell.cli import call
from particell.health import Finding
from particell.output.ownership import LOCK, owned
from particell.output.run import Run


@pytest.fixture(autouse=True)
def walk(monkeypatch, tmp_path):
    monkeypatch.setattr(cases, "CASES", {"walk": ("fake_case:Walk", "Random walkers")})
    monkeypatch.chdir(tmp_path)


def particell(line: str) -> int:
    """Exit status of a command line."""
    return call(shlex.split(line))


def fails(capsys, status: int, *words: str, line: str) -> None:
    """Check the status, and that one line on stderr has these words."""
    assert particell(line) == status
    error = capsys.readouterr().err.strip()
    assert "\n" not in error
    for word in words:
        assert word in error


def test_list(capsys):
    assert particell("list") == 0
    assert capsys.readouterr().out == "walk  Random walkers\n"
    assert particell("list walk") == 0
    assert "diffusivity   1e-12 m^2/s" in capsys.readouterr().out


def test_run_leaves_what_it_promises(tmp_path, capsys):
    assert particell("run walk --seed 5 --threads 1 --no-progress --set 'side=20 um'") == 0
    assert "spread" in (table := capsys.readouterr().out) and "ok" in table
    out = tmp_path / "out" / "walk"
    assert {p.name for p in out.iterdir()} == {
        "run.h5",
        "checkpoint.h5",
        "checkpoint-previous.h5",
        "spread.png",
        "summary.json",
        "case.json",
    }
    summary = json.loads((out / "summary.json").read_text())
    assert summary["case"] == "walk"
    assert summary["seed"] == 5
    assert summary["parameters"]["side"] == {"value": pytest.approx(2e-5), "unit": "m"}
    assert summary["metrics"]["spread"].keys() == {"value", "paper", "limit", "unit"}
    assert summary["metrics"]["frames"]["limit"] is None
    assert summary["conservation"] == {"amount_L": 0.0}
    assert summary["performance"]["steps"] == 10
    settings = summary["settings"]
    assert settings["kernel"] == "lucy"
    assert settings["threads"] == 1
    assert settings["versions"]["numpy"] == np.__version__
    assert Run(out).summary == summary


def test_metric_beyond_its_limit_is_status_1(capsys):
    assert particell("run walk --set limit=1e-6") == 1
    assert "FAILED" in capsys.readouterr().out


def test_wrong_input_is_one_line_and_status_2(capsys, tmp_path):
    fails(capsys, 2, "did you mean 'walk'", line="run wlak")
    fails(capsys, 2, "did you mean 'side'", line="run walk --set sid=1")
    fails(capsys, 2, "particles = 2", "greater than", line="run walk --set particles=2")
    fails(capsys, 2, "valid integer", line="run walk --set particles=4.5")
    fails(capsys, 2, "side = '3 kg'", "a number in m", line="run walk --set 'side=3 kg'")
    fails(capsys, 2, "side = -1.0", "greater than 0 m", line="run walk --set side=-1.0")
    fails(capsys, 2, "KEY=VALUE", line="run walk --set side")
    fails(capsys, 2, "threads = 9999", line="run walk --threads 9999")
    fails(capsys, 2, "luckier", line="run walk --set particles=13")
    fails(capsys, 2, "seed = -1", line="run walk --seed -1")
    assert not (tmp_path / "out").exists()
    assert particell("run walk --backend abacus") == 2
    assert particell("nonsense") == 2


def test_output_directory_is_refused(capsys, tmp_path):
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "thesis.tex").write_text("precious")
    fails(capsys, 2, "--overwrite", line="run walk --out used")
    assert particell("run walk --out used --overwrite") == 0
    assert (tmp_path / "used" / "thesis.tex").read_text() == "precious"
    capsys.readouterr()
    (tmp_path / "file").touch()
    fails(capsys, 2, "out = 'file/x'", "written to", line="run walk --out file/x")


def test_toml_file(capsys, tmp_path):
    file = tmp_path / "my.toml"
    file.write_text('case = "walk"\n[parameters]\nside = "30 um"\nparticles = 9\n')
    assert particell("run my.toml --set particles=8 --out here") == 0
    summary = json.loads((tmp_path / "here" / "summary.json").read_text())
    assert summary["parameters"]["particles"]["value"] == 8
    assert summary["parameters"]["side"]["value"] == pytest.approx(3e-5)
    capsys.readouterr()
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n"))  # Windows
    assert particell("run my.toml --out there") == 0
    capsys.readouterr()
    file.write_text('case = "walk"\n[parametres]\n')
    fails(capsys, 2, "did you mean 'parameters'", line="run my.toml")
    file.write_text("case = walk")
    fails(capsys, 2, "valid TOML", line="run my.toml")
    fails(capsys, 2, "readable file", line="run missing.toml")
    file.write_text('case = "walk"\n[parameters]\nside = "soon"\n')
    fails(capsys, 2, "side = 'soon'", line="run my.toml")


def test_broken_run_says_how_to_go_on(capsys, tmp_path):
    assert particell("run walk --set break_at=6 --out b") == 3
    error = capsys.readouterr().err
    assert "particle 3 at step 6" in error
    assert "b/checkpoint.h5" in error and "the same would happen" in error
    assert (tmp_path / "b" / "checkpoint.h5").exists()
    assert particell("run walk --set break_at=0 --out c") == 3
    assert "no checkpoint" in capsys.readouterr().err


def test_interrupted_run_resumes_bit_for_bit(capsys, tmp_path):
    assert particell("run walk --seed 3 --out whole") == 0
    assert particell("run walk --seed 3 --set interrupt_at=6 --out parts") == 130
    assert "particell resume parts" in capsys.readouterr().err
    # The last checkpoint is of step 5; step 6 is in the trajectory already and must be redone.
    assert Run(tmp_path / "parts").steps[-1] == 6
    case = json.loads((tmp_path / "parts" / "case.json").read_text())
    case["parameters"]["interrupt_at"] = -1
    (tmp_path / "parts" / "case.json").write_text(json.dumps(case))
    assert particell("resume parts") == 0
    one, two = Run(tmp_path / "whole"), Run(tmp_path / "parts")
    assert np.array_equal(one.steps, two.steps)
    assert np.array_equal(one.field("position")[:], two.field("position")[:])
    assert np.array_equal(one.observable("spread"), two.observable("spread"))


def test_resume_refuses_what_is_no_run(capsys, tmp_path):
    fails(capsys, 2, "case.json", line="resume nowhere")
    assert particell("run walk --out a") == 0
    (tmp_path / "a" / "checkpoint.h5").write_bytes(b"garbage")
    capsys.readouterr()
    fails(capsys, 2, "checkpoint", "damaged", line="resume a")
    (tmp_path / "a" / "checkpoint.h5").unlink()
    fails(capsys, 2, "there is no checkpoint", line="resume a")
    (tmp_path / "a" / "case.json").write_text("{}")
    fails(capsys, 2, "case file", line="resume a")


def test_plot_and_export(capsys, tmp_path):
    assert particell("run walk --out a") == 0
    (tmp_path / "a" / "spread.png").unlink()
    capsys.readouterr()
    assert particell("plot a") == 0
    assert capsys.readouterr().out.strip().endswith("spread.png")
    assert (tmp_path / "a" / "spread.png").exists()
    assert particell("export a --to vtkhdf") == 0
    with h5py.File(tmp_path / "a" / "run.vtkhdf") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == 11
    capsys.readouterr()
    fails(capsys, 2, "trajectory", line="export nowhere")


def test_validate_writes_one_page_and_does_not_repeat_itself(capsys, tmp_path):
    assert particell("validate") == 0
    assert "1 of 1 runs passed" in capsys.readouterr().out
    assert particell("validate walk --full --out v") == 0
    row = tmp_path / "v" / "walk" / "particles-64"
    assert Run(row).field("position").shape == (11, 64, 2)
    page = (tmp_path / "v" / "page" / "index.md").read_text()
    assert "| particles=64 | spread |" in page and "| yes |" in page
    assert "`particell run walk --set particles=64`" in page
    assert (tmp_path / "v" / "page" / "walk_particles-64_spread.png").exists()
    results = json.loads((tmp_path / "v" / "page" / "results.json").read_text())
    assert results["rows"][0]["metrics"]["spread"]["paper"] == 0.5
    made = (row / "run.h5").stat().st_mtime_ns
    capsys.readouterr()
    assert particell("validate walk --full --out v") == 0
    assert "finished before" in capsys.readouterr().out
    assert (row / "run.h5").stat().st_mtime_ns == made
    assert particell("validate walk --full --out v --overwrite") == 0
    assert (row / "run.h5").stat().st_mtime_ns > made
    made = (row / "run.h5").stat().st_mtime_ns
    assert particell("validate walk --full --out w --before v/page --longest 0") == 0
    assert "taken from v/page" in capsys.readouterr().out
    again = json.loads((tmp_path / "w" / "page" / "results.json").read_text())
    assert again["rows"] == json.loads((tmp_path / "v/page/results.json").read_text())["rows"]
    assert (tmp_path / "w" / "page" / "walk_particles-64_spread.png").exists()
    assert not (tmp_path / "w" / "walk").exists()
    fails(capsys, 2, "before = 'walk'", line="validate walk --before walk")
    assert particell("validate walk --full --out v --seed 2") == 0
    assert (row / "run.h5").stat().st_mtime_ns > made
    fails(capsys, 2, "did you mean 'walk'", line="validate wlak")


def test_validate_takes_rows_from_its_own_page(capsys):
    assert particell("validate walk --full --out v") == 0
    whole = Path("v/page/results.json").read_bytes()
    figure = Path("v/page/walk_particles-64_spread.png").read_bytes()
    assert particell("validate walk --full --out v --before v/page --longest 0") == 0
    assert "taken from v/page" in capsys.readouterr().out
    assert Path("v/page/results.json").read_bytes() == whole
    assert Path("v/page/walk_particles-64_spread.png").read_bytes() == figure
    row = json.loads(whole)["rows"][0]
    foreign = [{"command": "x"}, {**row, "metrics": {"a": 1}}, {**row, "figure": "../case.json"}]
    foreign += [{**row, "performance": {}}, {**row, "status": "good"}, 7]
    for rows in ({}, [], {"rows": 3}, *({"rows": [found]} for found in foreign)):
        Path("v/page/results.json").write_text(json.dumps(rows))
        fails(capsys, 2, "the rows of a page", line="validate walk --before v/page")


def test_validate_leaves_a_row_that_another_runs(capsys, monkeypatch):
    place = Path("v/walk/particles-64")
    place.mkdir(parents=True)
    statuses: list[int] = []
    with owned(place):
        other = threading.Thread(
            target=lambda: statuses.append(particell("validate walk --full --out v"))
        )
        other.start()
        other.join()
        assert [path.name for path in place.iterdir()] == [LOCK]
    assert statuses == [2]
    asked: list[str] = []
    monkeypatch.setattr("particell.validation.runs.commit", lambda: asked.append("commit"))
    monkeypatch.setattr("particell.cases.execution.commit", lambda: asked.append("of the run"))
    monkeypatch.setattr("particell.cases.execution.Run", lambda *_: asked.append("run"))
    particell("validate walk --full --out v")
    assert asked == ["commit", "of the run", "run"]  # and not when the run has ended


def test_validate_does_not_forget_that_a_run_was_ill(monkeypatch, capsys):
    from fake_case import WalkSimulation

    ill = [Finding("clumps", 0.5, 0.02, "they are torn")]
    monkeypatch.setattr(WalkSimulation, "health", lambda self: ill)
    assert particell("validate walk --full --out v") == 1
    assert particell("validate walk --full --out v") == 1
    assert "finished before" in capsys.readouterr().out


def test_validate_goes_on_after_what_fails(capsys, tmp_path, monkeypatch):
    from fake_case import Walk

    sizes = [{"particles": 13}, {"limit": 1e-6}, {"break_at": 3}, {"particles": 20}]
    monkeypatch.setattr(Walk, "full", sizes)
    monkeypatch.setattr("particell.validation.rows.GROUPS", {"all": ("walk", "not-there-yet")})
    assert particell("validate all --full --out v") == 3
    out = capsys.readouterr().out
    assert "1 of 4 runs passed" in out
    page = (tmp_path / "v" / "page" / "index.md").read_text()
    assert "did not finish" in page and "**no**" in page
    went_on = []
    monkeypatch.setattr(
        "particell.cases.directories.resume",
        lambda place, progress: went_on.append(place.name) or 0,
    )
    assert particell("validate all --full --out v") == 2
    assert went_on == ["break_at-3"]


def test_info_and_version(capsys):
    assert particell("info") == 0
    assert "threads" in capsys.readouterr().out
    assert particell("--version") == 0
    assert capsys.readouterr().out.startswith("particell ")


def test_command_line_starts_without_the_compiler():
    code = "import sys, particell.cli; print({'numba', 'pint', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("dims", ["2D", "2D and 3D"])
def test_bench_measures_all_that_it_names(dims, tmp_path, capsys, monkeypatch):
    """With a few particles and steps. Loops in space take long to compile: twice the plane then."""
    monkeypatch.setattr(bench, "SIZE", {2: 12, 3: 8})
    monkeypatch.setattr(bench, "STEPS", {2: 2, 3: 1})
    monkeypatch.setattr(bench, "best_time", lambda work, repeats=1: (work(), 1e-3)[1])
    monkeypatch.setattr(bench, "set_threads", lambda number: 1)
    if dims == "2D":
        flow = bench.flow_entries
        monkeypatch.setattr(bench, "flow_entries", lambda dim, threads: flow(2, threads))
    assert particell("bench --json bench.json") == 0
    rows = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    printed = capsys.readouterr().out.splitlines()
    assert len(rows) == len(printed) == 12
    assert all(line.startswith(row["name"]) for row, line in zip(rows, printed, strict=True))
    assert all(row["per_second"] > 0 and 0 < row["listed"] < 300 for row in rows)
    assert (rows[0]["particles"], rows[3]["particles"]) == (144, 144 if dims == "2D" else 512)
    assert [row["name"] for row in rows if "jumps_per_second" in row] == [
        f"diffusion of molecules, {number} a particle" for number in (20, 200, 2000)
    ]
