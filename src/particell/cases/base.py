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
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from particell.checks import plain
from particell.errors import InputError, unknown_name
from particell.recipe import Context, Metric, Recipe
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
    from particell.ensemble.results import EnsembleRun
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


class Case(BaseModel, Recipe):
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

        @property
        def every(self) -> float:
            """Time between frames, in s."""

    def __init__(self, **parameters: Any):
        try:
            super().__init__(**{name: plain(value) for name, value in parameters.items()})
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
    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """What the case is about, in numbers; at least one has a limit."""

    def identity(self) -> dict[str, Any]:
        """Name, class and parameters. The program's own cases are found by their names alone."""
        kind = type(self)
        own = kind.__module__.startswith(f"{__package__}.")
        return {
            "case": self.name,
            "class": None if own else f"{kind.__module__}:{kind.__qualname__}",
            "parameters": self.model_dump(mode="json"),
        }

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
