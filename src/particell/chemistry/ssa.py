r"""Exact stochastic reactions (Gillespie's direct method), every particle a well-mixed system.

Within a split step particles do not exchange molecules, so each is a stochastic system of its own,
independent of all others: a parallel loop, with no approximation. With the propensities
:math:`a_r(N)` (1/s, see :mod:`particell.chemistry.reactions`), the time to the next event is
exponential with the rate :math:`\sum_r a_r`, and it is reaction r with probability
:math:`a_r/\sum a`.

An event that would take more molecules than there are cannot happen. With mass action its
propensity vanishes by itself; one that a user gives counts as zero there, and where it is negative.
Both are noted, as such a law is wrong. Where concentrations take part too the loop is that of
:mod:`particell.chemistry.hybrid`.

References
----------
Gillespie, J. Phys. Chem. 81 (1977) 2340.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.chemistry.binomial import two_uniforms
from particell.chemistry.massaction import NEGATIVE, NOT_FINITE, TAKES_TOO_MUCH
from particell.compute.loop import particle_loop
from particell.compute.scatter import scatter_add
from particell.materials import AVOGADRO


@njit(error_model="numpy")
def propensity(
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
):
    """Events per second of reaction r: k (V 𝒩)^(1-order) times the falling factorials.

    A factor that is an amount counts as V 𝒩, by which its concentration is to be multiplied.
    """
    molecules = net.shape[1]
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            given = choose(law[r] - 1, count[i], volume, k)
            if given > 0.0:
                for s in range(molecules):
                    if count[i, s] + net[r, s] < 0:
                        found[r] |= TAKES_TOO_MUCH
                        return 0.0
            elif given < 0.0:
                found[r] |= NEGATIVE
                return 0.0
            return given  # a NaN too
    a = k
    scale = volume * AVOGADRO
    for f in range(reactants.shape[1]):
        s = reactants[r, f]
        if s >= 0:
            amount = s >= molecules
            if SWITCH and not amount:
                amount = partner[s] >= 0 and continuous[i, s] != 0
            a *= scale if amount else max(0, count[i, s] - repeats[r, f])
    powers = volume_power[r]
    if powers == 1:
        a *= scale
    while powers < 0:
        a /= scale
        powers += 1
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
    rate,
    reactants,
    repeats,
    net,
    volume_power,
    law,
    partner,
    continuous,
    found,
    count,
    event_counter,
    most_events,
    failed,
    broken,
    *,
    LAW,
):
    """Reactions of the molecules of particle i during tau; counts the events.

    ``LAW(m, N, V, k)`` is the m-th user-given propensity; None where there is none. ``part`` tells
    apart the parts of one step. ``failed[i]`` is set to 1 where the propensities are not finite,
    to 2 after ``most_events`` events: with either the loop would not end. ``broken[0]`` then lets
    all particles stop; nothing else depends on it. ``found[r]`` notes what is wrong with the law of
    reaction r.
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
                        i,
                        space,
                        k,
                        reactants,
                        repeats,
                        net,
                        volume_power,
                        law,
                        partner,
                        continuous,
                        found,
                        LAW,
                        False,
                    )
                    if not a < math.inf:
                        found[r] |= NOT_FINITE
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
                count[i, s] += net[chosen, s]
            events += 1
    if events >= most_events:
        failed[i] = 2
        broken[0] = 1
    if events > 0:
        scatter_add(event_counter, 0, events)
