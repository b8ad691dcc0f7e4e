"""Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror & Shaw, SC'11).

A random number is a pure function of what it is for: the key is (seed, purpose), the counter is
(particle or pair, step). Nothing is carried along, so numbers do not depend on threads or order.

Words have 32 bits and are cut to that; what is put into one is held to it (:func:`check_word`)
where it comes from: ids in :class:`~particell.particles.Particles`, steps of the species in
:class:`~particell.chemistry.engine.Chemistry`. The noise of the flow takes steps of 64 bits, in two
words.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.loop import compiled
from particell.errors import InputError

# What a number is for; part of the key, so that no two uses share numbers.
PAIR_NOISE = 1
REACTION = 2
JUMP = 3
ROUNDING = 4
INITIAL = 5
SPONGE = 6
RESERVOIR = 8
CARRIAGE = 9
VELOCITY_SPREAD = 10

_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint64(0x9E3779B9)
_W1 = np.uint64(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)
_16 = np.uint64(16)
_LOW16 = np.uint64(0xFFFF)


@njit
def _round(c0, c1, c2, c3, k0, k1):
    p0 = _M0 * c0
    p1 = _M1 * c2
    return (p1 >> _32) ^ c1 ^ k0, p1 & _LOW, (p0 >> _32) ^ c3 ^ k1, p0 & _LOW


@njit
def _next(k0, k1):
    return (k0 + _W0) & _LOW, (k1 + _W1) & _LOW


@njit
def philox(c0, c1, c2, c3, k0, k1):
    """Four independent 32-bit words (as uint64) for a counter of four words and a key of two."""
    # written out: a loop in here would keep a loop over pairs from being vectorised. The masks tell
    # the compiler that the factors have 32 bits.
    c0, c1, c2, c3 = c0 & _LOW, c1 & _LOW, c2 & _LOW, c3 & _LOW
    k0, k1 = k0 & _LOW, k1 & _LOW
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    k0, k1 = _next(k0, k1)
    return _round(c0, c1, c2, c3, k0, k1)


#: The same, put into its caller whatever its size: a loop that calls is not vectorised.
inlined_philox = njit(inline="always")(philox.py_func)


def stream_key(seed: int, purpose: int) -> tuple[np.uint64, np.uint64]:
    """The key (two 32-bit words) of a purpose under a seed of at most 56 bits."""
    if not 0 <= seed < 2**56:
        raise InputError("seed", seed, "between 0 and 2**56 - 1")
    return np.uint64(seed & 0xFFFFFFFF), np.uint64((seed >> 32) | (purpose << 24))


@compiled
def _derived(key0, key1, first, second):
    w0, w1, _w2, _w3 = philox(np.uint64(first), np.uint64(second), _LOW, _LOW, key0, key1)
    return w0, w1


def part_key(key: tuple[np.uint64, np.uint64], first: int, second: int) -> tuple:
    """A key for a part (of two numbers) of a purpose, where a counter has no word left for it."""
    return tuple(np.uint64(word) for word in _derived(*key, first, second))


def check_word(what: str, number: int) -> None:
    """Refuse what does not fit into a word: other numbers would share its random numbers.

    Raises
    ------
    InputError
        Where it is not below 2^32.
    """
    if not 0 <= number < 2**32:
        raise InputError(what, number, "below 2**32: random numbers would be used twice")


@njit
def uniform32(word):
    """A number in the open interval (0, 1) from one 32-bit word."""
    return (np.float64(word) + 0.5) * 2.3283064365386963e-10


@njit
def uniform53(high, low):
    """A number in the open interval (0, 1) with 53 random bits, from two 32-bit words."""
    bits = np.float64(high) * 2097152.0 + np.float64(low >> np.uint64(11))
    # the largest ones would be rounded up to 1
    return min((bits + 0.5) * 1.1102230246251565e-16, 0.9999999999999999)


@njit
def bounded_normal4(word0, word1):
    """Zero mean, unit variance: the sum of four 16-bit uniforms (kurtosis 2.7)."""
    total = (word0 & _LOW16) + (word0 >> _16) + (word1 & _LOW16) + (word1 >> _16)
    return (np.float64(total) - 131070.0) * 2.6428997921303014e-05


@njit
def bounded_normal2(word):
    """Zero mean, unit variance: the sum of two 16-bit uniforms (kurtosis 2.4)."""
    total = (word & _LOW16) + (word >> _16)
    return (np.float64(total) - 65535.0) * 3.737624730023707e-05


@njit
def normal_pair(word0, word1):
    """Two independent standard normal numbers from two words (Box & Muller)."""
    radius = math.sqrt(-2.0 * math.log(uniform32(word0)))
    angle = 6.283185307179586 * uniform32(word1)
    return radius * math.cos(angle), radius * math.sin(angle)
