"""What steps are made of: schemes are lists of these, in the order in which they run."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import ClassVar

from particell.boundaries.wall_friction import FREE, draw_spread, friction_width, take_spread
from particell.compute.philox import VELOCITY_SPREAD, stream_key
from particell.compute.sweep import Sweep
from particell.fields import RATE, Field, work
from particell.operations.operation import When
from particell.schemes import updates
from particell.schemes.flow import Flow
from particell.schemes.solver import Run, Solver, Stage


@dataclass(frozen=True)
class At(Stage):
    """The operations of a moment; with ``part`` positions have come to that part of the step."""

    when: When
    part: float | None = None
    pointwise: ClassVar[bool] = False

    def moments(self) -> Collection[When]:
        """See :meth:`Stage.moments`."""
        return (self.when,)

    def bind(self, solver: Solver) -> Run | None:
        """See :meth:`Stage.bind`."""
        fire, part, clock = solver.operations.at(self.when), self.part, solver.state.clock
        if part is None:
            return fire

        def reach() -> None:
            clock.now = clock.time + part * clock.dt
            if fire is not None:
                fire()

        return reach


@dataclass(frozen=True)
class BuildList(Stage):
    """The neighbour list at the present positions."""

    pointwise: ClassVar[bool] = False

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.build_list


@dataclass(frozen=True)
class RenewList(Stage):
    """The neighbour list anew, where it does not hold to the end of the step."""

    pointwise: ClassVar[bool] = False

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        state, p = solver.state, solver.state.particles
        needs_build, x = state.neighbours.needs_build, p["x"]
        velocity = p["transport" if "transport" in p else "v"]

        def renew() -> None:
            if needs_build(x, velocity, state.clock.dt):
                solver.build_list()

        return renew


@dataclass(frozen=True)
class Kick(Stage):
    """v += part dt a, beside walls as :mod:`particell.boundaries.wall_friction` says."""

    part: float = 0.5

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        kick = solver.loop(updates.kick, DIM=solver.state.dim, HELD=solver.flow.held)
        return solver.during(kick, self.part)


@dataclass(frozen=True)
class ChangeFields(Stage):
    """Fields of the user's: f += part dt df/dt."""

    part: float = 0.5

    def bind(self, solver: Solver) -> Run | None:
        """See :meth:`Stage.bind`."""
        p, loops = solver.state.particles, []
        for field in solver.scheme.fields:
            pair = {"value": p[field.name], "rate": p[field.name + RATE]}
            loops.append(solver.loop(updates.change, pair, COLUMNS=field.components))
        if not loops:
            return None
        n, clock, part = solver.state.n, solver.state.clock, self.part

        def change() -> None:
            for loop in loops:
                loop(n, part * clock.dt)

        return change


@dataclass(frozen=True)
class Drift(Stage):
    """x += part dt v, or v + δv."""

    part: float = 0.5

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.during(solver.loop(updates.drift, DIM=solver.state.dim), self.part)


@dataclass(frozen=True)
class ShiftVelocity(Stage):
    """v + δv in the middle of the step, by which particles move."""

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return [work(name, flow.state.dim) for name in ("shift", "transport", "shift_before")]

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        p = solver.state.particles
        more = {} if "flux" in p else {"flux": p["v"]}
        constants = {"DIM": solver.state.dim, "FLUX": "flux" in p}
        return solver.during(solver.loop(updates.transport_velocity, more, **constants), 1.0)


@dataclass(frozen=True)
class KeepShift(Stage):
    """The first shift has no history."""

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        device, p = solver.state.device, solver.state.particles
        return lambda: device.copy(p["shift"], p["shift_before"])


@dataclass(frozen=True)
class KernelSums(Stage):
    """The kernel's second moments, by which friction is divided."""

    pointwise: ClassVar[bool] = False

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return (work("kernel_sum"),)

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().kernel_sums(),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.sweep("kernel_sums")


def _friction_with_walls(flow: Flow) -> Sequence[Field]:
    """Γ of :mod:`particell.boundaries.wall_friction`, where there are walls."""
    if flow.held == FREE:
        return ()
    return (work("wall_friction", friction_width(flow.held, flow.state.dim)),)


@dataclass(frozen=True)
class Forces(Stage):
    """Accelerations, and rates of the user's fields; noise is that of step number + ``ahead``."""

    ahead: int = 1
    pointwise: ClassVar[bool] = False

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return _friction_with_walls(flow)

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().forces(),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.sweep("forces", self.ahead, pairs=True)


@dataclass(frozen=True)
class Rates(Stage):
    """Accelerations, and the density's rate unless it is summed, in one sweep.

    Fields of the user's are taken ``field_lead`` half steps ahead.
    """

    density: bool
    field_lead: float
    pointwise: ClassVar[bool] = False

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return _friction_with_walls(flow)

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().forces(density=self.density),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        name = "rates" if self.density else "forces"
        return solver.sweep(name, pairs=True, field_lead=self.field_lead)


@dataclass(frozen=True)
class Predict(Stage):
    """Keep the state for the corrector; then the Euler predictor."""

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        vectors = [work(name, flow.state.dim) for name in ("x0", "v0", "a0")]
        return [*vectors, work("density0"), work("density_rate0")]

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        dim, n = solver.state.dim, solver.state.n
        remember = solver.loop(updates.remember, DIM=dim)
        held = solver.flow.held
        predict = solver.during(solver.loop(updates.predict, DIM=dim, HELD=held), 1.0)

        def run() -> None:
            remember(n)
            predict()

        return run


@dataclass(frozen=True)
class Correct(Stage):
    """The trapezoidal corrector."""

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        correct = solver.loop(updates.correct, DIM=solver.state.dim, HELD=solver.flow.held)
        return solver.during(correct, 1.0)


def _spreads(flow: Flow) -> bool:
    """Whether velocities at whole steps are given what walls damp within a step."""
    return flow.held != FREE and bool(flow.scheme.fluctuations)


@dataclass(frozen=True)
class DrawSpread(Stage):
    """Give v its spread at whole steps (:mod:`particell.boundaries.wall_friction`)."""

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        if not _spreads(flow):
            return ()
        return (Field("velocity_spread", components=flow.state.dim, role="work", part_of="v"),)

    def bind(self, solver: Solver) -> Run | None:
        """See :meth:`Stage.bind`."""
        if not _spreads(solver.flow):
            return None
        clock, n = solver.state.clock, solver.state.n
        key0, key1 = stream_key(solver.state.seed, VELOCITY_SPREAD)
        constants = {"DIM": solver.state.dim, "HELD": solver.flow.held}
        draw = solver.loop(draw_spread, {"key0": key0, "key1": key1}, **constants)
        return lambda: draw(n, clock.step, 0.5 * clock.dt)


@dataclass(frozen=True)
class TakeSpread(Stage):
    """Take away from v what :class:`DrawSpread` added."""

    def bind(self, solver: Solver) -> Run | None:
        """See :meth:`Stage.bind`."""
        if not _spreads(solver.flow):
            return None
        take, n = solver.loop(take_spread, DIM=solver.state.dim), solver.state.n
        return lambda: take(n)


def beginning(densities: Sequence[Stage], forces: Sequence[Stage], shift: bool) -> list[Stage]:
    """What comes before the first step: the list, densities, forces, and a shift's history."""
    return [
        At(When.MOVED, 0.0),
        BuildList(),
        At(When.START),
        *densities,
        At(When.BEGUN),
        *forces,
        *([KeepShift()] if shift else []),
    ]


@dataclass(frozen=True)
class EverySteps(Stage):
    """Stages that run in every so many steps only; 0 for never."""

    every: int
    stages: tuple[Stage, ...]
    pointwise: ClassVar[bool] = False

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return [field for stage in self.stages for field in stage.fields(flow) if self.every]

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return [sweep for stage in self.stages for sweep in stage.sweeps(flow) if self.every]

    def moments(self) -> Collection[When]:
        """See :meth:`Stage.moments`."""
        return [when for stage in self.stages for when in stage.moments() if self.every]

    def bind(self, solver: Solver) -> Run | None:
        """See :meth:`Stage.bind`."""
        every, clock = self.every, solver.state.clock
        if not every:
            return None
        runs = solver.bound(self.stages)

        def run() -> None:
            if (clock.step + 1) % every == 0:
                for each in runs:
                    each()

        return run
