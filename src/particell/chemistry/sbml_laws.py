"""Kinetic laws of an SBML file as reactions: mass action where it is one, a compiled law else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from particell.chemistry.formula import (
    ZERO,
    Law,
    Number,
    Polynomial,
    Symbol,
    Tree,
    operation,
    polynomial,
    split,
    symbols,
)
from particell.chemistry.reactions import HIGHEST_ORDER, Reaction
from particell.errors import InputError
from particell.materials import AVOGADRO

#: Coefficients count as equal within this relative difference (round-off of the file's numbers).
ROUND_OFF = 1e-12

Side = dict[str, int]


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
    """

    compartment: str
    initial: float
    scale: float
    constant: bool


@dataclass
class Laws:
    """Turns reactions of libSBML into :class:`Reaction`; see :mod:`particell.chemistry.sbml`.

    Attributes
    ----------
    participants
        All species by id.
    molecules
        Those that are molecules.
    volumes
        Of the compartments, in m³.
    numbers
        What parameters and compartments stand for in formulas.
    places
        Groups of particles by compartment.
    notes
        Is added to.
    speed
        One unit of extent per time in mol/s.
    kinds
        What the reactions have become.
    """

    participants: Mapping[str, Participant]
    molecules: set[str]
    volumes: Mapping[str, float]
    numbers: Mapping[str, float]
    places: Mapping[str, Any]
    notes: list[str]
    speed: float
    kinds: dict[str, str] = field(default_factory=dict)

    def reactions(self, reaction: Any) -> list[Reaction]:
        """The reaction or reactions that one of the file becomes."""
        name = reaction.getId()
        if reaction.getFast():
            raise InputError("fast reaction", name, "left out: it has no rate of its own")
        law = reaction.getKineticLaw()
        if law is None or law.getMath() is None:
            raise InputError(f"kinetic law of reaction {name}", None, "given")
        left = self._side(name, reaction.getListOfReactants())
        right = self._side(name, reaction.getListOfProducts())
        tree = self._tree(name, law.getMath(), self._local(law))
        compartment = self._compartment(name, reaction, left, right, tree)
        left, right = (
            {s: n for s, n in side.items() if not self.participants[s].constant}
            for side in (left, right)
        )
        if not left and not right:
            raise InputError("reaction", name, "one that changes some species")
        factor = Number(self.speed / self.volumes[compartment])
        rate = operation("*", factor, tree)
        where = self.places.get(compartment)
        found = self._mass_action(name, rate, left, right, where)
        self.kinds[name] = "mass action" if found else "rate law"
        return found or self._custom(name, rate, left, right, where, reaction.getReversible())

    # --- mass action -------------------------------------------------------------------------

    def _mass_action(
        self, name: str, rate: Tree, left: Side, right: Side, where: Any
    ) -> list[Reaction] | None:
        expanded = polynomial(rate)
        if expanded is None:
            return None
        if not expanded:  # a law that is zero: nothing happens
            return [Reaction(None, 0.0, None, where, reactants=left, products=right)]
        leading = self._leading(name, expanded)
        terms = sorted(leading.items(), key=lambda term: term[1] < 0)
        signs = [coefficient > 0 for _, coefficient in terms]
        if signs not in ([True], [True, False]):
            return None
        made = []
        for (monomial, coefficient), (one, other) in zip(
            terms, ((left, right), (right, left)), strict=False
        ):
            powers = dict(monomial)
            if sum(powers.values()) > HIGHEST_ORDER:
                return None
            if any(powers.get(s) != n for s, n in one.items()):
                return None
            catalysts = {s: n for s, n in powers.items() if s not in one}
            products = {s: other.get(s, 0) + catalysts.get(s, 0) for s in {**other, **catalysts}}
            sides = {"reactants": {**one, **catalysts}, "products": products}
            made.append((abs(coefficient), sides))
        (forward, sides), *back = made
        if back and back[0][1] == {"reactants": sides["products"], "products": sides["reactants"]}:
            return [Reaction(None, forward, back[0][0], where, **sides)]  # type: ignore[arg-type]
        return [Reaction(None, k, None, where, **s) for k, s in made]  # type: ignore[arg-type]

    def _leading(self, name: str, expanded: Polynomial) -> Polynomial:
        """The polynomial with falling factorials of molecules, A (A - 1), counted as powers."""
        left = dict(expanded)
        found: Polynomial = {}
        while left:
            monomial = max(left, key=lambda m: sum(power for _, power in m))
            coefficient = left[monomial]
            falling = self._falling(monomial, coefficient)
            exact = len(falling) > 1 and all(
                abs(left.get(m, 0.0) - c) <= ROUND_OFF * abs(c) for m, c in falling.items()
            )
            for m in falling if exact else [monomial]:
                del left[m]
            found[monomial] = coefficient
            if exact and not all(s in self.molecules for s, _ in monomial):
                self.notes.append(
                    f"reaction {name} counts pairs of molecules; with concentrations it has the "
                    "limit of many"
                )
        return found

    def _falling(self, monomial: tuple[tuple[str, int], ...], coefficient: float) -> Polynomial:
        """coefficient Π A (A - u) (A - 2u)…, u one molecule in the compartment."""
        total: Tree = Number(coefficient)
        for s, power in monomial:
            one = 1.0 / (self.volumes[self.participants[s].compartment] * AVOGADRO)
            for k in range(power):
                step = operation("-", Symbol(s), Number(k * one))
                total = operation("*", total, step)
        return polynomial(total) or {}

    # --- other laws --------------------------------------------------------------------------

    def _custom(
        self, name: str, rate: Tree, left: Side, right: Side, where: Any, reversible: bool
    ) -> list[Reaction]:
        kinds = {s in self.molecules for s in (*left, *right, *symbols(rate))}
        if len(kinds) > 1:
            raise InputError(
                f"law of reaction {name}",
                "concentrations and molecules",
                "of species of one kind (see the argument molecules)",
            )
        molecules = kinds == {True}
        parts = split(rate)
        if parts is None:
            raise InputError(f"law of reaction {name}", "a difference below a fraction", "without")
        forward, backward = parts
        if backward != ZERO and molecules and not reversible:
            allowed = "without differences, for molecules (or marked as reversible)"
            raise InputError(f"law of irreversible reaction {name}", "a difference", allowed)
        found = []
        for tree, one, other in ((forward, left, right), (backward, right, left)):
            if tree == ZERO:
                continue
            law = Law(tree, molecules)
            options: dict[str, Any] = {"propensity" if molecules else "rate_law": law}
            found.append(Reaction(None, 1.0, None, where, **options, reactants=one, products=other))
        return found

    # --- reading -----------------------------------------------------------------------------

    def _side(self, name: str, references: Any) -> Side:
        side: Side = {}
        for k in range(references.size()):
            reference = references.get(k)
            species, number = reference.getSpecies(), reference.getStoichiometry()
            changing = reference.isSetStoichiometryMath() or not (
                reference.getLevel() < 3 or reference.getConstant()
            )
            key = f"stoichiometry of {species} in reaction {name}"
            if changing:
                raise InputError(key, "changing", "constant")
            if number != number or number != int(number) or number < 1:
                raise InputError(key, number, "a whole number >= 1")
            side[species] = side.get(species, 0) + int(number)
        return side

    def _local(self, law: Any) -> dict[str, float]:
        parameters = (
            law.getListOfLocalParameters() if law.getLevel() > 2 else law.getListOfParameters()
        )
        return {
            parameters.get(k).getId(): float(parameters.get(k).getValue())
            for k in range(parameters.size())
        }

    def _compartment(self, name: str, reaction: Any, left: Side, right: Side, tree: Tree) -> str:
        found = {self.participants[s].compartment for s in (*left, *right, *symbols(tree))}
        if not found and reaction.getCompartment():
            found = {reaction.getCompartment()}
        if len(found) != 1:
            raise InputError(f"compartments of reaction {name}", sorted(found), "a single one")
        return found.pop()

    def _tree(self, name: str, node: Any, local: Mapping[str, float]) -> Tree:
        """A formula of libSBML as a tree of concentrations in mol/m³."""
        import libsbml

        kind, children = node.getType(), [node.getChild(k) for k in range(node.getNumChildren())]
        if node.isNumber() or kind == libsbml.AST_NAME_AVOGADRO:
            return Number(float(node.getValue()))
        if kind == libsbml.AST_NAME:
            return self._symbol(name, node.getName(), local)
        operators = {
            libsbml.AST_PLUS: "+",
            libsbml.AST_MINUS: "-",
            libsbml.AST_TIMES: "*",
            libsbml.AST_DIVIDE: "/",
            libsbml.AST_POWER: "^",
            libsbml.AST_FUNCTION_POWER: "^",
        }
        operator = operators.get(kind)
        if operator is None:
            text = libsbml.formulaToL3String(node)
            allowed = "of + - * / and powers of numbers, parameters and species"
            raise InputError(f"law of reaction {name}", text, allowed)
        parts = [self._tree(name, child, local) for child in children]
        if operator == "-" and len(parts) == 1:
            parts = [ZERO, *parts]
        if not parts:
            return Number(1.0 if operator == "*" else 0.0)
        total = parts[0]
        try:
            for part in parts[1:]:
                total = operation(operator, total, part)
        except (ArithmeticError, ValueError) as error:
            text = libsbml.formulaToL3String(node)
            raise InputError(f"law of reaction {name}", text, f"a number ({error})") from None
        return total

    def _symbol(self, name: str, symbol: str, local: Mapping[str, float]) -> Tree:
        if symbol in local:
            value = local[symbol]
        elif symbol in self.participants:
            p = self.participants[symbol]
            if not p.constant:
                return operation("*", Number(p.scale), Symbol(symbol))
            value = p.initial * p.scale
        elif symbol in self.numbers:
            value = self.numbers[symbol]
        else:
            allowed = "a species, a parameter or a compartment"
            raise InputError(f"symbol in the law of reaction {name}", symbol, allowed)
        if value != value:
            raise InputError(f"parameter {symbol} of reaction {name}", None, "given a value")
        return Number(value)
