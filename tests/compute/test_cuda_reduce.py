"""Sums and maxima on a GPU have the bits of the CPU's.

As a script (``PYTHONPATH=tests python tests/compute/test_cuda_reduce.py``) it runs on the GPU at
hand; as a test on Numba's CUDA simulator, in a process of its own.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from particell.compute.device import Device
from particell.compute.reduce import Reduction
from simulated_gpu import lines_on_simulator


def sums(gpu):
    random = np.random.default_rng(1)
    wide = random.normal(size=60) * 10.0 ** random.integers(-300, 300, 60)
    for values in (
        random.normal(size=(90, 2)),
        np.concatenate([wide, [5e-324, 1e308, -1e308], -wide])[:, None],
        random.integers(-(2**40), 2**40, (60, 1)) * 5e-324,
        -np.abs(wide)[:, None],
        wide[np.abs(wide) < 1e30].astype(np.float32)[:, None],
        np.array([[1.0, -0.0, 2.0**-53]]),
    ):
        reduction = Reduction(gpu)
        for _ in range(2):  # nothing is left of the first time
            found = reduction.sum(gpu.array(values))
            assert found.tolist() == [math.fsum(column) for column in values.T.astype(float)]
            assert found.tobytes() == Reduction(Device()).sum(values).tobytes()


def sums_of_whole_numbers(gpu):
    values = np.random.default_rng(2).integers(-(2**60), 2**60, (90, 3)) // 256
    for whole in (values, (values % 200).astype(np.uint8), np.zeros((0, 2), np.int64)):
        expected = whole.sum(axis=0, dtype=np.int64).tolist()
        assert Reduction(gpu).sum(gpu.array(whole)).tolist() == expected


def sums_of_what_is_not_finite(gpu):
    for special in ([np.inf], [-np.inf], [np.inf, -np.inf], [np.nan], [1.7e308, 1.7e308]):
        values = np.concatenate([np.ones(40), special])[:, None]
        expected = Reduction(Device()).sum(values)
        assert np.array_equal(Reduction(gpu).sum(gpu.array(values)), expected, equal_nan=True)


def maxima(gpu):
    """Of one block, of several, of negative numbers, of what is no number."""
    random = np.random.default_rng(3)
    for n in (1, 7, 100):
        values = random.normal(size=n) - 10.0
        assert Reduction(gpu).max(gpu.array(values)) == values.max()
        assert Reduction(gpu).max(gpu.array(values.astype(np.float32))) == values.max().astype("f")
    for place in (0, 50, 99):
        values[place] = np.nan
        assert math.isnan(Reduction(gpu).max(gpu.array(values)))
        values[place] = np.inf
        assert Reduction(gpu).max(gpu.array(values)) == math.inf
        values[place] = 0.0


CHECKS = (sums, sums_of_whole_numbers, sums_of_what_is_not_finite, maxima)


def test_reductions_on_a_gpu():
    pytest.importorskip("numba.cuda", reason="numba.cuda is missing")
    assert lines_on_simulator(__file__) == [check.__name__ for check in CHECKS]


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for check in CHECKS:
        check(Device("cuda"))
        print(check.__name__, flush=True)
