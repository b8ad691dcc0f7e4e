r"""Exact stochastic reactions (Gillespie's direct method), every particle a well-mixed system.

Within a split step particles do not exchange molecules, so each is a stochastic system of its own,
independent of all others: a parallel loop, with no approximation. With the propensities
:math:`a_r(N)` (1/s, see :mod:`particell.chemistry.reactions`), the time to the next event is
exponential with the rate :math:`\sum_r a_r`, and it is reaction r with probability
:math:`a_r/\sum a`.

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


@njit
def propensity(r, numbers, volume, k, reactants, repeats, volume_power, law, choose):
    """Events per second of reaction r: k (V 𝒩)^(1-order) times the falling factorials."""
    if choose is not None:  # decided at compile time
        if law[r] > 0:
            return max(0.0, choose(law[r] - 1, numbers, volume, k))
    a = k
    for f in range(reactants.shape[1]):
        s = reactants[r, f]
        if s >= 0:
            a *= max(0, numbers[s] - repeats[r, f])
    powers = volume_power[r]
    scale = volume * AVOGADRO
    if powers == 1:
        a *= scale
    while powers < 0:
        a /= scale
        powers += 1
    return a


@njit
def simulate(
    numbers,
    volume,
    tau,
    g,
    rate,
    reactants,
    repeats,
    net,
    volume_power,
    law,
    choose,
    c0,
    c1,
    key0,
    key1,
):
    """Run one particle for tau, changing ``numbers``; the number of events."""
    events = 0
    left = tau
    block = 0
    running = True
    while running:
        total = 0.0
        for r in range(rate.shape[1]):
            if rate[g, r] > 0.0:
                total += propensity(
                    r, numbers, volume, rate[g, r], reactants, repeats, volume_power, law, choose
                )
        running = False
        if total > 0.0:
            u, v = two_uniforms(c0, c1, np.uint64(0), block, key0, key1)
            block += 1
            left += math.log(u) / total
            running = left > 0.0
        if running:
            target = v * total
            chosen = -1
            for r in range(rate.shape[1]):
                if target >= 0.0 and rate[g, r] > 0.0:
                    a = propensity(
                        r,
                        numbers,
                        volume,
                        rate[g, r],
                        reactants,
                        repeats,
                        volume_power,
                        law,
                        choose,
                    )
                    if a > 0.0:  # so that round-off in the sums cannot choose what cannot happen
                        chosen = r
                    target -= a
            for s in range(net.shape[1]):
                numbers[s] += net[chosen, s]
            events += 1
    return events


@particle_loop
def react(
    i,
    tau,
    step,
    key0,
    key1,
    id,
    group,
    volume,
    rate,
    reactants,
    repeats,
    net,
    volume_power,
    law,
    count,
    event_counter,
):
    """Reactions of the molecules of particle i during tau; counts the events."""
    events = simulate(
        count[i],
        volume[i],
        tau,
        group[i],
        rate,
        reactants,
        repeats,
        net,
        volume_power,
        law,
        None,
        np.uint64(id[i]),
        np.uint64(step),
        key0,
        key1,
    )
    if events > 0:
        scatter_add(event_counter, 0, events)


@particle_loop
def react_with_laws(
    i,
    tau,
    step,
    key0,
    key1,
    id,
    group,
    volume,
    rate,
    reactants,
    repeats,
    net,
    volume_power,
    law,
    count,
    event_counter,
    *,
    LAW,
):
    """The same with user-given propensities: ``LAW(m, N, V, k)`` is the m-th of them."""
    events = simulate(
        count[i],
        volume[i],
        tau,
        group[i],
        rate,
        reactants,
        repeats,
        net,
        volume_power,
        law,
        LAW,
        np.uint64(id[i]),
        np.uint64(step),
        key0,
        key1,
    )
    if events > 0:
        scatter_add(event_counter, 0, events)
