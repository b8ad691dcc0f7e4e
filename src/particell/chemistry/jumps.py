r"""Exact diffusion of molecules: random walks on the particles while these stand still.

A molecule in particle i jumps to neighbour j at the rate (Jacob, thesis, UCSB 2020, Eq. 28, per
molecule)

.. math:: k_{i\to j} = 2 \bar\kappa_{ij} V_j F_{ij} s_{ij},

whose detailed balance makes N_i/V_i uniform; s_ij as in :mod:`particell.laws.diffusion`. Jumps are
of first order, so molecules are independent walkers, and the law of their places after τ is
:math:`\exp(\tau K)` exactly, with any number of jumps in a step. It is sampled without a queue, in
one of two ways, both exact, chosen for each particle by the expected cost:

*few molecules*: how many leave at all is binomial, with probability 1 - exp(-k_i τ); each of those
walks with exponential waiting times until τ is used up;

*many*: uniformisation. With Λ = max k_i every molecule has a Poisson(Λτ) number of candidate jumps.
In round m the molecules that have more than m candidates are moved by one multinomial draw over
{stay, neighbours} with probabilities {1 - k_i/Λ, k_ij/Λ}; those that arrive have one candidate more
with the conditional probability ``further[m + 1]``. What is left of a group that has become small
walks alone, on the same chain.

Molecules that come in from outside during the step (reservoirs, walls with a surface value) are a
Poisson stream with uniform entry times. They walk for the rest of τ, or do the rounds with the law
of the number of candidates after a uniform time.

Random numbers are those of (id of the particle, step, walker, hop), each walker having a Philox
stream of its own; the draws of whole groups are walker :data:`GROUP`. The key is that of species
and round. Arrivals are summed as integers, so results depend neither on the number of threads nor
on the order in which particles and walkers come; a walk could be broken off anywhere and go on
elsewhere. Rates are stored and looked up in single precision (rounding 6e-8 of k_i), as cumulative
sums along the row of the neighbour list.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.special import gammainc

from particell.chemistry.binomial import (
    binomial,
    conditional_binomial,
    poisson,
    stochastic_round,
)
from particell.compute.loop import particle_loop
from particell.compute.philox import philox, uniform32
from particell.compute.scatter import scatter_add
from particell.materials import AVOGADRO

#: Cost of one binomial draw in units of one walked molecule: decides between the two ways.
BINOMIAL_COST = 1.2
#: What stands in the place of a walker's number in the draws of a group, and of what is rounded.
GROUP, ROUNDED = np.uint64(0xFFFFFFFF), np.uint64(0xFFFFFFFE)
#: Columns of the counters: jumps made, molecules that go on into the next round.
JUMPS, PENDING = 0, 1
#: 1 - 2^-23: the product with a single-precision number rounds to a smaller one.
_BELOW_ONE = 0.9999998807907104


@njit(error_model="numpy")
def find_slot(cumulative, first, last, target):
    """The first k in first..last-1 with cumulative[k] > target; there is one. Branch-free."""
    # unsigned, single precision, and a product instead of a condition: five times faster than
    # what comes to mind. The target must stay below the total when it is rounded.
    one = np.uint64(1)
    goal = np.float32(min(target, np.float64(cumulative[last - 1]) * _BELOW_ONE))
    place = np.uint64(first)
    size = np.uint64(last - first)
    while size > one:
        half = size >> one
        place += half * np.uint64(cumulative[place + half - one] <= goal)
        size -= half
    return place


@particle_loop
def move(
    i,
    m,
    tau,
    fastest,
    further,
    binomial_cost,
    s,
    step,
    key0,
    key1,
    id,
    group,
    status,
    start,
    stop,
    neighbours,
    cumulative,
    leave_rate,
    arrived,
    count,
    count_booked,
    moving,
    landed,
    counters,
    column,
    quantum,
    continuous,
    amount,
    *,
    SWITCH,
):
    """Round m for the molecules of particle i: those it holds (m = 0), or those that arrived.

    Molecules whose walk is over are added to ``landed``, those that may have further candidates
    to ``moving``; both have shape (threads, n). The key tells apart rounds and the sets of them in
    one step (species; residents and those from outside). With ``SWITCH`` particle i may hold an
    amount (in ``column``) instead, which sends and takes molecules of ``quantum`` mol each.

    The walk of a molecule is written out here and in :func:`enter`: as a function that takes
    arrays it would be slower by half, Numba counting references of each array in every call.
    """
    number = count[i, s] if m == 0 else arrived[i]
    worth = 0.0
    if SWITCH and continuous[i, s] != 0 and m == 0:
        worth = amount[i, column] / quantum
        number = stochastic_round(worth, np.uint64(id[i]), np.uint64(step), ROUNDED, key0, key1)
    if number == 0:
        return
    if status[group[i]] != 0:
        if m > 0:
            count_booked[i, s] -= number
        return
    c0 = np.uint64(id[i])
    c1 = np.uint64(step)
    jumps = 0
    leave = leave_rate[i]
    limit = binomial_cost * (stop[i] - start[i])
    p = -math.expm1(-leave * tau)
    timed = m == 0 and (leave == 0.0 or number * p < limit * max(1.0, fastest * tau))
    going, block = binomial(number, p if timed else further[m], c0, c1, GROUP, 0, key0, key1)
    if SWITCH and continuous[i, s] != 0:
        if m == 0:
            going = min(going, np.int64(math.floor(worth)))
            amount[i, column] = max(0.0, amount[i, column] - going * quantum)
        else:
            amount[i, column] += (number - going) * quantum
    elif m == 0:
        count[i, s] -= going
    else:
        count[i, s] += number - going
    if timed or going < limit:
        for walker in range(going):
            place = np.int64(i)
            left = tau  # an upper bound until the time of the first jump is needed
            tries = 0
            walking = True
            while walking:
                w0, w1, w2, _w3 = philox(c0, c1, np.uint64(walker), np.uint64(tries), key0, key1)
                tries += 1
                rate = leave_rate[place]
                target = uniform32(w0) * (rate if timed else fastest)
                if target < rate:
                    slot = find_slot(cumulative, start[place], stop[place], target)
                    place = np.int64(neighbours[slot])
                    jumps += 1
                u = uniform32(w1)
                if timed:
                    # exp(-y) >= 1 - y settles most cases without a logarithm
                    onward = leave_rate[place]
                    walking = u > 1.0 - onward * left
                    if walking:
                        if tries == 1:
                            left += math.log(1.0 - uniform32(w2) * p) / rate
                        left += math.log(u) / onward
                        walking = left > 0.0
                else:
                    walking = m + tries < len(further)
                    if walking:
                        walking = u < further[m + tries]
            scatter_add(landed, place, 1)
        scatter_add(counters, 0, jumps)
        return
    scatter_add(counters, 1, going)
    low = 0.0
    for k in range(start[i], stop[i]):
        if going > 0:
            high = np.float64(cumulative[k])
            part, block = conditional_binomial(
                going, low, high, fastest, c0, c1, GROUP, block, key0, key1
            )
            low = high
            if part > 0:
                scatter_add(moving, neighbours[k], part)
                going -= part
                jumps += part
    scatter_add(moving, i, going)
    scatter_add(counters, 0, jumps)


@particle_loop
def enter(
    i,
    tau,
    binomial_cost,
    s,
    step,
    key0,
    key1,
    id,
    group,
    status,
    start,
    stop,
    neighbours,
    cumulative,
    leave_rate,
    inflow,
    volume,
    depth,
    held,
    count_booked,
    moving,
    landed,
    counters,
):
    """Molecules that come in at particle i during tau: a Poisson stream, uniform in time.

    A reservoir of the concentration ``held`` (G, S) sends them to its neighbours, as its expected
    number of molecules would; next to a wall with a value they start in i itself.
    """
    inward = inflow[i]
    if inward == 0.0:
        return
    c0 = np.uint64(id[i])
    c1 = np.uint64(step)
    jumps = 0
    reservoir = status[group[i]] == 1
    mean = inward * tau
    if reservoir:
        mean *= held[group[i], s] * volume[i] * depth * AVOGADRO
    number, block = poisson(mean, c0, c1, GROUP, 0, key0, key1)
    count_booked[i, s] += number
    if number < binomial_cost * (stop[i] - start[i]):
        for walker in range(number):
            w0, w1, _w2, _w3 = philox(c0, c1, np.uint64(walker), np.uint64(0), key0, key1)
            hop = 1
            place = np.int64(i)
            left = tau * uniform32(w0)
            rate = inward
            walking = True
            if not reservoir:
                rate = leave_rate[place]
                left += math.log(uniform32(w1)) / rate
                walking = left > 0.0
            while walking:
                w0, w1, _w2, _w3 = philox(c0, c1, np.uint64(walker), np.uint64(hop), key0, key1)
                hop += 1
                target = uniform32(w0) * rate
                slot = find_slot(cumulative, start[place], stop[place], target)
                place = np.int64(neighbours[slot])
                jumps += 1
                rate = leave_rate[place]
                u = uniform32(w1)
                walking = u > 1.0 - rate * left
                if walking:
                    left += math.log(u) / rate
                    walking = left > 0.0
            scatter_add(landed, place, 1)
        scatter_add(counters, 0, jumps)
        return
    scatter_add(counters, 1, number)
    low = 0.0
    if reservoir:
        for k in range(start[i], stop[i]):
            if number > 0:
                high = np.float64(cumulative[k])
                part, block = conditional_binomial(
                    number, low, high, inward, c0, c1, GROUP, block, key0, key1
                )
                low = high
                if part > 0:
                    scatter_add(moving, neighbours[k], part)
                    number -= part
                    jumps += part
    scatter_add(counters, 0, jumps)
    if number > 0:
        scatter_add(moving, i, number)


@particle_loop
def collect(i, moving, arrived):
    """Sum what arrived at particle i over threads, and empty the buffer."""
    total = 0
    for thread in range(moving.shape[0]):
        total += moving[thread, i]
        moving[thread, i] = 0
    arrived[i] = total


@particle_loop
def settle(
    i,
    s,
    group,
    status,
    landed,
    count,
    count_booked,
    column,
    quantum,
    continuous,
    amount,
    *,
    SWITCH,
):
    """Give particle i the molecules whose walk ended there; absorbed ones are booked."""
    total = 0
    for thread in range(landed.shape[0]):
        total += landed[thread, i]
        landed[thread, i] = 0
    if SWITCH and continuous[i, s] != 0:
        amount[i, column] += total * quantum
    elif status[group[i]] == 0:
        count[i, s] += total
    else:
        count_booked[i, s] -= total


def rounds_needed(mean: float) -> int:
    """Length of the table of probabilities, beyond which a Poisson number never goes."""
    return int(mean + 14 * math.sqrt(mean)) + 64


def resident_probabilities(mean: float, length: int) -> np.ndarray:
    """P(K >= m+1 | K >= m) for m = 0, 1, ... of a Poisson number K of candidate jumps."""
    tail = np.append(1.0, gammainc(np.arange(1.0, length + 1), mean))
    return np.divide(tail[1:], tail[:-1], out=np.zeros(length), where=tail[:-1] > 0)


def inflow_probabilities(mean: float, length: int) -> np.ndarray:
    """The same for walkers that enter at a uniform time: entry m has P(K >= m | K >= m-1).

    Their number of candidates has P(K = k) = P(Poisson(mean) >= k+1)/mean; entry 0 is 1.
    """
    point = gammainc(np.arange(1.0, length + 1), mean) / mean if mean > 0 else np.eye(1, length)[0]
    tail = np.cumsum(point[::-1])[::-1]
    ratio = np.ones(length)
    np.divide(tail[1:], tail[:-1], out=ratio[1:], where=tail[:-1] > 0)
    return np.minimum(ratio, 1.0)
