"""Whose a directory is, which run its files belong to, and what a run that goes on may change."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time

import h5py
import numpy as np
import pytest

import particell as pc
from particell import observers
from particell.boundaries.sponge import Sponge
from particell.cli import call
from particell.errors import InputError
from particell.output import ownership
from particell.output.checkpoint import read_checkpoint
from particell.output.ownership import LOCK, UNKNOWN, owned, owner
from particell.output.trajectory import TrajectoryWriter
from particell.status import read_status
from small_cases import DIFFUSING_LINE
from systems import same_bits, unit_fluid

HOLD = """
import sys
from particell.output.ownership import owned
with owned(sys.argv[1]):
    print("ready", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def held(tmp_path):
    """A directory that another process has."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "ready\n"
    yield tmp_path, process
    process.kill()
    process.communicate()


def line(seed: int = 1, **options) -> pc.Simulation:
    """Molecules and a concentration on particles at rest."""
    box = pc.Domain((0,), (10,), "x", depth=1.0)
    species = [pc.Species("M", 0.1, molecules=True), pc.Species("C", 0.1)]
    given = {"reactions": [pc.Reaction("M -> 0", 0.5)], "dt": 0.01, **options}
    made = pc.Simulation(
        box, pc.fluid(box, unit_fluid(), 1.0), pc.Static(), species, seed=seed, **given
    )
    made.chemistry.set_count("M", 30)
    return made


def run(simulation: pc.Simulation, until: float, out, every: float | None = 0.1, **options):
    return simulation.run(until, every, out, progress=False, **options)


def restored(place, **options) -> pc.Simulation:
    made = line(**options)
    made.restore(read_checkpoint(place / "checkpoint.h5")[0])
    return made


@pytest.mark.parametrize(("dt", "every"), [(0.01, 0.25), ("auto", 50.0)])
def test_frames_after_steps_of_one_s_own(dt, every):
    """The first frame is now, the others are where they would have been from the beginning."""
    made = line(dt=dt)
    made.advance(23)
    now, given = made.time, made.dt
    times = run(made, 4 * every, None, every).times
    assert 0 < now < every and times == pytest.approx([now, *np.arange(1, 5) * every], rel=1e-12)
    assert dt == "auto" or made.dt == pytest.approx(given, rel=1e-12)
    # a part of what is left still is one
    made = line(dt=dt)
    made.advance(23)
    third = (4 * every - now) / 3
    times = run(made, 4 * every, None, third).times
    assert times == pytest.approx(now + np.arange(4) * third, rel=1e-12)


def test_a_first_frame_that_steps_do_not_reach():
    """Steps of a given length are not made shorter for good by one interval that is."""
    made = line(dt=0.01)
    made.advance(23)
    with pytest.raises(InputError, match=r"a whole part of the 0\.77 s to run"):
        run(made, 1.0, None, 1 / 3)
    made = line(dt="auto")
    made.advance(1)
    with pytest.raises(InputError, match="a whole part of"):
        run(made, 100.0, None, 30.0)


def test_a_run_that_is_broken_off_before_its_first_frame(tmp_path, monkeypatch):
    """It goes on to the same bits: the interval that is to come is in the checkpoint."""
    whole, broken = line(), line()
    for made in (whole, broken):
        made.advance(23)
    run(whole, 1.0, tmp_path / "whole", 0.25)
    asked: list[int] = []

    def ask_once():
        if not asked:
            asked.append(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(broken, "start", ask_once)
    with pytest.raises(pc.Interrupted):
        run(broken, 1.0, tmp_path / "broken", 0.25)
    resumed = restored(tmp_path / "broken")
    assert resumed.step == 23
    found = run(resumed, 1.0, tmp_path / "broken", 0.25)
    assert found.times == pytest.approx([0.23, 0.25, 0.5, 0.75, 1.0])
    assert same_bits(whole, resumed) == []


def test_a_directory_belongs_to_one_process(held):
    place, process = held
    assert owner(place) == f"process {process.pid}"
    with pytest.raises(InputError, match=f"nobody else runs in \\(process {process.pid} does\\)"):
        run(line(), 0.2, place)
    assert os.listdir(place) == [LOCK]
    process.kill()  # the lock dies with it, though its file stays
    process.wait()
    assert owner(place) is None and os.listdir(place) == [LOCK]
    run(line(), 0.2, place)
    assert LOCK not in os.listdir(place)


@pytest.mark.skipif(os.name != "posix", reason="needs modes of files, and fork")
def test_who_may_only_read_is_told_the_owner(held, monkeypatch):
    place, process = held
    (place / "status.json").write_text('{"state": "running"}')
    opened, plain = [], os.open

    def reading(path, flags, *more):
        """Root may do everything: refuse what others may not."""
        opened.append(path)
        if str(path).endswith(LOCK) and flags & (os.O_WRONLY | os.O_RDWR):
            raise PermissionError(13, "Permission denied")
        return plain(path, flags, *more)

    monkeypatch.setattr(os, "open", reading)
    assert owner(place) == f"process {process.pid}" and read_status(place)["state"] == "running"
    assert opened
    monkeypatch.setattr(ownership, "_lock", lambda handle, shared=False: None)  # there are none
    assert owner(place) == UNKNOWN and read_status(place)["state"] == "unknown"
    monkeypatch.undo()
    process.kill()
    process.wait()
    assert read_status(place)["state"] == "killed"


def test_the_lock_of_another_is_left(tmp_path):
    """A directory that was removed and made anew belongs to who has it since."""
    place = tmp_path / "one"
    place.mkdir()
    with owned(place):
        shutil.rmtree(place)
        place.mkdir()
        (place / LOCK).write_text("1 elsewhere")
    assert (place / LOCK).exists()
    (place / LOCK).unlink()
    with owned(place):
        pass
    assert os.listdir(place) == []


def test_who_waits_for_another_process_lets_threads_go_on(held, tmp_path):
    place, _ = held
    refused: list[str] = []

    def wait() -> None:
        try:
            with owned(place):
                pass
        except InputError as error:
            refused.append(str(error))

    waiting = threading.Thread(target=wait)
    (tmp_path / "own").mkdir()
    waiting.start()
    while os.path.realpath(place) not in ownership._held:
        time.sleep(0.001)
    with owned(tmp_path / "own"):
        assert waiting.is_alive()
    waiting.join()
    assert refused and not ownership._held


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_nothing_of_its_parent_s(tmp_path):
    """Not its directories, and not the guard that another thread of it has."""
    (tmp_path / "other").mkdir()
    with owned(tmp_path):
        with ownership._guard:
            child = os.fork()
            if not child:
                signal.alarm(20)  # where it waits for ever
                try:
                    with owned(tmp_path / "other"):
                        os._exit(0 if not ownership._held.get(os.path.realpath(tmp_path)) else 1)
                finally:
                    os._exit(2)
        assert os.waitpid(child, 0)[1] == 0
        assert owner(tmp_path) == f"process {os.getpid()}"


def test_a_run_and_an_ensemble_keep_others_out(tmp_path, monkeypatch):
    """While they run, from within; who only reads is let in."""
    place, seen = tmp_path / "one", []

    def look(time, observables) -> bool:
        error = []

        def other() -> None:
            try:
                with owned(place):
                    pass
            except InputError as found:
                error.append(str(found))

        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        seen.append((owner(place), error[0], len(pc.Run(place)), read_status(place)["state"]))
        return False

    run(line(), 0.2, place, stop=look)
    assert len(seen) == 2
    pid, error, frames, state = seen[-1]
    assert pid == f"process {os.getpid()}" and pid in error and "another thread" in error
    assert frames == 3 and state == "running"
    ensemble = pc.Ensemble(line, 2, until=0.1)
    with owned(tmp_path / "one"):
        pass  # free again
    thread = threading.Thread(target=lambda: seen.append(_refused(ensemble, tmp_path / "many")))
    (tmp_path / "many").mkdir()
    with owned(tmp_path / "many"):
        thread.start()
        thread.join()
    assert "nobody else runs in" in seen[-1]


def _refused(ensemble: pc.Ensemble, place) -> str:
    try:
        ensemble.run(place, processes=1, progress=False)
    except InputError as error:
        return str(error)
    return ""


def test_the_command_line_names_the_owner(held, capsys):
    place, process = held
    (place / "case.json").write_text("{}")
    (place / "my.toml").write_text('case = "diffusion-1d"\n')
    assert call(["run", str(place / "my.toml"), "--out", str(place), "--overwrite"]) == 2
    error = capsys.readouterr().err
    assert f"process {process.pid}" in error and str(place) in error and error.count("\n") == 1


def test_a_trajectory_belongs_to_its_run(tmp_path):
    """An older copy, and another realisation, are refused and not glued on."""
    place, other = tmp_path / "one", tmp_path / "other"
    run(line(), 0.2, place)
    shutil.copy(place / "run.h5", tmp_path / "older.h5")
    run(restored(place), 0.4, place)
    run(line(), 0.4, other)
    run(line(seed=2), 0.4, tmp_path / "third")
    whole = (place / "run.h5").read_bytes()
    for path, words in (
        (tmp_path / "older.h5", "an older copy"),
        (other / "run.h5", "another run in it"),
        (tmp_path / "third" / "run.h5", "another run in it"),
    ):
        shutil.copy(path, place / "run.h5")
        with pytest.raises(InputError, match=words):
            run(restored(place), 0.6, place)
        assert (place / "run.h5").read_bytes() == path.read_bytes()
    (place / "run.h5").write_bytes(whole)
    assert len(run(restored(place), 0.6, place)) == 7


def test_a_run_that_has_ended_is_made_longer(tmp_path):
    """To the same bits as in one piece, in a new process or the same."""
    run(line(), 0.6, tmp_path / "whole")
    whole = read_checkpoint(tmp_path / "whole" / "checkpoint.h5")[0]
    run(line(), 0.3, tmp_path / "parts")
    run(restored(tmp_path / "parts"), 0.5, tmp_path / "parts", None)
    last = restored(tmp_path / "parts")
    assert np.allclose(run(last, 0.6, tmp_path / "parts", None).times, np.arange(7) / 10)
    simulation = line()
    run(simulation, 0.3, tmp_path / "same")
    assert len(run(simulation, 0.6, tmp_path / "same")) == 7
    for place in ("parts", "same"):
        state = read_checkpoint(tmp_path / place / "checkpoint.h5")[0]
        for name, values in whole["fields"].items():
            assert np.array_equal(values, state["fields"][name]), name
        with (
            h5py.File(tmp_path / place / "run.h5") as ours,
            h5py.File(tmp_path / "whole" / "run.h5") as theirs,
        ):
            name = "particles/all/count/M/value"
            assert np.array_equal(ours[name], theirs[name])


def test_what_was_done_in_between_is_not_left_out(tmp_path):
    """Steps of which the directory has no frames and averages: refused, until it is put back."""
    simulation = line()
    mean = pc.TimeAverage(np.array([[5.0]]), ["concentration/C"])
    run(simulation, 0.2, tmp_path, averages=mean)
    simulation.advance()
    with pytest.raises(InputError, match="restore it; of step 20, and this is 21"):
        run(simulation, 0.4, tmp_path, averages=mean)
    run(simulation, 0.41, None)
    with pytest.raises(InputError, match="restore it"):
        run(simulation, 0.6, tmp_path, averages=mean)
    simulation.restore(read_checkpoint(tmp_path / "checkpoint.h5")[0])
    assert len(run(simulation, 0.4, tmp_path, averages=mean)) == 5
    with pytest.raises(InputError, match=r"until = 0.1.*present time 0.4"):
        run(simulation, 0.1, tmp_path, averages=mean)


def test_a_run_is_told_of_before_its_loops_are_compiled(tmp_path, monkeypatch):
    seen = []
    simulation, start = line(), pc.Simulation.start

    def slow(self) -> None:
        seen.append(read_status(tmp_path))
        start(self)
        if len(seen) == 1:
            raise ValueError("no loop")

    monkeypatch.setattr(pc.Simulation, "start", slow)
    with pytest.raises(ValueError, match="no loop"):
        run(simulation, 0.2, tmp_path)
    assert (seen[0]["state"], seen[0]["step"], seen[0]["frames"]) == ("running", 0, 0)
    found = read_status(tmp_path)
    assert (found["state"], found["error"]) == ("failed", "ValueError: no loop")


def test_what_fails_where_a_file_cannot_be_closed_is_told_all_the_same(tmp_path, monkeypatch):
    def full(*_) -> None:
        raise OSError(28, "No space left on device")

    def fails(state) -> None:
        monkeypatch.setattr(TrajectoryWriter, "close", full)
        raise ValueError("once")

    with pytest.raises(ValueError, match="once"):
        run(line(operations=[pc.Every(fails, steps=3)]), 0.2, tmp_path)
    assert read_status(tmp_path)["state"] == "failed"


def test_other_intervals_and_ends(tmp_path):
    run(line(), 0.2, tmp_path)
    found = run(restored(tmp_path), 0.4, tmp_path, 0.05)
    assert np.allclose(found.times, [0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4])
    found = run(restored(tmp_path), 3.4, tmp_path, 1.0)
    assert np.allclose(found.times[-4:], [0.4, 1.4, 2.4, 3.4])
    found = run(restored(tmp_path), 3.7, tmp_path, None)  # no whole interval: ten frames
    assert np.allclose(found.times[-11:], 3.4 + 0.03 * np.arange(11))
    assert run(restored(tmp_path), 3.7, tmp_path).times[-1] == pytest.approx(3.7)  # is there
    with pytest.raises(InputError, match="every"):
        run(restored(tmp_path), 4.0, tmp_path, 0.07)


def test_other_intervals_from_between_frames(tmp_path, monkeypatch):
    """The interval at hand is ended as it was begun."""
    monkeypatch.setattr(observers, "CHUNK", 3)

    def interrupt(state) -> None:
        if state.step == 14:
            raise KeyboardInterrupt

    first = line(operations=[pc.Every(interrupt, steps=1)])
    with pytest.raises(KeyboardInterrupt):
        run(first, 0.4, tmp_path, checkpoint_every=0.0)
    assert read_status(tmp_path)["state"] == "interrupted"
    again = line(operations=[pc.Every(interrupt, steps=1)])
    again.restore(read_checkpoint(tmp_path / "checkpoint.h5")[0])
    assert 10 < again.step < 14
    again.operations.by_name["interrupt"].function = lambda state: None
    found = run(again, 0.3, tmp_path, 0.05)
    assert np.allclose(found.times, [0, 0.1, 0.2, 0.25, 0.3])


def test_a_checkpoint_may_go_on_in_another_directory(tmp_path):
    run(line(), 0.5, tmp_path / "one")
    found = run(restored(tmp_path / "one"), 1.0, tmp_path / "two")
    assert np.allclose(found.times, np.arange(5, 11) / 10)
    one, two = (h5py.File(tmp_path / p / "run.h5")["parameters"].attrs for p in ("one", "two"))
    assert one["run_id"] != two["run_id"] and one["seed"] == two["seed"] == 1
    assert len(run(restored(tmp_path / "two"), 1.2, tmp_path / "two")) == 8
    again = restored(tmp_path / "one")
    run(again, 3.0, None, None)  # by default a tenth of what is left
    assert again.time == pytest.approx(3.0)


def law(rate: float) -> dict:
    return {"reactions": [pc.Reaction("C -> 0", rate_law=lambda C, k: rate * C[0])]}


CHANGED = {
    "splitting": {"splitting": "strang"},
    "normalisation": {"normalise_diffusion": False},
    "the rate": {"reactions": [pc.Reaction("M -> 0", 0.6)]},
    "a step": {"dt": 0.02},
    "the depth": {"depth": 2.0},
    "a sponge more": {"boundaries": [Sponge(1.0, 4.0, time=0.5, species={"C": 1.0})]},
    "an operation more": {"operations": [pc.Every(print, steps=3)]},
    "an observable more": {"observables": {"one": lambda state: 1.0}},
}


@pytest.mark.parametrize("changed", CHANGED.values(), ids=CHANGED)
def test_a_changed_description_is_refused(changed):
    state = line().state()
    line().restore(state)
    other = _with(changed)
    with pytest.raises(InputError, match="of the checkpoint"):
        other.restore(state)


def _with(changed) -> pc.Simulation:
    given = {"reactions": [pc.Reaction("M -> 0", 0.5)], "dt": 0.01, **changed}
    box = pc.Domain((0,), (10,), "x", depth=given.pop("depth", 1.0))
    species = [pc.Species("M", 0.1, molecules=True), pc.Species("C", 0.1)]
    return pc.Simulation(box, pc.fluid(box, unit_fluid(), 1.0), pc.Static(), species, **given)


def test_a_surface_that_has_changed_is_refused():
    """Particles may be the same in front of another wall."""

    def beside(edge: float) -> pc.Simulation:
        box = pc.Domain((0,), (10,), depth=1.0)
        wall = pc.Box((-np.inf,), (edge,))
        points, volume = np.arange(3.5, 10.0)[:, None], np.ones(7)
        inner = pc.Phase("fluid", unit_fluid(), points, volume)
        outer = pc.Phase("wall", unit_fluid(), points[:3] - 3.0, 1.0, "wall", surface=wall)
        return pc.Simulation(box, [inner, outer], pc.Static(), dt=0.01)

    state = beside(3.0).state()
    beside(3.0).restore(state)
    with pytest.raises(InputError, match="surfaces of the checkpoint"):
        beside(2.9).restore(state)


def _sponge(value: float, time: float = 0.5) -> dict:
    target = lambda x: value + 0 * x[:, 0]  # noqa: E731 - a function that refers to a number
    return {"boundaries": [Sponge(1.0, 4.0, time=time, species={"C": target})]}


def _every(value: float) -> dict:
    log: list[float] = []
    return {"operations": [pc.Every(lambda state: log.append(value), steps=3, name="log")]}


class Kicks(pc.Operation):
    """An operation with values of its own, and something that it collects."""

    def __init__(self, *kicks: float):
        self.kicks, self.seen = list(kicks), []

    def __call__(self, state) -> None:
        self.seen.append(state.time * self.kicks[0])


class Table:
    def __init__(self, value: float):
        self.value = value


def _reads(thing) -> dict:
    def read(state) -> None:
        assert thing

    return {"operations": [pc.Every(read, steps=3)]}


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (_sponge(1.0), _sponge(2.0)),
        (_sponge(1.0), _sponge(1.0, time=0.6)),
        (_every(1.0), _every(2.0)),
        (
            {"operations": [pc.Every(print, steps=3)]},
            {"operations": [pc.Every(print, steps=4)]},
        ),
        ({"operations": [Kicks(1.0)]}, {"operations": [Kicks(2.0)]}),
        (_reads({"k": 1.0}), _reads({"k": 2.0})),
        (_reads([1.0, {2.0}]), _reads([1.0, {3.0}])),
        (_reads(Table(1.0)), _reads(Table(2.0))),
        (_reads(pc.Circle((0, 0), 1.0)), _reads(pc.Circle((0, 0), 1.0 + 1e-9))),
        (law(0.5), law(0.6)),
        (
            {"observables": {"n": lambda state: 1.0}},
            {"observables": {"n": lambda state: 2.0}},
        ),
    ],
)
def test_what_functions_refer_to_is_compared(one, other):
    first = _with(one)
    first.advance(4)
    state = first.state()
    _with(one).restore(state)  # what a function has collected is no part of it
    with pytest.raises(InputError, match="of the checkpoint"):
        _with(other).restore(state)


def test_other_averages_are_refused(tmp_path):
    def mean(at: float, field: str = "concentration/C") -> pc.TimeAverage:
        return pc.TimeAverage(np.array([[at]]), [field])

    run(line(), 0.2, tmp_path, averages=mean(5.0))
    for other in (mean(6.0), mean(5.0, "count/M"), ()):
        with pytest.raises(InputError, match="averages"):
            run(restored(tmp_path), 0.4, tmp_path, averages=other)
    assert len(run(restored(tmp_path), 0.4, tmp_path, averages=mean(5.0))) == 5


@pytest.mark.parametrize("name", ["a/b", ".", "..", "a\0b", "\n", "x" * 300, ""])
def test_names_of_averages(name):
    with pytest.raises(InputError, match="name"):
        pc.TimeAverage(np.zeros((1, 1)), name=name)


def test_resume_until(tmp_path, monkeypatch, capsys):
    """On the command line: longer, with metrics and figures of the whole; the case says so too."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(DIFFUSING_LINE)
    assert call(["run", "my.toml", "--out", "one", "--no-progress"]) == 0
    assert call(["resume", "one", "--until", "2 s", "--no-progress"]) == 0
    assert np.allclose(pc.Run("one").times, [0, 0.5, 1, 1.5, 2])
    written = (tmp_path / "one" / "case.json").read_bytes()
    assert json.loads(written)["parameters"]["run"]["until"] == 2.0
    for end, words in (("3.7", "every"), ("0.5", "later than the present time 2 s")):
        capsys.readouterr()
        assert call(["resume", "one", "--until", end, "--no-progress"]) == 2
        assert words in capsys.readouterr().err
        assert (tmp_path / "one" / "case.json").read_bytes() == written
    assert call(["resume", "one", "--no-progress"]) == 0  # ended: figures and summary again
    capsys.readouterr()
    assert call(["info", "one"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("one: ended\n") and "t = 2 of 2 s (100.0%), 5 frames" in said
    assert call(["run", "my.toml", "--out", "two", "--no-progress"]) == 0
    shutil.copy("two/checkpoint.h5", "one/checkpoint.h5")
    capsys.readouterr()
    assert call(["resume", "one", "--until", "3", "--no-progress"]) == 2
    assert "it is of another one" in capsys.readouterr().err


def test_bits_of_a_run_that_went_on_are_those_of_steps(tmp_path):
    """The chunks in which steps are made are chosen by the clock, and change nothing."""
    one, two = line(), line()
    run(one, 0.3, tmp_path)
    two.plan(0.1)
    two.advance(one.step)
    assert same_bits(one, two) == []
