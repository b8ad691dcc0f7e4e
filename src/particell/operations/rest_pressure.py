"""The table of a fluid's pressure at rest, for :mod:`particell.laws.hydrostatics`.

For a fluid with a free surface nothing is taken out of the pressure, since there the sum over
pairs ends where the fluid does. Whether it has one is decided by how full the supports are at the
start (:func:`is_enclosed`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from particell.geometry.domain import Domain
from particell.operations.operation import Operation, When
from particell.particles import Particles
from particell.sources.images import Plane, points_with_images
from particell.state import State

#: Share of its support that is filled for a particle in the bulk, at least: half is a surface.
FULL = 0.75
#: Part of the particles that may have less, where they are placed at random.
LOOSE = 0.01
#: Particles that are looked at in each layer.
SAMPLE = 1000
#: Places of the table in a particle spacing, so that layers are told apart, and at most.
PER_SPACING, MOST_PLACES = 4, 16384
#: Steps from one table to the next, where tables follow fluids of several densities.
EVERY = 10


class RestPressure(Operation):
    """P^H of a set of particles, as arrays for loops; zero until :meth:`tabulate` finds one.

    Parameters
    ----------
    state
        The state at the start.
    gravity
        In m/s², shape (D,).
    contrast
        Whether there are fluids of several densities.
    """

    every = EVERY

    def __init__(self, state: State, gravity: np.ndarray, contrast: bool) -> None:
        self.device, self.domain, self.particles = state.device, state.domain, state.particles
        self.mirrors = state.mirrors
        self.gravity, domain, device = gravity, state.domain, state.device
        particles = state.particles
        x = particles.host("x").astype(float)
        spacing = float(particles.host("volume").min()) ** (1 / domain.dim)
        across = float(np.linalg.norm(np.ptp(x, axis=0)))
        self._places = int(min(PER_SPACING * across / spacing, MOST_PLACES)) + 3
        self._enclosed: bool | None = None
        self._contrast = contrast
        self.tables: dict[str, Any] = {
            "rest_axis": device.array(np.zeros(domain.dim + 3)),
            "rest_weight": device.array(np.zeros(self._places)),
            "rest_pressure": device.array(np.zeros(self._places)),
        }

    def acts(self) -> Mapping[When, Callable[[State], None]]:
        """It tabulates at the start, and every few steps where fluids may have moved."""
        return {When.BEGUN: lambda _: self.tabulate(), When.DRIFTED: lambda _: self.follow()}

    def follow(self) -> None:
        """Tabulate anew, where what is at s may have become another fluid.

        With fluids of one density the table stays that of the start, also with buoyancy: what that
        weighs is small, and convection is no nearer to its references with a table that follows.
        """
        if self._enclosed and self._contrast:
            self.tabulate()

    def tabulate(self) -> None:
        """Take w(s) from where the particles are and from what acts on them."""
        p = self.particles
        closed = ~np.array(self.domain.periodic)
        if "buoyancy" not in p and not np.any(self.gravity[closed]):
            return
        if self._enclosed is None:
            self._enclosed = is_enclosed(self.domain, p, self.mirrors)
        if not self._enclosed:
            return
        fluid = p.view("is_wall") == 0
        force = np.tile(self.gravity, (len(p), 1))
        if "buoyancy" in p:
            force = force + p.view("buoyancy")
        force = np.where(closed, force, 0.0)[fluid]
        mass = p.view("mass")[fluid].astype(float)
        axis = np.zeros(self.domain.dim)
        if np.any(force):
            axis = np.linalg.eigh(np.einsum("n,ni,nj->ij", mass, force, force))[1][:, -1]
            axis = np.where(closed, axis, 0.0)
        x = p.view("x").astype(float)
        s, volume = (x * axis).sum(axis=1), p.view("volume")[fluid].astype(float)
        start, interval = s.min(), max(float(np.ptp(s)), 1e-300) / (self._places - 1)
        height = (s[fluid] - start) / interval
        weight = self._means(height, mass * (force * axis).sum(axis=1), volume)
        steps = 0.5 * interval * (weight[1:] + weight[:-1])
        pressure = np.concatenate([[0.0], np.cumsum(steps)])
        at = np.interp(height, np.arange(self._places), pressure)
        pressure -= (volume * at).sum() / volume.sum()
        self.put({"rest_weight": weight, "rest_pressure": pressure})
        self.put({"rest_axis": np.array([*axis, start, 1.0 / interval, interval])})

    def _means(self, height: np.ndarray, weight: np.ndarray, volume: np.ndarray) -> np.ndarray:
        """Weight per volume at each place of the table.

        Means over the two intervals around a place hold at the centre of what they are made of.
        Between these they are interpolated, and beyond the outermost ones their line goes on:
        exact where the weight is linear in s, and without overshoot where it jumps.
        """
        k = np.clip(height.astype(int), 0, self._places - 2)
        upper = height - k

        def sums(values: np.ndarray) -> np.ndarray:
            low = np.bincount(k, values * (1 - upper), self._places)
            return low + np.bincount(k + 1, values * upper, self._places)

        below = sums(volume)
        known = below > 1e-9 * below.max()
        centre, mean = (
            sums(volume * height)[known] / below[known],
            sums(weight)[known] / below[known],
        )
        places = np.arange(self._places)
        table = np.interp(places, centre, mean)
        if len(centre) > 2:
            for end, inner, beyond in ((0, 2, places < centre[0]), (-1, -3, places > centre[-1])):
                slope = (mean[end] - mean[inner]) / (centre[end] - centre[inner])
                table[beyond] = mean[end] + slope * (places[beyond] - centre[end])
        return table

    def put(self, values: dict[str, np.ndarray]) -> None:
        """Write tables."""
        for name, array in values.items():
            self.device.write(self.tables[name], array)

    def saved(self) -> dict[str, Any]:
        """Tables, and whether it has any."""
        tables = {k: np.array(self.device.to_host(v)) for k, v in self.tables.items()}
        return {**tables, "enclosed": np.array(self._enclosed is True)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """See :meth:`.Operation.restore`."""
        self.put({name: saved[name] for name in self.tables})
        self._enclosed = bool(saved["enclosed"])


def is_enclosed(domain: Domain, particles: Particles, mirrors: Sequence[Plane] = ()) -> bool:
    """Whether the fluid has neighbours all round: walls, other fluid, or images of itself.

    Looked at are its outermost particles in all directions, and others at equal intervals.
    """
    fluid = np.flatnonzero(particles.host("is_wall") == 0)
    if not len(fluid):
        return False
    x = particles.host("x").astype(float)
    support = particles.host("support").astype(float)
    volume = particles.host("volume").astype(float)
    dim = domain.dim
    shown, whose = points_with_images(mirrors, x, float(support.max()))
    tree = domain.tree(shown)
    ball = math.pi ** (dim / 2) / math.gamma(dim / 2 + 1)

    def filled(rows: np.ndarray) -> np.ndarray:
        rows = rows[:: max(1, len(rows) // SAMPLE)]
        near = tree.query_ball_point(tree.data[rows], support[rows])
        within = np.array([volume[whose[k]].sum() for k in near])
        return within / (ball * support[rows] ** dim)

    if np.mean(filled(fluid) < FULL) > LOOSE:
        return False
    spacing = volume[fluid] ** (1 / dim)
    for d in np.flatnonzero(~domain.periodic):
        height = x[fluid, d]
        for outer in (height < height.min() + 0.9 * spacing, height > height.max() - 0.9 * spacing):
            if filled(fluid[outer]).mean() < FULL:
                return False
    return True
