"""Tables of how long a simulation runs, what it writes and averages, and when it stops early."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from particell.analysis.fields import grid, line
from particell.averages import TimeAverage
from particell.casefile.table import Name, Position, Table, describes
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.observers import SteadyState
from particell.plans import MOST_FRAMES
from particell.simulation import Simulation
from particell.units import Number, Time

#: More points than are worth averaging at.
MOST_POINTS = 10_000_000

_Duration = Annotated[Time, Field(gt=0)]


@describes(Simulation)
class SimulationTable(Table):
    """How the simulation is stepped."""

    dt: Literal["auto"] | _Duration
    normalise_diffusion: bool
    splitting: Literal["auto", "lie", "strang"]


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


class LineTable(Table):
    """Equally spaced points on a straight line."""

    start: Position
    """One end."""
    end: Position
    """The other."""
    points: Annotated[int, Field(ge=2, le=MOST_POINTS)] = 101
    """How many, both ends included."""


@describes(TimeAverage)
class AverageTable(Table):
    """Fields averaged in time, at points that do not move: one of `grid`, `line`, `points`."""

    fields: Annotated[list[Name], Field(min_length=1)]  # type: ignore[assignment]
    grid: Annotated[list[Annotated[int, Field(ge=1)]], Field(max_length=3)] | None = None
    """Cells along each axis of a grid that fills the domain; the points are their centres."""
    line: LineTable | None = None
    """Points on a straight line."""
    points: Annotated[list[Position], Field(min_length=1)] | None = None
    """Any points, D numbers each."""
    samples: Annotated[int, Field(ge=1)]
    after: Annotated[Time, Field(ge=0)]
    groups: Annotated[list[Name], Field(min_length=1)] | None
    name: Name
    kernel: Name

    @model_validator(mode="after")
    def _one_place(self) -> AverageTable:
        given = [key for key in ("grid", "line", "points") if getattr(self, key) is not None]
        if len(given) != 1:
            raise InputError("points", " and ".join(given), "one of grid, line, points")
        return self

    def build(self, domain: Domain) -> TimeAverage:
        """The average."""
        return TimeAverage(self._places(domain), **self.given("grid", "line", "points"))

    def _places(self, domain: Domain) -> np.ndarray:
        if self.grid is not None:
            if np.prod(np.array(self.grid, float)) > MOST_POINTS:
                raise InputError("grid", self.grid, f"at most {MOST_POINTS:.0e} cells")
            return grid(domain, self.grid)
        chosen = self.points or [self.line.start, self.line.end]  # type: ignore[union-attr]
        for place in chosen:
            if len(place) != domain.dim:
                allowed = f"of {domain.dim} numbers, as the domain has"
                raise InputError("points", list(place), allowed)
        if self.line is not None:
            return line(self.line.start, self.line.end, self.line.points)
        return np.array(chosen)
