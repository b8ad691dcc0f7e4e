from __future__ import annotations

import os

import numpy as np
import pytest

import ensemble_system as system
from particell import Ensemble, EnsembleInterrupted, EnsembleRun, Run
from particell.cases.execution import execute
from particell.ensemble import realisation_seed
from particell.errors import InputError, RunError
from particell.output.files import read_json

TIMES = {"until": system.UNTIL, "every": system.EVERY}


def ensemble(function=system.build, runs=3, seed=1, **options) -> Ensemble:
    return Ensemble(function, runs, seed, **{**TIMES, **options})


@pytest.fixture(scope="module")
def alone() -> list[dict[str, np.ndarray]]:
    """The last frames of realisations that were run by themselves."""
    frames = []
    for k in range(3):
        simulation = system.build(realisation_seed(1, k))
        frames.append(simulation.run(**TIMES, progress=False).frame(-1))
    return frames


def same(result: EnsembleRun, frames) -> bool:
    return same_runs(result.runs, frames)


def same_runs(runs: list[Run], frames) -> bool:
    return len(runs) == len(frames) and all(
        run.frame(-1)[name].tobytes() == frame[name].tobytes()
        for run, frame in zip(runs, frames, strict=True)
        for name in frame
    )


def test_seeds_are_those_of_numpys_spawn():
    children = np.random.SeedSequence(7).spawn(5)
    words = [int(c.generate_state(1, np.uint64)[0]) >> 8 for c in children]
    assert [realisation_seed(7, k) for k in range(5)] == words
    assert ensemble(seed=7, runs=3).seeds == words[:3]
    many = ensemble(runs=2000).seeds
    assert len(set(many)) == 2000
    assert max(many) < 2**56


def test_in_this_process(alone, tmp_path):
    result = ensemble().run(tmp_path, processes=1, progress=False)
    assert same(result, alone)
    assert result.seeds == ensemble().seeds
    assert not same(result, alone[::-1])


def test_in_two_processes(alone, tmp_path):
    # a function without a module, as in a notebook
    result = ensemble(lambda seed: system.build(seed)).run(tmp_path, 2, progress=False)
    assert same(result, alone)


def test_a_recipe_that_is_no_case(alone, tmp_path):
    result = Ensemble(system.Line(), runs=3).run(tmp_path / "out", processes=1, progress=False)
    assert same(result, alone)
    device = {"backend": "cpu", "precision": "float64"}
    assert result.settings["description"] == {"shift": 0.0, **device}
    assert execute(system.Line(), tmp_path / "one", realisation_seed(1, 1), progress=False) == 0
    assert same_runs([Run(tmp_path / "one")], alone[1:2])
    context = {"seed": realisation_seed(1, 1), **device, "threads": None}
    recorded = read_json(tmp_path / "one" / "case.json", "case")
    assert len(recorded.pop("run")) == 32
    assert recorded == {"shift": 0.0, "context": context}
    with pytest.raises(InputError, match="until"):
        Ensemble(system.Line, runs=3)  # a class is a function


@pytest.mark.filterwarnings("ignore")
def test_on_a_cluster(alone, tmp_path):
    distributed = pytest.importorskip("dask.distributed")
    options = {"processes": False, "dashboard_address": None, "protocol": "inproc://"}
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert same(ensemble().run(tmp_path, client=client, progress=False), alone)
        with pytest.raises(InputError, match="out = None"):
            ensemble().run(client=client)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, **options) as cluster,
        distributed.Client(cluster) as client,
        pytest.raises(InputError, match="single thread"),
    ):
        ensemble().run(tmp_path / "other", client=client, progress=False)


def test_one_that_fails_is_reported_and_the_others_go_on(alone, tmp_path, capsys):
    broken = {realisation_seed(1, 1)}

    def build(seed):
        if seed in broken:
            raise RunError("not finite", step=3, time=0.1, field="v", particle=5)
        return system.build(seed)

    result = ensemble(build).run(tmp_path, processes=1, progress=False)
    assert result.indices == [0, 2]
    assert same(result, [alone[0], alone[2]])
    assert list(result.failed) == [1]
    assert "particle 5" in result.failed[1]
    assert "realisation 1 failed: RunError: not finite" in capsys.readouterr().err

    broken.clear()
    kept = (tmp_path / "run-0000/run.h5").stat().st_mtime_ns
    result = ensemble(build).run(tmp_path, processes=1, progress=False)
    assert same(result, alone)
    assert not result.failed
    assert (tmp_path / "run-0000/run.h5").stat().st_mtime_ns == kept


def test_one_that_kills_its_process_is_reported(alone, tmp_path, capsys):
    result = ensemble(system.deadly, runs=2).run(tmp_path, processes=2, progress=False)
    assert same(result, alone[:1])
    assert "died" in result.failed[1]


@pytest.mark.parametrize("processes", [1, 2])
def test_interrupted_and_resumed(alone, tmp_path, monkeypatch, processes):
    monkeypatch.setenv("HALT", "1")
    make = ensemble(system.interrupting)
    with pytest.raises(EnsembleInterrupted, match="resume") as stopped:
        make.run(tmp_path, processes, progress=False)
    assert stopped.value.done in (1, 2)  # the signal reaches one process only
    half = EnsembleRun(tmp_path)
    assert 1 not in half.indices
    assert (tmp_path / "run-0001/checkpoint.h5").exists()
    monkeypatch.delenv("HALT")
    assert same(make.run(tmp_path, 1, progress=False), alone)


def test_more_realisations_later(alone, tmp_path):
    ensemble(runs=2).run(tmp_path, processes=1, progress=False)
    kept = (tmp_path / "run-0001/run.h5").stat().st_mtime_ns
    assert same(ensemble(runs=3).run(tmp_path, processes=1, progress=False), alone)
    assert (tmp_path / "run-0001/run.h5").stat().st_mtime_ns == kept


def test_without_a_directory(alone):
    result = ensemble().run(processes=1, progress=False)
    assert same(result, alone)
    directory = result.directory
    del result
    assert not os.path.exists(directory)


def test_wrong_input(tmp_path):
    for options, words in (
        ({"runs": 0}, "runs = 0"),
        ({"runs": 2.5}, "runs = 2.5"),
        ({"seed": -1}, "seed = -1"),
        ({"until": None}, "until = None"),
        ({"threads": 0}, "threads = 0"),
        ({"function": "build"}, "description = 'build'"),
        ({"backend": "cuda"}, "backend"),
    ):
        with pytest.raises(InputError, match=words):
            ensemble(**options)
    make = ensemble(runs=2)
    with pytest.raises(InputError, match="processes = 0"):
        make.run(tmp_path, processes=0)
    with pytest.raises(InputError, match="client = 3"):
        make.run(tmp_path, client=3)
    with pytest.raises(InputError, match="seed of the simulation"):
        ensemble(lambda seed: system.build(5)).run(tmp_path / "none", processes=1)
    assert not (tmp_path / "none").exists()
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="this very ensemble"):
        make.run(tmp_path, processes=1)
    with pytest.raises(InputError, match="directory"):
        EnsembleRun(tmp_path)


def test_another_ensemble_is_not_overwritten_unless_told(tmp_path):
    ensemble(runs=1).run(tmp_path, processes=1, progress=False)
    with pytest.raises(InputError, match="this very ensemble"):
        ensemble(runs=1, seed=2).run(tmp_path, processes=1)
    result = ensemble(runs=1, seed=2).run(tmp_path, processes=1, progress=False, overwrite=True)
    assert result.seeds == [realisation_seed(2, 0)]
