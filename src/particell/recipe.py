"""Recipes: what a run, or an ensemble of runs, is made from.

A recipe is all that :mod:`particell.cases.execution` and :mod:`particell.ensemble` know. Every
:class:`~particell.cases.base.Case` is one, and so becomes a function that builds a simulation.
"""

from __future__ import annotations

import abc
import functools
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from particell.errors import InputError

if TYPE_CHECKING:
    from particell.compute.device import Device
    from particell.output.run import Run
    from particell.simulation import Simulation


@dataclass(frozen=True)
class Context:
    """How a recipe is run, as opposed to what it is.

    Attributes
    ----------
    seed
        Of the random numbers.
    backend
        ``"cpu"`` or ``"cuda"``.
    precision
        ``"float64"`` or ``"float32"``.
    threads
        Number of CPU threads, or None for all.
    """

    seed: int = 1
    backend: str = "cpu"
    precision: str = "float64"
    threads: int | None = None

    @functools.cached_property
    def device(self) -> Device:
        """The device to build the simulation on."""
        from particell.compute.device import Device

        return Device(self.backend, self.precision)


@dataclass(frozen=True)
class Metric:
    """A number that a run is about.

    Attributes
    ----------
    value
        What was measured.
    paper
        What the paper printed, or None.
    limit
        The greatest magnitude allowed, or None where the value is not an error.
    unit
        Unit of all three.
    """

    value: float
    paper: float | None = None
    limit: float | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        if self.value is None:  # as files have what is no number
            object.__setattr__(self, "value", math.nan)

    @property
    def passed(self) -> bool:
        """Whether |value| ≤ limit; true without a limit, false for a NaN with one."""
        return self.limit is None or bool(abs(self.value) <= self.limit)

    def as_dict(self) -> dict[str, Any]:
        """The metric as in ``summary.json``."""
        return asdict(self)


class Recipe(abc.ABC):
    """What to build, how long to run it and how often to write; picklable, for other processes."""

    is_data: ClassVar[bool] = True
    """Whether its identity, with a context, says all that it takes to build it again."""

    if TYPE_CHECKING:
        # Fields, properties or constants of the actual recipes, which is why they are none here.
        @property
        def name(self) -> str:
            """What it is called."""

        @property
        def title(self) -> str:
            """What it is, in one line."""

        @property
        def until(self) -> float:
            """When the simulation ends, in s."""

        @property
        def every(self) -> float | None:
            """Time between frames, in s."""

    @abc.abstractmethod
    def identity(self) -> dict[str, Any]:
        """What it is, as JSON: the same for the same recipe, whatever the context."""

    @abc.abstractmethod
    def build(self, context: Context) -> Simulation:
        """The simulation, at its first moment."""

    def run_options(self) -> dict[str, Any]:
        """Further options of :meth:`particell.simulation.Simulation.run`, such as ``stop``."""
        return {}

    def parameters(self) -> dict[str, dict[str, Any]]:
        """All parameters: ``{name: {"value": …, "unit": …}}``."""
        return {}

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """What the run is about, in numbers."""
        return {}

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Draw the figures into a directory; gives the paths of the PNG files."""
        return []


@dataclass(frozen=True)
class FunctionRecipe(Recipe):
    """What a function ``build(seed)`` makes, on the device that the function chooses."""

    is_data: ClassVar[bool] = False
    title: ClassVar[str] = ""

    function: Callable[[int], Simulation]
    until: float
    every: float | None = None

    @property
    def name(self) -> str:
        """Name of the function, for messages and summaries."""
        return getattr(self.function, "__qualname__", type(self.function).__qualname__)

    def identity(self) -> dict[str, Any]:
        """See :class:`Recipe`."""
        return {"function": self.name, "until": self.until, "every": self.every}

    def build(self, context: Context) -> Simulation:
        """See :class:`Recipe`."""
        simulation = self.function(context.seed)
        found = getattr(simulation, "seed", None)
        if found != context.seed:
            allowed = f"the one given to build, {context.seed}"
            raise InputError("seed of the simulation", found, allowed)
        return simulation
