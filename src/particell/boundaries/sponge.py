r"""Sponge: where velocity (and species) relax to a target, as at a recycled channel's inlet.

With the papers' profile :math:`\varphi(x) = B\left(\frac{x-x_s}{x_e-x_s}\right)^n`, B = 1, n = 3,

.. math:: v \leftarrow v - (v - v_{target})\,\left[1 - (1-\varphi)^{dt/\tau}\right]

so that its strength does not depend on the time step (methods: SDPD-SSA, Eq. 36 ff.; there the
factor is φ itself, which makes the sponge as much stronger as the step is smaller).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from particell.checks import checked, not_negative, positive
from particell.compute.loop import particle_loop
from particell.errors import InputError

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
        s = (points[:, self.axis] - self.start) / (self.end - self.start)
        return np.where((s > 0) & (s <= 1), np.clip(s, 0, 1) ** self.exponent, 0.0)


@particle_loop
def relax_velocity(i, x, v, is_wall, start, end, exponent, dt_over_time, target, *, DIM, AXIS):
    """Bring v_i towards ``target[i]`` (n, DIM) by the factor 1 − (1−φ)^(dt/τ)."""
    if is_wall[i]:
        return
    s = (x[i, AXIS] - start) / (end - start)
    if s <= 0.0 or s > 1.0:
        return
    share = 1.0 - (1.0 - s**exponent) ** dt_over_time
    for d in range(DIM):
        v[i, d] -= share * (v[i, d] - target[i, d])


@particle_loop
def share_of_target(i, x, start, end, exponent, dt_over_time, sponge_share, *, AXIS):
    """The factor 1 − (1−φ)^(dt/τ) of particle i, 0 outside the zone."""
    s = (x[i, AXIS] - start) / (end - start)
    sponge_share[i] = 0.0
    if s > 0.0 and s <= 1.0:
        sponge_share[i] = 1.0 - (1.0 - s**exponent) ** dt_over_time
