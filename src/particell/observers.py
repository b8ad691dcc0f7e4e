"""The time loop with output: frames, checkpoints, progress, stopping, Ctrl-C."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time as clock
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, Protocol

from particell.averages import RunningAverage, TimeAverage, check_averages
from particell.checks import checked, not_negative, positive
from particell.compute import neighbours
from particell.compute.cache import compiled_before
from particell.errors import HealthWarning, InputError, Interrupted, unknown_name
from particell.health import beyond
from particell.laws.digest import described
from particell.output.files import prepare_directory
from particell.output.ownership import owned
from particell.output.run import CHECKPOINT, OWN_FILES, TRAJECTORY, Run
from particell.output.trajectory import run_id
from particell.plans import Plan
from particell.progress import Bar, say
from particell.recorder import Recorder, new_id
from particell.restored import check_kind
from particell.simulated import Runnable
from particell.status import ENDED, STOPPED, Status

#: Steps between looks at the clock, the state's soundness and the user's wish to stop, at most ...
CHUNK = 50
#: ... and seconds, where a step takes less.
LOOK = 0.4
#: Part of its end by which the time of a run that has ended may differ: it is a sum of steps.
AT_END = 1e-9


class Stop(Protocol):
    """A condition that ends a run early; asked after every frame."""

    def __call__(self, time: float, observables: Mapping[str, float]) -> bool:
        """Whether to stop."""
        ...


@checked
@dataclass
class SteadyState:
    """Stop when an observable changes by less than a tolerance per unit of time.

    Parameters
    ----------
    observable
        Name, for example ``"kinetic_energy"``.
    tolerance
        Largest relative change per ``interval``.
    interval
        In s.
    after
        Time in s before which the run does not stop.
    """

    observable: str = "kinetic_energy"
    tolerance: float = 1e-3
    interval: float = 1.0
    after: float = 0.0

    def __post_init__(self) -> None:
        not_negative("tolerance", self.tolerance)
        positive("interval", self.interval)
        self._last: tuple[float, float] | None = None

    def __call__(self, time: float, observables: Mapping[str, float]) -> bool:
        """Whether the change since the last call is small enough."""
        if self.observable not in observables:
            raise InputError("observable", self.observable, f"one of {', '.join(observables)}")
        value, last = observables[self.observable], self._last
        self._last = (time, value)
        if last is None or time <= last[0] or time < self.after:
            return False
        change = abs(value - last[1]) / (time - last[0]) * self.interval
        return change <= self.tolerance * max(abs(value), 1e-300)


@contextmanager
def stop_requests() -> Iterator[list[bool]]:
    """Turn the first Ctrl-C (SIGINT, SIGTERM) into a request; the second one acts at once."""
    asked = [False]
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    def ask(number: int, frame: object) -> None:
        if asked[0]:
            raise KeyboardInterrupt
        asked[0] = True

    previous = {s: signal.signal(s, ask) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield asked
    finally:
        for s, handler in previous.items():
            signal.signal(s, handler)


def run_with_observers(
    simulation: Runnable,
    until: float,
    every: float | None,
    out: str | Path | None,
    progress: bool,
    checkpoint_every: float,
    stop: Stop | None,
    overwrite: bool = False,
    averages: TimeAverage | Sequence[TimeAverage] = (),
) -> Run:
    """See :meth:`particell.simulation.Simulation.run`."""
    not_negative("checkpoint_every", checkpoint_every)
    chosen = [averages] if isinstance(averages, TimeAverage) else list(averages)
    check_averages(simulation, chosen)
    _check_stop(simulation, stop)
    directory = None if out is None else Path(out)
    going_on = directory is not None and _goes_on(simulation, directory)
    if going_on and math.isclose(until, simulation.time, rel_tol=AT_END):
        assert directory is not None
        return Run(directory)
    plan = _plan(simulation, until, every, going_on)
    with contextlib.ExitStack() as stack:
        if directory is not None:
            if not going_on:
                _refuse_other(directory, overwrite)
            stack.enter_context(owned(prepare_directory(directory)))
            if not going_on:
                _claim(simulation, directory, overwrite)
        if progress and not compiled_before(Path(neighbours.__file__)):
            say("compiling the loops (only the first time; up to a minute)")
        # from here on: what is raised while loops are compiled may be lost
        asked = stack.enter_context(stop_requests())
        status = Status(simulation, directory)
        if not going_on:  # of one that does, nothing may change until it is accepted
            status.tell(plan)
            stack.enter_context(status.failures(plan))
        simulation.start()
        running = _running(simulation, chosen, going_on)
        recorder = Recorder(simulation, directory, going_on, running)
        status.identity = recorder.identity
        if going_on:
            stack.enter_context(status.failures(plan))
        session = Session(simulation, recorder, plan, status, stop, asked)
        session.run(going_on, progress, checkpoint_every)
        run = recorder.finish()
    run.health = simulation.health()
    for finding in beyond(run.health):
        warnings.warn(finding.line, HealthWarning, stacklevel=5)
    return run


def _goes_on(simulation: Runnable, directory: Path) -> bool:
    """Whether the run in a directory is the one that this simulation has come from."""
    if simulation.resumed_run is None or not os.path.exists(directory / TRAJECTORY):
        return False
    if run_id(directory / TRAJECTORY) != simulation.resumed_run["id"]:
        return False
    if simulation.step != simulation.resumed_step:
        allowed = (
            f"gone on with from its checkpoint (restore it; of step {simulation.resumed_step}, and "
            f"this is {simulation.step}): what lies between would be missing"
        )
        raise InputError("out", str(directory), allowed)
    return True


def check_end(
    simulation: Runnable, until: float, every: float | None, directory: str | Path
) -> None:
    """Refuse an end that :meth:`.Simulation.run` would refuse; nothing is changed.

    Raises
    ------
    InputError
        Naming it.
    """
    clock, timing = simulation.system.clock, simulation.timing
    kept = clock.saved(), timing.saved()
    try:
        _plan(simulation, until, every, _goes_on(simulation, Path(directory)))
    finally:
        clock.restore(kept[0])
        timing.restore(kept[1])


def _plan(simulation: Runnable, until: float, every: float | None, going_on: bool) -> Plan:
    if not (until > simulation.time and math.isfinite(until)):
        raise InputError("until", until, f"later than the present time {simulation.time:g} s")
    saved = simulation.resumed_plan
    if going_on and saved is not None:
        return Plan.going_on(simulation, saved, until, every)
    return Plan.new(simulation, until, every)


def _running(
    simulation: Runnable, chosen: Sequence[TimeAverage], going_on: bool
) -> list[RunningAverage]:
    """The sums of averages, of a run that goes on as they were at its checkpoint."""
    if going_on:
        now = {average.name: described(average) for average in chosen}
        if now != simulation.resumed_averaged:
            names = ", ".join(simulation.resumed_averaged) or "none"
            allowed = f"as when the run began ({names}), with the same points and fields"
            raise InputError("averages", list(now), allowed)
    running = [RunningAverage(simulation, average) for average in chosen]
    for average in running if going_on else []:
        name = average.average.name
        saved = simulation.resumed_averages.get(name)
        check_kind(f"average '{name}'", saved, average.sums)
        average.sums[...] = saved
    return running


def _check_stop(simulation: Runnable, stop: Stop | None) -> None:
    if stop is not None and not callable(stop):
        raise InputError("stop", stop, "a condition such as SteadyState, or None")
    if isinstance(stop, SteadyState) and stop.observable not in (o := simulation.observables()):
        raise unknown_name("observable", stop.observable, o)


def _refuse_other(directory: Path, overwrite: bool) -> None:
    """Refuse a directory that holds another run, unless it may be replaced."""
    used = any(os.path.exists(directory / name) for name in (TRAJECTORY, CHECKPOINT))
    if used and not overwrite:
        allowed = "without another run in it (or give overwrite=True)"
        raise InputError("out", str(directory), allowed)


def _claim(simulation: Runnable, directory: Path, overwrite: bool) -> None:
    """Make a directory that is owned ready for a new run."""
    _refuse_other(directory, overwrite)
    used = any(os.path.exists(directory / name) for name in (TRAJECTORY, CHECKPOINT))
    if used:
        prepare_directory(directory, *OWN_FILES)
    if simulation.resumed_run is not None:  # another trajectory, and so another run
        simulation.run_id = new_id()


class Session:
    """A run from where a simulation is to the end of its plan.

    Parameters
    ----------
    simulation, recorder, plan, status
        What runs, what takes its frames, when, and what tells of it.
    stop
        The condition that ends it early, if any.
    asked
        Whether the user wants it to stop.
    """

    def __init__(
        self,
        simulation: Runnable,
        recorder: Recorder,
        plan: Plan,
        status: Status,
        stop: Stop | None,
        asked: list[bool],
    ):
        self.simulation, self.recorder, self.plan = simulation, recorder, plan
        self.status, self.stop, self.asked = status, stop, asked
        self._saved = -1  # the step of the last checkpoint
        self._seconds = LOOK  # that a step takes; the first one shows how many

    def run(self, going_on: bool, progress: bool, checkpoint_every: float) -> None:
        """Make steps, frames and checkpoints; tell that it has ended."""
        try:
            if not going_on:
                for average in self.recorder.averages:
                    average.sample()
                self.recorder.record()
                self._checkpoint()
            self.status.tell(self.plan)
            stopped = self._steps(progress, checkpoint_every)
            self._checkpoint()
            self.status.tell(self.plan, STOPPED if stopped else ENDED)
        except BaseException:
            with contextlib.suppress(Exception):  # what has broken the run may break this too
                self.recorder.close()
            raise
        finally:
            self._remember()

    def _checkpoint(self) -> None:
        self.recorder.checkpoint(self.plan)
        self._saved = self.simulation.step
        self.status.saved()

    def _remember(self) -> None:
        """Let the simulation know what it may go on with."""
        s, kept = self.simulation, self.recorder.kept(self.plan)
        if self.recorder.directory is not None and self.recorder.identity["frames"]:
            s.resumed_plan, s.resumed_run = kept["plan"], kept["run"]
            s.resumed_averages, s.resumed_averaged = kept["averages"], kept["averaged"]
            s.resumed_step = self._saved

    def _interrupt(self) -> NoReturn:
        """Write a checkpoint and say that the run was stopped."""
        self._checkpoint()
        where = str(self.recorder.directory) if self.recorder.directory else None
        raise Interrupted(where, step=self.simulation.step, time=self.simulation.time)

    def _steps(self, progress: bool, checkpoint_every: float) -> bool:
        """All steps; gives whether the condition has ended them."""
        s, plan = self.simulation, self.plan
        if self.asked[0]:
            self._interrupt()
        saved = clock.monotonic()
        bar = Bar(
            progress,
            total=plan.last,
            initial=s.step,
            unit="step",
            desc=f"{len(s.particles)} particles",
            mininterval=0.5,
        )
        with bar:
            while s.step < plan.last:
                bar.update(self._some())
                if s.step == plan.next and self._frame(bar):
                    return True
                if self.asked[0]:
                    self._interrupt()
                if clock.monotonic() - saved > checkpoint_every:
                    self._checkpoint()
                    saved = clock.monotonic()
        return False

    def _some(self) -> int:
        """Steps up to the next look at the state, a frame, a sample, or a wish to stop."""
        s, plan = self.simulation, self.plan
        to_frame = plan.next - s.step
        due = [a.due_in(to_frame, plan.per_frame) for a in self.recorder.averages]
        # where a state is looked at must not depend on how fast the machine is
        to_look = CHUNK - (plan.per_frame - to_frame) % CHUNK
        steps, done = min(to_look, to_frame, *due), 0
        while done < steps and not (done and self.asked[0]):
            few = min(steps - done, max(1, int(LOOK / max(self._seconds, 1e-9))))
            begin = clock.monotonic()
            s.advance(few, check=done + few == steps)
            self._seconds = (clock.monotonic() - begin) / few
            done += few
            self.status.tell(plan)
        for average, ahead in zip(self.recorder.averages, due, strict=True):
            if done == ahead:
                average.sample()
        return done

    def _frame(self, bar: Bar) -> bool:
        """Take a frame; gives whether the condition ends the run."""
        s, plan = self.simulation, self.plan
        observables = self.recorder.record()
        bar.words(f"t = {s.time:.4g} s")
        if self.stop is not None and self.stop(s.time, observables):
            plan.next += plan.per_frame
            plan.last = s.step  # so that a resumed run stays stopped
            return True
        plan.frame_taken(s)
        if s.timing.outran(s.monitor.largest_speed()):
            plan.finer(s)
        bar.total(plan.last)
        return False
