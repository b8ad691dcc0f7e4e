"""Deterministic reactions of concentrations: a loop over the particles.

The equations and how they are integrated are in :mod:`particell.chemistry.integrators`. Where laws
depend on the time it is one more of what they describe: a clock that every particle starts with.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from particell.chemistry.integrators import advance
from particell.chemistry.lawcode import CLOCK
from particell.chemistry.rates import EDGE, INNER, law_value, reaction_rate
from particell.compute.loop import particle_loop

if TYPE_CHECKING:
    from particell.chemistry.network import Tables

#: Lanes share the particles between them; each has one row of scratch memory.
LANES = 512
#: What is found of a reaction (bits of ``found``): its law takes what is not there, is negative
#: (a propensity), or is not finite.
TAKES_TOO_MUCH, NEGATIVE, NOT_FINITE = 1, 2, 4


def with_clock(tables: Tables) -> dict[str, np.ndarray]:
    """The tables of reactions, with a clock as last species and what drives it as last reaction."""
    found = {
        "reactants": tables.reactants,
        "net": tables.net,
        "rate": tables.rate,
        "law": tables.law,
        "takes_part": tables.takes_part,
    }
    if not tables.timed:
        return found
    rows, columns = ((0, 1), (0, 0)), ((0, 1), (0, 1))
    found["reactants"] = np.pad(tables.reactants, rows, constant_values=-1)
    found["net"] = np.pad(tables.net, columns)
    found["net"][-1, -1] = 1
    found["rate"] = np.pad(tables.rate, ((0, 0), (0, 1)), constant_values=CLOCK)
    found["law"] = np.pad(tables.law, (0, 1))
    found["takes_part"] = np.pad(tables.takes_part, columns)
    return found


@njit(**INNER)
def begin(w, n, reactions):
    """Make the values of the lane's n components those that the step begins with."""
    largest = 8 * n + n * n + reactions
    for s in range(n):
        w[largest + s] = w[s]
        w[largest + n + s] = math.inf


@njit(**INNER)
def with_change(amount, value, volume):
    """An amount after its concentration became ``value``; what diffusion left below 0 stays so."""
    if amount < 0.0:
        return amount + value * volume
    return max(0.0, amount + (value - amount / volume) * volume)


@njit(**INNER)
def examine(w, n, species, tau, failed, found, reactants, net, law, choose):
    """Note in ``found`` which laws do not vanish where what they consume has run out.

    Where the integration failed, which are not finite.
    """
    rates, now = 8 * n + n * n, n - n
    size = 0.0
    for s in range(species):
        size = max(size, w[s], w[rates + len(net) + s])
    for r in range(len(found)):
        k = w[rates + r]
        if k > 0.0:
            if failed:
                rate = reaction_rate(
                    r, w, now, species, k, EDGE * size, reactants, net, law, choose
                )
                if not abs(rate) < math.inf:
                    found[r] |= NOT_FINITE
            elif law[r] > 0:
                for s in range(species):
                    kept = w[s]
                    if net[r, s] != 0 and kept <= 1e3 * EDGE * size:
                        w[s] = 0.0
                        value = net[r, s] * law_value(r, w, now, species, k, law, choose)
                        w[s] = kept
                        if value * tau < -1e-12 * size:
                            found[r] |= TAKES_TOO_MUCH


@particle_loop
def react(
    lane,
    rows,
    tau,
    time,
    group,
    volume,
    rate,
    reactants,
    net,
    law,
    partner,
    takes_part,
    continuous,
    amount,
    work,
    substeps,
    found,
    *,
    LAW,
    SWITCH,
):
    """Reactions during tau from a time on in the particles of a lane, one after the other.

    ``LAW(m, C, k)`` is the m-th user-given rate law; None where there is none.
    ``substeps[lane]`` is the largest number of sub-steps; where the integration failed in particle
    i it is -1 - i, or -1 - i - rows for too many sub-steps, and the rest of the lane is left.
    ``found[r]`` notes what is wrong with the law of reaction r.
    With ``SWITCH`` species that are molecules in this particle, and what involves them, are left
    out: see :mod:`particell.chemistry.switching`.
    """
    row = np.int64(lane)
    lanes = work.shape[0]
    w = work[row]
    most = 0
    failed = -1
    columns = amount.shape[1]
    n = net.shape[1]  # perhaps with a clock
    rates = 8 * n + n * n
    for i in range(row * rows // lanes, (row + 1) * rows // lanes):
        if failed >= 0:
            break
        for s in range(columns):
            w[s] = max(0.0, amount[i, s] / volume[i])
        for s in range(columns, n):
            w[s] = time * CLOCK
        for r in range(rate.shape[1]):
            w[rates + r] = rate[group[i], r]
        if SWITCH:
            for s in range(columns):
                if partner[s] >= 0 and continuous[i, partner[s]] == 0:
                    w[s] = 0.0
                    for r in range(rate.shape[1]):
                        if takes_part[r, s] != 0:
                            w[rates + r] = 0.0
        begin(w, n, len(net))
        _left, _h, steps = advance(w, n, n, tau, tau, math.inf, reactants, net, law, LAW)
        if LAW is not None or steps < 0:
            examine(w, n, n, tau, steps < 0, found, reactants, net, law, LAW)
        if steps < 0:
            failed = i if steps == -1 else i + rows
        most = max(most, steps)
        if steps != 0:
            for s in range(columns):
                if SWITCH and partner[s] >= 0 and continuous[i, max(partner[s], 0)] == 0:
                    continue
                amount[i, s] = with_change(amount[i, s], w[s], volume[i])
    substeps[row] = -1 - failed if failed >= 0 else most
