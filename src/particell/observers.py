"""The time loop with output: frames, checkpoints, progress, stopping, Ctrl-C."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import threading
import time as clock
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Protocol

import numpy as np
from tqdm import tqdm

from particell import snapshot
from particell.averages import RunningAverage, TimeAverage, check_averages
from particell.checks import checked, not_negative, positive
from particell.compute import neighbours
from particell.compute.cache import compiled_before
from particell.errors import HealthWarning, InputError, Interrupted, RunError, unknown_name
from particell.health import beyond
from particell.output.checkpoint import write_checkpoint
from particell.output.files import OutputError, plain, prepare_directory
from particell.output.h5md import AVERAGES
from particell.output.run import CHECKPOINT, OWN_FILES, TRAJECTORY, Run
from particell.output.sources import ROLES
from particell.output.trajectory import TrajectoryWriter
from particell.schemes.timestep import check_number_of_steps
from particell.simulated import Runnable

#: Steps between looks at the clock, the state's soundness and the user's wish to stop.
CHUNK = 50
#: More frames than any disk holds.
MOST_FRAMES = 1e9


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


class Recorder:
    """Where frames go: to ``run.h5``, or to memory."""

    def __init__(
        self,
        simulation: Runnable,
        directory: Path | None,
        resumed: bool,
        averages: list[RunningAverage],
    ):
        self.simulation, self.directory, self.averages = simulation, directory, averages
        self.points = {a.average.name: a.average.points for a in averages}
        self.frames: list[dict[str, np.ndarray]] = []
        self.observables: list[dict[str, Any]] = []
        self.steps: list[int] = []
        self.times: list[float] = []
        self.writer: TrajectoryWriter | None = None
        self.static = simulation.static_frame()  # normals of walls that turn are those of now
        if directory is None:
            return
        if resumed:
            self.writer = TrajectoryWriter.resume(directory / TRAJECTORY, simulation.step)
        else:
            roles = [role.as_dict() for role in snapshot.roles_of(simulation)]
            self.writer = TrajectoryWriter(
                directory / TRAJECTORY,
                simulation.domain,
                self.static,
                simulation.group_names,
                parameters=json.dumps(plain({**simulation.settings, ROLES: roles})),
                points=self.points,
                units=snapshot.units_of(simulation),
            )

    def record(self) -> dict[str, float]:
        """Take a frame; returns the observables."""
        s = self.simulation
        frame, observables = s.frame(), s.observables()
        s.watch.look()
        series: dict[str, Any] = dict(observables)
        for average in self.averages:
            for field, mean in average.take().items():
                series[f"{AVERAGES}/{average.average.name}/{field}"] = mean
        if self.writer is not None:
            self.writer.append(s.step, s.time, frame, series)
        else:
            self.frames.append(frame)
            self.observables.append(series)
            self.steps.append(s.step)
            self.times.append(s.time)
        return observables

    def checkpoint(self, plan: dict) -> None:
        """Write a checkpoint that the frames written so far belong to."""
        if self.directory is None:
            return
        self.simulation.check()  # a checkpoint is good, whatever observers did
        if self.writer is not None:
            self.writer.sync()
        sums = {average.average.name: average.sums for average in self.averages}
        state = {**self.simulation.state(), "plan": plan, "averages": sums}
        write_checkpoint(self.directory / CHECKPOINT, state, {"step": self.simulation.step})

    def close(self) -> None:
        """Close the file."""
        if self.writer is not None:
            self.writer.close()

    def finish(self) -> Run:
        """Close the file and open the run."""
        s = self.simulation
        self.close()
        if self.directory is not None:
            return Run(self.directory)
        return Run.from_memory(
            s.domain,
            s.group_names,
            self.static,
            self.steps,
            self.times,
            self.frames,
            self.observables,
            points=self.points,
            units=snapshot.units_of(s),
            roles=snapshot.roles_of(s),
        )


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
    if not (until > simulation.time and math.isfinite(until)):
        if simulation.resumed and out is not None and until <= simulation.time * (1 + 1e-9):
            return Run(out)
        raise InputError("until", until, f"later than the present time {simulation.time:g} s")
    every = (until - simulation.time) / 10 if every is None else every
    if not 0 < every <= until * (1 + 1e-9):
        raise InputError("every", every, f"positive and at most 'until' = {until:g} s")
    _check_stop(simulation, stop)
    resumed = simulation.resumed and out is not None
    plan = simulation.resumed_plan if resumed else None
    if plan is None:
        intervals = _intervals(until - simulation.time, every)
        per_frame = simulation.plan(every)
        check_number_of_steps(simulation.dt, intervals * every)
        plan = {
            "every": every,
            "per_frame": per_frame,
            "last": simulation.step + intervals * per_frame,
            "next": simulation.step + per_frame,
        }
    directory = None if out is None else _claim(Path(out), resumed or overwrite, resumed)
    if progress and not compiled_before(Path(neighbours.__file__)):
        tqdm.write("compiling the loops (only the first time; up to a minute)", sys.stderr)
    # from here on: what is raised while loops are compiled may be lost
    with stop_requests() as asked:
        simulation.start()
        running = _running(simulation, averages, resumed)
        recorder = Recorder(simulation, directory, resumed, running)
        if not resumed:
            for average in running:
                average.sample()
            recorder.record()
            recorder.checkpoint(plan)
        _loop(simulation, recorder, plan, progress, checkpoint_every, stop, asked)
    run = recorder.finish()
    run.health = simulation.health()
    for finding in beyond(run.health):
        warnings.warn(finding.line, HealthWarning, stacklevel=5)
    return run


def _running(
    simulation: Runnable, averages: TimeAverage | Sequence[TimeAverage], resumed: bool
) -> list[RunningAverage]:
    """The sums of averages, of a resumed run as they were at its checkpoint."""
    chosen = [averages] if isinstance(averages, TimeAverage) else list(averages)
    check_averages(simulation, chosen)
    running = [RunningAverage(simulation, average) for average in chosen]
    if resumed:
        saved = simulation.resumed_averages
        same = {a.average.name: a.sums.shape for a in running}
        if same != {name: sums.shape for name, sums in saved.items()}:
            allowed = f"as when the run began: {', '.join(saved) or 'none'}"
            raise InputError("averages", list(same), allowed)
        for average in running:
            average.sums[...] = saved[average.average.name]
    return running


def _check_stop(simulation: Runnable, stop: Stop | None) -> None:
    if stop is not None and not callable(stop):
        raise InputError("stop", stop, "a condition such as SteadyState, or None")
    if isinstance(stop, SteadyState) and stop.observable not in (o := simulation.observables()):
        raise unknown_name("observable", stop.observable, o)


def _intervals(span: float, every: float) -> int:
    """How many frames a span of time in s has; refuses an interval that would not reach its end."""
    if span > MOST_FRAMES * every:
        least = span / MOST_FRAMES
        raise InputError("every", every, f"at least {least:g} s: {MOST_FRAMES:g} frames")
    number = max(1, round(span / every))
    if abs(number * every - span) > 1e-6 * span:
        raise InputError("every", every, f"a whole part of the {span:g} s to run")
    return number


def _claim(directory: Path, allowed: bool, resumed: bool) -> Path:
    """Make the directory of a run; one that holds another run needs to be allowed."""
    used = any(os.path.exists(directory / name) for name in (TRAJECTORY, CHECKPOINT))
    if used and not allowed:
        raise InputError("out", str(directory), "without a run in it (or give overwrite=True)")
    return prepare_directory(directory, *(OWN_FILES if used and not resumed else ()))


def _plan_again(simulation: Runnable, plan: dict) -> None:
    """Smaller steps from this frame on; the frames keep their times."""
    frames = (plan["last"] - simulation.step) // plan["per_frame"]
    if frames:
        plan["per_frame"] = simulation.plan(plan["every"])
        plan["next"] = simulation.step + plan["per_frame"]
        plan["last"] = simulation.step + frames * plan["per_frame"]


def _interrupt(simulation: Runnable, recorder: Recorder, plan: dict) -> NoReturn:
    """Write a checkpoint and say that the run was stopped."""
    recorder.checkpoint(plan)
    recorder.close()
    where = str(recorder.directory) if recorder.directory else None
    raise Interrupted(where, step=simulation.step, time=simulation.time)


def _loop(
    simulation: Runnable,
    recorder: Recorder,
    plan: dict,
    progress: bool,
    checkpoint_every: float,
    stop: Stop | None,
    asked: list[bool],
) -> None:
    if asked[0]:
        _interrupt(simulation, recorder, plan)
    saved = clock.monotonic()
    bar = tqdm(
        total=plan["last"],
        initial=simulation.step,
        unit="step",
        disable=not progress,
        desc=f"{len(simulation.particles)} particles",
        mininterval=0.5,
    )
    with bar:
        try:
            while simulation.step < plan["last"]:
                to_frame = plan["next"] - simulation.step
                due = [a.due_in(to_frame, plan["per_frame"]) for a in recorder.averages]
                steps = min(CHUNK, to_frame, *due)
                simulation.advance(steps)
                bar.update(steps)
                for average, steps_ahead in zip(recorder.averages, due, strict=True):
                    if steps == steps_ahead:
                        average.sample()
                if simulation.step == plan["next"]:
                    observables = recorder.record()
                    plan["next"] += plan["per_frame"]
                    bar.set_postfix_str(f"t = {simulation.time:.4g} s", refresh=False)
                    if stop is not None and stop(simulation.time, observables):
                        plan["last"] = simulation.step  # so that a resumed run stays stopped
                        break
                    if simulation.timing.outran(simulation.monitor.largest_speed()):
                        _plan_again(simulation, plan)
                        bar.total = plan["last"]
                if asked[0]:
                    _interrupt(simulation, recorder, plan)
                if clock.monotonic() - saved > checkpoint_every:
                    recorder.checkpoint(plan)
                    saved = clock.monotonic()
        except (RunError, OutputError):
            # the checkpoint on the disk is from before the fault: keep it
            recorder.close()
            raise
        recorder.checkpoint(plan)
