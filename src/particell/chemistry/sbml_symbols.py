"""What the names in an SBML file stand for: numbers at t = 0, and trees afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from particell.chemistry.formula import ZERO, Number, Symbol, Time, Tree, operation
from particell.chemistry.sbml_math import tree_of
from particell.chemistry.sbml_units import Units
from particell.errors import InputError, unknown_name
from particell.units import parse


@dataclass(frozen=True)
class Participant:
    """A species of the file.

    Attributes
    ----------
    compartment
        Where it is.
    initial
        In mol/m³.
    scale
        What its symbol in a formula is at 1 mol/m³: a concentration or an amount in the file's
        units.
    constant
        Whether reactions leave it as it is.
    substance
        One unit of its substance in mol.
    """

    compartment: str
    initial: float
    scale: float
    constant: bool
    substance: float


def items(found: Any) -> list[Any]:
    """The items of one of libSBML's lists."""
    return [found.get(k) for k in range(found.size())]


class Symbols:
    """The names of a model.

    Parameters
    ----------
    model
        Of libSBML.
    units
        Its units.
    given
        The volumes that compartments stand for, by id, where the file does not say.
    notes
        Is added to.

    Attributes
    ----------
    sizes
        Of the compartments, as numbers of the file; NaN where there is none.
    volumes
        Of the compartments, in m³.
    shared
        Compartments whose volume was given.
    participants
        The species by id, without those that a rule assigns.
    assigned
        Names that a rule assigns, with the rule's formula.
    """

    def __init__(self, model: Any, units: Units, given: Mapping[str, Any], notes: list[str]):
        self.model, self.units, self.notes = model, units, notes
        self.species = {s.getId(): s for s in items(model.getListOfSpecies())}
        self.compartments = {c.getId(): c for c in items(model.getListOfCompartments())}
        self.functions = {f.getId(): f for f in items(model.getListOfFunctionDefinitions())}
        self._parameters = {p.getId(): p for p in items(model.getListOfParameters())}
        self._reactions = {r.getId(): r for r in items(model.getListOfReactions())}
        self._references = {
            reference.getId(): reference
            for r in self._reactions.values()
            for side in (r.getListOfReactants(), r.getListOfProducts())
            for reference in items(side)
            if reference.getId()
        }
        self._initial = _maths(model.getListOfInitialAssignments(), "getSymbol")
        self._rules = _maths(model.getListOfRules(), "getVariable")
        self._numbers: dict[str, float] = {}
        self._trees: dict[str, Tree] = {}
        self._busy: list[tuple[str, Callable[[str], Any]]] = []
        self.time = operation("*", Number(1.0 / units.value("time")), Time())
        self.sizes, self.volumes = self._spaces(given)
        self.shared = set(given)
        self.participants = {
            name: self._participant(name, s)
            for name, s in self.species.items()
            if name not in self._rules
        }
        self.assigned = {name: self.tree(name) for name in self._rules}

    def _formula(self, node: Any, lookup: Callable[[str], Tree], time: Tree, where: str) -> Tree:
        return tree_of(node, lookup, time, where, self.functions)

    # --- numbers at the beginning -------------------------------------------------------------

    def number(self, name: str) -> float:
        """What a name stands for at t = 0, in the file's units."""
        if name not in self._numbers:
            self._numbers[name] = self._guarded(name, self._number)
        return self._numbers[name]

    def _guarded(self, name: str, work: Callable[[str], Any]) -> Any:
        """``work(name)``, where it does not need its own result."""
        key = name, work
        if key in self._busy:
            raise InputError("assignment", name, "not defined by itself")
        self._busy.append(key)
        try:
            return work(name)
        finally:
            self._busy.pop()

    def _number(self, name: str) -> float:
        math_node = self._initial.get(name) or self._rules.get(name)
        if math_node is not None:
            where = f"assignment of {name}"
            return self._at_start(self._formula(math_node, self._starting, ZERO, where), where)
        if name in self.compartments:
            return self._known(f"size of compartment {name}", self.sizes[name])
        if name in self.species:
            return self._amount(name, self.species[name])
        if name in self._parameters:
            return self._given("parameter", self._parameters[name])
        if name in self._references:
            return float(self._references[name].getStoichiometry())
        if name in self._reactions:
            law = self._law(name)
            return self._at_start(self.law_tree(name, law, self._starting, ZERO), name)
        raise InputError("symbol", name, "a species, a parameter, a compartment or a reaction")

    def _starting(self, name: str) -> Tree:
        return Number(self.number(name))

    @staticmethod
    def _at_start(tree: Tree, where: str) -> float:
        if not isinstance(tree, Number):
            raise InputError(where, "no number at t = 0", "a number there")
        return tree.value

    @staticmethod
    def _known(what: str, value: float) -> float:
        if value != value:
            raise InputError(what, None, "given a value")
        return value

    def _given(self, what: str, item: Any) -> float:
        value = float(item.getValue()) if item.isSetValue() else math.nan
        return self._known(f"{what} {item.getId()}", value)

    def _amount(self, name: str, s: Any) -> float:
        """The initial value of a species' symbol: an amount or a concentration."""
        size = self.sizes[s.getCompartment()]
        if s.isSetInitialConcentration():
            value = s.getInitialConcentration()
            if s.getHasOnlySubstanceUnits():
                value *= self._known(f"size of compartment {s.getCompartment()}", size)
        elif s.isSetInitialAmount():
            value = s.getInitialAmount()
            if not s.getHasOnlySubstanceUnits():
                value /= self._known(f"size of compartment {s.getCompartment()}", size)
        else:
            raise InputError(f"initial value of species {name}", None, "given")
        return float(value)

    # --- trees afterwards ---------------------------------------------------------------------

    def tree(self, name: str) -> Tree:
        """What a name stands for, of concentrations in mol/m³ and the time."""
        if name not in self._trees:
            self._trees[name] = self._guarded(name, self._tree)
        return self._trees[name]

    def _tree(self, name: str) -> Tree:
        if name in self._rules:
            return self._formula(self._rules[name], self.tree, self.time, f"rule of {name}")
        if name in self.participants and not self.participants[name].constant:
            return operation("*", Number(self.participants[name].scale), Symbol(name))
        if name in self._reactions:
            return self.law_tree(name, self._law(name), self.tree, self.time)
        return Number(self.number(name))

    def _law(self, name: str) -> Any:
        law = self._reactions[name].getKineticLaw()
        if law is None or law.getMath() is None:
            raise InputError(f"kinetic law of reaction {name}", None, "given")
        return law

    def law_tree(self, name: str, law: Any, lookup: Callable[[str], Tree], time: Tree) -> Tree:
        """The formula of a kinetic law, with its own parameters."""
        found = law.getListOfLocalParameters() if law.getLevel() > 2 else law.getListOfParameters()
        local = {p.getId(): p for p in items(found)}

        def inside(symbol: str) -> Tree:
            if symbol in local:
                what = f"parameter of reaction {name}:"
                return Number(self._given(what, local[symbol]))
            return lookup(symbol)

        return self._formula(law.getMath(), inside, time, f"law of reaction {name}")

    def stoichiometry(self, reference: Any, key: str) -> float:
        """How many of its species a reference stands for."""
        if reference.isSetStoichiometryMath():
            node = reference.getStoichiometryMath().getMath()
            tree = self._formula(node, self.tree, self.time, key)
        elif reference.getId() and reference.getId() in {**self._initial, **self._rules}:
            tree = self.tree(reference.getId())
        else:
            tree = Number(float(reference.getStoichiometry()))
        if not isinstance(tree, Number):
            raise InputError(key, "changing", "constant")
        if tree.value != tree.value:
            raise InputError(key, None, "given")
        return tree.value

    # --- compartments and species -------------------------------------------------------------

    def _spaces(self, given: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, float]]:
        """Sizes as numbers of the file, and volumes in m³."""
        for name in given:
            if name not in self.compartments:
                raise unknown_name("compartment in volumes", name, self.compartments)
        self.sizes = {
            name: float(c.getSize()) if c.isSetSize() else math.nan
            for name, c in self.compartments.items()
        }
        volumes = {}
        for name, c in self.compartments.items():
            if name in self._rules or name in self._initial:
                self.sizes[name] = self._constant_size(name)
            volume = None
            if name in given:
                volume = parse(f"volume of compartment {name}", given[name], "m^3")
                if not 0 < volume < math.inf:
                    raise InputError(f"volume of compartment {name}", volume, "positive")
            volumes[name] = self._space(name, c, volume)
        return self.sizes, volumes

    def _constant_size(self, name: str) -> float:
        """A size that a rule or an initial assignment gives."""
        if name in self._rules:
            tree = self._guarded(name, self._fixed)
            if not isinstance(tree, Number):
                raise InputError(f"compartment {name}", "changing", "of constant size")
        return self.number(name)

    def _fixed(self, name: str) -> Tree:
        """A name in a rule for a size: what varies, or may, is a symbol."""
        if name in self._rules:

            def inside(other: str) -> Tree:
                return self._guarded(other, self._fixed)

            return self._formula(self._rules[name], inside, self.time, f"rule of {name}")
        if name in self.species or name in self._reactions:
            return Symbol(name)
        return Number(self.number(name))

    def _space(self, name: str, c: Any, given: float | None) -> float:
        """The volume of a compartment in m³; a size that the file leaves out is found."""
        size, dimensions = self.sizes[name], c.getSpatialDimensionsAsDouble()
        if size == size and not size > 0:
            raise InputError(f"size of compartment {name}", size, "positive")
        if given is not None:
            if size != size and dimensions == 3:
                self.sizes[name] = self._size_of(given, name, c)
            return given
        if dimensions != 3:
            what = f"volume of compartment {name} of {dimensions:g} dimensions"
            raise InputError(what, None, f"given by volumes={{'{name}': '1 um^3'}}")
        unit = self.units.value("volume", c.getUnits(), f"compartment {name}")
        if size == size:
            return size * unit
        self.notes.append(
            f"compartment {name} has no size: amounts are those in one unit of volume of the "
            f"file, {unit:g} m³; give the volume that it stands for by volumes={{'{name}': …}}"
        )
        return unit

    def _size_of(self, volume: float, name: str, c: Any) -> float:
        """A volume as a number of the file's units, NaN where it has none."""
        try:
            return volume / self.units.value("volume", c.getUnits(), f"compartment {name}")
        except InputError:
            return math.nan

    def _participant(self, name: str, s: Any) -> Participant:
        where = s.getCompartment()
        substance = self.units.value("substance", s.getSubstanceUnits(), f"species {name}")
        amounts = s.getHasOnlySubstanceUnits()
        if s.isSetSpatialSizeUnits() and not amounts:
            own, unit = s.getSpatialSizeUnits(), self.compartments[where].getUnits()
            if self.units.value("volume", own) != self.units.value("volume", unit):
                raise InputError("spatialSizeUnits of species", name, f"those of {where}")
        size = 1.0 if amounts else self._size_for(name, where)
        scale = self.volumes[where] / (substance * size)
        constant = bool(s.getConstant() or s.getBoundaryCondition())
        initial = self.number(name) / scale
        if not initial >= 0 and not constant:
            raise InputError(f"initial value of species {name}", initial, "a number >= 0")
        return Participant(where, initial, scale, constant, substance)

    def _size_for(self, name: str, where: str) -> float:
        """The size that a concentration is divided by."""
        size = self.sizes[where]
        if size != size:
            allowed = (
                f"given in the file, or by volumes={{'{where}': …}}: {name} is a concentration"
            )
            raise InputError(f"size of compartment {where}", None, allowed)
        return size


def _maths(found: Any, name: str) -> dict[str, Any]:
    """Formulas by the name that they define; those without one (level 3 version 2) define none."""
    every = ((getattr(each, name)(), each.getMath()) for each in items(found))
    return {symbol: node for symbol, node in every if symbol and node is not None}
