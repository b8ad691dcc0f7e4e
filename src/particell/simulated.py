"""What observers may see of a simulation: they know its parts, and not who puts them together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from particell.chemistry.engine import Chemistry
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.monitor import Monitor
from particell.operations.operation import Operations
from particell.operations.walls import Walls
from particell.particles import Particles
from particell.phases import Phase
from particell.schemes.solver import Solver
from particell.state import State
from particell.timing import TimeStep


class Simulated(Protocol):
    """The parts of a simulation."""

    system: State
    scheme: Any
    solver: Solver
    chemistry: Chemistry | None
    operations: Operations
    walls: Walls
    monitor: Monitor
    timing: TimeStep
    domain: Domain
    device: Device
    particles: Particles
    neighbours: NeighbourList
    phases: list[Phase]
    materials: list[Fluid]
    seed: int
    described: dict[str, str]
    static: bool
    books: bool
    step: int
    time: float
    dt: float
    chemistry_every: int


class Runnable(Simulated, Protocol):
    """A simulation that observers make steps."""

    run_id: str
    account: Any
    resumed: bool
    resumed_plan: Mapping[str, Any] | None
    resumed_run: Mapping[str, Any] | None
    resumed_step: int
    resumed_averages: Mapping[str, np.ndarray]
    resumed_averaged: Mapping[str, str]
    watch: Any

    @property
    def group_names(self) -> list[str]:
        """Names of the groups."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """What was chosen for the run."""
        ...

    def start(self) -> None:
        """Do what comes before the first step."""
        ...

    def plan(self, every: float) -> int:
        """Choose dt so that ``every`` is a whole number of steps."""
        ...

    def advance(self, steps: int = 1, check: bool = True) -> None:
        """Do time steps."""
        ...

    def check(self) -> None:
        """Refuse to go on with a broken state."""
        ...

    def static_frame(self) -> dict[str, np.ndarray]:
        """Fields that do not change."""
        ...

    def frame(self) -> dict[str, np.ndarray]:
        """Fields of a frame."""
        ...

    def observables(self) -> dict[str, float]:
        """Scalars for time series."""
        ...

    def health(self) -> list[Any]:
        """Whether the run can be trusted."""
        ...

    def state(self) -> dict[str, Any]:
        """What a checkpoint holds."""
        ...
