from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy import stats

from particell.compute import philox
from particell.compute.device import Device
from particell.compute.rounding import nearest_integer
from particell.particles import Particles

ONES = 0xFFFFFFFF


def block(*words):
    return tuple(int(w) for w in philox.philox(*(np.uint64(w) for w in words)))


def test_known_answers():
    """The vectors of Random123's kat_vectors for philox4x32-10."""
    assert block(0, 0, 0, 0, 0, 0) == (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)
    assert block(*[ONES] * 6) == (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)
    pi = (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344, 0xA4093822, 0x299F31D0)
    assert block(*pi) == (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1)


def test_streams_have_keys_of_their_own():
    keys = {
        tuple(map(int, philox.stream_key(seed, purpose)))
        for seed in (0, 1, 2**32, 2**56 - 1)
        for purpose in range(1, 10)
    }
    assert len(keys) == 36
    assert all(0 <= word < 2**32 for key in keys for word in key)
    for seed in (-1, 2**56):
        with pytest.raises(ValueError, match="seed"):
            philox.stream_key(seed, 1)


def test_parts_have_keys_of_their_own():
    key = philox.stream_key(1, philox.JUMP)
    keys = {philox.part_key(key, stream, m) for stream in range(20) for m in (0, 1, 70_000)}
    assert len(keys) == 60
    assert key not in keys
    assert all(isinstance(word, np.uint64) and word < 2**32 for key in keys for word in key)


def test_what_does_not_fit_into_a_word_is_refused():
    philox.check_word("step", 2**32 - 1)
    for number in (-1, 2**32):
        with pytest.raises(ValueError, match=r"step = .* below 2\*\*32"):
            philox.check_word("step", number)
    with pytest.raises(ValueError, match="number of particles"):
        Particles(Device(), 2**32, 2, [])


def test_uniforms_never_reach_the_ends():
    zero, ones = np.uint64(0), np.uint64(ONES)
    assert 0 < philox.uniform32(zero) < 1e-9
    assert 1 - 1e-9 < philox.uniform32(ones) < 1
    assert 0 < philox.uniform53(zero, zero) < 1e-15
    assert 1 - 1e-15 < philox.uniform53(ones, ones) < 1


@njit
def draw(n, kind, key0, key1):
    values = np.empty(4 * n)
    for i in range(n):
        w = philox.philox(np.uint64(i), np.uint64(7), np.uint64(0), np.uint64(0), key0, key1)
        if kind == 0:
            values[4 * i] = philox.bounded_normal4(w[0], w[1])
            values[4 * i + 1] = philox.bounded_normal4(w[2], w[3])
            values[4 * i + 2], values[4 * i + 3] = 0.0, 0.0
        elif kind == 1:
            for k in range(4):
                values[4 * i + k] = philox.bounded_normal2(w[k])
        elif kind == 2:
            values[4 * i], values[4 * i + 1] = philox.normal_pair(w[0], w[1])
            values[4 * i + 2], values[4 * i + 3] = philox.normal_pair(w[2], w[3])
        else:
            for k in range(4):
                values[4 * i + k] = philox.uniform32(w[k])
    return values


@pytest.mark.parametrize(
    ("kind", "kurtosis", "bound"), [(0, 2.7, 3.4642), (1, 2.4, 2.4496), (2, 3.0, 7.0)]
)
def test_noise_has_zero_mean_and_unit_variance(kind, kurtosis, bound):
    values = draw(100_000, kind, *philox.stream_key(3, 1))
    if kind == 0:
        values = values.reshape(-1, 4)[:, :2].ravel()
    n = len(values)
    assert abs(values.mean()) < 5 / n**0.5
    assert abs(values.var() - 1) < 5 * ((kurtosis - 1) / n) ** 0.5
    assert stats.kurtosis(values, fisher=False) == pytest.approx(kurtosis, abs=0.06)
    assert np.abs(values).max() <= bound
    assert stats.kstest(draw(20_000, 3, *philox.stream_key(3, 1)), "uniform").pvalue > 1e-6


def test_bounded_numbers_are_exactly_normalised():
    """Mean 0 and variance 1 over all values of a 16-bit half, without any sampling."""
    half = np.arange(2**16, dtype=float)
    four = 131070.0, 2.6428997921303014e-05
    two = 65535.0, 3.737624730023707e-05
    for number, (mean, scale) in ((4, four), (2, two)):
        assert number * half.mean() == mean
        assert number * half.var() * scale**2 == pytest.approx(1, abs=1e-14)


def test_nearest_integer_is_rint():
    values = np.concatenate(
        [
            np.random.default_rng(1).uniform(-9, 9, 1000),
            [0.5, -0.5, 1.5, 2.5, 0.49999999999999994, 1e9 + 0.3, 0.0, np.nan],
        ]
    )
    found = np.array([nearest_integer(v) for v in values])
    assert np.array_equal(found, np.rint(values), equal_nan=True)
