"""What reactions conserve: sums of species whose total no reaction changes."""

from __future__ import annotations

from fractions import Fraction
from math import lcm
from typing import TYPE_CHECKING

import numpy as np

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


def conserved_totals(chemistry: Chemistry) -> dict[str, tuple[float | int, float]]:
    """Totals net of booked flux that neither diffusion nor any reaction may change.

    Returns
    -------
    dict
        For each of :func:`conserved_sums` its value and the magnitude that a drift is relative to;
        for molecules whole numbers and a magnitude of 1.
    """
    totals = chemistry.totals()
    found: dict[str, tuple[float | int, float]] = {}
    for table, whole in ((chemistry.deterministic, False), (chemistry.stochastic, True)):
        for name, weights in conserved_sums(table.net, table.names).items():
            parts = [(int(w), *totals[s]) for w, s in zip(weights, table.names, strict=True) if w]
            value = sum(w * (total - booked) for w, total, booked in parts)
            size = sum(abs(w) * max(abs(total), abs(booked)) for w, total, booked in parts)
            found[name] = (value, 1.0 if whole else max(float(size), 1e-300))
    return found
