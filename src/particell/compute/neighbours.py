"""Neighbour list.

Particles are sorted by cell, in a cell by id, and kept in that order, so that neighbours are near
in memory. Row *i* of the list holds ``list[start[i]:split[i]]``, the mobile neighbours, and
``list[split[i]:stop[i]]``, the neighbours of kind wall, all within the pair's support plus a skin,
both in the order of the cells around i and in a cell by id. Rows have a common capacity (compressed
rows with slack), so that one pass fills them.

**The list is a function of positions at its build, ids, supports and the grid of cells**, and so is
the order of particles in memory: neither where they were before nor the capacity counts. A sum over
a row has the same bits whatever happened before, and a checkpoint holds the positions, not the
list.

On CPUs the list is that of clusters (:mod:`particell.compute.clusters`), from which rows are taken
where they are asked for (:meth:`NeighbourList.want`): finding them cell by cell for every particle
takes several times as long. There the order in a row is that of the cluster's list.

The list stays valid until two particles may have come nearer than the skin. That is decided from
*relative* displacements: the boxes that the displacements of each cell span are compared with
those of the cells around it. Neighbours that flow together do not trigger a rebuild, and of what
slides past with a cell in between only the approach across that cell counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from particell.compute.batches import batch_buffer, batch_size
from particell.compute.cells import assign_cells, cells_of, counting_sort
from particell.compute.clusters import Clusters
from particell.compute.device import Device
from particell.compute.displacements import closed_gaps, displacement_boxes
from particell.compute.loop import particle_loop
from particell.compute.rows import find_neighbours, find_walls, rows_of_cluster
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.particles import Particles

#: Part of the skin that displacements may use up; the rest covers the integrator's corrections.
SAFETY = 0.9


@particle_loop
def wrap_positions(i, x, image, lower, period, inverse_period, *, DIM):
    """Bring x back between lower and lower + period on periodic axes; ``image`` counts turns."""
    for d in range(DIM):
        turns = math.floor((x[i, d] - lower[d]) * inverse_period[d])
        x[i, d] -= turns * period[d]
        image[i, d] += int(turns)


class NeighbourList:
    """Neighbours of all particles of a set, kept valid while the particles move.

    Parameters
    ----------
    device
        Where loops run.
    domain
        The simulated box.
    particles
        Whose neighbours they are.
    support
        Largest support of a particle, in m.
    skin
        What is added to the support, in m.
    lower, upper
        The region that holds all particles (walls stand outside the domain).
    uniform, walls
        Whether all supports are equal; whether there are wall particles.

    Raises
    ------
    InputError
        Where the support exceeds half of a periodic edge: two images of a particle would be
        neighbours. (With the skin it may in a list that is not moved on.)

    Attributes
    ----------
    start, split, stop
        int64 arrays (n,): row i is ``neighbours[start[i]:stop[i]]``; walls begin at ``split[i]``.
    neighbours
        uint32 array (an unsigned index spares the test for negative ones).
    crosses
        uint8 array (n,): whether row i may hold pairs across a periodic face, for which the
        minimum image has to be taken.
    builds
        How often the list was built.
    renewals
        How often arrays were made anew: who holds some has to look them up again.
    """

    def __init__(
        self,
        device: Device,
        domain: Domain,
        particles: Particles,
        support: float,
        skin: float,
        lower: np.ndarray,
        upper: np.ndarray,
        uniform: bool,
        walls: bool,
    ):
        self.device, self.domain, self.skin, self.support = device, domain, skin, support
        self.particles = particles
        dim, n = domain.dim, len(particles)
        self.constants = {"DIM": dim, "UNIFORM": bool(uniform), "WALLS": bool(walls)}
        width = support + skin
        short = domain.lengths[domain.periodic]
        if short.size and 2 * support > short.min() * (1 + 1e-9):
            allowed = f"at most half of the shortest periodic edge ({short.min():g} m)"
            raise InputError("support", support, allowed)
        lengths = upper - lower
        cells = cells_of(lengths, width, n)
        self.n, self.number_of_cells = n, int(np.prod(cells))
        narrowest = float((lengths / cells)[cells > 1].min(initial=np.inf))
        self._farthest = narrowest - 0.5 * support  # the displacement that makes others near
        reals, array = device.zeros, device.array
        self.fields: dict[str, Any] = _Parts()
        self.fields |= {
            "lower": array(lower),
            "inverse_cell": array(cells / lengths),
            "cells": array(cells),
            "periodic": array(domain.periodic),
            "period": array(domain.lengths),
            "inverse_period": array(domain.inverse_periods),
            "cell": device.zeros(n, np.int32),
            "has_walls": device.zeros(self.number_of_cells, np.uint8),
            "cell_start": device.zeros(self.number_of_cells + 1, np.int64),
            "cell_width": array(lengths / cells),
            "x_built": reals((n, dim)),
            "low": reals((self.number_of_cells, dim), np.float64),
            "high": reals((self.number_of_cells, dim), np.float64),
            "largest": reals(self.number_of_cells, np.float64),
            "closed": device.zeros(self.number_of_cells, np.uint8),
            "most_moved": (SAFETY * skin) ** 2,
            "least_apart": (support + (1.0 - SAFETY) * skin) ** 2,
        }
        self.order = device.zeros(n, np.int64)
        self.capacity = self.builds = self.renewals = 0
        clustered = device.backend == "cpu" and device.form != "gather"
        self._clusters = Clusters(self, lengths) if clustered else None
        if self._clusters is not None:
            self.fields |= self._clusters.fields
        bind, f, only = device.bind, self.fields, {"DIM": dim}
        self._wrap = bind(wrap_positions, f, **only)
        self._assign = bind(assign_cells, f, **only)
        self._find_walls = bind(find_walls, f)
        self._boxes = bind(displacement_boxes, f, **only)
        self._compare = bind(closed_gaps, f, **only)
        self._on_gpu: Any = None
        if device.backend == "cuda":
            from particell.compute.cuda_list import DeviceList

            self._on_gpu = DeviceList(device, f, dim, SAFETY * skin, self._farthest)

    def __getattr__(self, name: str):
        try:
            return self.__dict__["fields"][name]
        except KeyError:
            raise AttributeError(name) from None

    def want(self, part: str) -> None:
        """Make ``"rows"`` from now on, of the present list too if there is one.

        They follow from the positions at its build: when they are asked for makes no difference.
        ``"clusters"`` are there, on CPUs.
        """
        if part == "rows" and not self.capacity:
            n, zeros = self.n, self.device.zeros
            self.fields |= {
                name: zeros(n, np.int64) for name in ("start", "split", "stop", "found")
            }
            self.fields |= {"crosses": zeros(n, np.uint8), "beyond": batch_buffer(self.device, n)}
            self.fields["ends"] = batch_buffer(self.device, n, dtype=np.int64)
            self._reserve(32)
            if self.builds:
                self._fill_rows()

    def build(self, particles: Particles) -> None:
        """Wrap positions into the domain, sort all fields into cell order and list neighbours."""
        self._wrap(self.n, particles["x"], particles["image"])
        self.device.copy(particles["x"], self.x_built)
        self._make(particles)
        self.builds += 1

    def _make(self, particles: Particles) -> None:
        """Sort all fields and list neighbours by the positions ``x_built``."""
        n, x = self.n, self.x_built
        self._assign(n, x)
        sort = self._on_gpu.sort if self._on_gpu else counting_sort
        sort(self.cell, particles["id"], self.cell_start, self.order)
        particles.permute(self.order, x)
        self._assign(n, x)
        if self.constants["WALLS"]:
            self._find_walls(self.number_of_cells, particles["is_wall"])
        if self._clusters is not None and self._clusters.build(self.x_built):
            self.fields |= self._clusters.fields
            self.renewals += 1
            if self.capacity:  # who holds rows looks up all arrays again
                self._reserve(self.capacity)
        if self.capacity:
            self._fill_rows()

    def needs_build(self, x, v, dt: float) -> bool:
        """Whether a pair outside the list may be within its support after a move by ``dt v``."""
        self._boxes(self.number_of_cells, x, v, dt)
        if self._on_gpu:
            return self._on_gpu.worn_out()
        largest = math.sqrt(float(self.fields["largest"].max()))
        if not largest < math.inf:
            return True
        if 2 * largest <= SAFETY * self.skin:
            return False
        if largest > self._farthest:  # of cells that are not compared
            return True
        self._compare(self.number_of_cells)
        return bool(self.fields["closed"].any())

    def saved(self) -> dict[str, Any]:
        """What :meth:`restore` makes the same list from, beside the fields of the particles."""
        return {"x_built": np.array(self.device.to_host(self.x_built)), "builds": self.builds}

    def restore(self, saved: Mapping[str, Any], particles: Particles) -> None:
        """Make a list that was :meth:`saved` again, bit for bit.

        Parameters
        ----------
        saved
            Of a list of the same particles.
        particles
            With the fields that they had, in the order of that time; they are sorted where they
            are not yet.

        Raises
        ------
        InputError
            Where it is not of a list of as many particles.
        """
        x = saved.get("x_built")
        if not isinstance(x, np.ndarray) or x.shape != self.x_built.shape or "builds" not in saved:
            raise InputError("checkpoint", "another neighbour list", "of these particles")
        self.device.write(self.x_built, x)
        self._make(particles)
        self.builds = int(saved["builds"])

    def _reserve(self, capacity: int) -> None:
        self.capacity = capacity
        self.renewals += 1
        self.fields["neighbours"] = self.device.zeros(self.n * capacity + 1, np.uint32)
        self._bind_rows()

    def _bind_rows(self) -> None:
        given = {**self.fields, "skin": self.skin, "capacity": self.capacity}
        options = {**self.constants, "BATCH": batch_size(self.device)}
        if self._clusters is None:
            self._find = self.device.bind(find_neighbours, given, **options)
            return
        options.pop("WALLS")
        self._rows = self.device.bind(rows_of_cluster, {**self._clusters.own, **given}, **options)

    def _fill_rows(self) -> None:
        p, position = self.particles, self.x_built.reshape(self.n * self.domain.dim)
        while True:
            if self._clusters is None:
                self._find(self.n, position, p["support"], p["is_wall"])
            else:
                self._rows(self._clusters.number)
            needed = self._longest_row() + 1
            if needed <= self.capacity:
                return
            self._reserve(int(needed * 1.15) + 4)

    def _longest_row(self) -> int:
        """Neighbours of the particle that has most."""
        return self._on_gpu.longest(self.found) if self._on_gpu else int(self.found.max(initial=0))


class _Parts(dict):
    """Arrays by name; those of a part of the list that was not asked for are missed in words."""

    def __missing__(self, name: str) -> Any:
        raise KeyError(f"{name}: unknown, or of a part of the list that nobody asked for (want)")
