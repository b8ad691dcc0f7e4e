r"""Sponge: where velocity (and species) relax to a target, as at a recycled channel's inlet.

With the papers' profile :math:`\varphi(x) = B\left(\frac{x-x_s}{x_e-x_s}\right)^n`, B = 1, n = 3,

.. math:: v \leftarrow v - (v - v_{target})\,\left[1 - (1-\varphi)^{dt/\tau}\right]

so that its strength does not depend on the time step (methods: SDPD-SSA, Eq. 36 ff.; there the
factor is φ itself, which makes the sponge as much stronger as the step is smaller).

Places are those at the moment. On a periodic axis that of the image counts which lies in the zone:
a particle that has crossed a face is in the box again, and a zone may go on across one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from particell.checks import checked, not_negative, positive
from particell.compute.loop import particle_loop
from particell.errors import InputError
from particell.geometry.domain import Domain

Field = Callable[[np.ndarray], np.ndarray]


@checked
@dataclass(frozen=True)
class Sponge:
    """A zone in which the fluid is brought to given values.

    Parameters
    ----------
    start, end
        Coordinates along ``axis`` in m: φ = 0 at ``start`` and 1 at ``end``.
    time
        Time constant τ in s.
    velocity
        Function of points (n, D) that returns the target velocity (n, D) in m/s, or None.
    species
        Target concentrations in mol/m³ by species, as functions of points (n, D) or numbers.
    axis
        0, 1 or 2.
    exponent
        n.
    """

    start: float
    end: float
    time: float
    velocity: Field | None = None
    species: Mapping[str, Field | float] = field(default_factory=dict)
    axis: int = 0
    exponent: float = 3.0

    def __post_init__(self) -> None:
        positive("time", self.time)
        positive("exponent", self.exponent)
        if self.axis not in (0, 1, 2):
            raise InputError("axis", self.axis, "0, 1 or 2")
        for name, target in self.species.items():
            if not callable(target):
                not_negative(f"target of {name} in Sponge", target)
        if self.start == self.end:
            raise InputError("end", self.end, "different from 'start'")

    def strength(self, points: np.ndarray) -> np.ndarray:
        """φ at points (n, D), shape (n,); 0 outside the zone."""
        return self._profile(points[:, self.axis])

    def strength_in(self, domain: Domain, points: np.ndarray) -> np.ndarray:
        """:meth:`strength` at the images of points in the zone, in a box with periodic axes."""
        first, period, inverse_period = self.window(domain)
        x = points[:, self.axis]
        return self._profile(x - period * np.floor((x - first) * inverse_period))

    def window(self, domain: Domain) -> tuple[float, float, float]:
        """Where the period begins that the zone is in, its length in m, and 1/length (or 0)."""
        length = float(domain.lengths[self.axis])
        within = abs(self.end - self.start) <= length
        first = min(self.start, self.end) if within else float(domain.lower[self.axis])
        return first, length, float(domain.inverse_periods[self.axis])

    def _profile(self, x: np.ndarray) -> np.ndarray:
        s = (x - self.start) / (self.end - self.start)
        return np.where((s > 0) & (s <= 1), np.clip(s, 0, 1) ** self.exponent, 0.0)


@njit(inline="always")
def share_taken(place, start, end, exponent, dt_over_time):
    """The factor 1 − (1−φ)^(dt/τ) at a place along the axis, 0 outside the zone."""
    s = (place - start) / (end - start)
    if s <= 0.0 or s > 1.0:
        return 0.0
    return 1.0 - (1.0 - s**exponent) ** dt_over_time


@particle_loop
def relax_velocity(
    i,
    x,
    v,
    is_wall,
    start,
    end,
    exponent,
    origin,
    edge,
    inverse_edge,
    dt_over_time,
    target,
    *,
    DIM,
    AXIS,
):
    """Bring v_i towards ``target[i]`` (n, DIM) by the factor 1 − (1−φ)^(dt/τ)."""
    if is_wall[i]:
        return
    place = x[i, AXIS] - edge * math.floor((x[i, AXIS] - origin) * inverse_edge)
    share = share_taken(place, start, end, exponent, dt_over_time)
    if share > 0.0:
        for d in range(DIM):
            v[i, d] -= share * (v[i, d] - target[i, d])


@particle_loop
def share_of_target(
    i,
    x,
    start,
    end,
    exponent,
    origin,
    edge,
    inverse_edge,
    dt_over_time,
    sponge_share,
    *,
    AXIS,
):
    """The factor 1 − (1−φ)^(dt/τ) of particle i, 0 outside the zone."""
    place = x[i, AXIS] - edge * math.floor((x[i, AXIS] - origin) * inverse_edge)
    sponge_share[i] = share_taken(place, start, end, exponent, dt_over_time)


@particle_loop
def way_since(i, x, sponge_x, support, way, *, DIM):
    """How far particle i has come since the targets were evaluated, squared, in supports."""
    square = 0.0
    for d in range(DIM):
        s = x[i, d] - sponge_x[i, d]
        square += s * s
    way[i] = square / (support[i] * support[i])
