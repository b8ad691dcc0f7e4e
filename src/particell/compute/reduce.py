"""Sums and maxima over particles that depend on the values alone.

Real numbers are summed exactly and rounded once: whatever the order in memory, the number of
threads or the split among processes, the result is that of :func:`math.fsum`
(:mod:`particell.compute.accumulator`). Every global quantity (energy, momentum, amounts, and means
that feed back into the motion) goes through :class:`Reduction`.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from particell.compute.accumulator import WIDTH, carry, rounded, whole_parts
from particell.compute.communicator import Alone, Communicator
from particell.compute.device import Device
from particell.compute.loop import particle_loop

#: Lanes in which numbers are added, so that threads share the work; a lane takes less than 2^29.
LANES = 64
FEW = 512


@particle_loop
def accumulate(lane, values, lanes, bins):
    """Add one lane's share of the rows of a table of reals to its bins, column by column.

    ``bins`` has shape (lanes columns, WIDTH).
    """
    rows, columns = values.shape
    first, last = lane * rows // lanes, (lane + 1) * rows // lanes
    for c in range(columns):
        row = lane * columns + c
        for b in range(WIDTH):
            bins[row, b] = 0
        for i in range(first, last):
            b, low, middle, high = whole_parts(values[i, c])
            bins[row, b] += low
            bins[row, b + 1] += middle
            bins[row, b + 2] += high
        carry(bins, row)


@particle_loop
def sum_integers(lane, values, lanes, bins):
    """Sum one lane's share of the rows of a table of whole numbers; ``bins`` (lanes columns, 1)."""
    rows, columns = values.shape
    for c in range(columns):
        total = 0
        for i in range(lane * rows // lanes, (lane + 1) * rows // lanes):
            total += values[i, c]
        bins[lane * columns + c, 0] = total


@particle_loop
def gather_lanes(k, bins, lanes, total):
    """Sum bin k of all lanes; k counts the bins of all columns."""
    columns, width = total.shape
    c, b = k // width, k % width
    found = 0
    for lane in range(lanes):
        found += bins[lane * columns + c, b]
    total[c, b] = found


class Reduction:
    """Sums and maxima of per-particle values: arrays of the device, or NumPy's.

    Parameters
    ----------
    device
        Where loops run.
    communicator
        Who else holds particles.
    """

    def __init__(self, device: Device, communicator: Communicator | None = None):
        self.device = device
        self.communicator: Communicator = communicator or Alone()
        self._host = device if device.backend == "cpu" else Device()
        self._most_lanes = LANES
        self._work: dict[tuple, Any] = {}

    @functools.cached_property
    def _on_gpu(self) -> Any:
        from particell.compute.cuda_reduce import DeviceReduction

        return DeviceReduction(self.device)

    def _array(self, *shape: int):
        """Room to work in, made once."""
        if shape not in self._work:
            self._work[shape] = self._host.zeros(shape, np.int64)
        return self._work[shape]

    def sum(self, values) -> np.ndarray:
        """Column sums of an array of shape (n, columns); returns shape (columns,).

        Of real numbers they are exact and rounded once, to float64; whole numbers are int64.
        """
        here = isinstance(values, np.ndarray)
        total = self._sum_here(values) if here else self.device.to_host(self._on_gpu.sum(values))
        found = self.communicator.sum(total)
        real = values.dtype.kind == "f"
        return np.array([rounded(row) for row in found]) if real else np.array(found[:, 0])

    def _sum_here(self, values: np.ndarray) -> np.ndarray:
        """Bins (columns, WIDTH) of real numbers, sums (columns, 1) of whole ones."""
        rows, columns = values.shape
        real = values.dtype.kind == "f"
        width = WIDTH if real else 1
        lanes = max(1, min(self._most_lanes, rows // FEW))
        bins, total = self._array(lanes * columns, width), self._array(columns, width)
        add = (accumulate if real else sum_integers).specialise("cpu")
        add(lanes, values, lanes, bins)
        gather_lanes.specialise("cpu")(columns * width, bins, lanes, total)
        return total

    def max(self, values) -> float:
        """Largest of a non-empty array of shape (n,); NaN where one is NaN."""
        here = isinstance(values, np.ndarray)
        return self.communicator.maximum(float(values.max()) if here else self._on_gpu.max(values))
