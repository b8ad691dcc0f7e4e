"""What the tables of a case file refer to while a simulation is made of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.casefile.constants import Constants
from particell.casefile.formula import AXES, TIME, Formula, is_formula
from particell.chemistry.sbml import SBMLModel
from particell.errors import InputError, unknown_name
from particell.geometry.domain import Domain
from particell.geometry.shapes import Shape
from particell.materials import Fluid
from particell.phases import Phase
from particell.units import Quantity, registry

#: Memory of a particle with a hundred neighbours, all included.
BYTES_A_PARTICLE = 1200

Points = np.ndarray


def memory() -> int:
    """Memory of this machine in bytes; where the system does not say, as much as any has."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 2**42


def known(what: str, name: str, names: Collection[str]) -> str:
    """A name that exists."""
    if name not in names:
        if not names:
            raise InputError(what, name, "described in this file, which has none")
        raise unknown_name(what, name, names)
    return name


@dataclass(frozen=True)
class PlaceAndTime:
    """Numbers and formulas of the place and the time, as a function of what laws are given."""

    parts: tuple[Any, ...]
    constants: Mapping[str, Any]

    def __call__(self, *given: Any) -> list[Any]:
        """One value of each, at ``x, …, t``."""
        values = {**self.constants, **dict(zip(AXES, given[:-1], strict=False)), TIME: given[-1]}
        return [p.traced(values) if isinstance(p, Formula) else p for p in self.parts]


class Scope:
    """Everything by name.

    Attributes
    ----------
    constants, domain, materials, shapes, phases, species, networks
        What has been made so far.
    """

    def __init__(self, constants: Constants, domain: Domain):
        self.constants, self.domain = constants, domain
        self.materials: dict[str, Fluid] = {}
        self.shapes: dict[str, Shape] = {}
        self.phases: dict[str, Phase] = {}
        self.species: tuple[str, ...] = ()
        self.networks: list[SBMLModel] = []
        units: Any = registry()
        middle = 0.5 * (domain.lower + domain.upper)
        self._quantities = {**constants.quantities, TIME: units.Quantity(1.0, "s")}
        for axis, place in zip(AXES, middle, strict=False):
            self._quantities[axis] = units.Quantity(np.array([place]), "m")

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return self.domain.dim

    def material(self, name: str) -> Fluid:
        """A material by name."""
        return self.materials[known("material", name, self.materials)]

    def shape(self, name: str) -> Shape:
        """A shape by name."""
        return self.shapes[known("shape", name, self.shapes)]

    def vector(self, key: str, values: Collection[Any]) -> tuple[Any, ...]:
        """As many numbers as there are dimensions."""
        if len(values) != self.dim:
            raise InputError(key, list(values), f"{self.dim} numbers, as the domain has")
        return tuple(values)

    def axis(self, key: str, axis: int) -> int:
        """The number of an axis that exists."""
        if axis >= self.dim:
            raise InputError(key, axis, f"at most {self.dim - 1} in {self.dim} dimensions")
        return axis

    def number(self, key: str, value: Any, unit: str) -> float:
        """A positive number with a unit that depends on the dimension."""
        try:
            number = Quantity(unit).convert(value)
        except ValueError as error:
            raise InputError(key, value, str(error)) from None
        if not number > 0:
            raise InputError(key, number, f"greater than 0 {unit}")
        return number

    def profile(self, key: str, value: Any, unit: str) -> Any:
        """A number, or the function of points (n, D) that a formula describes."""
        if not is_formula(value):
            return value
        formula = Formula(key, value)
        formula.require({*self.constants.values, *AXES[: self.dim]})
        formula.check_unit(self._quantities, unit)
        return self._function(formula)

    def _function(self, formula: Formula) -> Callable[[Points], Points]:
        constants = self.constants.values

        def evaluate(points: Points) -> Points:
            places = dict(zip(AXES, points.T, strict=False))
            found = np.asarray(formula.value({**constants, **places}), dtype=float)
            if not np.all(np.isfinite(found)):
                raise formula.error("a formula that is finite wherever it is needed")
            return np.array(np.broadcast_to(found, len(points)))

        return evaluate

    def motion(self, key: str, value: Any, unit: str) -> Callable[[float], float]:
        """The function of time in s that a number or a formula of t describes."""
        formula = Formula(key, value if is_formula(value) else f"= {float(value)!r}")
        formula.require({*self.constants.values, TIME})
        if is_formula(value):
            formula.check_unit(self._quantities, unit)
        constants = self.constants.values

        def evaluate(time: float) -> float:
            found = float(formula.value({**constants, TIME: time}))
            if not np.isfinite(found):
                raise formula.error("a formula that is finite at all times")
            return found

        evaluate(0.0)
        return evaluate

    def place_and_time(self, key: str, values: Collection[Any], unit: str) -> PlaceAndTime:
        """What laws compute of numbers, and of formulas of the place and the time t."""
        parts: list[Any] = []
        for value in values:
            if is_formula(value):
                formula = Formula(key, value)
                formula.require({*self.constants.values, *AXES[: self.dim], TIME})
                formula.check_unit(self._quantities, unit)
                parts.append(formula)
            else:
                parts.append(value)
        found = PlaceAndTime(tuple(parts), dict(self.constants.values))
        found(*(0.5 * (self.domain.lower + self.domain.upper)), 0.0)  # refuses what loops cannot do
        return found

    def velocity(self, key: str, values: Collection[Any] | None, function: bool = False) -> Any:
        """None, D numbers, or a function of points that returns velocities (n, D) in m/s.

        With ``function`` no numbers.
        """
        if values is None:
            return None
        parts = [self.profile(key, v, "m/s") for v in self.vector(key, values)]
        if not function and not any(callable(part) for part in parts):
            return tuple(parts)

        def evaluate(points: Points) -> Points:
            columns = [p(points) if callable(p) else np.full(len(points), p) for p in parts]
            return np.stack(columns, axis=-1)

        return evaluate

    def known_species(self, key: str, names: Mapping[str, Any] | Collection[str]) -> None:
        """Refuse species that are not described."""
        for name in names:
            known(f"species in {key}", name, self.species)

    def known_group(self, key: str, names: str | Collection[str] | None) -> None:
        """Refuse groups of particles that are not described."""
        for name in (names,) if isinstance(names, str) else names or ():
            if name not in self.phases and not any(p.kind == "wall" for p in self.phases.values()):
                allowed = (
                    f"a group that a phase makes, which are {', '.join(self.phases)}: "
                    "no phase is a wall (channel_walls makes two, box_walls those of a closed box)"
                )
                raise InputError(f"group in {key}", name, allowed)
            known(f"group in {key}", name, self.phases)

    def admit(self, particles: float) -> None:
        """Refuse more particles than the machine has memory for."""
        most = memory() / BYTES_A_PARTICLE
        if not particles <= most:
            allowed = (
                f"at most {most:.2g} in the memory of this machine: "
                "take a larger spacing or a smaller domain"
            )
            raise InputError("number of particles", f"{particles:.3g}", allowed)
