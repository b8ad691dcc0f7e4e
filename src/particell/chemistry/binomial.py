r"""Exact samplers of the binomial and the Poisson law, drawing from a Philox stream.

Small means are sampled by inversion of the cumulative distribution, large ones by transformed
rejection with squeeze, whose cost does not grow with the mean (algorithms BTRS and PTRS of
Hörmann). Both are exact up to the 53 bits of the uniform numbers; there is no normal
approximation anywhere. A multinomial is a chain of conditional binomials
(:func:`conditional_binomial`).

Every sampler takes a counter ``(c0, c1, c2, block)`` and a key and returns the value and the next
free block, so that a particle draws as many numbers as it needs from a stream of its own.

References
----------
Hörmann, "The generation of binomial random variates", J. Stat. Comput. Simul. 46 (1993) 101;
Hörmann, "The transformed rejection method for generating Poisson random variables",
Insur. Math. Econ. 12 (1993) 39; Devroye, Non-Uniform Random Variate Generation (1986), III.2.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.philox import philox, uniform53

#: Mean from which rejection is used; its hat is proven for means of ten and more.
REJECTION_MEAN = 10.0
_HALF_LOG_TWO_PI = 0.9189385332046727


@njit(error_model="numpy")
def two_uniforms(c0, c1, c2, block, k0, k1):
    """Two uniform numbers of 53 bits: one Philox block."""
    w0, w1, w2, w3 = philox(c0, c1, c2, np.uint64(block), k0, k1)
    return uniform53(w0, w1), uniform53(w2, w3)


@njit(error_model="numpy")
def stirling_tail(k):
    """ln k! minus Stirling's formula in the form sqrt(2π) (k+1)^(k+½) e^-(k+1)."""
    a = k + 1.0
    if k < 10.0:
        return math.lgamma(a) - (_HALF_LOG_TWO_PI + (k + 0.5) * math.log(a) - a)
    square = 1.0 / (a * a)
    return (1.0 / 12.0 - (1.0 / 360.0 - square / 1260.0) * square) / a


@njit(error_model="numpy")
def binomial(n, p, c0, c1, c2, block, k0, k1):
    """Number of successes in n independent trials of probability p, and the next free block."""
    # one function, in which nothing is called from two places: it compiles in half the time
    if n <= 0 or p <= 0.0:
        return np.int64(0), block
    if p >= 1.0:
        return np.int64(n), block
    small = min(p, 1.0 - p)
    r = small / (1.0 - small)
    invert = n * small < REJECTION_MEAN
    deviation = math.sqrt(n * small * (1.0 - small))
    b = 1.15 + 2.53 * deviation
    a = -0.0873 + 0.0248 * b + 0.01 * small
    center = n * small + 0.5
    squeeze = 0.92 - 4.2 / b
    k = 0.0
    accepted = False
    while not accepted:
        u, v = two_uniforms(c0, c1, c2, block, k0, k1)
        block += 1
        if invert:  # the smallest k with P(K <= k) > u
            probability = math.exp(n * math.log1p(-small))
            while u > probability and k < n:
                u -= probability
                k += 1.0
                probability *= r * (n - k + 1.0) / k
            accepted = True
        else:  # BTRS, for n p >= 10
            u -= 0.5
            us = 0.5 - abs(u)
            k = math.floor((2.0 * a / us + b) * u + center)
            accepted = us >= 0.07 and v <= squeeze
            if not accepted and 0.0 <= k <= n:
                mode = math.floor((n + 1) * small)
                scale = (2.83 + 5.1 / b) * deviation
                bound = (
                    (mode + 0.5) * math.log((mode + 1.0) / (r * (n - mode + 1.0)))
                    + (n + 1.0) * math.log((n - mode + 1.0) / (n - k + 1.0))
                    + (k + 0.5) * math.log(r * (n - k + 1.0) / (k + 1.0))
                )
                for term in range(4):
                    z = mode if term < 2 else k
                    z = z if term % 2 == 0 else n - z
                    sign = 1.0 if term < 2 else -1.0
                    bound += sign * stirling_tail(z)
                accepted = math.log(v * scale / (a / (us * us) + b)) <= bound
    successes = np.int64(k)
    if p > 0.5:
        successes = n - successes
    return successes, block


@njit(error_model="numpy")
def conditional_binomial(number, low, high, scale, c0, c1, c2, block, k0, k1):
    """One link of a multinomial: how many of ``number`` fall between low and high.

    All of them lie between ``low`` and ``scale`` of a cumulative table.
    """
    if high <= low:
        return np.int64(0), block
    return binomial(number, (high - low) / (scale - low), c0, c1, c2, block, k0, k1)


@njit(error_model="numpy")
def _poisson_inversion(mean, u):
    probability = math.exp(-mean)
    k = 0
    while u > probability and k < 200:
        u -= probability
        k += 1
        probability *= mean / k
    return k


@njit(error_model="numpy")
def poisson(mean, c0, c1, c2, block, k0, k1):
    """A Poisson number of the given mean (inversion, or PTRS), and the next free block."""
    if mean <= 0.0:
        return np.int64(0), block
    if mean < REJECTION_MEAN:
        u, _ = two_uniforms(c0, c1, c2, block, k0, k1)
        return np.int64(_poisson_inversion(mean, u)), block + 1
    b = 0.931 + 2.53 * math.sqrt(mean)
    a = -0.059 + 0.02483 * b
    inverse_scale = 1.1239 + 1.1328 / (b - 3.4)
    squeeze = 0.9277 - 3.6224 / (b - 2.0)
    logarithm = math.log(mean)
    k = 0.0
    accepted = False
    while not accepted:
        u, v = two_uniforms(c0, c1, c2, block, k0, k1)
        block += 1
        u -= 0.5
        us = 0.5 - abs(u)
        k = math.floor((2.0 * a / us + b) * u + mean + 0.43)
        if us >= 0.07 and v <= squeeze:
            accepted = True
        elif k >= 0.0 and not (us < 0.013 and v > us):
            left = math.log(v * inverse_scale / (a / (us * us) + b))
            accepted = left <= k * logarithm - mean - math.lgamma(k + 1.0)
    return np.int64(k), block


@njit(error_model="numpy")
def stochastic_round(value, c0, c1, c2, k0, k1):
    """A whole number of mean ``value``: its floor, or one more with the fraction's probability."""
    u, _ = two_uniforms(c0, c1, c2, 0, k0, k1)
    return np.int64(math.floor(value + u))
