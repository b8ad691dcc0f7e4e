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

from particell.chemistry.binomial import two_uniforms
from particell.chemistry.integrators import STOP_ACCURACY, advance
from particell.chemistry.joint import WHOLE, set_rates, turnover
from particell.chemistry.massaction import begin, examine, with_change
from particell.chemistry.rates import reaction_rate
from particell.compute.loop import particle_loop
from particell.compute.scatter import scatter_add

#: Value that the integral of propensities is compared with: its error may be 1e-6.
RESOLVED = 1e3


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
    :func:`~particell.chemistry.joint.turnover`.
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
