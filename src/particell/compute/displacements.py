"""Whether a neighbour list may miss a pair: how far cells of particles have moved since its build.

The boxes that the displacements of each cell span are compared with those of the cells around it.
"""

from __future__ import annotations

import math

from numba import njit

from particell.compute.cells import cell_at, cell_gap, cells_around, place_of, wrap_cell
from particell.compute.loop import particle_loop


@particle_loop
def displacement_boxes(c, x, v, dt, x_built, cell_start, low, high, largest, *, DIM):
    """The box spanned by displacements x + dt v - x_built in cell c, and the largest squared."""
    biggest = 0.0
    for d in range(DIM):
        low[c, d] = 1e300
        high[c, d] = -1e300
    for i in range(cell_start[c], cell_start[c + 1]):
        square = 0.0
        for d in range(DIM):
            s = x[i, d] + dt * v[i, d] - x_built[i, d]
            square += s * s
            low[c, d] = min(low[c, d], s)
            high[c, d] = max(high[c, d], s)
        biggest = max(biggest, square)
    largest[c] = biggest


@njit(inline="always")
def gap_closed(c, low, high, cells, periodic, cell_width, least_apart, most_moved, DIM):
    """Whether a pair of cell c and a cell within two of it may have come too near, since the build.

    Particles of cells next to each other: by moving ``most_moved`` (squared) relative to each
    other. Others, which have a cell between them: when what is left of that on each axis is less
    than ``least_apart`` (squared). So a shear wears out the list by what cells slide past those
    next to them only.
    """
    ix, iy, iz = place_of(c, cells, DIM)
    first_x, number_x, first_y, number_y, first_z, number_z = cells_around(
        ix, iy, iz, cells, periodic, 2, DIM
    )
    last = cells[DIM - 1]
    gap_x, gap_y, left_x, left_y = 0.0, 0.0, 0.0, 0.0
    near = False
    for ox in range(number_x):
        cx = 0
        if DIM == 3:
            gap_x = cell_gap(ix, first_x + ox, cells[0], periodic[0], cell_width[0])
            cx = wrap_cell(first_x + ox, cells[0])
        for oy in range(number_y):
            cy = 0
            if DIM >= 2:
                gap_y = cell_gap(
                    iy, first_y + oy, cells[DIM - 2], periodic[DIM - 2], cell_width[DIM - 2]
                )
                cy = wrap_cell(first_y + oy, cells[DIM - 2])
            for oz in range(number_z):
                gap_z = cell_gap(iz, first_z + oz, last, periodic[DIM - 1], cell_width[DIM - 1])
                other = cell_at(cx, cy, wrap_cell(first_z + oz, last), cells, DIM)
                if other < c:  # which compares itself with this one
                    continue
                moved = 0.0
                for d in range(DIM):
                    s = max(high[c, d] - low[other, d], high[other, d] - low[c, d])
                    s = max(s, 0.0)
                    moved += s * s
                    if d == DIM - 1:
                        left_z = max(gap_z - s, 0.0)
                    elif d == DIM - 2:
                        left_y = max(gap_y - s, 0.0)
                    else:
                        left_x = max(gap_x - s, 0.0)
                if gap_x + gap_y + gap_z > 0.0:
                    apart = left_x * left_x + left_y * left_y + left_z * left_z
                    near |= apart < least_apart
                else:
                    near |= moved > most_moved
    return near


@particle_loop
def closed_gaps(c, low, high, cells, periodic, cell_width, least_apart, most_moved, closed, *, DIM):
    """Whether cell c and one near it may have come too near: :func:`gap_closed`."""
    closed[c] = gap_closed(c, low, high, cells, periodic, cell_width, least_apart, most_moved, DIM)


@particle_loop
def judge_list(
    c,
    low,
    high,
    cells,
    periodic,
    cell_width,
    least_apart,
    most_moved,
    moved,
    held,
    compared,
    call,
    judged,
    *,
    DIM,
):
    """``judged[0]`` becomes ``call`` where the list may miss a pair of cell c.

    ``moved[0]`` is the largest displacement, squared; twice that up to ``held`` is harmless, more
    than ``compared`` is beyond the cells that :func:`gap_closed` looks at.
    """
    largest = math.sqrt(moved[0])
    if 2.0 * largest <= held:
        return
    far = not largest < math.inf or largest > compared
    if far or gap_closed(c, low, high, cells, periodic, cell_width, least_apart, most_moved, DIM):
        judged[0] = call
