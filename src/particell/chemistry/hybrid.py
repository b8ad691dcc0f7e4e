r"""Reactions of molecules and concentrations together: a piecewise-deterministic Markov process.

Between two events the amounts of a particle follow their rate equations, and what is molecules does
not change. The propensities :math:`a_r(N, C(t))` move with the amounts, and the next event comes
where

.. math:: \int a(C(t'))\,dt' = -\ln u, \qquad a = \sum_r a_r,

with a uniform number u: the law of the process exactly, whatever the step. The integral is one more
component of the rate equations (:mod:`particell.chemistry.integrators`), on which nothing depends,
with the same error control; the step that ends at the event is found by the Illinois rule. So
neither kind of species waits for the other, and no step has to be chosen for them.

A species that is an amount n (mol per depth) counts as :math:`X = n\,depth\,𝒩` molecules in
the propensity, without falling factorials; an event takes and makes whole molecules' worth of it,
1/(depth 𝒩) mol each, and so the sum over both kinds is kept to round-off. An event that would
take more than is there cannot happen: what is left of less than one molecule's worth stays until
diffusion or reactions have brought more, and the integration stops where they have. So an amount is
never negative, and the mean is that of the deterministic law where X is large.

References
----------
Davis, J. R. Statist. Soc. B 46 (1984) 353; Alfonsi, Cancès, Turinici, Di Ventura & Huisinga,
ESAIM: Proc. 14 (2005) 1.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.chemistry.binomial import two_uniforms
from particell.chemistry.integrators import INNER, STOP_ACCURACY, advance, reaction_rate
from particell.chemistry.massaction import NOT_FINITE, begin, examine, with_change
from particell.chemistry.network import Tables
from particell.chemistry.ssa import propensity
from particell.compute.loop import particle_loop
from particell.compute.scatter import scatter_add
from particell.materials import AVOGADRO

#: Value that the integral of propensities is compared with: its error may be 1e-6.
RESOLVED = 1e3
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


@particle_loop
def react(
    lane,
    rows,
    tau,
    step,
    part,
    key0,
    key1,
    id,
    group,
    volume,
    depth,
    quantum,
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
    found,
    rate_amounts,
    takes_part_amounts,
    found_amounts,
    joint_reactants,
    joint_net,
    joint_law,
    count,
    amount,
    work,
    substeps,
    pace,
    event_counter,
    most_events,
    failed,
    broken,
    *,
    LAW,
    RATE_LAW,
    SWITCH,
):
    """Reactions of both kinds during tau in the particles of a lane, one after the other.

    ``RATE_LAW`` and ``LAW`` choose user-given laws as in the loops of concentrations alone
    (:mod:`particell.chemistry.massaction`) and molecules alone (:mod:`particell.chemistry.ssa`),
    whose ``substeps``, ``failed``, ``broken`` and ``found`` these are. With ``SWITCH`` species that
    are molecules in a particle take no part in its rate equations, and those that are amounts stand
    for concentrations. ``pace[lane]`` is the fastest rate that reactions left behind, see
    :func:`turnover`.
    """
    row = np.int64(lane)
    lanes = work.shape[0]
    w = work[row]
    species = amount.shape[1]
    n, now = species + 1, species - species
    joint = len(joint_net)
    first = joint - len(net)
    rates = 8 * n + n * n
    largest = rates + joint
    most = 0
    stopped = -1
    total_events = 0
    fastest = 0.0
    for i in range(row * rows // lanes, (row + 1) * rows // lanes):
        if stopped >= 0 or broken[0] != 0:
            break
        g = group[i]
        space = volume[i] * depth
        worth = quantum / volume[i]
        for s in range(species):
            w[s] = max(0.0, amount[i, s] / volume[i])
        for r in range(first):
            w[rates + r] = rate_amounts[g, r]
        if SWITCH:
            for s in range(net.shape[1]):
                if partner[s] >= 0 and continuous[i, s] == 0:
                    w[partner[s]] = 1.0  # a factor that does nothing
                    for r in range(first):
                        if takes_part_amounts[r, partner[s]] != 0:
                            w[rates + r] = 0.0
        w[species] = 0.0
        begin(w, n, joint)
        w[largest + species] = RESOLVED
        left = tau
        h = tau
        block = 0
        events = 0
        steps = 0
        target = 0.0
        choice = 0.0
        drawn = False
        while left > 0.0:
            fine = set_rates(
                w,
                n,
                i,
                g,
                space,
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
                LAW,
                SWITCH,
            )
            if not drawn:
                u, choice = two_uniforms(
                    np.uint64(id[i]), np.uint64(step), np.uint64(part), block, key0, key1
                )
                block += 1
                target = -math.log(u)
                w[species] = 0.0
                drawn = True
            done = -1
            if fine:
                left, h, done = advance(
                    w,
                    n,
                    species,
                    left,
                    h,
                    target,
                    joint_reactants,
                    joint_net,
                    joint_law,
                    RATE_LAW,
                )
            steps += abs(done)
            if done < 0:
                examine(
                    w,
                    n,
                    species,
                    tau,
                    True,
                    found_amounts,
                    joint_reactants,
                    joint_net,
                    joint_law,
                    RATE_LAW,
                )
                stopped = i if done == -1 else i + rows
                left = 0.0
            elif w[species] >= target - STOP_ACCURACY and left > 0.0:
                drawn = False
                goal = 0.0
                chosen = -1
                for sweep in range(2):  # the sum, then the one in which a part of it falls
                    total = 0.0
                    for r in range(first, joint):
                        k = w[rates + r]
                        if k > 0.0:
                            total += reaction_rate(
                                r,
                                w,
                                now,
                                species,
                                k,
                                0.0,
                                joint_reactants,
                                joint_net,
                                joint_law,
                                None,
                            )
                        if sweep == 1 and chosen < 0 and total > goal:
                            chosen = r - first
                    goal = choice * total
                possible = chosen >= 0
                if possible:
                    for s in range(species):
                        change = 0
                        if s < net_amount.shape[1]:
                            change = net_amount[chosen, s]
                        if w[s] < -change * worth * (1.0 - WHOLE):
                            possible = False
                    if SWITCH:
                        for s in range(net.shape[1]):
                            taken = -net[chosen, s] * worth * (1.0 - WHOLE)
                            if partner[s] >= 0 and continuous[i, s] != 0:
                                possible = possible and w[partner[s]] >= taken
                if possible:
                    for s in range(net.shape[1]):
                        if SWITCH and partner[s] >= 0 and continuous[i, s] != 0:
                            column = partner[s]
                            w[column] = max(0.0, w[column] + net[chosen, s] * worth)
                        else:
                            count[i, s] += net[chosen, s]
                    for s in range(net_amount.shape[1]):
                        w[s] = max(0.0, w[s] + net_amount[chosen, s] * worth)
                    events += 1
                    if events >= most_events:
                        failed[i] = 2
                        broken[0] = 1
                        left = 0.0
        if RATE_LAW is not None and stopped < 0:
            examine(
                w,
                n,
                species,
                tau,
                False,
                found_amounts,
                joint_reactants,
                joint_net,
                joint_law,
                RATE_LAW,
            )
        fastest = max(
            fastest,
            turnover(
                w,
                n,
                i,
                g,
                space,
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
            ),
        )
        for s in range(species):
            moves = True
            if SWITCH:
                for m in range(net.shape[1]):
                    if partner[m] == s and continuous[i, m] == 0:
                        moves = False
            if moves:
                amount[i, s] = with_change(amount[i, s], w[s], volume[i])
        most = max(most, steps)
        total_events += events
    pace[row] = fastest
    substeps[row] = -1 - stopped if stopped >= 0 else most
    if total_events > 0:
        scatter_add(event_counter, 0, total_events)
