r"""Exact stochastic reactions (Gillespie's direct method), every particle a well-mixed system.

Within a split step particles do not exchange molecules, so each is a stochastic system of its own,
independent of all others: a parallel loop, with no approximation. With the propensities
:math:`a_r(N)` (1/s, see :mod:`particell.chemistry.reactions`), the time to the next event is
exponential with the rate :math:`\sum_r a_r`, and it is reaction r with probability
:math:`a_r/\sum a`.

**Molecules and concentrations together.** A reaction of both kinds is a sequence of such events
too. A species that is an amount n (mol per depth) counts as :math:`X = n\,depth\,𝒩` molecules in
the propensity, without falling factorials; an event takes and makes whole molecules' worth of it,
1/(depth 𝒩) mol each, and so the sum over both kinds is kept to round-off. An event that would
take more than is there cannot happen: what is left of less than one molecule's worth stays until
diffusion or reactions have brought more. So an amount is never negative, and the mean is that of
the deterministic law where X is large.

References
----------
Gillespie, J. Phys. Chem. 81 (1977) 2340.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.chemistry.binomial import two_uniforms
from particell.compute.loop import particle_loop
from particell.compute.scatter import scatter_add
from particell.materials import AVOGADRO


@njit(error_model="numpy")
def amount_column(slot, i, molecules, partner, continuous, SWITCH):
    """Column of ``amount`` that a species' number in the tables stands for; -1 for molecules."""
    if slot >= molecules:
        return slot - molecules
    if SWITCH and partner[slot] >= 0 and continuous[i, slot] != 0:
        return partner[slot]
    return -1


@njit(error_model="numpy")
def propensity(
    r,
    count,
    amount,
    i,
    volume,
    quantum,
    k,
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
    choose,
    MIXED,
    SWITCH,
):
    """Events per second of reaction r: k (V 𝒩)^(1-order) times the falling factorials."""
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            given = choose(law[r] - 1, count[i], volume, k)
            return 0.0 if given < 0.0 else given  # max() would make a 0 of a NaN
    molecules = net.shape[1]
    a = k
    for f in range(reactants.shape[1]):
        s = reactants[r, f]
        if s >= 0:
            if MIXED:
                column = amount_column(s, i, molecules, partner, continuous, SWITCH)
                if column >= 0:
                    a *= amount[i, column] / quantum
                    continue
            a *= max(0, count[i, s] - repeats[r, f])
    powers = volume_power[r]
    scale = volume * AVOGADRO
    if powers == 1:
        a *= scale
    while powers < 0:
        a /= scale
        powers += 1
    if MIXED:
        for s in range(net_amount.shape[1]):
            if net_amount[r, s] < 0 and amount[i, s] < -net_amount[r, s] * quantum:
                a = 0.0
        if SWITCH:
            discrete = shared[r] == 0
            for s in range(molecules):
                if takes_part[r, s] != 0 and partner[s] >= 0:
                    if continuous[i, s] == 0:
                        discrete = True
                    elif net[r, s] < 0 and amount[i, partner[s]] < -net[r, s] * quantum:
                        a = 0.0
            if not discrete:  # all its species are amounts here
                a = 0.0
    return a


@particle_loop
def react(
    i,
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
    count,
    amount,
    event_counter,
    most_events,
    failed,
    broken,
    *,
    LAW,
    MIXED,
    SWITCH,
):
    """Reactions of the molecules of particle i during tau; counts the events.

    ``LAW(m, N, V, k)`` is the m-th user-given propensity; None where there is none. ``part`` tells
    apart the parts of one step. ``quantum`` is one molecule in mol per depth. ``failed[i]`` is set
    to 1 where the propensities are not finite, to 2 after ``most_events`` events: with either the
    loop would not end. ``broken[0]`` then lets all particles stop; nothing else depends on it.
    """
    if broken[0] != 0:
        return
    g = group[i]
    space = volume[i] * depth
    c0 = np.uint64(id[i])
    c1 = np.uint64(step)
    c2 = np.uint64(part)
    events = 0
    left = tau
    block = 0
    running = True
    while running:
        total = 0.0
        target = 0.0
        chosen = -1
        # the sum of the propensities, then the one in which a part of it falls
        for sweep in range(2):
            for r in range(rate.shape[1]):
                k = rate[g, r]
                if target >= 0.0 and k > 0.0:
                    a = propensity(
                        r,
                        count,
                        amount,
                        i,
                        space,
                        quantum,
                        k,
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
                        LAW,
                        MIXED,
                        SWITCH,
                    )
                    if sweep == 0:
                        total += a
                    else:
                        if a > 0.0:  # so that round-off cannot choose what cannot happen
                            chosen = r
                        target -= a
            if sweep == 0:
                running = False
                target = -1.0
                if not total < math.inf:
                    failed[i] = 1
                    broken[0] = 1
                elif total > 0.0:
                    u, v = two_uniforms(c0, c1, c2, block, key0, key1)
                    block += 1
                    left += math.log(u) / total
                    running = left > 0.0 and events < most_events
                    if running:
                        target = v * total
        if running:
            for s in range(net.shape[1]):
                if SWITCH and partner[s] >= 0 and continuous[i, s] != 0:
                    amount[i, max(partner[s], 0)] += net[chosen, s] * quantum
                else:
                    count[i, s] += net[chosen, s]
            if MIXED:
                for s in range(net_amount.shape[1]):
                    amount[i, s] += net_amount[chosen, s] * quantum
            events += 1
    if events >= most_events:
        failed[i] = 2
        broken[0] = 1
    if events > 0:
        scatter_add(event_counter, 0, events)
