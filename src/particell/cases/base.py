"""What a case is: parameters with units, a simulation to build, metrics and figures.

A case is a class with fields for its parameters::

    class Poiseuille(Case):
        name = "poiseuille"
        title = "Flow between two plates, driven by a body force"

        height: Annotated[Length, Field(gt=0)] = 100e-6
        \"\"\"Distance of the plates.\"\"\"
        resolution: Annotated[int, Field(ge=4)] = 20
        \"\"\"Particles across the channel.\"\"\"
        until: Time = 0.5
        every: Time = 0.05

        def build(self, context): ...
        def analyse(self, run, simulation): ...
        def figures(self, run, directory): ...

and one line in the table of :mod:`particell.cases`.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from particell.errors import InputError, unknown_name
from particell.units import (
    Acceleration,
    Concentration,
    Density,
    Diffusivity,
    Length,
    Mass,
    Number,
    Pressure,
    Quantity,
    Rate,
    Temperature,
    Time,
    Velocity,
    Viscosity,
)

if TYPE_CHECKING:
    from particell.compute.device import Device
    from particell.ensemble.results import EnsembleRun
    from particell.observers import Stop
    from particell.output.run import Run
    from particell.simulation import Simulation

__all__ = [
    "Acceleration",
    "Case",
    "Concentration",
    "Context",
    "Density",
    "Diffusivity",
    "Length",
    "Mass",
    "Metric",
    "Number",
    "Pressure",
    "Quantity",
    "Rate",
    "Temperature",
    "Time",
    "Velocity",
    "Viscosity",
]


@dataclass(frozen=True)
class Context:
    """How a case is run, as opposed to what it is.

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
    """A number that a case is about.

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

    @property
    def passed(self) -> bool:
        """Whether |value| ≤ limit; true without a limit, false for a NaN with one."""
        return self.limit is None or bool(abs(self.value) <= self.limit)

    def as_dict(self) -> dict[str, Any]:
        """The metric as in ``summary.json``."""
        return asdict(self)


class Case(BaseModel, abc.ABC):
    """Base class of all cases.

    Parameters
    ----------
    **parameters
        Values of the fields, in SI units or as text with a unit.

    Raises
    ------
    InputError
        Naming the first parameter that is wrong, its value and what is allowed.
    """

    model_config = ConfigDict(
        extra="forbid",
        validate_default=True,
        validate_assignment=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    name: ClassVar[str]
    """What the case is called on the command line."""
    title: ClassVar[str]
    """What it is, in one line."""
    full: ClassVar[Mapping[str, Any] | Sequence[Mapping[str, Any]]] = {}
    """Parameters of the paper's size, or of each of its sizes, for ``validate --full``."""
    reference: ClassVar[str] = ""
    """What it is compared with, in a few words."""

    if TYPE_CHECKING:
        # Either fields or properties of the actual cases, which is why they are none here.
        @property
        def until(self) -> float:
            """When the simulation ends, in s."""

        @property
        def every(self) -> float:
            """Time between frames, in s."""

    def __init__(self, **parameters: Any):
        try:
            super().__init__(**parameters)
        except ValidationError as error:
            raise input_error(error, type(self)) from None

    def __setattr__(self, name: str, value: Any) -> None:
        try:
            super().__setattr__(name, value)
        except ValidationError as error:
            raise input_error(error, type(self)) from None

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if cls.__abstractmethods__:
            return
        for needed in ("name", "title", "until", "every"):
            if not hasattr(cls, needed) and needed not in cls.model_fields:
                raise TypeError(f"{cls.__name__} needs '{needed}'")

    @abc.abstractmethod
    def build(self, context: Context) -> Simulation:
        """The simulation, at its first moment."""

    def stop(self) -> Stop | None:
        """A condition that ends the run before ``until``; none by default."""
        return None

    @abc.abstractmethod
    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """What the case is about, in numbers; at least one has a limit."""

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Draw the figures into a directory; gives the paths of the PNG files."""
        return []

    def ensemble_metrics(self, ensemble: EnsembleRun) -> dict[str, Metric]:
        """What many realisations come to; by default the mean of each metric of :meth:`analyse`.

        The mean is held against the limit of the metric itself.
        """
        from particell.ensemble.report import mean_metrics

        return mean_metrics(ensemble)

    def ensemble_figures(self, ensemble: EnsembleRun, directory: Path) -> list[Path]:
        """Draw the figures of many realisations; by default mean ± deviation of the observables."""
        from particell.ensemble.report import observables_figure

        return observables_figure(ensemble, directory)

    def parameters(self) -> dict[str, dict[str, Any]]:
        """All parameters: ``{name: {"value": …, "unit": …}}``."""
        values = self.model_dump(mode="json")
        return {
            name: {"value": values[name], "unit": unit_of_parameter(info)}
            for name, info in type(self).model_fields.items()
        }

    @classmethod
    def describe(cls) -> list[tuple[str, Any, str, str]]:
        """Name, default value, unit and description of every parameter."""
        return [
            (name, info.get_default(), unit_of_parameter(info), info.description or "")
            for name, info in cls.model_fields.items()
        ]


def unit_of_parameter(info: FieldInfo) -> str:
    """The unit that a parameter is kept in; empty where it has none."""
    for item in (*info.metadata, *_metadata_within(info.annotation)):
        if isinstance(item, Quantity):
            return item.unit
    return ""


def _metadata_within(annotation: Any) -> list[Any]:
    """Metadata of the items of ``tuple[Length, Length]``, ``Length | None`` and the like."""
    found = list(getattr(annotation, "__metadata__", ()))
    for argument in get_args(annotation):
        found += _metadata_within(argument)
    return found


def input_error(error: ValidationError, case: type[Case]) -> InputError:
    """The first error of a validation, in one line in our own words."""
    first = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in first["loc"])
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):  # from a validator of the case itself
        return cause
    if first["type"] == "extra_forbidden":
        return unknown_name("parameter", key, case.model_fields)
    if first["type"] == "missing":
        return InputError(key, None, "given")
    allowed = str(cause) if cause else first["msg"].removeprefix("Input should be ")
    info = case.model_fields.get(key)
    unit = unit_of_parameter(info) if info else ""
    if unit and not cause:
        allowed += f" {unit}"
    return InputError(key or case.name, first["input"], allowed)
