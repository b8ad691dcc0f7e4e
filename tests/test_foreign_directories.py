"""Directories of strangers: they are data, and nothing that they name is called or read."""

from __future__ import annotations

import json
import shlex

import h5py
import numpy as np
import pytest

import particell as pc
from particell import cases
from particell.cases.directories import read_case, replot, resume
from particell.cases.ensembles import read_ensemble
from particell.cases.execution import execute
from particell.cli import call
from particell.ensemble import Ensemble
from particell.errors import InputError, Interrupted
from particell.output.checkpoint import read_checkpoint, seal, write_checkpoint
from particell.output.files import CheckpointError
from particell.output.run import Run

CALL = {"class": "subprocess:check_output", "parameters": {"args": ["touch", "EXECUTED"]}}
CONTEXT = {"seed": 1, "backend": "cpu", "precision": "float64", "threads": 1}


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys, line: str) -> str:
    capsys.readouterr()
    assert call(shlex.split(line)) == 2
    error = capsys.readouterr().err.strip()
    assert "\n" not in error
    return error


@pytest.mark.parametrize("command", ["resume", "plot"])
@pytest.mark.parametrize(
    "reference",
    [
        "subprocess:check_output",
        "os:system",
        "builtins:print",
        "particell.cases.execution:execute",
        "particell.cases.poiseuille:Poiseuille.describe",
        "no_such_module:Case",
        ["a", "list"],
        7,
    ],
)
def test_a_class_that_a_directory_names_is_not_imported(place, capsys, command, reference):
    run = {"case": "poiseuille", **CALL, "class": reference, "context": CONTEXT}
    (place / "case.json").write_text(json.dumps(run))
    assert "must be a built-in case" in refused(capsys, f"{command} .")
    (place / "case.json").unlink()
    described = {"case": "poiseuille", **CALL, "class": reference, **CONTEXT}
    ensemble = {"runs": 2, "seed": 1, "threads": 1, "description": described}
    (place / "ensemble.json").write_text(json.dumps(ensemble))
    assert "must be a built-in case" in refused(capsys, f"{command} .")
    assert not (place / "EXECUTED").exists()


def test_what_the_user_names_must_be_a_case(place, capsys):
    (place / "case.json").write_text(json.dumps({"case": "x", **CALL, "context": CONTEXT}))
    assert "of a particell.cases.base.Case" in refused(
        capsys, "plot . --case subprocess:check_output"
    )
    assert "No module named" in refused(capsys, "plot . --case no_such_module:Case")
    assert "'x'" in refused(capsys, "plot . --case fake_case:Walk")  # another than the run's
    assert not (place / "EXECUTED").exists()


def test_a_case_of_ones_own_goes_on_where_the_user_names_it(place, capsys):
    from fake_case import Walk

    case = Walk(interrupt_at=6)
    with pytest.raises(Interrupted):
        execute(case, "half", progress=False)
    recorded = json.loads((place / "half" / "case.json").read_text())
    recorded["parameters"]["interrupt_at"] = -1
    (place / "half" / "case.json").write_text(json.dumps(recorded))
    assert "--case" in refused(capsys, "resume half")
    with pytest.raises(InputError, match="--case"):
        resume("half")
    assert call(shlex.split("resume half --no-progress --case fake_case:Walk")) == 0
    assert replot("half", Walk) and isinstance(read_case("half", Walk)[0], Walk)
    result = Ensemble(Walk(), runs=2).run("several", processes=1, progress=False)
    assert len(result) == 2
    assert "--case" in refused(capsys, "plot several")
    assert call(shlex.split("plot several --case fake_case:Walk")) == 0
    with pytest.raises(InputError, match="--case"):
        read_ensemble("several")


def test_parameters_that_are_nested_without_end(place):
    from systems import periodic_lattice

    periodic_lattice(8, 2).run(0.01, out=place, progress=False)
    with h5py.File(place / "run.h5", "a") as file:
        del file["parameters/run"]
        file["parameters/run"] = "[" * 100_000
    run = Run(place)
    assert [role.kind for role in run.source.roles()] == ["fluid"]
    with pytest.raises(InputError, match="JSON of a table"):
        _ = run.parameters


@pytest.mark.parametrize("text", ["[" * 100_000, '{"description": [], "seed": 1, "runs": 1}'])
def test_ensembles_that_are_no_ensembles(place, capsys, text):
    (place / "ensemble.json").write_text(text)
    refused(capsys, "resume .")


def _external(file: h5py.File) -> None:
    file["observables/there"] = h5py.ExternalLink("other.h5", "/numbers")


def _raw(file: h5py.File) -> None:
    file.create_dataset("observables/raw", (4,), "f8", external=[("secret", 0, 32)])


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "numbers", (4,))
    file.create_virtual_dataset("observables/virtual", layout)


@pytest.mark.parametrize("spoil", [_external, _raw, _virtual])
def test_numbers_that_are_in_other_files_are_refused(place, monkeypatch, capsys, spoil):
    monkeypatch.setattr(cases, "CASES", {"walk": ("fake_case:Walk", "Random walkers")})
    (place / "secret").write_bytes(b"\0" * 32)
    with h5py.File("other.h5", "w") as file:
        file["numbers"] = np.arange(4.0)
    assert call(shlex.split("run walk --out w --no-progress")) == 0
    with h5py.File("w/run.h5", "r+") as file:
        spoil(file)
        file["again"] = file["particles"]  # a link within the file does no harm
    with pytest.raises(InputError, match="one file with all in it"):
        len(Run("w"))
    assert "one file with all in it" in refused(capsys, "plot w")
    write_checkpoint("good.h5", {"x": np.arange(3)})
    with h5py.File("good.h5", "r+") as file:
        spoil(file)
    seal("good.h5")
    with pytest.raises(CheckpointError, match="other"):
        read_checkpoint("good.h5")


def test_a_run_that_a_script_made_is_drawn_and_says_how_it_goes_on(place, capsys):
    box = pc.Domain((0, 0), (8, 8), "xy", depth=1.0)
    wall = pc.Fluid(1.0, 0.1, sound_speed=10.0)
    made = pc.Simulation(box, pc.fluid(box, wall, 1.0), pc.Static(), [pc.Species("C", 0.1)])
    made.run(0.2, 0.1, "script", progress=False)
    capsys.readouterr()
    assert call(["plot", "script"]) == 0
    drawn = capsys.readouterr().out.split()
    assert "script/observables.png" in drawn and "script/concentration-C.png" in drawn
    assert all((place / path).stat().st_size for path in drawn)
    assert "read_checkpoint('script/checkpoint.h5')" in refused(capsys, "resume script")
    groups = Run("script").parameters["groups"]
    assert [(g["name"], g["kind"], g["surface"]) for g in groups] == [("fluid", "fluid", None)]
    with h5py.File("script/run.h5", "r+") as file:
        del file["parameters/run"]
        file["parameters/run"] = "[" * 10_000
    with pytest.raises(InputError, match="JSON of a table"):
        _ = Run("script").parameters
