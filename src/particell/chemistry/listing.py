"""Species and reactions as tables, for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from particell.representation import shown, table

_RATE_UNITS = ("mol/m³/s", "1/s", "m³/mol/s", "m⁶/mol²/s")


def species_table(species: Iterable[Any]) -> str:
    """Name, kind, diffusivity and place of each species."""
    rows = [(s.name, _kind(s), s.diffusivity, _place(s.only_in)) for s in species]
    return table(rows, ("species", "as", "diffusivity [m²/s]", "in"))


def reaction_table(reactions: Iterable[Any]) -> str:
    """Equation, rates and place of each reaction."""
    rows = []
    for r in reactions:
        left, right = r.reactants or {}, r.products or {}
        forward = shown(r.forward)
        if r.rate_law is not None or r.propensity is not None:
            forward = "law of its own" + (f", k = {forward}" if forward else "")
        elif forward:
            forward += f" {_unit(r.units, left)}"
        backward = f"{shown(r.backward)} {_unit(r.units, right)}" if r.reversible else ""
        rows.append((r.label, forward, backward, _place(r.only_in)))
    return table(rows, ("reaction", "forward", "backward", "in"))


def _kind(species: Any) -> str:
    if species.switches:
        above, below = species.switch_above, species.switch_below
        return f"molecules; an amount from {above:g} on, back below {below:g}"
    return "molecules" if species.molecules else "concentration"


def _place(only_in: object) -> str:
    return shown(only_in) or "wherever it can be"


def _unit(units: str, side: Mapping[str, int]) -> str:
    order = sum(side.values())
    known = units == "concentration" and order < len(_RATE_UNITS)
    return _RATE_UNITS[order] if known else "1/s"
