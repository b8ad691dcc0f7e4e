from __future__ import annotations

import math

import numpy as np
import pytest

from particell.compute.device import Device
from particell.compute.reduce import LANES, Reduction


def wide(n, seed=0):
    """Numbers of all magnitudes and signs."""
    random = np.random.default_rng(seed)
    return random.normal(size=n) * 10.0 ** random.integers(-300, 300, n)


SETS = {
    "usual": np.random.default_rng(1).normal(size=100_000),
    "all magnitudes": wide(20_000),
    "cancels": np.concatenate([wide(999), -wide(999), [5e-324, 1e308, -1e308]]),
    "denormal": np.random.default_rng(2).integers(-(2**40), 2**40, 5000) * 5e-324,
    "largest": np.array([1.7976931348623157e308, -1.7976931348623157e308, 1.0] * 300),
    "half to even": np.array([1.0, 2**-53, 2.0**-106] * 3 + [1.0, 2**-53]),
    "negative": -np.abs(wide(3000, 3)),
    "one": np.array([-0.1]),
    "zeros": np.array([0.0, -0.0]),
}


@pytest.mark.parametrize("name", SETS)
def test_sums_are_exact(name):
    """Equal to fsum, in any order and any number of lanes."""
    values, random = SETS[name], np.random.default_rng(4)
    reduction = Reduction(Device())
    for lanes in (1, 3, LANES):
        reduction._most_lanes = lanes
        columns = np.stack([values, random.permutation(values), -values], axis=1)
        exact = math.fsum(values)
        assert reduction.sum(columns).tolist() == [exact, exact, -exact]


def test_sums_of_single_precision_and_of_whole_numbers():
    reduction = Reduction(Device())
    values = wide(4000)
    values = values[np.abs(values) < 1e30].astype(np.float32)
    assert reduction.sum(values[:, None]).tolist() == [math.fsum(values)]
    whole = np.random.default_rng(1).integers(-(2**60), 2**60, (5000, 2)) // 4096
    assert reduction.sum(whole).tolist() == whole.sum(axis=0).tolist()
    small = np.full((3000, 1), 200, np.uint8)
    assert reduction.sum(small).tolist() == [600_000]
    assert reduction.sum(np.zeros((0, 2))).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("special", "expected"),
    [
        ([math.inf], math.inf),
        ([-math.inf], -math.inf),
        ([math.inf, -math.inf], math.nan),
        ([math.nan], math.nan),
        ([1.7e308, 1.7e308], math.inf),
        ([-1.7e308, -1.7e308], -math.inf),
    ],
)
def test_sums_of_what_is_not_finite(special, expected):
    values = np.concatenate([np.ones(2000), special])[:, None]
    assert np.array_equal(Reduction(Device()).sum(values), [expected], equal_nan=True)


def test_largest():
    values = np.random.default_rng(1).normal(size=1000)
    assert Reduction(Device()).max(values) == values.max()


def test_no_memory_is_taken_twice():
    reduction, values = Reduction(Device()), np.ones((5000, 2))
    reduction.sum(values)
    made = {key: id(array) for key, array in reduction._work.items()}
    reduction.sum(values)
    assert {key: id(array) for key, array in reduction._work.items()} == made


class Others:
    """A communicator that has what other processes would send."""

    rank, size = 0, 3

    def __init__(self, bins=0, largest=-math.inf):
        self.bins, self.largest, self.sent = bins, largest, None

    def sum(self, numbers):
        self.sent = numbers.copy()
        return numbers + self.bins

    def maximum(self, number):
        return max(number, self.largest)


def test_sums_over_processes_are_those_of_one():
    """Whoever holds which particle: 1/3 and 2/3 of numbers of all sizes, bit for bit."""
    random = np.random.default_rng(5)
    values = random.normal(size=(900, 2)) * 10.0 ** random.integers(-200, 200, (900, 2))
    first, second = Others(), Others()
    Reduction(Device(), first).sum(values[:300])
    Reduction(Device(), second).sum(values[300:500])
    whole = Reduction(Device(), Others(first.sent + second.sent)).sum(values[500:])
    assert whole.tobytes() == Reduction(Device()).sum(values).tobytes()
    assert Reduction(Device(), Others(largest=7.0)).max(np.array([1.0, 3.0])) == 7.0
