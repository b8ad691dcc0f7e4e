"""``particell ensemble`` on a case that takes no time."""

from __future__ import annotations

import json
import shlex
import sys
import types

import pytest

from particell import EnsembleRun, cases
from particell.cli import call
from particell.ensemble import realisation_seed


@pytest.fixture(autouse=True)
def walk(monkeypatch, tmp_path):
    monkeypatch.setattr(cases, "CASES", {"walk": ("fake_case:Walk", "Random walkers")})
    monkeypatch.chdir(tmp_path)


def particell(line: str) -> int:
    return call(shlex.split(line))


def test_leaves_what_it_promises(tmp_path, capsys):
    line = "ensemble walk --runs 3 --processes 1 --seed 5 --no-progress --set particles=8"
    assert particell(line) == 0
    assert "3 of 3 realisations done" in capsys.readouterr().out
    out = tmp_path / "out/walk-runs"
    assert {p.name for p in out.iterdir()} == {
        *("run-0000", "run-0001", "run-0002", "ensemble.json", "summary.json", "observables.png")
    }
    assert {p.name for p in (out / "run-0001").iterdir()} == {
        *("case.json", "run.h5", "checkpoint.h5", "checkpoint-previous.h5", "summary.json")
    }
    summary = json.loads((out / "summary.json").read_text())
    assert summary["case"] == "walk"
    assert summary["seed"] == 5
    assert summary["finished"] == [0, 1, 2]
    assert summary["failed"] == []
    assert summary["parameters"]["particles"]["value"] == 8
    members = [run.summary["metrics"]["spread"]["value"] for run in EnsembleRun(out).runs]
    assert len(set(members)) == 3
    mean = sum(members) / 3
    assert summary["metrics"]["mean spread"]["value"] == pytest.approx(mean)
    assert summary["members"]["spread"]["greatest"] == max(members)
    assert summary["performance"]["steps"] == 30
    (out / "observables.png").unlink()
    assert particell(f"plot {out}") == 0
    assert (out / "observables.png").exists()
    assert particell(line) == 0  # nothing left to do


def test_a_member_is_the_run_with_its_seed(tmp_path):
    assert particell("ensemble walk --runs 2 --processes 1 --no-progress") == 0
    seed = realisation_seed(1, 1)
    assert particell(f"run walk --seed {seed} --out single --no-progress") == 0
    one, other = (tmp_path / d / "summary.json" for d in ("single", "out/walk-runs/run-0001"))
    one, other = (json.loads(path.read_text()) for path in (one, other))
    assert one["metrics"] == other["metrics"]
    assert one["seed"] == other["seed"]


def test_a_single_realisation_has_no_scatter(tmp_path):
    assert particell("ensemble walk --runs 1 --no-progress") == 0
    out = tmp_path / "out/walk-runs"
    assert not (out / "observables.png").exists()
    summary = json.loads((out / "summary.json").read_text())
    assert summary["members"]["spread"]["deviation"] is None


def test_metric_beyond_its_limit_is_status_1(capsys):
    assert particell("ensemble walk --runs 2 --processes 1 --set limit=1e-6 --no-progress") == 1
    out = capsys.readouterr().out
    assert "FAILED" in out
    assert "beyond its limit in 2 of 2" in out


def test_broken_realisations_are_status_3(tmp_path, capsys):
    assert particell("ensemble walk --runs 2 --processes 1 --set break_at=3 --no-progress") == 3
    captured = capsys.readouterr()
    assert "realisation 1 failed: RunError: not finite" in captured.err
    summary = json.loads((tmp_path / "out/walk-runs/summary.json").read_text())
    assert [f["run"] for f in summary["failed"]] == [0, 1]
    assert summary["failed"][1]["seed"] == realisation_seed(1, 1)
    assert "not finite" in summary["failed"][0]["error"]


def test_interrupted_is_status_130_and_says_how_to_go_on(tmp_path, capsys):
    line = "ensemble walk --runs 2 --processes 1 --no-progress --set interrupt_at=4"
    assert particell(line) == 130
    assert "particell resume" in (error := capsys.readouterr().err)
    assert "0 of 2" in error
    out = tmp_path / "out/walk-runs"
    settings = json.loads((out / "ensemble.json").read_text())
    settings["description"]["parameters"]["interrupt_at"] = -1
    (out / "ensemble.json").write_text(json.dumps(settings))
    assert particell(f"resume {out} --no-progress") == 0
    assert len(EnsembleRun(out)) == 2


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("ensemble walk --runs 0", "runs = 0"),
        ("ensemble walk --runs 2 --processes 0", "processes = 0"),
        ("ensemble wlak --runs 2", "did you mean 'walk'"),
        ("ensemble walk --runs 2 --set particles=13", "luckier"),
        ("ensemble walk --runs 2 --seed -1", "seed = -1"),
        ("ensemble walk", "--runs"),
    ],
)
def test_wrong_input(line, words, capsys, tmp_path):
    assert particell(line) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_another_ensemble_in_the_directory(capsys):
    assert particell("ensemble walk --runs 2 --processes 1 --no-progress") == 0
    line = "ensemble walk --runs 2 --processes 1 --no-progress --seed 2"
    assert particell(line) == 2
    assert "this very ensemble" in capsys.readouterr().err
    assert particell(f"{line} --overwrite") == 0


def test_a_cluster_that_does_not_answer_or_is_not_installed(capsys, monkeypatch):
    line = "ensemble walk --runs 2 --scheduler tcp://nowhere:1 --no-progress"

    class Silent(types.ModuleType):
        def Client(self, address, timeout):  # noqa: N802
            raise OSError(f"Timed out trying to connect to {address}")

    monkeypatch.setitem(sys.modules, "dask.distributed", Silent("dask.distributed"))
    monkeypatch.setitem(sys.modules, "dask", types.ModuleType("dask"))
    assert particell(line) == 2
    assert "Timed out trying to connect" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    assert particell(line) == 2
    assert "particell[cluster]" in capsys.readouterr().err
