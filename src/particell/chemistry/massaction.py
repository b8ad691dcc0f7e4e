r"""Deterministic reactions of concentrations, each particle well mixed and sub-stepped.

.. math:: \frac{dC_s}{dt} = \sum_r \nu_{rs}\, r_r(C), \qquad r_r = k_r \prod C^{\text{order}},

or a user-given rate law. The kinetics may be stiff and must not limit the flow's step: every
particle integrates its own equations over the step, with an estimated error of each sub-step below
1e-6 C + 1e-9 max C. One explicit step of Dormand & Prince's pair (fifth order, error by the fourth)
over the whole time is tried first. Where that is not accurate enough, the Rosenbrock method RODAS3
(four stages, third order, L-stable, an embedded second-order solution) chooses sub-steps.
Its Jacobian is exact for mass action and by differences for user-given laws; either way
stoichiometric invariants are kept to round-off. A sub-step that would make a concentration negative
is halved.

References
----------
Dormand & Prince, J. Comput. Appl. Math. 6 (1980) 19; Sandu, Verwer, Blom, Spee, Carmichael & Potra,
Atmos. Environ. 31 (1997) 3459 (RODAS3); Hairer & Wanner, Solving Ordinary Differential Equations II
(1996), IV.7.
"""

from __future__ import annotations

import math
from typing import Any

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
#: Dormand & Prince's pair: row m makes the argument of stage m + 2, the last one the new value.
STAGES = np.array(
    [
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
#: New value minus that of the embedded fourth order.
ERROR = np.array(
    [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40],
)
#: These functions are called from compiled code only: no wrappers for Python need compiling.
INNER: Any = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def work_columns(species: int, reactions: int) -> int:
    """Length of a lane's row of scratch memory: see :func:`integrate`."""
    return species * species + 8 * species + reactions


@njit(**INNER)
def reaction_rate(r, w, at, n, k, reactants, law, choose):
    """Rate of reaction r in mol/m³/s, of the concentrations at ``w[at:at+n]``."""
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            return choose(law[r] - 1, w[at : at + n], k)
    rate = k
    for f in range(reactants.shape[1]):
        if reactants[r, f] >= 0:
            rate *= w[at + reactants[r, f]]
    return rate


@njit(**INNER)
def rate_slope(r, s, w, n, k, size, reactants, law, choose):
    """Derivative of the rate of reaction r with respect to species s at ``w[0:n]``."""
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            kept = w[s]
            step = 1e-7 * max(kept, 1e-3 * size)
            low = choose(law[r] - 1, w[0:n], k)
            w[s] = kept + step
            high = choose(law[r] - 1, w[0:n], k)
            w[s] = kept
            return (high - low) / step
    slope = 0.0
    for f in range(reactants.shape[1]):
        if reactants[r, f] == s:
            product = k
            for other in range(reactants.shape[1]):
                if other != f and reactants[r, other] >= 0:
                    product *= w[reactants[r, other]]
            slope += product
    return slope


@njit(**INNER)
def explicit_step(w, n, tau, reactants, net, law, choose):
    """Try one explicit step over tau: 1 where it is accurate, 0 where nothing reacts, else -1.

    The lane's row of scratch memory w is that of :func:`integrate`, with seven stages and the
    argument of the rates where that one has its matrix. Where the step is not accurate the
    concentrations are left as they were.
    """
    argument, rates = 8 * n, 8 * n + n * n
    size = 0.0
    for s in range(n):
        size = max(size, w[s])
        w[argument + s] = w[s]
    for stage in range(7):
        u = (stage + 1) * n
        for s in range(n):
            w[u + s] = 0.0
        for r in range(len(net)):
            k = w[rates + r]
            if k > 0.0:
                value = tau * reaction_rate(r, w, argument, n, k, reactants, law, choose)
                for s in range(n):
                    w[u + s] += net[r, s] * value
        if stage == 0:
            fastest = 0.0
            for s in range(n):
                fastest = max(fastest, abs(w[n + s]))
                if not abs(w[n + s]) < math.inf:  # max() may overlook a NaN
                    return -1
            if fastest == 0.0:
                return 0
            if size == 0.0:
                size = fastest
        if stage < 6:
            for s in range(n):
                value = w[s]
                for earlier in range(stage + 1):
                    value += STAGES[stage, earlier] * w[(earlier + 1) * n + s]
                w[argument + s] = value
    for s in range(n):
        new = w[argument + s]
        error = 0.0
        for stage in range(7):
            error += ERROR[stage] * w[(stage + 1) * n + s]
        tolerance = RELATIVE_TOLERANCE * max(w[s], abs(new)) + ABSOLUTE_TOLERANCE * size
        if not (abs(error) <= tolerance and new >= -ROUND_OFF * size):
            return -1
    for s in range(n):
        w[s] = max(w[argument + s], 0.0)
    return 1


@njit(**INNER)
def integrate(w, n, tau, reactants, net, law, choose):
    """Integrate the lane's concentrations over tau; the sub-steps, -1 where it does not succeed.

    The lane's row of scratch memory w holds the concentrations, four stages, the argument of the
    rates (in the end the new concentrations), the pivots, from 8 n on the matrix, and the rate
    constants (0 where a reaction does not take place).

    One function without repetitions, as Numba compiles every function and every call of it anew:
    the stages share one text, and the matrix is made when the first one's rates are known.
    """
    argument, pivots, matrix, rates = 5 * n, 6 * n, 8 * n, 8 * n + n * n
    size = 0.0
    for s in range(n):
        size = max(size, w[s])
    left = tau
    h = tau
    steps = 0
    while left > 0.0 and steps < MOST_SUBSTEPS:
        steps += 1
        last = h >= left
        if last:
            h = left
        for stage in range(4):
            u = (stage + 1) * n
            for s in range(n):
                value = w[s]
                if stage >= 2:
                    value += 2.0 * w[n + s]
                if stage == 3:
                    value += w[3 * n + s]
                w[argument + s] = value
                w[u + s] = 0.0
            for r in range(len(net)):
                k = w[rates + r]
                if k > 0.0:
                    value = reaction_rate(r, w, argument, n, k, reactants, law, choose)
                    for s in range(n):
                        w[u + s] += net[r, s] * value
            if stage == 0:
                if steps == 1:
                    fastest = 0.0
                    for s in range(n):
                        fastest = max(fastest, abs(w[u + s]))
                        if not abs(w[u + s]) < math.inf:
                            return -1
                    if fastest == 0.0:
                        return 0
                    if size == 0.0:
                        size = fastest * tau
                # 2/h - J (RODAS3 has γ = 1/2) and its LU factors, with row exchanges, in place
                for k in range(n * n):
                    w[matrix + k] = 0.0
                for s in range(n):
                    w[matrix + s * n + s] = 2.0 / h
                for r in range(len(net)):
                    k = w[rates + r]
                    if k > 0.0:
                        for s in range(n):
                            slope = rate_slope(r, s, w, n, k, size, reactants, law, choose)
                            for row in range(n):
                                w[matrix + row * n + s] -= net[r, row] * slope
                for k in range(n):
                    best = k
                    diagonal = matrix + k * n
                    for row in range(k + 1, n):
                        if abs(w[matrix + row * n + k]) > abs(w[matrix + best * n + k]):
                            best = row
                    w[pivots + k] = best
                    for col in range(n):
                        kept = w[diagonal + col]
                        w[diagonal + col] = w[matrix + best * n + col]
                        w[matrix + best * n + col] = kept
                    for row in range(k + 1, n):
                        factor = w[matrix + row * n + k] / w[diagonal + k]
                        w[matrix + row * n + k] = factor
                        for col in range(k + 1, n):
                            w[matrix + row * n + col] -= factor * w[diagonal + col]
            for s in range(n):
                earlier = 4.0 * w[n + s] if stage == 1 else 0.0
                if stage >= 2:
                    earlier = w[n + s] - w[2 * n + s]
                if stage == 3:
                    earlier -= 8.0 / 3.0 * w[3 * n + s]
                w[u + s] += earlier / h
            for k in range(n):
                best = u + int(w[pivots + k])
                kept = w[u + k]
                w[u + k] = w[best]
                w[best] = kept
            for k in range(n):
                for row in range(k + 1, n):
                    w[u + row] -= w[matrix + row * n + k] * w[u + k]
            for back in range(n):
                k = n - 1 - back
                w[u + k] /= w[matrix + k * n + k]
                for row in range(k):
                    w[u + row] -= w[matrix + row * n + k] * w[u + k]
        error = 0.0
        for s in range(n):
            new = w[argument + s] + w[4 * n + s]
            w[argument + s] = new
            tolerance = RELATIVE_TOLERANCE * max(w[s], abs(new)) + ABSOLUTE_TOLERANCE * size
            error = max(error, abs(w[4 * n + s]) / tolerance)
            if not new >= -ROUND_OFF * size:
                error = math.inf
        if error <= 1.0:
            for s in range(n):
                w[s] = max(w[argument + s], 0.0)
            left = 0.0 if last else left - h
            h *= min(6.0, 0.9 * max(error, 1e-6) ** (-1.0 / 3.0))
        elif error < math.inf:
            h *= max(0.1, 0.9 * error ** (-1.0 / 3.0))
        else:
            h *= 0.5
    return steps if left == 0.0 else -1


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
    partner,
    takes_part,
    continuous,
    amount,
    work,
    substeps,
    *,
    LAW,
    SWITCH,
):
    """Reactions during tau in the particles of a lane, one after the other.

    ``LAW(m, C, k)`` is the m-th user-given rate law; None where there is none.
    ``substeps[lane]`` is the largest number of sub-steps, -1 - i where the integration failed in
    particle i; the rest of the lane is left then.
    With ``SWITCH`` species that are molecules in this particle, and what involves them, are left
    out: see :mod:`particell.chemistry.switching`.
    """
    row = np.int64(lane)
    lanes = work.shape[0]
    w = work[row]
    most = 0
    failed = -1
    n = amount.shape[1]
    rates = 8 * n + n * n
    for i in range(row * rows // lanes, (row + 1) * rows // lanes):
        if failed >= 0:
            break
        for s in range(n):
            w[s] = amount[i, s] / volume[i]
        for r in range(rate.shape[1]):
            w[rates + r] = rate[group[i], r]
        if SWITCH:
            for s in range(n):
                if partner[s] >= 0 and continuous[i, partner[s]] == 0:
                    w[s] = 0.0
                    for r in range(rate.shape[1]):
                        if takes_part[r, s] != 0:
                            w[rates + r] = 0.0
        steps = explicit_step(w, n, tau, reactants, net, law, LAW)
        if steps < 0:
            steps = integrate(w, n, tau, reactants, net, law, LAW)
        if steps < 0:
            failed = i
        most = max(most, steps)
        if steps != 0:
            for s in range(n):
                if SWITCH and partner[s] >= 0 and continuous[i, max(partner[s], 0)] == 0:
                    continue
                change = w[s] - amount[i, s] / volume[i]
                amount[i, s] = max(0.0, amount[i, s] + change * volume[i])
    substeps[row] = -1 - failed if failed >= 0 else most
