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


@njit(error_model="numpy")
def propensity(r, count, i, volume, k, reactants, repeats, volume_power, law, choose):
    """Events per second of reaction r: k (V 𝒩)^(1-order) times the falling factorials."""
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            return max(0.0, choose(law[r] - 1, count[i], volume, k))
    a = k
    for f in range(reactants.shape[1]):
        s = reactants[r, f]
        if s >= 0:
            a *= max(0, count[i, s] - repeats[r, f])
    powers = volume_power[r]
    scale = volume * AVOGADRO
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
    count,
    event_counter,
    *,
    LAW,
):
    """Reactions of the molecules of particle i during tau; counts the events.

    ``LAW(m, N, V, k)`` is the m-th user-given propensity; None where there is none.
    """
    g = group[i]
    space = volume[i] * depth
    c0 = np.uint64(id[i])
    c1 = np.uint64(step)
    c2 = np.uint64(0)
    events = 0
    left = tau
    block = 0
    running = True
    while running:
        total = 0.0
        for r in range(rate.shape[1]):
            k = rate[g, r]
            if k > 0.0:
                total += propensity(
                    r, count, i, space, k, reactants, repeats, volume_power, law, LAW
                )
        running = False
        if total > 0.0:
            u, v = two_uniforms(c0, c1, c2, block, key0, key1)
            block += 1
            left += math.log(u) / total
            running = left > 0.0
        if running:
            target = v * total
            chosen = -1
            for r in range(rate.shape[1]):
                k = rate[g, r]
                if target >= 0.0 and k > 0.0:
                    a = propensity(
                        r, count, i, space, k, reactants, repeats, volume_power, law, LAW
                    )
                    if a > 0.0:  # so that round-off in the sums cannot choose what cannot happen
                        chosen = r
                    target -= a
            for s in range(net.shape[1]):
                count[i, s] += net[chosen, s]
            events += 1
    if events > 0:
        scatter_add(event_counter, 0, events)
