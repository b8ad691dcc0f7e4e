"""A grid of cells over a box: numbers of cells, what is around one, particles sorted into them.

Cells are numbered row-major, the last axis fastest. In loops their places are (ix, iy, iz); of
fewer dimensions the first of these are 0 (a line has iz, a plane iy and iz).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.loop import compiled, particle_loop


def cells_of(lengths: np.ndarray, width: float, particles: int) -> np.ndarray:
    """Numbers of cells by axis, each at least ``width`` wide; fewer where particles are sparse."""
    cells = np.maximum(1, np.floor(lengths / width)).astype(np.int64)
    while np.prod(cells.astype(float)) > 4 * particles + 64:
        cells = np.maximum(1, cells // 2)
    return cells


@njit
def place_of(c, cells, DIM):
    """(ix, iy, iz) of cell c."""
    iz = c % cells[DIM - 1]
    rest = c // cells[DIM - 1]
    if DIM == 3:
        return rest // cells[1], rest % cells[1], iz
    return 0, rest, iz


@njit
def cell_at(ix, iy, iz, cells, DIM):
    """The cell at (ix, iy, iz)."""
    if DIM == 3:
        return (ix * cells[1] + iy) * cells[2] + iz
    if DIM == 2:
        return iy * cells[1] + iz
    return iz


@njit
def axis_cells(c, cells, periodic, reach):
    """First cell and number of cells within ``reach`` of cell ``c`` along one axis."""
    if periodic:
        if cells <= 2 * reach + 1:
            return 0, cells
        return c - reach, 2 * reach + 1
    first = max(c - reach, 0)
    return first, min(c + reach, cells - 1) - first + 1


@njit
def cells_around(ix, iy, iz, cells, periodic, reach, DIM):
    """First cell and number of cells within ``reach`` of a cell, on each of three axes.

    First cells may be negative on periodic axes, and ranges end beyond the last one:
    :func:`wrap_cell` brings them back.
    """
    first_x, number_x, first_y, number_y = 0, 1, 0, 1
    if DIM == 3:
        first_x, number_x = axis_cells(ix, cells[0], periodic[0], reach)
    if DIM >= 2:
        first_y, number_y = axis_cells(iy, cells[DIM - 2], periodic[DIM - 2], reach)
    first_z, number_z = axis_cells(iz, cells[DIM - 1], periodic[DIM - 1], reach)
    return first_x, number_x, first_y, number_y, first_z, number_z


@njit
def wrap_cell(c, cells):
    """A cell index brought back between 0 and cells - 1."""
    if c < 0:
        return c + cells
    if c >= cells:
        return c - cells
    return c


@njit
def wraps_around(first, number, cells, periodic):
    """Whether a range of cells along one axis reaches across a periodic face."""
    return periodic and (first < 0 or first + number > cells or number == cells)


@njit
def cell_gap(c, other, cells, periodic, width):
    """Width of the cells that lie between two cells along one axis: how far apart they are."""
    between = abs(other - c)
    if periodic:
        between = min(between, cells - between)
    return max(between - 1, 0) * width


@particle_loop
def assign_cells(i, x, lower, inverse_cell, cells, cell, *, DIM):
    """The cell of particle i, row-major with the last axis fastest; outliers go to the edge."""
    index = 0
    for d in range(DIM):
        c = math.floor((x[i, d] - lower[d]) * inverse_cell[d])
        c = min(max(c, 0), cells[d] - 1)
        index = index * cells[d] + c
    cell[i] = index


#: Cells with more particles than this are first put roughly in order (Shell's gaps).
_FEW = 64


@njit
def _sort_by_id(order, first, last, ids):
    """Put ``order[first:last]`` in the order of ids; quick where it nearly is."""
    number = last - first
    gap = 1
    while gap * _FEW < number:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(first + gap, last):
            moved = order[k]
            own = ids[moved]
            place = k
            while place - gap >= first and ids[order[place - gap]] > own:
                order[place] = order[place - gap]
                place -= gap
            order[place] = moved
        gap //= 3


@compiled
def counting_sort(cell, ids, cell_start, order):
    """The order of particles by (cell, id), and the first particle of each cell.

    It depends on nothing else: neither on the places of particles in memory nor on earlier orders.
    """
    cell_start[:] = 0
    for i in range(len(cell)):
        cell_start[cell[i] + 1] += 1
    for c in range(1, len(cell_start)):
        cell_start[c] += cell_start[c - 1]
    for i in range(len(cell)):
        order[cell_start[cell[i]]] = i
        cell_start[cell[i]] += 1
    for c in range(len(cell_start) - 1, 0, -1):
        cell_start[c] = cell_start[c - 1]
    cell_start[0] = 0
    for c in range(len(cell_start) - 1):
        _sort_by_id(order, cell_start[c], cell_start[c + 1], ids)
