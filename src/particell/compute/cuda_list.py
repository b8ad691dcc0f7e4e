"""What a GPU does of a neighbour list that a CPU does one after the other.

Sorting particles by (cell, id), the longest row, and whether the list still holds. The host reads
the longest row at builds, and one word a step that says whether to build.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numba import cuda as _module

from particell.compute.cuda_scan import THREADS, Largest, RunningSum
from particell.compute.device import clear
from particell.compute.displacements import judge_list
from particell.compute.loop import particle_loop

cuda: Any = _module  # its stubs know 'atomic' as a class only


@cuda.jit
def count_cells(n, cell, number, arrival):
    """Count the particles of each cell; ``arrival[i]`` have come before particle i."""
    i = cuda.grid(1)
    if i < n:
        arrival[i] = cuda.atomic.add(number, cell[i], 1)


@particle_loop
def fill_cells(i, cell, cell_start, arrival, arrived):
    """Put particle i in a place of its cell, by chance as it came."""
    arrived[cell_start[cell[i]] + arrival[i]] = i


@particle_loop
def order_cells(k, cell, cell_start, ids, arrived, order):
    """Put the particle in place k where as many of its cell come before it as have smaller ids."""
    i = arrived[k]
    c, own = cell[i], ids[i]
    place = cell_start[c]
    for other in range(cell_start[c], cell_start[c + 1]):
        place += ids[arrived[other]] < own
    order[place] = i


class DeviceSort:
    """The order of particles by (cell, id), and the first particle of each cell.

    The same as :func:`particell.compute.cells.counting_sort` makes.

    Parameters
    ----------
    device
        Where the particles are.
    n, cells
        How many particles and cells there are.
    """

    def __init__(self, device: Any, n: int, cells: int):
        self.n = n
        self._sum = RunningSum(device, cells + 1)
        self._arrival, self._arrived = device.zeros(n, np.int64), device.zeros(n, np.int64)
        self._clear, self._fill, self._put = (
            loop.specialise(device.backend) for loop in (clear, fill_cells, order_cells)
        )

    def __call__(self, cell: Any, ids: Any, cell_start: Any, order: Any) -> None:
        """Fill ``cell_start`` (cells + 1,) and ``order`` (n,)."""
        n = self.n
        self._clear(len(cell_start), cell_start)
        count_cells[-(-n // THREADS), THREADS](n, cell, cell_start, self._arrival)
        self._sum(cell_start)
        self._fill(n, cell, cell_start, self._arrival, self._arrived)
        self._put(n, cell, cell_start, ids, self._arrived, order)


class DeviceList:
    """The parts of a neighbour list that are decided on a GPU.

    Parameters
    ----------
    device
        Where the particles are.
    fields
        Those of the list.
    dim
        Number of dimensions.
    held, compared
        See :func:`particell.compute.displacements.judge_list`.
    """

    def __init__(
        self, device: Any, fields: Mapping[str, Any], dim: int, held: float, compared: float
    ):
        self.device = device
        self.number_of_cells, n = len(fields["largest"]), len(fields["cell"])
        self.sort = DeviceSort(device, n, self.number_of_cells)
        self._longest = Largest(device, n, np.int64)
        self._farthest = Largest(device, self.number_of_cells, np.float64)
        self._calls, self._judged = 0, device.zeros(1, np.int64)
        given = {"moved": self._farthest.found, "judged": self._judged}
        given |= {**fields, "held": held, "compared": compared}
        self._judge = device.bind(judge_list, given, DIM=dim)
        self._largest = fields["largest"]

    def longest(self, found: Any) -> int:
        """The largest number of neighbours; read by the host, at builds."""
        return int(self.device.to_host(self._longest(found))[0])

    def worn_out(self) -> bool:
        """Whether displacements, whose boxes are there, may have brought others near.

        This is the one word that the host reads in a step. Each call marks it with another number,
        so that it need not be cleared.
        """
        self._calls += 1
        self._farthest(self._largest)
        self._judge(self.number_of_cells, self._calls)
        return int(self.device.to_host(self._judged)[0]) == self._calls
