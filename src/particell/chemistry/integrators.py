r"""Rate equations of one well-mixed particle: steps, their errors, and where to stop.

The kinetics (:mod:`particell.chemistry.rates`) may be stiff and must not limit the flow's step:
every particle integrates its own equations, with an estimated error of each sub-step below

.. math:: 10^{-6}\,C_s + 10^{-9}\,\max_t C_s,

the largest value that *this species* had in the particle during the step: what else is there does
not matter. Sub-steps are explicit, of Dormand & Prince's pair (fifth order, error by the fourth),
with the whole time tried first, but never beyond the pair's stability for the fastest loss of a
species (what takes it away, divided by what there is). Where many would be needed for stability,
the Rosenbrock method RODAS3 (four stages, third order, L-stable, an embedded
second-order solution) goes on. Its Jacobian is exact for mass action and by differences for
user-given laws; either way stoichiometric invariants are kept to round-off.

A sub-step that would make a concentration negative, beyond round-off and 10⁻²⁴ of the particle's
largest, is halved.

**Components beyond the species.** One more component may follow the species, on which nothing
depends: the integral of the propensities of :mod:`particell.chemistry.hybrid`. Integration stops
where it reaches its target.

References
----------
Dormand & Prince, J. Comput. Appl. Math. 6 (1980) 19; Sandu, Verwer, Blom, Spee, Carmichael & Potra,
Atmos. Environ. 31 (1997) 3459 (RODAS3); Hairer & Wanner, Solving Ordinary Differential Equations II
(1996), IV.7.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.chemistry.rates import EDGE, INNER, derivatives, rate_slope

RELATIVE_TOLERANCE = 1e-6
#: Absolute tolerance in units of the largest value that the species had during the step.
ABSOLUTE_TOLERANCE = 1e-9
#: Below this part of the particle's largest concentration nothing is resolved.
UNRESOLVED = 1e-20
#: What is less, in mol/m³, is nothing (6e-77 molecules in a cubic metre).
NOTHING = 1e-100
#: What is less than this part of what could react in the time left is a residue.
RESIDUE = 1e-15
#: Negative concentrations down to this part of the species' largest are round-off, and set to zero.
#: So are those down to ``EDGE`` of the particle's largest: what comes from the start of a chain of
#: six species begins as a power of the step that a method of third order need not make positive.
ROUND_OFF = 1e-15
#: Error of sums of rates that cancel, in units of their sizes.
CANCELLATION = 1e-14
#: Step times fastest loss that an explicit step may have: stability ends at 3.3, and here what
#: is off falls to a quarter in each step.
STABLE = 2.5
#: Explicit steps that stability may ask for; beyond it the implicit method goes on.
MOST_EXPLICIT = 60
#: Explicit steps, whatever for.
MOST_TRIED = 500
MOST_SUBSTEPS = 1_000_000
#: Sub-steps that have been halved to this part of the time are in vain: rates are not finite.
SMALLEST = 1e-40
#: A stop is found to this accuracy: of the integral of propensities, or relative of a level.
STOP_ACCURACY = 1e-7
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


@njit(**INNER)
def tolerance(now, new, largest, size):
    """Error that a component may have after a sub-step."""
    relative = RELATIVE_TOLERANCE * max(now, abs(new)) + ABSOLUTE_TOLERANCE * largest
    return relative + UNRESOLVED * size + RELATIVE_TOLERANCE * NOTHING


@njit(**INNER)
def explicit_step(w, n, species, h, size, reactants, net, law, choose):
    """One explicit step of h: its error in units of what is allowed.

    The rates of change at its beginning are known; the new values are left where the argument is.
    """
    argument = 8 * n
    largest = argument + n * n + len(net)
    gross, none = largest + 2 * n, -n  # a literal -1 would have the function compiled anew
    edge = EDGE * size
    for stage in range(6):
        for s in range(n):
            value = 0.0
            for earlier in range(stage + 1):
                value += STAGES[stage, earlier] * w[(earlier + 1) * n + s]
            w[argument + s] = w[s] + h * value
        out = (stage + 2) * n
        derivatives(w, argument, out, none, n, species, edge, reactants, net, law, choose)
    worst = 0.0
    for s in range(n):
        new = w[argument + s]
        error = 0.0
        for stage in range(7):
            error += ERROR[stage] * w[(stage + 1) * n + s]
        noise = CANCELLATION * h * w[gross + s]
        worst = max(worst, abs(h * error) / (tolerance(w[s], new, w[largest + s], size) + noise))
        if not new >= -ROUND_OFF * w[largest + s] - noise - edge:
            worst = math.inf  # a NaN too
    return worst


@njit(**INNER)
def implicit_step(w, n, species, h, size, reactants, net, law, choose):
    """One step of h of RODAS3: its error in units of what is allowed.

    The rates of change at its beginning are known; the new values are left at ``w[5 * n]``.

    One function without repetitions, as Numba compiles every function and every call of it anew:
    the stages share one text.
    """
    argument, pivots, matrix = 5 * n, 6 * n, 8 * n
    rates = matrix + n * n
    largest = rates + len(net)
    gross, noise, none = largest + 2 * n, largest + 3 * n, -n
    edge = EDGE * size
    # 2/h - J (RODAS3 has γ = 1/2) and its LU factors, with row exchanges, in place
    for k in range(n * n):
        w[matrix + k] = 0.0
    for s in range(n):
        w[7 * n + s] = w[n + s]
        w[matrix + s * n + s] = 2.0 / h
    for r in range(len(net)):
        k = w[rates + r]
        if k > 0.0:
            for s in range(species):
                # user-given laws feel differences of what a step changes, or of what there is
                step = 1e-7 * max(w[s], h * abs(w[n + s])) + UNRESOLVED * size + NOTHING
                slope = rate_slope(r, s, w, species, k, edge, step, reactants, net, law, choose)
                for row in range(n):
                    w[matrix + row * n + s] -= net[r, row] * slope
    for s in range(n):
        w[noise + s] = CANCELLATION * 2.0 * w[gross + s] / abs(w[matrix + s * n + s])
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
    for stage in range(4):
        u = (stage + 1) * n
        if stage < 2:  # at the same place
            for s in range(n):
                w[u + s] = w[7 * n + s]
        else:
            for s in range(n):
                w[argument + s] = w[s] + 2.0 * w[n + s]
                if stage == 3:
                    w[argument + s] += w[3 * n + s]
            derivatives(w, argument, u, none, n, species, edge, reactants, net, law, choose)
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
    worst = 0.0
    for s in range(n):
        new = w[argument + s] + w[4 * n + s]
        w[argument + s] = new
        w[n + s] = w[7 * n + s]
        allowed = tolerance(w[s], new, w[largest + s], size) + w[noise + s]
        worst = max(worst, abs(w[4 * n + s]) / allowed)
        if not new >= -ROUND_OFF * w[largest + s] - w[noise + s] - edge:
            worst = math.inf
    return worst


@njit(**INNER)
def excess(w, at, n, species, target, levels):
    """How far the values at ``w[at]`` are beyond the target or a level; negative before them."""
    beyond = w[at + species] - target if n > species else -1.0
    for s in range(species):
        if w[levels + s] < math.inf:
            beyond = max(beyond, w[at + s] / w[levels + s] - 1.0)
    return beyond


@njit(**INNER)
def advance(w, n, species, left, h, target, reactants, net, law, choose):
    """Integrate the lane's values until the time ``left`` is used up, or to where to stop.

    That is where the component after the species (there is one if ``n > species``) reaches
    ``target``, or a species the level it has in the scratch memory. ``h`` is the step to try first.

    Returns
    -------
    tuple
        What is left of the time, the step to try next, and the number of sub-steps: negative where
        it did not succeed, -1 for rates that are not finite, -2 for too many sub-steps.
    """
    rates = 8 * n + n * n
    largest = rates + len(net)
    levels, gross, now = largest + n, largest + 2 * n, n - n
    steps = 0
    stiff = False
    fresh = False  # whether the rates of change are known
    searching = False  # for the step that ends where to stop, between low and high
    size, trial, limit, begin = 0.0, 0.0, 0.0, 0.0
    low, high, low_excess, high_excess = 0.0, 0.0, 0.0, 0.0
    side, tries, tried = 0, 0, 0
    going = left > 0.0
    while going:
        if not fresh:
            fresh = True
            size, fastest, loss = 0.0, 0.0, 0.0
            for s in range(species):
                size = max(size, w[s])
            derivatives(w, now, n, gross, n, species, EDGE * size, reactants, net, law, choose)
            for s in range(species):
                fastest = max(fastest, abs(w[n + s]))
            if size < RESIDUE * fastest * left < math.inf:
                # all that is left is a residue of what laws that do not vanish could take: they
                # end at the edge of that, not at the residue's, where it would be gone at once
                size = fastest * left
                derivatives(w, now, n, gross, n, species, EDGE * size, reactants, net, law, choose)
                fastest = 0.0
            for s in range(n):
                if not abs(w[n + s]) < math.inf:
                    return left, h, -1
                if s < species:
                    fastest = max(fastest, abs(w[n + s]))
                    if w[s] > 0.0:
                        loss = max(loss, 0.5 * (w[gross + s] - w[n + s]) / w[s])
            wait = math.inf
            if n > species and w[n + species] > 0.0:
                wait = max(0.0, target - w[species]) / w[n + species]
            if fastest == 0.0:  # then the propensities are constant as well
                if wait <= left:
                    w[species] = target
                    return left - wait, h, steps
                if n > species:
                    w[species] += left * w[n + species]
                return 0.0, h, steps
            if size == 0.0:
                size = fastest * left
            begin = excess(w, now, n, species, target, levels)
            limit = min(left, wait)
            trial = min(h, limit)
            if not stiff:
                if loss * limit > STABLE * MOST_EXPLICIT:
                    stiff = True
                    h, trial = left, limit
                elif loss * trial > STABLE:
                    trial = STABLE / loss
        if steps == MOST_SUBSTEPS:
            return left, h, -2
        if not trial > SMALLEST * left:
            return left, h, -1
        steps += 1
        if stiff:
            argument, power = 5 * n, -1.0 / 3.0
            error = implicit_step(w, n, species, trial, size, reactants, net, law, choose)
        else:
            argument, power = 8 * n, -0.2
            error = explicit_step(w, n, species, trial, size, reactants, net, law, choose)
            tried += 1
            if tried > MOST_TRIED and not searching:
                # with steps as long as these: tried with the whole time it may end where what
                # grows would be in equilibrium, an unstable one, with no error to be seen
                stiff = True
                continue
        if not searching and not error <= 1.0:
            trial *= max(0.1, 0.9 * error**power) if error < math.inf else 0.5
            h = trial
            continue
        over = excess(w, argument, n, species, target, levels)
        if abs(over) > STOP_ACCURACY and (searching or over > 0.0) and tries < 60:
            if not searching:
                searching = True
                tries, side = 0, 0
                low, low_excess = 0.0, begin
                high, high_excess = trial, over
            elif over > 0.0:  # the Illinois rule: an end that stays counts half
                high, high_excess = trial, over
                low_excess *= 0.5 if side > 0 else 1.0
                side = 1
            else:
                low, low_excess = trial, over
                high_excess *= 0.5 if side < 0 else 1.0
                side = -1
            tries += 1
            trial = high - high_excess * (high - low) / (high_excess - low_excess)
            continue
        for s in range(n):
            w[s] = w[argument + s] if w[argument + s] > NOTHING else 0.0
            w[largest + s] = max(w[largest + s], w[s])
        left = 0.0 if trial >= left else left - trial
        if not searching:
            grown = trial * min(6.0, 0.9 * max(error, 1e-6) ** power)
            h = max(h, grown) if trial < h else grown
        searching, fresh, tries = False, False, 0
        going = left > 0.0 and over < -STOP_ACCURACY
    return left, h, steps
