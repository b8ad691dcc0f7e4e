"""Stages that bring densities, pressures and fluxes of momentum forward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from particell.boundaries.wall_friction import FREE
from particell.compute.sweep import Sweep
from particell.fields import Field, work
from particell.schemes import updates
from particell.schemes.flow import Flow
from particell.schemes.solver import Run, Solver, Stage


@dataclass(frozen=True)
class PredictDensity(Stage):
    """Density and volume at a part of the step, by the last rate."""

    part: float = 0.5

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return (work("density_half"),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.during(solver.loop(updates.predict_density), self.part)


@dataclass(frozen=True)
class DensityRates(Stage):
    """The density's rate half-way through a step."""

    pointwise: ClassVar[bool] = False

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().density_rates(),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.sweep("density_rates", pairs=True)


@dataclass(frozen=True)
class FluxRates(Stage):
    """The density's rate and the flux of momentum where particles move with v + δv."""

    consistent: bool
    form: str
    pointwise: ClassVar[bool] = False

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return (work("flux", flow.state.dim),)

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().flux_rates(self.consistent, self.form),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.sweep("flux_rates", pairs=True)


@dataclass(frozen=True)
class AddFlux(Stage):
    """v += part dt times the flux of momentum."""

    part: float = 1.0

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        more = {"a": solver.state.particles["flux"]}
        kick = solver.loop(updates.kick, more, DIM=solver.state.dim, HELD=FREE)
        return solver.during(kick, self.part)


@dataclass(frozen=True)
class SumDensity(Stage):
    """Density from the arrangement."""

    pointwise: ClassVar[bool] = False

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().summed_density(),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.sweep("summed_density")


@dataclass(frozen=True)
class EquationOfState(Stage):
    """ρ += part dt dρ/dt, then pressure and volume."""

    part: float = 0.0

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return [work(name) for name in ("pressure_term", "density_rate")]

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        return solver.during(solver.loop(updates.equation_of_state), self.part)


@dataclass(frozen=True)
class WallPressure(Stage):
    """Pressure of walls from the fluid's."""

    pointwise: ClassVar[bool] = False

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().wall_pressure(),) if flow.walls else ()

    def bind(self, solver: Solver) -> Run | None:
        """See :meth:`Stage.bind`."""
        return solver.sweep("wall_pressure") if solver.flow.walls else None


@dataclass(frozen=True)
class FilterDensity(Stage):
    """Smooth the fluid's density; walls keep theirs."""

    pointwise: ClassVar[bool] = False

    def fields(self, flow: Flow) -> Sequence[Field]:
        """See :meth:`Stage.fields`."""
        return (work("density_half"),)

    def sweeps(self, flow: Flow) -> Sequence[Sweep]:
        """See :meth:`Stage.sweeps`."""
        return (flow.sweeps().density_filter(),)

    def bind(self, solver: Solver) -> Run:
        """See :meth:`Stage.bind`."""
        device, p = solver.state.device, solver.state.particles
        smooth = solver.sweep("filtered_density")

        def run() -> None:
            device.copy(p["density"], p["density_half"])
            smooth()
            device.copy(p["density_half"], p["density"])

        return run
