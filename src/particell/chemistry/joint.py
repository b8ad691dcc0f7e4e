"""What molecules and concentrations have in common where they react together: table and rates.

The equations are in :mod:`particell.chemistry.hybrid`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.chemistry.integrators import STOP_ACCURACY
from particell.chemistry.massaction import NOT_FINITE
from particell.chemistry.network import Tables
from particell.chemistry.rates import INNER
from particell.chemistry.ssa import propensity
from particell.materials import AVOGADRO

#: An amount is one molecule's worth down to this part less, so that round-off keeps none back.
WHOLE = 1e-9


def couples(deterministic: Tables, stochastic: Tables) -> bool:
    """Whether molecules and concentrations react together."""
    if not stochastic.reactions:
        return False
    names = len(stochastic.names)
    read = bool((stochastic.reactants >= names).any())  # it may take part without being changed
    return read or bool(stochastic.net_amount.any()) or len(stochastic.switching) > 0


def joint_tables(deterministic: Tables, stochastic: Tables) -> dict[str, np.ndarray]:
    """Reactions of both kinds as rows of one table of rate equations.

    Those of molecules come last. Of their factors the amounts are left, and what they change is the
    component after the species: the integral of the propensities.
    """
    slots, molecules = stochastic.reactants, len(stochastic.names)
    amounts = np.where(slots >= molecules, slots - molecules, -1)
    own = (slots >= 0) & (slots < molecules)
    amounts[own] = stochastic.partner[slots[own]]
    first, second = deterministic.reactions, stochastic.reactions
    species = len(deterministic.names)
    net = np.zeros((first + second, species + 1), np.int64)
    net[:first, :species] = deterministic.net
    net[first:, species] = 1
    return {
        "joint_reactants": np.concatenate([deterministic.reactants, amounts]),
        "joint_net": net,
        "joint_law": np.concatenate([deterministic.law, np.zeros(second, np.int64)]),
    }


@njit(**INNER)
def set_rates(
    w,
    n,
    i,
    g,
    volume,
    worth,
    rate,
    reactants,
    repeats,
    net,
    net_amount,
    volume_power,
    law,
    partner,
    continuous,
    takes_part,
    shared,
    joint,
    found,
    count,
    choose,
    SWITCH,
):
    """The propensities but for their factors of amounts, as rates of the last of ``joint`` rows.

    An event that would take more of an amount than there is cannot happen; the level where it can
    is set. ``worth`` is one molecule in mol/m³. False where a propensity is not finite.
    """
    rates = 8 * n + n * n
    levels = rates + joint + n
    first = joint - len(net)
    molecules = net.shape[1]
    for s in range(n):
        w[levels + s] = math.inf
    fine = True
    for r in range(len(net)):
        k = rate[g, r]
        possible = k > 0.0
        if SWITCH and possible:  # unless all its species are amounts here
            possible = shared[r] == 0
            for s in range(molecules):
                if takes_part[r, s] != 0 and partner[s] >= 0 and continuous[i, s] == 0:
                    possible = True
        a = 0.0
        if possible:
            a = propensity(
                r,
                count,
                i,
                volume,
                k,
                reactants,
                repeats,
                net,
                volume_power,
                law,
                partner,
                continuous,
                found,
                choose,
                SWITCH,
            )
            if not a < math.inf:
                found[r] |= NOT_FINITE
                fine = False
        reachable = a > 0.0
        if reachable:
            for s in range(molecules + net_amount.shape[1]):
                column, change = s - molecules, 0
                if s >= molecules:
                    change = net_amount[r, column]
                elif SWITCH and partner[s] >= 0 and continuous[i, s] != 0:
                    column, change = partner[s], net[r, s]
                if change < 0 and w[column] < -change * worth * (1.0 - WHOLE):
                    a = 0.0
                    needed = -change * worth * (1.0 + 2.0 * STOP_ACCURACY)
                    w[levels + column] = min(w[levels + column], needed)
        w[rates + first + r] = a
    return fine


@njit(**INNER)
def turnover(
    w,
    n,
    i,
    g,
    volume,
    rate,
    reactants,
    repeats,
    net,
    net_amount,
    volume_power,
    law,
    partner,
    continuous,
    joint,
    count,
    SWITCH,
):
    """Largest rate in 1/s at which one molecule, or a part of an amount, is turned into others.

    Of mass action also for a molecule that is not there but could come; of a user-given propensity
    for those that are there.
    """
    rates = 8 * n + n * n
    gross = rates + joint + 2 * n
    first = joint - len(net)
    molecules = net.shape[1]
    scale = volume * AVOGADRO
    fastest = 0.0
    for s in range(n - 1):
        if w[s] > 0.0:
            fastest = max(fastest, 0.5 * (w[gross + s] - w[n + s]) / w[s])
    for r in range(len(net)):
        if law[r] > 0:
            for s in range(molecules):
                if net[r, s] < 0 and count[i, s] > 0:
                    fastest = max(fastest, w[rates + first + r] / count[i, s])
        elif rate[g, r] > 0.0:
            for one in range(reactants.shape[1]):
                own = reactants[r, one]
                if own >= 0:
                    changed = net[r, own] if own < molecules else net_amount[r, own - molecules]
                    a = rate[g, r] * scale ** volume_power[r] if changed != 0 else 0.0
                    for f in range(reactants.shape[1]):
                        s = reactants[r, f]
                        if s >= 0 and f != one:
                            column = s - molecules
                            if SWITCH and s < molecules:
                                amount_here = partner[s] >= 0 and continuous[i, s] != 0
                                column = partner[s] if amount_here else -1
                            if column >= 0:
                                a *= w[column] * scale
                            else:
                                a *= max(0, count[i, s] - (repeats[r, f] if s != own else 0))
                    fastest = max(fastest, a)
    return fastest
