"""Tables of how long a simulation runs, what it writes, and when it stops early."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from particell.casefile.table import Name, Table, describes
from particell.errors import InputError
from particell.observers import MOST_FRAMES, SteadyState
from particell.simulation import Simulation
from particell.units import Number, Time

_Duration = Annotated[Time, Field(gt=0)]


@describes(Simulation)
class SimulationTable(Table):
    """How the simulation is stepped."""

    dt: Literal["auto"] | _Duration
    normalise_diffusion: bool
    splitting: Literal["lie", "strang"]


@describes(Simulation.run)
class RunTable(Table):
    """How long it runs, and what it writes."""

    until: _Duration
    every: _Duration | None
    checkpoint_every: _Duration

    @model_validator(mode="after")
    def _frames_fit(self) -> RunTable:
        if self.every is None:
            self.every = self.until / 10
        if self.every > self.until * (1 + 1e-9):
            raise InputError("every", self.every, f"at most 'until' = {self.until:g} s")
        if self.every * MOST_FRAMES < self.until:
            least = self.until / MOST_FRAMES
            raise InputError("every", self.every, f"at least {least:g} s: {MOST_FRAMES:g} frames")
        return self


@describes(SteadyState)
class StopTable(Table):
    """Stop when an observable changes by less than a tolerance per unit of time."""

    observable: Name
    tolerance: Annotated[Number, Field(ge=0)]
    interval: _Duration
    after: Annotated[Time, Field(ge=0)]

    def build(self) -> SteadyState:
        """The condition."""
        return SteadyState(**self.given())
