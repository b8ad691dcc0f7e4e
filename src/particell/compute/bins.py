"""Loops that put particles into bins along columns, and find what is near a cluster.

See :mod:`particell.compute.clusters`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.batches import BATCH, batch_row
from particell.compute.loop import particle_loop

#: Particles of a cluster: two vectors of four numbers, or one of eight.
LANES = 8
#: Bits of an entry that are the neighbour's slot; the others say which image of it.
SLOT_BITS = 27
#: What is round-off, as a part of the reach: nothing at its end is missed.
CLOSE = 1e-9


@njit
def bin_along(x, lower, inverse, number):
    """Which of ``number`` bins x is in; those beyond the ends are in the last."""
    return min(max(np.int64(math.floor((x - lower) * inverse)), 0), number - 1)


@particle_loop
def assign_bins(i, x, is_wall, lower, inverse_bin, bins, bin_of, *, DIM):
    """The bin of particle i, along columns that are passed up and down in turn; walls after all."""
    column = 0
    for d in range(DIM - 1):
        here = bin_along(x[i, d], lower[d], inverse_bin[d], bins[d])
        if column % 2 == 1:
            here = bins[d] - 1 - here
        column = column * bins[d] + here
    last = bins[DIM - 1]
    here = bin_along(x[i, DIM - 1], lower[DIM - 1], inverse_bin[DIM - 1], last)
    if column % 2 == 1:
        here = last - 1 - here
    index = column * last + here
    if is_wall[i]:
        total = last
        for d in range(DIM - 1):
            total *= bins[d]
        index += total
    bin_of[i] = index


@particle_loop
def place_slots(s, member, x, support, place, own_support, slots, *, DIM):
    """Positions by slot, one row of numbers an axis, and supports."""
    for d in range(DIM):
        place[d * slots + s] = x[member[s], d]
    own_support[s] = support[member[s]]


@njit
def turned(here, number, before):
    """A bin's number where every second column is passed downwards."""
    return number - 1 - here if before % 2 == 1 else here


@njit
def bins_within(low, high, lower, inverse, number, periodic):
    """First and last bin of an interval; on periodic axes these may lie beyond the ends."""
    first = np.int64(math.floor((low - lower) * inverse))
    last = np.int64(math.floor((high - lower) * inverse))
    if periodic:
        return max(first, -number), min(last, 2 * number - 1)
    return min(max(first, 0), number - 1), min(max(last, 0), number - 1)


@njit
def gap_to_bin(low, high, here, lower, width, number, periodic):
    """How far a bin is from an interval along one axis; those at ends that are no faces are open.

    Particles outside are in them.
    """
    begin, end = lower + here * width, lower + (here + 1) * width
    gap = 0.0
    if high < begin and (periodic or here > 0):
        gap = begin - high
    if low > end and (periodic or here < number - 1):
        gap = low - end
    return gap


@njit
def image_of(here, number):
    """The bin inside the domain and the image (0, 1, 2 for −1, 0, 1 periods) of one beyond it."""
    if here < 0:
        return here + number, 0
    if here >= number:
        return here - number, 2
    return here, 1


@njit(inline="always")
def four(values, at, less):
    """Four numbers that stand one after the other, each less by the same."""
    return (
        values[at] - less,
        values[at + np.uint64(1)] - less,
        values[at + np.uint64(2)] - less,
        values[at + np.uint64(3)] - less,
    )


@particle_loop(vectorise=True)
def find_clusters(
    c,
    place,
    own_support,
    slots,
    wall_slots,
    bin_start,
    lower,
    bin_width,
    inverse_bin,
    bins,
    periodic,
    period,
    skin,
    largest_support,
    beyond,
    cluster_start,
    cluster_split,
    cluster_stop,
    cluster_entries,
    fill,
    *,
    DIM,
    UNIFORM,
    WALLS,
):
    """The list of cluster c; without ``fill`` ``cluster_stop`` becomes its greatest length.

    ``wall_slots`` is what slots of walls are ahead of their numbers in the sorted order.
    """
    first = np.uint64(c) * np.uint64(LANES)
    at_y, at_z = np.uint64((DIM - 2) * slots), np.uint64((DIM - 1) * slots)
    low_x, low_y, low_z = 0.0, 0.0, 0.0
    high_x, high_y, high_z = 0.0, 0.0, 0.0
    widest = 0.0
    for slot in range(first, first + np.uint64(LANES)):
        z = place[at_z + slot]
        low_z = z if slot == first else min(low_z, z)
        high_z = z if slot == first else max(high_z, z)
        if DIM > 1:
            y = place[at_y + slot]
            low_y = y if slot == first else min(low_y, y)
            high_y = y if slot == first else max(high_y, y)
        if DIM > 2:
            x = place[slot]
            low_x = x if slot == first else min(low_x, x)
            high_x = x if slot == first else max(high_x, x)
        widest = max(widest, own_support[slot])
    reach = (0.5 * (widest + largest_support) + skin) * (1.0 + CLOSE)
    first_x, last_x, first_y, last_y = 0, 0, 0, 0
    number_x, number_y, number_z = 1, 1, bins[DIM - 1]
    if DIM > 2:
        number_x = bins[0]
        first_x, last_x = bins_within(
            low_x - reach, high_x + reach, lower[0], inverse_bin[0], number_x, periodic[0]
        )
    if DIM > 1:
        number_y = bins[DIM - 2]
        first_y, last_y = bins_within(
            low_y - reach,
            high_y + reach,
            lower[DIM - 2],
            inverse_bin[DIM - 2],
            number_y,
            periodic[DIM - 2],
        )
    put = batch_row(c) * np.uint64(BATCH)
    k = np.uint64(cluster_start[c]) if fill else np.uint64(0)
    total = number_x * number_y * number_z
    for kind in range(2 if WALLS else 1):
        if fill and kind == 1:
            cluster_split[c] = k
        ahead = wall_slots if kind == 1 else 0
        for ox in range(first_x, last_x + 1):
            cx, image_x, left_x = ox, 1, reach * reach
            if DIM > 2:
                cx, image_x = image_of(ox, number_x)
                gap = gap_to_bin(low_x, high_x, ox, lower[0], bin_width[0], number_x, periodic[0])
                left_x -= gap * gap
            for oy in range(first_y, last_y + 1):
                cy, image_y, left = oy, 1, left_x
                if DIM > 1:
                    cy, image_y = image_of(oy, number_y)
                    gap = gap_to_bin(
                        low_y,
                        high_y,
                        oy,
                        lower[DIM - 2],
                        bin_width[DIM - 2],
                        number_y,
                        periodic[DIM - 2],
                    )
                    left -= gap * gap
                if left < 0.0:
                    continue
                column = cx * number_y + (turned(cy, number_y, cx) if DIM > 2 else cy)
                along = math.sqrt(left)
                first_z, last_z = bins_within(
                    low_z - along,
                    high_z + along,
                    lower[DIM - 1],
                    inverse_bin[DIM - 1],
                    number_z,
                    periodic[DIM - 1],
                )
                for image_z in range(3):
                    begin_z = max(first_z - (image_z - 1) * number_z, 0)
                    end_z = min(last_z - (image_z - 1) * number_z, number_z - 1)
                    if begin_z > end_z:
                        continue
                    if column % 2 == 1:
                        begin_z, end_z = number_z - 1 - end_z, number_z - 1 - begin_z
                    row = kind * total + column * number_z
                    begin, end = bin_start[row + begin_z], bin_start[row + end_z + 1]
                    if not fill:
                        k += np.uint64(end - begin)
                        continue
                    image = (image_x * 3 + image_y) * 3 + image_z
                    shift_x = (image_x - 1) * period[0] if DIM > 2 else 0.0
                    shift_y = (image_y - 1) * period[DIM - 2] if DIM > 1 else 0.0
                    shift_z = (image_z - 1) * period[DIM - 1]
                    code = np.uint32(image << SLOT_BITS)
                    j = np.uint64(begin + ahead)
                    after = np.uint64(end + ahead)
                    while j < after:
                        number = min(after - j, np.uint64(BATCH))
                        for half in range(0, LANES, 4):
                            own = first + np.uint64(half)
                            z0, z1, z2, z3 = four(place, at_z + own, shift_z)
                            h0, h1, h2, h3 = four(own_support, own, -skin)
                            if DIM > 1:
                                y0, y1, y2, y3 = four(place, at_y + own, shift_y)
                            if DIM > 2:
                                x0, x1, x2, x3 = four(place, own, shift_x)
                            for q in range(number):
                                s = j + np.uint64(q)
                                z = place[at_z + s]
                                d0, d1, d2, d3 = z0 - z, z1 - z, z2 - z, z3 - z
                                d0, d1, d2, d3 = d0 * d0, d1 * d1, d2 * d2, d3 * d3
                                if DIM > 1:
                                    y = place[at_y + s]
                                    d0 += (y0 - y) * (y0 - y)
                                    d1 += (y1 - y) * (y1 - y)
                                    d2 += (y2 - y) * (y2 - y)
                                    d3 += (y3 - y) * (y3 - y)
                                if DIM > 2:
                                    x = place[s]
                                    d0 += (x0 - x) * (x0 - x)
                                    d1 += (x1 - x) * (x1 - x)
                                    d2 += (x2 - x) * (x2 - x)
                                    d3 += (x3 - x) * (x3 - x)
                                if not UNIFORM:
                                    h = 0.5 * (own_support[s] + skin)
                                    d0 -= (0.5 * h0 + h) * (0.5 * h0 + h)
                                    d1 -= (0.5 * h1 + h) * (0.5 * h1 + h)
                                    d2 -= (0.5 * h2 + h) * (0.5 * h2 + h)
                                    d3 -= (0.5 * h3 + h) * (0.5 * h3 + h)
                                d0 = d0 if d0 < d1 else d1
                                d2 = d2 if d2 < d3 else d3
                                d0 = d0 if d0 < d2 else d2
                                if UNIFORM:
                                    d0 -= h0 * h0
                                if half > 0:
                                    before = beyond[put + np.uint64(q)]
                                    d0 = d0 if d0 < before else before
                                beyond[put + np.uint64(q)] = d0
                        for q in range(number):
                            cluster_entries[k] = code | np.uint32(j + np.uint64(q))
                            k += np.uint64(beyond[put + np.uint64(q)] < 0.0)
                        j += number
    if fill and not WALLS:
        cluster_split[c] = k
    cluster_stop[c] = k
