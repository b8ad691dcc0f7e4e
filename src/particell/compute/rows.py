"""Rows of neighbours, particle by particle: from the lists of clusters, or (on GPUs) from cells."""

from __future__ import annotations

import numpy as np

from particell.compute.batches import batch_row
from particell.compute.bins import LANES, SLOT_BITS
from particell.compute.cells import cell_at, cells_around, place_of, wrap_cell, wraps_around
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_whole

#: The image of an entry that is the neighbour itself: the middle one of 27.
NEAREST = 13


@particle_loop(vectorise=True)
def rows_of_cluster(
    c,
    member,
    cluster_size,
    cluster_start,
    cluster_split,
    cluster_stop,
    cluster_entries,
    shifts,
    place,
    own_support,
    slots,
    octets,
    skin,
    capacity,
    beyond,
    ends,
    start,
    split,
    stop,
    neighbours,
    found,
    crosses,
    *,
    DIM,
    UNIFORM,
    BATCH,
):
    """Fill the rows of a cluster's particles, in the order of its list.

    ``found[i]`` may exceed the capacity, then row i is not whole. ``octets`` is 1, which the
    compiler does not know (:mod:`particell.compute.lanes`).
    """
    first = np.uint64(c) * np.uint64(LANES)
    size = np.uint64(cluster_size[c])
    lane_count = octets * np.uint64(LANES)
    at_y, at_z = np.uint64((DIM - 2) * slots), np.uint64((DIM - 1) * slots)
    put = batch_row(c) * np.uint64(BATCH)
    for lane in range(size):
        ends[put + lane] = np.int64(member[first + lane]) * capacity
    wraps = False
    for part in range(2):
        begin, last = np.uint64(cluster_start[c]), np.uint64(cluster_split[c])
        if part == 1:
            begin, last = last, np.uint64(cluster_stop[c])
        for k in range(begin, last):
            entry = np.uint64(cluster_entries[k])
            slot = entry & np.uint64((1 << SLOT_BITS) - 1)
            image = entry >> np.uint64(SLOT_BITS)
            wraps |= image != np.uint64(NEAREST)
            shift = image * np.uint64(DIM)
            z = place[at_z + slot] + shifts[shift + np.uint64(DIM - 1)]
            y = place[at_y + slot] + shifts[shift + np.uint64(DIM - 2)] if DIM > 1 else 0.0
            x = place[slot] + shifts[shift] if DIM > 2 else 0.0
            h = own_support[slot]
            for lane in range(lane_count):
                own = first + lane
                r2 = (place[at_z + own] - z) * (place[at_z + own] - z)
                if DIM > 1:
                    r2 += (place[at_y + own] - y) * (place[at_y + own] - y)
                if DIM > 2:
                    r2 += (place[own] - x) * (place[own] - x)
                reach = own_support[own] if UNIFORM else 0.5 * (own_support[own] + h)
                beyond[put + lane] = r2 - (reach + skin) * (reach + skin)
            j = member[slot]
            for lane in range(size):
                limit = (np.int64(member[first + lane]) + 1) * capacity - 1
                end = ends[put + lane]
                neighbours[np.uint64(min(end, limit))] = j
                ends[put + lane] = end + ((beyond[put + lane] < 0.0) & (slot != first + lane))
        for lane in range(size):
            i = member[first + lane]
            end = min(ends[put + lane], (np.int64(i) + 1) * capacity - 1)
            if part == 0:
                split[i] = end
            stop[i] = end
    for lane in range(size):
        i = member[first + lane]
        start[i] = np.int64(i) * capacity
        found[i] = ends[put + lane] - start[i]
        crosses[i] = wraps


@particle_loop
def find_walls(c, cell_start, is_wall, has_walls):
    """Whether cell c holds wall particles."""
    found = False
    for i in range(cell_start[c], cell_start[c + 1]):
        found |= is_wall[i] != 0
    has_walls[c] = found


@particle_loop(vectorise=True)
def find_neighbours(
    i,
    position,
    support,
    is_wall,
    cell,
    cell_start,
    has_walls,
    cells,
    periodic,
    period,
    inverse_period,
    skin,
    capacity,
    start,
    split,
    stop,
    neighbours,
    found,
    crosses,
    beyond,
    *,
    DIM,
    UNIFORM,
    WALLS,
    BATCH,
):
    """Fill row i of the list; ``found[i]`` may exceed the capacity, then the row is not whole.

    ``position`` is x_built as one row of numbers, whose stride the compiler knows. The batch
    ``beyond`` holds by how much the squared distances of candidates exceed the squared reach.
    """
    ix, iy, iz = place_of(np.int64(cell[i]), cells, DIM)
    first_x, number_x, first_y, number_y, first_z, number_z = cells_around(
        ix, iy, iz, cells, periodic, 1, DIM
    )
    last = cells[DIM - 1]
    wraps = (
        wraps_around(first_z, number_z, last, periodic[DIM - 1])
        or (DIM >= 2 and wraps_around(first_y, number_y, cells[DIM - 2], periodic[DIM - 2]))
        or (DIM == 3 and wraps_around(first_x, number_x, cells[0], periodic[0]))
    )
    crosses[i] = wraps
    begin = i * capacity
    k = begin
    limit = begin + capacity - 1
    back = limit  # walls are put at the end, backwards
    dims, batch = np.uint64(DIM), np.uint64(BATCH)
    own = np.uint64(i) * dims
    xi = position[own]
    yi = position[own + np.uint64(1)] if DIM > 1 else 0.0
    zi = position[own + np.uint64(2)] if DIM > 2 else 0.0
    reach = support[i] + skin
    put = batch_row(i) * batch
    for ox in range(number_x):
        cx = wrap_cell(first_x + ox, cells[0]) if DIM == 3 else 0
        for oy in range(number_y):
            cy = wrap_cell(first_y + oy, cells[DIM - 2]) if DIM >= 2 else 0
            row = cell_at(cx, cy, 0, cells, DIM)
            # the cells along the last axis are one run of particles, two if it wraps around
            for run in range(2):
                low = max(first_z, 0)
                high = min(first_z + number_z, last)
                if run == 1:
                    low = 0
                    high = 0
                    if first_z < 0:
                        low = first_z + last
                        high = last
                    if first_z + number_z > last:
                        high = first_z + number_z - last
                walled = False
                if WALLS:
                    for c in range(row + low, row + high):
                        walled |= has_walls[c] != 0
                j = np.uint64(cell_start[row + low])
                after = np.uint64(cell_start[row + high])
                while j < after:
                    number = min(after - j, batch)
                    for q in range(number):
                        other = j + np.uint64(q)
                        at = other * dims
                        dx = xi - position[at]
                        if wraps:
                            dx -= period[0] * nearest_whole(dx * inverse_period[0])
                        r2 = dx * dx
                        if DIM > 1:
                            dy = yi - position[at + np.uint64(1)]
                            if wraps:
                                dy -= period[1] * nearest_whole(dy * inverse_period[1])
                            r2 += dy * dy
                        if DIM > 2:
                            dz = zi - position[at + np.uint64(2)]
                            if wraps:
                                dz -= period[2] * nearest_whole(dz * inverse_period[2])
                            r2 += dz * dz
                        if not UNIFORM:
                            reach = 0.5 * (support[i] + support[other]) + skin
                        beyond[put + np.uint64(q)] = r2 - reach * reach
                    if WALLS and walled:
                        for q in range(number):
                            other = j + np.uint64(q)
                            near = (beyond[put + np.uint64(q)] < 0.0) & (other != i)
                            wall = is_wall[other] != 0
                            neighbours[min(k, limit)] = other
                            neighbours[max(back, begin)] = other
                            k += near & (not wall)
                            back -= near & wall
                    else:
                        for q in range(number):
                            other = j + np.uint64(q)
                            neighbours[min(k, limit)] = other
                            k += (beyond[put + np.uint64(q)] < 0.0) & (other != i)
                    j += number
    number_of_walls = limit - back
    found[i] = k - begin + number_of_walls
    start[i], split[i], stop[i] = begin, min(k, limit), min(k + number_of_walls, limit)
    if WALLS and k <= back:  # the row is whole: they are turned round and follow the others
        first = back + 1
        for q in range(number_of_walls // 2):
            neighbours[first + q], neighbours[limit - q] = (
                neighbours[limit - q],
                neighbours[first + q],
            )
        for q in range(number_of_walls):
            neighbours[k + q] = neighbours[first + q]
