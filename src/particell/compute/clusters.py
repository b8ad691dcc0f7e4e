"""Clusters: particles near each other, which share one list of neighbours.

The lanes of a vector can be particles: eight of them that are near each other see nearly the same
neighbours, whose numbers are then read once for all eight and not gathered
(:mod:`particell.compute.lanes`). Particles are put in order column by column (squares of the cross
section that hold about as many particles along as across), along the last axis up one column and
down the next, and every ``LANES`` of them are a cluster, mobile ones first, then walls. A place in
this order is a *slot*; those that are left over in the last cluster of a kind repeat its last
particle.

Cluster *c* has ``cluster_entries[cluster_start[c]:cluster_split[c]]``, slots of the mobile
particles within the pair's support plus skin of any of its own (which are among them), and up to
``cluster_stop[c]`` those of walls. Each entry has in its upper bits which image of the neighbour
is meant, so that no pair looks for the nearest one: ``shifts`` has what is taken off x_i − x_j.
Entries are ordered column by column and along these: as all here, by places when the list is built
alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particell.compute.batches import batch_buffer
from particell.compute.bins import LANES, SLOT_BITS, assign_bins, find_clusters, place_slots
from particell.compute.cells import counting_sort
from particell.errors import InputError
from particell.particles import Particles

#: Bins along a column for a cluster that is as long as wide.
BINS = 4


class Clusters:
    """Clusters of a set of particles and their lists.

    Parameters
    ----------
    neighbours
        The list whose part they are.
    lengths
        Of the region that holds all particles, in m.

    Attributes
    ----------
    fields
        Arrays by name: ``member`` (slots), the particle of each; ``cluster_size`` (clusters), how
        many slots are no repetition; the list as the module says.
    own
        What the list is made with.
    number
        Of clusters.
    """

    def __init__(self, neighbours: Any, lengths: np.ndarray):
        self.device, self.particles = neighbours.device, neighbours.particles
        device, domain, particles = self.device, neighbours.domain, self.particles
        fields, n, dim = neighbours.fields, neighbours.n, domain.dim
        walls = int(np.count_nonzero(particles.view("is_wall")))
        self._numbers = [n - walls, walls]
        whole = [-(-number // LANES) * LANES for number in self._numbers]
        slots = sum(whole)
        if slots >= 1 << SLOT_BITS:
            raise InputError("particles", n, f"fewer than {1 << SLOT_BITS} in the form 'lanes'")
        self._whole, self.number = whole, slots // LANES
        bins = bins_of(lengths, spacing_of(particles, lengths), dim, n)
        total = int(np.prod(bins))
        zeros, array = device.zeros, device.array
        sizes = np.full(slots // LANES, LANES, np.uint8)
        for end, number, filled in zip(np.cumsum(whole), self._numbers, whole, strict=True):
            if number:
                sizes[end // LANES - 1] = LANES - (filled - number)
        images = np.array([(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)])
        self.fields: dict[str, Any] = {
            "member": zeros(slots, np.uint32),
            "cluster_size": array(sizes),
            "cluster_start": zeros(slots // LANES, np.int64),
            "cluster_split": zeros(slots // LANES, np.int64),
            "cluster_stop": zeros(slots // LANES, np.int64),
            "cluster_entries": zeros(1, np.uint32),
            "shifts": array((images[:, 3 - dim :] * domain.lengths).ravel()),
        }
        self.own = {
            **{name: fields[name] for name in ("lower", "periodic", "period")},
            "bins": array(bins),
            "inverse_bin": array(bins / lengths),
            "bin_width": array(lengths / bins),
            "bin_of": zeros(n, np.int32),
            "bin_start": zeros(2 * total + 1, np.int64),
            "place": zeros(dim * slots),
            "own_support": zeros(slots),
            "beyond": batch_buffer(device, slots),
            "slots": slots,
            "octets": np.uint64(1),
            "wall_slots": whole[0] - self._numbers[0],
            "largest_support": neighbours.support,
            "skin": neighbours.skin,
        }
        self._order = np.zeros(n, np.int64)
        own, only = self.own, {"DIM": dim}
        self._assign = device.bind(assign_bins, own, **only)
        self._place = device.bind(place_slots, {**own, **self.fields}, **only)
        self._constants = {**only, "UNIFORM": neighbours.constants["UNIFORM"], "WALLS": walls > 0}
        self._reserve(0)

    def _reserve(self, entries: int) -> None:
        """Make room for so many, and the one that is written where none is found."""
        self.fields["cluster_entries"] = self.device.zeros(entries + 1, np.uint32)
        fields = {**self.own, **self.fields}
        self._find = self.device.bind(find_clusters, fields, **self._constants)

    def build(self, x: Any) -> bool:
        """Make clusters and their lists of the places x; whether arrays are new."""
        p, f, own = self.particles, self.fields, self.own
        self._assign(len(p), x, p["is_wall"])
        counting_sort(own["bin_of"], p.view("id"), own["bin_start"], self._order)
        begin = slot = 0
        for number, whole in zip(self._numbers, self._whole, strict=True):
            if number:
                f["member"][slot : slot + number] = self._order[begin : begin + number]
                f["member"][slot + number : slot + whole] = self._order[begin + number - 1]
            begin, slot = begin + number, slot + whole
        self._place(own["slots"], x, p["support"])
        self._find(self.number, False)
        most = f["cluster_stop"]
        np.cumsum(most[:-1], out=f["cluster_start"][1:])
        needed = int(most.sum())
        grown = needed >= len(f["cluster_entries"])
        if grown:
            self._reserve(int(needed * 1.1))
        self._find(self.number, True)
        return grown


def spacing_of(particles: Particles, lengths: np.ndarray) -> float:
    """The spacing of most particles in m; where volumes are unknown, that of a full region."""
    dim = len(lengths)
    mass, density = particles.view("mass"), particles.view("density")
    if len(mass) and np.all(mass > 0) and np.all(density > 0):
        return float(np.median(mass / density)) ** (1 / dim)
    return float(np.prod(lengths) / max(1, len(mass))) ** (1 / dim)


def bins_of(lengths: np.ndarray, spacing: float, dim: int, particles: int) -> np.ndarray:
    """Numbers of columns along all axes but the last, and of bins along it."""
    side = LANES ** (1 / dim) * spacing
    bins = np.maximum(1, np.rint(lengths / side)).astype(np.int64)
    bins[-1] = max(1, int(BINS * lengths[-1] / side))
    while np.prod(bins.astype(float)) > 4 * particles + 64:
        bins = np.maximum(1, bins // 2)
    return bins
