r"""Molecules that a shift carries from particle to particle, drawn about the mean flux.

The mean is the flux J of :mod:`particell.laws.species_flux` at the middle of the step. Of the N_i
molecules in particle i a binomial number leaves, of mean
:math:`E_i = \sum_j\max(0, J_{i\to j})\,\tau`, each to neighbour j with the probability
:math:`J_{i\to j}\tau/E_i`. Numbers stay whole, not negative and conserved, and means are those of
the law, but for one thing: where :math:`E_i > N_i` only N_i can leave. That happens to particles
without molecules, since what is below the mean is carried by taking from them. What they owed,
:math:`E_i - N_i`, is added up.

The numbers of particle i come from a Philox stream of its own, and arrivals are summed as integers,
so that results do not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from particell.chemistry.binomial import binomial, conditional_binomial
from particell.compute.loop import particle_loop
from particell.compute.scatter import scatter_add
from particell.laws.species_flux import species_flux


@particle_loop
def as_numbers(i, count, number, *, COLUMNS):
    """Molecules as the real numbers that the law takes."""
    for s in range(COLUMNS):
        number[i, s] = count[i, s]


@njit
def outflow(own_shift, its_shift, own_content, its_content):
    """Mean number of molecules per time that go from a particle to its neighbour."""
    return max(0.0, -species_flux(own_shift, its_shift, own_content, its_content))


@particle_loop
def send(
    i,
    id,
    group,
    start,
    split,
    neighbours,
    own_shift,
    its_shift,
    carries,
    deviation,
    count,
    landed,
    moved,
    key0,
    key1,
    s,
    step,
    tau,
):
    """Draw the molecules of species s that leave particle i during tau; they are put into landed.

    ``landed`` has shape (threads, n). ``moved`` (n, 2) takes the mean number that should leave,
    and how much of it the particle does not hold.
    """
    own = deviation[i, s]
    mean = 0.0
    for k in range(start[i], split[i]):
        j = neighbours[k]
        part = outflow(own_shift[k], its_shift[k], own, deviation[j, s])
        mean += carries[group[j], s] * part
    mean *= carries[group[i], s] * tau
    held = count[i, s]
    moved[i, 0] = mean
    moved[i, 1] = max(0.0, mean - held)
    if mean == 0.0 or held == 0:
        return
    c0, c1, c2 = np.uint64(id[i]), np.uint64(step), np.uint64(s)
    going, block = binomial(held, mean / held, c0, c1, c2, 0, key0, key1)
    count[i, s] -= going
    low, high = 0.0, 0.0
    for k in range(start[i], split[i]):
        if going > 0:
            j = neighbours[k]
            part = outflow(own_shift[k], its_shift[k], own, deviation[j, s])
            high += tau * carries[group[j], s] * part
            number, block = conditional_binomial(
                going, low, high, mean, c0, c1, c2, block, key0, key1
            )
            low = high
            going -= number
            scatter_add(landed, j, number)
    count[i, s] += going  # what rounding of the sums has left over


@particle_loop
def receive(i, s, landed, count):
    """Give particle i what the others have sent."""
    for thread in range(landed.shape[0]):
        count[i, s] += landed[thread, i]
        landed[thread, i] = 0
