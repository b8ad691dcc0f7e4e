r"""Deterministic reactions of concentrations, each particle well mixed, with sub-steps of their own.

.. math:: \frac{dC_s}{dt} = \sum_r \nu_{rs}\, r_r(C), \qquad r_r = k_r \prod C^{\text{order}},

or a user-given rate law. The kinetics may be stiff and must not limit the flow's step: every
particle integrates its own equations over the step with the Rosenbrock method RODAS3 (four stages,
third order, L-stable, an embedded second-order solution), whose sub-steps are chosen so that the
estimated error of each stays below 1e-6 C + 1e-9 max C. The Jacobian is exact for mass action and
by differences for user-given laws; either way stoichiometric invariants are kept to round-off. A
sub-step that would make a concentration negative is halved.

References
----------
Sandu, Verwer, Blom, Spee, Carmichael & Potra, Atmos. Environ. 31 (1997) 3459 (RODAS3); Hairer &
Wanner, Solving Ordinary Differential Equations II (1996), IV.7.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.loop import particle_loop

RELATIVE_TOLERANCE = 1e-6
#: Absolute tolerance in units of the largest concentration of the particle.
ABSOLUTE_TOLERANCE = 1e-9
#: Negative concentrations down to this part of the largest are round-off, and set to zero.
ROUND_OFF = 1e-15
#: Lanes share the particles between them; each has one row of scratch memory.
LANES = 512
MOST_SUBSTEPS = 1_000_000


def work_columns(species: int) -> int:
    """Length of a lane's row of scratch memory: matrix, four stages, four vectors."""
    return species * species + 8 * species


@njit
def reaction_rate(r, c, k, reactants, law, choose):
    """Rate of reaction r in mol/m³/s."""
    if choose is not None:  # decided at compile time
        if law[r] > 0:
            return choose(law[r] - 1, c, k)
    rate = k
    for f in range(reactants.shape[1]):
        if reactants[r, f] >= 0:
            rate *= c[reactants[r, f]]
    return rate


@njit
def derivative(c, g, rate, reactants, net, law, choose, out):
    """dC/dt of all species into ``out``; the largest |dC/dt|."""
    for s in range(len(c)):
        out[s] = 0.0
    for r in range(rate.shape[1]):
        if rate[g, r] > 0.0:
            value = reaction_rate(r, c, rate[g, r], reactants, law, choose)
            for s in range(len(c)):
                out[s] += net[r, s] * value
    largest = 0.0
    for s in range(len(c)):
        largest = max(largest, abs(out[s]))
    return largest


@njit
def rate_slope(r, s, c, k, size, reactants, law, choose):
    """Derivative of the rate of reaction r with respect to species s."""
    if choose is not None:
        if law[r] > 0:
            kept = c[s]
            step = 1e-7 * max(kept, 1e-3 * size)
            low = choose(law[r] - 1, c, k)
            c[s] = kept + step
            high = choose(law[r] - 1, c, k)
            c[s] = kept
            return (high - low) / step
    slope = 0.0
    for f in range(reactants.shape[1]):
        if reactants[r, f] == s:
            product = k
            for other in range(reactants.shape[1]):
                if other != f and reactants[r, other] >= 0:
                    product *= c[reactants[r, other]]
            slope += product
    return slope


@njit
def system_matrix(c, g, h, size, rate, reactants, net, law, choose, matrix):
    """The matrix 2/h - J (RODAS3 has γ = 1/2) by rows into ``matrix``."""
    n = len(c)
    for k in range(n * n):
        matrix[k] = 0.0
    for s in range(n):
        matrix[s * n + s] = 2.0 / h
    for r in range(rate.shape[1]):
        if rate[g, r] > 0.0:
            for s in range(n):
                slope = rate_slope(r, s, c, rate[g, r], size, reactants, law, choose)
                if slope != 0.0:
                    for row in range(n):
                        matrix[row * n + s] -= net[r, row] * slope


@njit
def factorise(matrix, pivots, n):
    """LU decomposition with row exchanges, in place; ``pivots`` is a float array."""
    for k in range(n):
        best = k
        for row in range(k + 1, n):
            if abs(matrix[row * n + k]) > abs(matrix[best * n + k]):
                best = row
        pivots[k] = best
        if best != k:
            for col in range(n):
                kept = matrix[k * n + col]
                matrix[k * n + col] = matrix[best * n + col]
                matrix[best * n + col] = kept
        inverse = 1.0 / matrix[k * n + k]
        for row in range(k + 1, n):
            matrix[row * n + k] *= inverse
            for col in range(k + 1, n):
                matrix[row * n + col] -= matrix[row * n + k] * matrix[k * n + col]


@njit
def solve(matrix, pivots, n, b):
    """Solve in place with the factors of :func:`factorise`."""
    for k in range(n):
        best = int(pivots[k])
        kept = b[k]
        b[k] = b[best]
        b[best] = kept
    for k in range(n):
        for row in range(k + 1, n):
            b[row] -= matrix[row * n + k] * b[k]
    for back in range(n):
        k = n - 1 - back
        b[k] /= matrix[k * n + k]
        for row in range(k):
            b[row] -= matrix[row * n + k] * b[k]


@njit
def rodas3(c, g, h, size, rate, reactants, net, law, choose, work):
    """One sub-step: the new concentrations in ``work``; the error in units of the tolerance.

    A result with a negative concentration has an infinite error.
    """
    n = len(c)
    matrix = work[: n * n]
    stages = work[n * n :]
    u1, u2, u3 = stages[:n], stages[n : 2 * n], stages[2 * n : 3 * n]
    u4, pivots = stages[3 * n : 4 * n], stages[4 * n : 5 * n]
    argument, new = stages[5 * n : 6 * n], stages[6 * n : 7 * n]
    system_matrix(c, g, h, size, rate, reactants, net, law, choose, matrix)
    factorise(matrix, pivots, n)
    derivative(c, g, rate, reactants, net, law, choose, u1)
    for s in range(n):
        u2[s] = u1[s]
    solve(matrix, pivots, n, u1)
    for s in range(n):
        u2[s] += 4.0 / h * u1[s]
    solve(matrix, pivots, n, u2)
    for s in range(n):
        argument[s] = c[s] + 2.0 * u1[s]
    derivative(argument, g, rate, reactants, net, law, choose, u3)
    for s in range(n):
        u3[s] += (u1[s] - u2[s]) / h
    solve(matrix, pivots, n, u3)
    for s in range(n):
        argument[s] = c[s] + 2.0 * u1[s] + u3[s]
    derivative(argument, g, rate, reactants, net, law, choose, u4)
    for s in range(n):
        u4[s] += (u1[s] - u2[s] - 8.0 / 3.0 * u3[s]) / h
    solve(matrix, pivots, n, u4)
    error = 0.0
    for s in range(n):
        new[s] = c[s] + 2.0 * u1[s] + u3[s] + u4[s]
        tolerance = RELATIVE_TOLERANCE * max(abs(c[s]), abs(new[s])) + ABSOLUTE_TOLERANCE * size
        error = max(error, abs(u4[s]) / tolerance)
        if not new[s] >= -ROUND_OFF * size:
            error = math.inf
    return error


@njit
def integrate(c, g, tau, rate, reactants, net, law, choose, work):
    """Integrate ``c`` over tau in place; the number of sub-steps, -1 where it does not succeed."""
    n = len(c)
    new = work[n * n + 6 * n : n * n + 7 * n]
    fastest = derivative(c, g, rate, reactants, net, law, choose, new)
    if fastest == 0.0:
        return 0
    size = fastest * tau
    for s in range(n):
        size = max(size, c[s])
    left = tau
    h = tau
    steps = 0
    while left > 0.0 and steps < MOST_SUBSTEPS:
        steps += 1
        last = h >= left
        if last:
            h = left
        error = rodas3(c, g, h, size, rate, reactants, net, law, choose, work)
        if error <= 1.0:
            for s in range(n):
                c[s] = max(new[s], 0.0)
            left = 0.0 if last else left - h
            h *= min(6.0, 0.9 * max(error, 1e-6) ** (-1.0 / 3.0))
        elif error < math.inf:
            h *= max(0.1, 0.9 * error ** (-1.0 / 3.0))
        else:
            h *= 0.5
    return steps if left == 0.0 else -1


@njit
def react_lane(
    lane,
    rows,
    tau,
    group,
    volume,
    rate,
    reactants,
    net,
    law,
    choose,
    concentration,
    amount,
    work,
    substeps,
):
    """The particles of one lane; ``substeps[lane]`` is the largest number of sub-steps."""
    lane = np.int64(lane)
    lanes = work.shape[0]
    most = 0
    failed = False
    species = amount.shape[1]
    for i in range(lane * rows // lanes, (lane + 1) * rows // lanes):
        for s in range(species):
            concentration[i, s] = amount[i, s] / volume[i]
        steps = integrate(
            concentration[i], group[i], tau, rate, reactants, net, law, choose, work[lane]
        )
        failed = failed or steps < 0
        most = max(most, steps)
        if steps != 0:
            for s in range(species):
                change = concentration[i, s] - amount[i, s] / volume[i]
                amount[i, s] = max(0.0, amount[i, s] + change * volume[i])
    substeps[lane] = -1 if failed else most


@particle_loop
def react(
    lane,
    rows,
    tau,
    group,
    volume,
    rate,
    reactants,
    net,
    law,
    concentration,
    amount,
    work,
    substeps,
):
    """Mass action during tau in all particles of a lane."""
    react_lane(
        lane,
        rows,
        tau,
        group,
        volume,
        rate,
        reactants,
        net,
        law,
        None,
        concentration,
        amount,
        work,
        substeps,
    )


@particle_loop
def react_with_laws(
    lane,
    rows,
    tau,
    group,
    volume,
    rate,
    reactants,
    net,
    law,
    concentration,
    amount,
    work,
    substeps,
    *,
    LAW,
):
    """The same with user-given rate laws: ``LAW(m, C, k)`` is the m-th of them."""
    react_lane(
        lane,
        rows,
        tau,
        group,
        volume,
        rate,
        reactants,
        net,
        law,
        LAW,
        concentration,
        amount,
        work,
        substeps,
    )
