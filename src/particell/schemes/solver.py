"""A scheme on a state: its stages, bound to arrays and loops, and run one after the other.

A stage says which fields and sweeps it needs and what it does; it holds no arrays. What concerns
single particles is *pointwise*, sums over neighbours are sweeps, and at moments
(:class:`.When`) the simulation's operations act.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from particell.compute.loop import Loop
from particell.compute.sweep import Sweep
from particell.errors import InputError
from particell.fields import Field
from particell.operations.operation import Operation, Operations, When
from particell.schemes.flow import Flow
from particell.state import State

Run = Callable[[], None]


@dataclass(frozen=True)
class Stage:
    """A part of a step.

    Attributes
    ----------
    pointwise
        Whether a particle's row is made from that row alone.
    """

    pointwise: ClassVar[bool] = True

    def fields(self, flow: Flow) -> Sequence[Field]:
        """Fields that it needs besides what all particles have."""
        return ()

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """Sums over neighbours that it makes."""
        return ()

    def moments(self) -> Collection[When]:
        """Moments at which it lets operations act, besides those that every step has."""
        return ()

    def bind(self, solver: Solver) -> Run | None:
        """Look up arrays and loops; None where there is nothing to do."""
        raise NotImplementedError


class Solver:
    """Runs the stages of a scheme.

    Parameters
    ----------
    state
        What it acts on.
    scheme
        The description.
    flow
        What is made of it on this state; None where nothing moves.
    operations
        What happens at moments of the step.

    Attributes
    ----------
    first, stages
        What runs before the first step, and in every step.
    """

    def __init__(self, state: State, scheme: Any, flow: Flow | None, operations: Operations):
        self.state, self.scheme, self.operations = state, scheme, operations
        self._flow = flow
        self.first: list[Stage] = _stages_of(scheme, "first_stages")
        self.stages: list[Stage] = _stages_of(scheme, "stages")
        self._runs: list[Run] | None = None
        self._done = lambda: None
        self._sweeps: dict[str, Any] = {}
        self._described: dict[str, Sweep] = {}
        self._renewals = 0

    @property
    def flow(self) -> Flow:
        """The flow, of schemes in which particles move."""
        assert self._flow is not None, "particles at rest have no flow"
        return self._flow

    # --- what stages are bound to --------------------------------------------------------------
    def loop(
        self, loop: Loop, more: Mapping[str, Any] | None = None, **constants: Any
    ) -> Callable[..., None]:
        """A loop over particles with its arguments looked up."""
        return self.state.device.bind(loop, self.flow.fields(dict(more or {})), **constants)

    def during(self, loop: Callable[..., None], part: float) -> Run:
        """A loop that is given a part of the time step."""
        n, clock = self.state.n, self.state.clock
        return lambda: loop(n, part * clock.dt)

    def sweep(self, name: str, ahead: int = 0, pairs: bool = False, **more: float) -> Run:
        """A sweep by name; with ``pairs`` after the operations that come before pairs.

        Noise is that of step number + ``ahead``; ``more`` are further numbers.
        """
        before = self.operations.at(When.PAIRS) if pairs else None
        n, clock = self.state.n, self.state.clock
        numbers = self.flow.numbers

        def run() -> None:
            if before is not None:
                before()
            self._bound_sweep(name)(n, **{**numbers(clock.step + ahead), **more})

        return run

    def _bound_sweep(self, name: str) -> Callable[..., None]:
        """A sweep on the arrays that there are now."""
        found = self._sweeps.get(name)
        if found is None:
            found = self._sweeps[name] = self.flow.bound(self._described[name])
        return found

    def descriptions(self) -> list[Sweep]:
        """The sweeps that steps are made of, each once, in the order of the stages."""
        if self._flow is None:
            return []
        found = {s.name: s for stage in self.stages for s in stage.sweeps(self.flow)}
        found |= {s.name: s for stage in self.first for s in stage.sweeps(self.flow)}
        return list(found.values())

    def forms(self) -> dict[str, str]:
        """The forms that sweeps run in, by name."""
        device = self.state.device
        return {sweep.name: sweep.form_on(device) for sweep in self.descriptions()}

    def bound(self, stages: Sequence[Stage]) -> list[Run]:
        """Stages as calls, without those that have nothing to do."""
        if self._flow is not None:
            for sweep in (s for stage in stages for s in stage.sweeps(self.flow)):
                self._described.setdefault(sweep.name, sweep)
        return [run for run in (stage.bind(self) for stage in stages) if run is not None]

    def renewed(self) -> None:
        """Bind sweeps again where arrays of the neighbour list are new (grown, restored)."""
        renewals = self.state.neighbours.renewals
        if self._renewals != renewals:
            self._renewals = renewals
            self._sweeps.clear()

    def check_moments(self, operations: Sequence[Operation]) -> None:
        """Refuse operations of the user's that would never act.

        Raises
        ------
        InputError
            Naming the operation and the moments that there are.
        """
        known = {When.LIST, When.DONE} | ({When.PAIRS} if self._flow is not None else set())
        known |= {when for s in (*self.first, *self.stages) for when in s.moments()}
        for operation in operations:
            asked = set(operation.acts())
            if asked and not asked & known:
                names = ", ".join(w.name for w in When if w in known)
                shown = ", ".join(w.name for w in asked)
                raise InputError(f"when of {operation.name}", shown, f"one of {names}, here")

    # --- what it does ----------------------------------------------------------------------------
    def do(self, *stages: Stage) -> None:
        """Run stages by themselves, now."""
        for run in self.bound(stages):
            run()

    def build_list(self) -> None:
        """Build the neighbour list at the present positions."""
        self.state.neighbours.build(self.state.particles)
        self.renewed()
        fire = self.operations.at(When.LIST)
        if fire is not None:
            fire()

    def start(self) -> None:
        """The neighbour list, and what follows from the state before the first step."""
        self.state.clock.now = self.state.clock.time
        self.do(*self.first)

    def step(self) -> None:
        """A time step."""
        if self._runs is None:
            self._runs = self.bound(self.stages)
            done = self.operations.at(When.DONE)
            self._done = done or self._done
        self.state.clock.now = self.state.clock.time
        for run in self._runs:
            run()
        self.state.clock.tick()
        self._done()


def _stages_of(scheme: Any, method: str) -> list[Stage]:
    """What a scheme is made of; refused where that is no list of stages."""
    found = getattr(scheme, method)()
    if not isinstance(found, list) or not all(isinstance(stage, Stage) for stage in found):
        where = f"{type(scheme).__name__}.{method}()"
        raise InputError(where, found, "a list of stages (particell.schemes.solver.Stage)")
    return found


def add_fields(flow: Flow) -> None:
    """Add what the stages of a flow's scheme need, and the user's fields with their rates.

    Raises
    ------
    InputError
        For fields of the user's whose names mean something else.
    """
    particles, scheme = flow.state.particles, flow.scheme
    for stage in [*_stages_of(scheme, "first_stages"), *_stages_of(scheme, "stages")]:
        for field in stage.fields(flow):
            if field.name not in particles:
                particles.add(field)
    flow.check_names(scheme.fields)
    for field in scheme.fields:
        particles.add(field)
        particles.add(field.rate)
