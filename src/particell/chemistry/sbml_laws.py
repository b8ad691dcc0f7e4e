"""Kinetic laws of an SBML file as reactions: mass action where it is one, a compiled law else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from particell.chemistry.formula import ZERO, Number, Symbol, Tree, call, operation, symbols, timed
from particell.chemistry.lawcode import Law
from particell.chemistry.polynomials import Polynomial, polynomial, split
from particell.chemistry.reactions import HIGHEST_ORDER, Reaction
from particell.chemistry.sbml_symbols import Participant, Symbols, items
from particell.errors import InputError
from particell.materials import AVOGADRO

#: Coefficients count as equal within this relative difference (round-off of the file's numbers).
ROUND_OFF = 1e-12
#: Stoichiometries that are not whole become so times a number up to this one.
MOST_PARTS = 1000

Side = dict[str, int]


@dataclass
class Laws:
    """Turns reactions of libSBML into :class:`Reaction`; see :mod:`particell.chemistry.sbml`.

    Attributes
    ----------
    symbols
        What names stand for.
    molecules
        Species that are molecules.
    places
        Groups of particles by compartment.
    notes
        Is added to.
    kinds
        What the reactions have become.
    """

    symbols: Symbols
    molecules: set[str]
    places: Mapping[str, Any]
    notes: list[str]
    kinds: dict[str, str] = field(default_factory=dict)

    @property
    def participants(self) -> Mapping[str, Participant]:
        """All species by id that no rule assigns."""
        return self.symbols.participants

    @property
    def volumes(self) -> Mapping[str, float]:
        """Of the compartments, in m³."""
        return self.symbols.volumes

    def reactions(self, reaction: Any) -> list[Reaction]:
        """The reaction or reactions that one of the file becomes."""
        name = reaction.getId()
        if reaction.getFast():
            raise InputError("fast reaction", name, "left out: it has no rate of its own")
        parts = {
            side: self._side(name, references)
            for side, references in (
                ("left", reaction.getListOfReactants()),
                ("right", reaction.getListOfProducts()),
            )
        }
        tree = self.symbols.tree(name)
        free = {
            side: {s: n for s, n in numbers.items() if self._changes(s)}
            for side, numbers in parts.items()
        }
        if not any(free.values()) or tree == ZERO:
            self.kinds[name] = "nothing"
            why = "has the rate 0" if tree == ZERO else "changes no species"
            self.notes.append(f"reaction {name} {why} and is left out")
            return []
        whole = self._whole(name, free)
        left, right = (
            {s: round(n * whole) for s, n in numbers.items()} for numbers in free.values()
        )
        compartment = self._compartment(name, (*left, *right), tree)
        speed = self._speed(name, [*left, *right]) / whole
        rate = operation("*", Number(speed / self.volumes[compartment]), tree)
        where = self.places.get(compartment)
        # what is declared irreversible happens in one direction alone, as the noise tells
        one_way = not reaction.getReversible() and bool(self.molecules & {*left, *right})
        found = self._mass_action(name, rate, left, right, where, one_way)
        self.kinds[name] = "mass action" if found else "rate law"
        return found or self._custom(name, rate, left, right, where, one_way)

    def _changes(self, species: str) -> bool:
        return species in self.participants and not self.participants[species].constant

    # --- mass action -------------------------------------------------------------------------

    def _mass_action(
        self, name: str, rate: Tree, left: Side, right: Side, where: Any, one_way: bool
    ) -> list[Reaction] | None:
        expanded = polynomial(rate)
        if expanded is None:
            return None
        if not expanded:
            return None
        leading = self._leading(name, expanded)
        terms = sorted(leading.items(), key=lambda term: term[1] < 0)
        signs = [coefficient > 0 for _, coefficient in terms]
        if signs not in ([True], [True, False]) or (one_way and len(signs) > 1):
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
        self, name: str, rate: Tree, left: Side, right: Side, where: Any, one_way: bool
    ) -> list[Reaction]:
        kinds = {s in self.molecules for s in (*left, *right, *symbols(rate))}
        if len(kinds) > 1:
            raise InputError(
                f"law of reaction {name}",
                "concentrations and molecules",
                "of species of one kind (see the argument molecules)",
            )
        molecules = kinds == {True}
        if molecules and timed(rate):
            allowed = "left out where species are molecules (concentrations may have it)"
            raise InputError(f"law of reaction {name}", "the time", allowed)
        laws = self._laws_of_molecules(name, rate, one_way) if molecules else _laws(rate)
        found = []
        for law, one, other in zip(laws, (left, right), (right, left), strict=False):
            if law is None:
                continue
            options: dict[str, Any] = {"propensity" if molecules else "rate_law": law}
            found.append(Reaction(None, 1.0, None, where, **options, reactants=one, products=other))
        return found

    def _laws_of_molecules(self, name: str, rate: Tree, one_way: bool) -> list[Law | None]:
        """Propensities of the way there and of the way back."""
        parts = split(rate)
        if parts is not None and parts[1] == ZERO:
            return [Law(rate, True)]
        if one_way:
            end = "does not happen" if parts is None else "ends the run"
            self.notes.append(
                f"reaction {name} is irreversible: it {end} where its law is negative"
            )
            return [Law(rate, True) if parts is None else Law(parts[0], True, parts[1])]
        if parts is not None:
            return [None if part == ZERO else Law(part, True) for part in parts]
        self.notes.append(
            f"reaction {name} happens in one direction at a time: its law is no difference of two"
        )
        back = operation("*", Number(-1.0), rate)
        return [Law(call("maximum", each, ZERO), True) for each in (rate, back)]

    # --- reading -----------------------------------------------------------------------------

    def _side(self, name: str, references: Any) -> dict[str, float]:
        side: dict[str, float] = {}
        for reference in items(references):
            species = reference.getSpecies()
            key = f"stoichiometry of {species} in reaction {name}"
            number = self.symbols.stoichiometry(reference, key)
            if number < 0:
                raise InputError(key, number, "a number >= 0")
            if number:
                side[species] = side.get(species, 0.0) + number
        return side

    def _whole(self, name: str, sides: Mapping[str, Mapping[str, float]]) -> int:
        """What makes all stoichiometries of a reaction whole; 1 for molecules."""
        numbers = {s: n for side in sides.values() for s, n in side.items()}
        for parts in range(1, MOST_PARTS + 1):
            if all(abs(n * parts - round(n * parts)) < 1e-9 * parts for n in numbers.values()):
                if parts == 1 or not self.molecules & set(numbers):
                    return parts
                break
        wrong = next(s for s, n in numbers.items() if abs(n - round(n)) > 1e-9)
        allowed = f"whole for molecules, else a fraction with a denominator up to {MOST_PARTS}"
        raise InputError(f"stoichiometry of {wrong} in reaction {name}", numbers[wrong], allowed)

    def _speed(self, name: str, species: list[str]) -> float:
        """One unit of a reaction's extent per time in mol/s."""
        units, model = self.symbols.units, self.symbols.model
        speeds = {}
        for s in species:
            item, substance = self.symbols.species[s], self.participants[s].substance
            factor = item.getConversionFactor() or model.getConversionFactor()
            if factor:
                speeds[s] = substance * self.symbols.number(factor)
                continue
            speeds[s] = substance
            if abs(substance / units.extent() - 1) > 1e-9:
                raise InputError(
                    f"units of extent of reaction {name}",
                    f"{units.extent():g} mol",
                    f"those of species {s} ({substance:g} mol), or a conversionFactor be given",
                )
        low, high = min(speeds.values()), max(speeds.values())
        if high - low > 1e-9 * abs(high) or low <= 0:
            shown = ", ".join(sorted(set(species)))
            raise InputError(f"conversion factors of reaction {name}", shown, "alike and positive")
        return low / units.value("time")

    def _compartment(self, name: str, species: tuple[str, ...], tree: Tree) -> str:
        found = sorted({self.participants[s].compartment for s in (*species, *symbols(tree))})
        given = all(c in self.symbols.shared for c in found)
        alike = len({self.volumes[c] for c in found}) == 1
        if len(found) > 1 and not (given and alike):
            written = ", ".join(f"'{c}': '1 um^3'" for c in found)
            allowed = f"a single one, or of the same volume by volumes={{{written}}}"
            raise InputError(f"compartments of reaction {name}", found, allowed)
        places = [self.places.get(c) for c in found]
        if any(place != places[0] for place in places):
            raise InputError(f"compartments of reaction {name}", found, "in the same groups")
        return found[0]


def _laws(rate: Tree) -> list[Law | None]:
    """Of concentrations: of both ways, or the difference as it stands where it is not seen."""
    parts = split(rate)
    if parts is None:
        return [Law(rate)]
    return [None if part == ZERO else Law(part) for part in parts]
