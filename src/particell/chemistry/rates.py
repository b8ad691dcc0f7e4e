r"""Rates of the reactions of one well-mixed particle, and what changes its components.

.. math:: \frac{dC_s}{dt} = \sum_r \nu_{rs}\, r_r(C), \qquad r_r = k_r \prod C^{\text{order}},

or a user-given rate law. One that does not vanish where what it consumes runs out is multiplied by
:math:`C/(C+\epsilon)`, with :math:`\epsilon` 10⁻²⁴ of the largest concentration: what is consumed
falls to zero at the place where the law brings it there and stays, or is used up as fast as it
comes.

Concentrations and all that is made of them stand in a row of scratch memory, ``w``.
"""

from __future__ import annotations

from typing import Any

from numba import njit

#: Where rate laws that do not vanish by themselves do so, in units of the largest concentration.
EDGE = 1e-24
#: These functions are called from compiled code only: no wrappers for Python need compiling.
INNER: Any = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def work_columns(components: int, reactions: int) -> int:
    """Length of a lane's row of scratch memory.

    With n components: the values, seven stages (of which RODAS3 uses four, then the argument of its
    rates, the pivots and a copy of the first stage), the explicit pair's argument or RODAS3's
    matrix (n²), one rate constant for each reaction (0 where it does not take place), and for each
    component the largest value so far, the level to stop at (infinite for none), the sum of the
    sizes of what changes it, and the round-off of a step.
    """
    return components**2 + 12 * components + reactions


@njit(**INNER)
def law_value(r, w, at, n, k, law, choose):
    """The user-given rate of reaction r as it stands; 0 where it has none."""
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            return choose(law[r] - 1, w[at : at + n], k)
    return 0.0


@njit(**INNER)
def reaction_rate(r, w, at, n, k, edge, reactants, net, law, choose):
    """Rate of reaction r in mol/m³/s, of the concentrations of n species from ``w[at]`` on."""
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            rate = choose(law[r] - 1, w[at : at + n], k)
            for s in range(n):
                if net[r, s] * rate < 0.0:
                    c = w[at + s]
                    rate *= c / (c + edge) if c > 0.0 else 0.0
            return rate
    rate = k
    for f in range(reactants.shape[1]):
        if reactants[r, f] >= 0:
            rate *= w[at + reactants[r, f]]
    return rate


@njit(**INNER)
def rate_slope(r, s, w, n, k, edge, step, reactants, net, law, choose):
    """Derivative of the rate of reaction r with respect to species s at ``w[0:n]``.

    ``step`` is the difference that user-given laws are evaluated over.
    """
    if choose is not None:  # noqa: SIM102 - decided at compile time
        if law[r] > 0:
            kept = w[s]
            low = choose(law[r] - 1, w[0:n], k)
            w[s] = kept + step
            high = choose(law[r] - 1, w[0:n], k)
            w[s] = kept
            slope = (high - low) / (kept + step - kept)
            for other in range(n):
                if net[r, other] * low < 0.0:
                    c = w[other]
                    part = c / (c + edge) if c > 0.0 else 0.0
                    slope *= part
                    if other == s:
                        slope += low * edge / ((c + edge) * (c + edge))
                    low *= part
            return slope
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
def derivatives(w, at, out, gross, n, species, edge, reactants, net, law, choose):
    """The components' rates of change at ``w[at:at+species]``, to ``w[out:out+n]``.

    With ``gross >= 0`` the sums of the sizes of what changes them too, to ``w[gross:gross+n]``.
    """
    rates = 8 * n + n * n
    for s in range(n):
        w[out + s] = 0.0
        if gross >= 0:
            w[gross + s] = 0.0
    for r in range(len(net)):
        k = w[rates + r]
        if k > 0.0:
            rate = reaction_rate(r, w, at, species, k, edge, reactants, net, law, choose)
            for s in range(n):
                w[out + s] += net[r, s] * rate
                if gross >= 0:
                    w[gross + s] += abs(net[r, s] * rate)
