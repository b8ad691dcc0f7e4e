r"""Reactions, as text or as tables of coefficients.

**What a rate constant means.** The rate of a mass-action reaction counts *events*, and there is no
factor ½ anywhere: for ``"2 A -> B"`` with rate constant k the rate is :math:`k C_A^2`, each event
takes two A, so :math:`dC_A/dt = -2 k C_A^2`. For molecules, in a particle of volume V and with
Avogadro's number 𝒩, the propensities (events per second) are

==========  ===================================
``0 -> A``  :math:`k V 𝒩`
``A ->``    :math:`k N_A`
``A + B``   :math:`k N_A N_B / (V 𝒩)`
``2 A``     :math:`k N_A (N_A - 1) / (V 𝒩)`
order 3     falling factorials over :math:`(V 𝒩)^2`
==========  ===================================

GillesPy2 and SpatialPy write their mass-action propensity of ``2 A`` alike, k N(N-1)/V; so do SBML
rate laws ``k*A*A`` that count events. Gillespie's constant c counts distinct pairs,
c N(N-1)/2: give ``forward = c/2`` with ``units="molecules"``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from particell.checks import checked
from particell.chemistry.lawcode import Law
from particell.chemistry.species import checked_rate, group_names
from particell.errors import InputError
from particell.representation import block, brief

Rate = float | Mapping[str, float]
_TERM = re.compile(r"(?:(\d+)\s*\*?\s*)?([^\W\d]\w*)")
_NOTHING = ("0", "∅", "")
HIGHEST_ORDER = 3


def parse_side(text: str, equation: str) -> dict[str, int]:
    """Coefficients by species of one side of a reaction, such as ``"2 A + B"`` or ``"0"``."""
    side: dict[str, int] = {}
    if text.strip() in _NOTHING:
        return side
    for part in text.split("+"):
        match = _TERM.fullmatch(part.strip())
        if match is None or match[1] == "0":
            raise InputError(
                "reaction", equation, "terms such as 'A' or '2 A' joined by '+', or 0 for nothing"
            )
        side[match[2]] = side.get(match[2], 0) + int(match[1] or 1)
    return side


def parse_reaction(equation: str) -> tuple[dict[str, int], dict[str, int], bool]:
    """Reactants, products and whether the reaction is reversible.

    >>> parse_reaction("R + 2 L <-> RL")
    ({'R': 1, 'L': 2}, {'RL': 1}, True)
    """
    text = equation.replace("⇌", "<->").replace("→", "->")
    for arrow in ("<->", "->"):
        left, found, right = text.partition(arrow)
        if found:
            if "->" in right or "<" in left:
                break
            return parse_side(left, equation), parse_side(right, equation), arrow == "<->"
    raise InputError("reaction", equation, "two sides with one '->' or '<->' between them")


@checked
@dataclass(frozen=True, repr=False)
class Reaction:
    """A reaction between species: concentrations, molecules, or both (mass action only).

    Parameters
    ----------
    equation
        ``"R + L <-> RL"``, ``"2 A -> B"``, ``"0 -> A"``; or give ``reactants`` and ``products``.
    forward
        Rate constant in SI units, (mol/m³)^(1-order)/s, see the module's docstring for what it
        counts; one number, or one for each group by name (others: 0).
    backward
        The same for the way back; makes a reaction given by tables reversible.
    only_in
        Group or groups where it takes place; by default wherever all its species are.
    units
        ``"concentration"``, or ``"molecules"``: rate constants per molecule, the propensity is
        ``forward`` times the falling factorials, whatever the volume.
    rate_law
        For concentrations, instead of mass action: ``f(C, k) -> mol/m³/s``, compiled by Numba.
        ``C`` is a one-dimensional float64 array, the concentrations in mol/m³ of all
        concentration species in the order of the simulation's list (``C[0]`` is the first species
        that is a concentration); ``k`` is ``forward`` of the particle's group.
    propensity
        The same for molecules: ``f(N, V, k) -> 1/s`` with the int64 array N of numbers of
        molecules in the particle (all molecule species, in order) and its volume V in m³.

    Raises
    ------
    InputError
        For text that is no reaction, rates that are negative or missing, orders above 3.
    """

    equation: str | None = None
    forward: Rate | None = None
    backward: Rate | None = None
    only_in: str | Sequence[str] | None = None
    units: str = "concentration"
    rate_law: Callable[..., float] | Law | None = None
    propensity: Callable[..., float] | Law | None = None
    reactants: Mapping[str, int] | None = None
    products: Mapping[str, int] | None = None

    def __post_init__(self) -> None:
        if (self.equation is None) == (self.reactants is None and self.products is None):
            raise InputError("reaction", self.equation, "an equation, or reactants and products")
        if self.equation is None:
            left, right = self._side("reactants"), self._side("products")
            reversible = self.backward is not None
        else:
            left, right, reversible = parse_reaction(self.equation)
        self._set("reactants", left)
        self._set("products", right)
        if not left and not right:
            raise InputError("reaction", self.label, "something on at least one side")
        self._set("only_in", group_names(self.label, self.only_in))
        if self.units not in ("concentration", "molecules"):
            raise InputError(f"units of {self.label}", self.units, "'concentration' or 'molecules'")
        own_law = self.rate_law is not None or self.propensity is not None
        if own_law and reversible:
            raise InputError(
                "reaction", self.label, "written with '->' where it has a rate law of its own"
            )
        if not own_law:
            for side in (left, right) if reversible else (left,):
                if sum(side.values()) > HIGHEST_ORDER:
                    raise InputError("reaction", self.label, "of order 0 to 3 (or have a rate_law)")
        if self.forward is None and own_law:
            self._set("forward", 1.0)
        self._set("forward", self._rate("forward", self.forward))
        if reversible:
            self._set("backward", self._rate("backward", self.backward))
        elif self.backward is not None:
            raise InputError(
                f"backward of {self.label}", self.backward, "left out, or '<->' be written"
            )

    def __repr__(self) -> str:
        sides = ("reactants", "products") if self.equation is not None else ()
        return brief(self, unnamed=3, without=sides)

    def _repr_html_(self) -> str:
        from particell.chemistry.listing import reaction_table

        return block(f"Reaction {self.label}", reaction_table([self]))

    @property
    def label(self) -> str:
        """The equation, for messages."""
        if self.equation is not None:
            return self.equation
        sides = []
        for side in (self.reactants, self.products):
            terms = [name if c == 1 else f"{c} {name}" for name, c in (side or {}).items()]
            sides.append(" + ".join(terms) or "0")
        return " -> ".join(sides)

    @property
    def reversible(self) -> bool:
        """Whether there is a way back."""
        return self.backward is not None

    @property
    def names(self) -> list[str]:
        """All species of the reaction."""
        return list({**(self.reactants or {}), **(self.products or {})})

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _side(self, which: str) -> dict[str, int]:
        side = dict(getattr(self, which) or {})
        for name, coefficient in side.items():
            if not isinstance(coefficient, int) or coefficient < 1:
                raise InputError(f"{which} {name}", coefficient, "a whole number >= 1")
        return side

    def _rate(self, which: str, rate: Rate | None) -> Rate:
        key = f"{which} rate of {self.label}"
        if rate is None:
            raise InputError(key, rate, "given")
        if isinstance(rate, Mapping):
            return {group: checked_rate(f"{key} in {group}", k) for group, k in rate.items()}
        return checked_rate(key, rate)
