"""When frames are taken: the plan of a run, what of it a checkpoint keeps, and what may change."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from particell.errors import InputError
from particell.restored import StateError, number, whole
from particell.schemes.timestep import check_number_of_steps
from particell.simulated import Runnable

#: More frames than any disk holds.
MOST_FRAMES = 1e9
#: Part of an interval by which a time may be missed: times are sums of steps.
SLACK = 1e-6


@dataclass
class Plan:
    """When the next frames are due.

    Attributes
    ----------
    every, until
        The interval of frames and the end, in s.
    per_frame
        Steps in an interval.
    next, last
        The steps of the next frame and of the last one.
    then
        The interval from the next frame on, where it is to be another one; else 0.
    """

    every: float
    until: float
    per_frame: int
    next: int
    last: int
    then: float = 0.0

    @classmethod
    def new(cls, simulation: Runnable, until: float, every: float | None) -> Plan:
        """A plan from now on; by default of ten frames.

        Where intervals from now on do not reach the end, but those from time 0 on do, the first one
        is shorter: frames are at multiples of the interval.
        """
        span, step = until - simulation.time, simulation.step
        every = span / 10 if every is None else every
        if not 0 < every <= span * (1 + 1e-9):
            raise InputError("every", every, f"positive and at most the {span:g} s to run")
        first = _first_interval(simulation, span, until, every)
        if first:
            per_frame = simulation.plan(first)
            check_number_of_steps(simulation.dt, span)
            return cls(first, until, per_frame, step + per_frame, step + per_frame, every)
        frames = _intervals(span, every)
        per_frame = simulation.plan(every)
        check_number_of_steps(simulation.dt, frames * every)
        return cls(every, until, per_frame, step + per_frame, step + frames * per_frame)

    @classmethod
    def going_on(
        cls, simulation: Runnable, saved: Mapping[str, Any], until: float, every: float | None
    ) -> Plan:
        """The plan of a run that goes on: as it was, or with another end, or other intervals."""
        plan = cls(**saved)
        plan._check(simulation)
        step = simulation.step
        asked = plan.then or plan.every
        same = every is None or math.isclose(every, asked, rel_tol=1e-9)
        if same and math.isclose(until, plan.until, rel_tol=1e-9):
            return plan
        interval = asked if every is None else every
        ahead = simulation.time + (plan.next - step) * simulation.dt
        early = until < ahead - SLACK * plan.every
        if step == plan.next - plan.per_frame and (early or plan.then or not same):
            default = every is None and not _fits(until - simulation.time, interval)
            return cls.new(simulation, until, None if default else interval)
        if early:
            raise InputError("until", until, f"at least the time of the next frame, {ahead:g} s")
        return plan._longer(simulation, until - ahead, until, interval, every is None)

    def _longer(
        self, simulation: Runnable, more: float, until: float, interval: float, default: bool
    ) -> Plan:
        """The same up to the next frame, and after it ``more`` seconds up to another end."""
        at_frame = simulation.step == self.next - self.per_frame
        there = more < SLACK * interval
        if default and at_frame and not (there or _fits(more, interval)):
            return Plan.new(simulation, until, None)
        frames = 0 if there else _intervals(more, interval)
        if interval != self.every:
            return Plan(self.every, until, self.per_frame, self.next, self.next, interval)
        check_number_of_steps(simulation.dt, frames * self.every)
        last = self.next + frames * self.per_frame
        return Plan(self.every, until, self.per_frame, self.next, last)

    def saved(self) -> dict[str, Any]:
        """What a checkpoint keeps."""
        return asdict(self)

    def frame_taken(self, simulation: Runnable) -> None:
        """The next frame, now that one has been taken."""
        if self.then and self.until > simulation.time * (1 + 1e-9):
            vars(self).update(vars(Plan.new(simulation, self.until, self.then)))
            return
        self.next += self.per_frame

    def finer(self, simulation: Runnable) -> None:
        """Smaller steps from this frame on; the frames keep their times."""
        frames = (self.last - simulation.step) // self.per_frame
        if frames:
            self.per_frame = simulation.plan(self.every)
            self.next = simulation.step + self.per_frame
            self.last = simulation.step + frames * self.per_frame

    def _check(self, simulation: Runnable) -> None:
        """Refuse what does not belong to the clock of the simulation."""
        dt, step = simulation.dt, simulation.step
        if not math.isclose(self.per_frame * dt, self.every, rel_tol=1e-6):
            raise StateError("every", self.every, f"{self.per_frame} steps of {dt:g} s")
        if not self.next - self.per_frame <= step < self.next:
            allowed = f"one after step {step}, by at most {self.per_frame}"
            raise StateError("step of the next frame", self.next, allowed)
        if self.per_frame % simulation.chemistry_every:
            allowed = f"a whole number of {simulation.chemistry_every}"
            raise StateError("steps between frames", self.per_frame, allowed)
        ahead = simulation.time + (self.last - step) * dt
        if ahead > self.until + 1.5 * self.every:
            raise StateError("last step", self.last, f"one up to t = {self.until:g} s")


def check_plan(saved: Any) -> None:
    """Refuse a plan that is none.

    Raises
    ------
    StateError
        Naming what it holds.
    """
    names = [f.name for f in fields(Plan)]
    if not isinstance(saved, Mapping) or set(saved) != set(names):
        raise StateError("plan", type(saved).__name__, f"with {', '.join(names)}")
    for name in ("every", "until"):
        number(name, saved[name], 0.0, zero=False)
    number("then", saved["then"], 0.0)
    for name in ("per_frame", "next", "last"):
        whole(name, saved[name], 1 if name == "per_frame" else 0)


def _first_interval(simulation: Runnable, span: float, until: float, every: float) -> float:
    """The time in s to the next multiple of ``every``, where frames are at those; else 0."""
    if _fits(span, every) or span > MOST_FRAMES * every or not _fits(until, every):
        return 0.0
    first, dt = math.fmod(span, every), simulation.dt
    if simulation.timing.automatic:
        return first
    # steps of a given length stay as they are
    steps = round(first / dt)
    return steps * dt if abs(steps * dt - first) <= SLACK * dt else 0.0


def _fits(span: float, every: float) -> bool:
    return abs(max(1, round(span / every)) * every - span) <= SLACK * span


def _intervals(span: float, every: float) -> int:
    """How many frames a span of time in s has; refuses an interval that would not reach its end."""
    if span > MOST_FRAMES * every:
        least = span / MOST_FRAMES
        raise InputError("every", every, f"at least {least:g} s: {MOST_FRAMES:g} frames")
    if not _fits(span, every):
        raise InputError("every", every, f"a whole part of the {span:g} s to run")
    return max(1, round(span / every))
