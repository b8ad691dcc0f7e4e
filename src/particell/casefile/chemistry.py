"""Tables of species, of reactions, and of what there is of each species at the beginning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from particell.casefile.formula import is_formula
from particell.casefile.ratelaw import law_of
from particell.casefile.scope import Scope, known
from particell.casefile.table import ByGroup, Name, Profile, Table, describes
from particell.chemistry.reactions import Reaction, parse_reaction
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.simulation import Simulation
from particell.units import Number, parse

_Groups = Name | tuple[Name, ...]


@describes(Species)
class SpeciesTable(Table):
    """A species, as a concentration or as whole numbers of molecules."""

    name: Name
    diffusivity: Annotated[Any, ByGroup("m^2/s")]
    molecules: bool
    only_in: _Groups | None
    switch_above: Number | None
    switch_below: Number | None

    def build(self, scope: Scope) -> Species:
        """The species."""
        scope.known_group("only_in", self.only_in)
        if isinstance(self.diffusivity, Mapping):
            scope.known_group("diffusivity", tuple(self.diffusivity))
        return Species(**self.given())


@describes(Reaction)
class ReactionTable(Table):
    """A reaction of mass action, or with a rate law of its own."""

    equation: Annotated[str, Field(max_length=1000)]
    """"R + L <-> RL", "2 A -> B", "0 -> A"."""
    forward: Any
    """Rate constant, (mol/m^3)^(1-order)/s; one, or one for each group by name (others: 0)."""
    backward: Any
    """The same for the way back of a reaction with "<->"."""
    only_in: _Groups | None
    units: str
    rate_law: Annotated[str, Field(max_length=1000)] | None = None
    """Instead of mass action: a formula of constants, of the species' concentrations in mol/m^3
    and of the time t, times ``forward``; its unit is mol/m^3/s. For molecules too, without t."""

    @model_validator(mode="after")
    def _rates_in_si(self) -> ReactionTable:
        """The unit of a rate constant depends on the equation's order."""
        sides = parse_reaction(self.equation)
        for name, side in (("forward", sides[0]), ("backward", sides[1])):
            order = sum(side.values())
            unit = _rate_unit(order, self.units, self.rate_law is not None)
            setattr(self, name, _in_unit(name, getattr(self, name), unit))
        return self

    def build(self, scope: Scope, species: Mapping[str, Species]) -> Reaction:
        """The reaction."""
        scope.known_group("only_in", self.only_in)
        for key, rate in (("forward", self.forward), ("backward", self.backward)):
            if isinstance(rate, Mapping):
                scope.known_group(key, tuple(rate))
        values = self.given("rate_law")
        if self.rate_law is not None:
            whole = all(species[n].molecules for n in self._names() if n in species)
            law = law_of("rate_law", self.rate_law, scope, whole)
            values["propensity" if whole else "rate_law"] = law
        reaction = Reaction(**values)
        for name in reaction.names:
            known("species", name, scope.species)
        return reaction

    def _names(self) -> list[str]:
        left, right, _ = parse_reaction(self.equation)
        return [*left, *right]


def _rate_unit(order: int, units: str, own_law: bool) -> str:
    if own_law:
        return ""
    if units == "molecules" or order == 1:
        return "1/s"
    if order == 0:
        return "mol/m^3/s"
    return f"m^{3 * (order - 1)}/mol^{order - 1}/s" if order <= 3 else "1/s"


def _in_unit(key: str, rate: Any, unit: str) -> Any:
    if rate is None:
        return None
    if isinstance(rate, Mapping):
        return {str(group): parse(f"{key}.{group}", k, unit) for group, k in rate.items()}
    return parse(key, rate, unit)


class InitialTable(Table):
    """How much there is of a species at the beginning; nothing without it."""

    species: Name
    """Name of the species."""
    concentration: Annotated[Any, Profile("mol/m^3")] | None = None
    """Concentration: a number or a formula of x, y, z."""
    count: Annotated[Any, Profile("")] | None = None
    """Or molecules a particle: whole numbers."""
    group: Name | None = None
    """Name of the group concerned; without it all that hold the species."""

    @model_validator(mode="after")
    def _one_of_both(self) -> InitialTable:
        if (self.concentration is None) == (self.count is None):
            given = "both" if self.count is not None else "neither"
            raise InputError("concentration, count", given, "given one of them")
        if self.count is not None and not is_formula(self.count):
            count = float(self.count)
            if count != round(count) or not 0 <= count < 2**53:
                raise InputError(f"count of {self.species}", count, "a whole number, 0 to 2^53")
        return self

    def apply(self, scope: Scope, simulation: Simulation) -> None:
        """Set it."""
        known("species", self.species, scope.species)
        if self.group is not None:
            known("group", self.group, scope.phases)
        chemistry = simulation.chemistry
        assert chemistry is not None
        if self.count is not None:
            values = scope.profile("count", self.count, "")
            chemistry.set_count(self.species, values, self.group)
        else:
            values = scope.profile("concentration", self.concentration, "mol/m^3")
            chemistry.set_concentration(self.species, values, self.group)
