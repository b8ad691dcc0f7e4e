"""What reactions conserve: sums of species whose total no reaction changes."""

from __future__ import annotations

from fractions import Fraction
from math import lcm
from typing import TYPE_CHECKING

import numpy as np

from particell.materials import AVOGADRO

if TYPE_CHECKING:
    from particell.chemistry.engine import Chemistry


def conserved_sums(net: np.ndarray, names: list[str]) -> dict[str, np.ndarray]:
    """Independent integer combinations of species that every reaction leaves as they are.

    They span the null space of the stoichiometric matrix, which is found by exact elimination.

    Parameters
    ----------
    net
        Change of each species by one event of each reaction, (reactions, species), whole numbers.
    names
        Names of the species.

    Returns
    -------
    dict
        Coefficients (species,) by a name such as ``"L + RL"``.
    """
    columns = len(names)
    rows = [[Fraction(int(v)) for v in row] for row in net]
    pivots: list[int] = []
    for column in range(columns):
        row = len(pivots)
        best = next((r for r in range(row, len(rows)) if rows[r][column]), None)
        if best is None:
            continue
        rows[row], rows[best] = rows[best], rows[row]
        rows[row] = [v / rows[row][column] for v in rows[row]]
        for r in range(len(rows)):
            if r != row:
                factor = rows[r][column]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[row], strict=True)]
        pivots.append(column)
    found = {}
    for free in (c for c in range(columns) if c not in pivots):
        vector = [Fraction(0)] * columns
        vector[free] = Fraction(1)
        for row, column in enumerate(pivots):
            vector[column] = -rows[row][free]
        scale = lcm(*(v.denominator for v in vector))
        weights = np.array([int(v * scale) for v in vector])
        found[_written(weights, names)] = weights
    return found


def _written(weights: np.ndarray, names: list[str]) -> str:
    """``"L + 2 RL"`` for weights 1 and 2, positive terms first."""
    order = np.argsort(weights < 0, kind="stable")
    text = ""
    for k in order:
        if weights[k]:
            size = "" if abs(weights[k]) == 1 else f"{abs(weights[k])} "
            sign = " - " if weights[k] < 0 else " + "
            text += f"{sign}{size}{names[k]}"
    return text.removeprefix(" + ").strip()


def all_reactions(chemistry: Chemistry) -> tuple[np.ndarray, list[str]]:
    """Change of every species by each reaction (reactions, species), and the species' names."""
    amounts, counts = chemistry.deterministic, chemistry.stochastic
    names = amounts.names + [name for name in counts.names if name not in amounts.names]
    net = np.zeros((amounts.reactions + counts.reactions, len(names)), np.int64)
    net[: amounts.reactions, : len(amounts.names)] = amounts.net
    net[amounts.reactions :, : len(amounts.names)] = counts.net_amount
    for s, name in enumerate(counts.names):
        net[amounts.reactions :, names.index(name)] += counts.net[:, s]
    return net, names


def conserved_totals(chemistry: Chemistry) -> dict[str, tuple[float | int, float]]:
    """Totals net of booked flux that neither diffusion nor any reaction may change.

    Returns
    -------
    dict
        For each of :func:`conserved_sums` its value and the magnitude that a drift is relative to;
        for molecules whole numbers and a magnitude of 1. Where molecules and concentrations, or
        species that switch, are in one sum, all is in molecules.
    """
    totals = chemistry.totals()
    found: dict[str, tuple[float | int, float]] = {}
    net, names = all_reactions(chemistry)
    for name, weights in conserved_sums(net, names).items():
        inside = [s for w, s in zip(weights, names, strict=True) if w]
        molecules = [chemistry.species[s].molecules for s in inside]
        whole = all(molecules) and not any(chemistry.species[s].switches for s in inside)
        parts = []
        for w, s in zip(weights, names, strict=True):
            if w:
                mixed = any(molecules) and not chemistry.species[s].molecules
                scale = chemistry.depth * AVOGADRO if mixed else 1
                parts.append((int(w), totals[s][0] * scale, totals[s][1] * scale))
        value = sum(w * (total - booked) for w, total, booked in parts)
        size = sum(abs(w) * max(abs(total), abs(booked)) for w, total, booked in parts)
        found[name] = (value, 1.0 if whole else max(float(size), 1e-300))
    return found
