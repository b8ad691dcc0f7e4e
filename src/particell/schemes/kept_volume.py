"""The volume of fluid that fills a closed or periodic space stays what it is.

Continuity integrates the density of each particle by its own neighbours, and nothing binds the sum
of the volumes m/ρ to the space that they fill: it drifts, by a percent or so in ten passages where
particles move with v + δv (the rate of density sees that they crowd, not that δv undoes it) and
as much in closed cavities in three dimensions. The mean pressure drifts with it, by c₀² times that,
which resists shear (:mod:`particell.laws.pressure`). So all densities are scaled at each build of
the neighbour list by the factor that gives the volume back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particell.compute.device import Device
from particell.compute.reduce import Reduction
from particell.geometry.domain import Domain
from particell.particles import Particles
from particell.schemes import updates
from particell.schemes.hydrostatics import is_enclosed


class KeptVolume:
    """Σ m/ρ of the fluid, brought back to what it was.

    Parameters
    ----------
    device, domain, particles
        Where loops run; the box; the particles at the start.
    reference
        Reference density by group in kg/m³.
    wanted
        True keeps Σ m/ρ₀, the volume at the reference density. False keeps nothing. None keeps
        Σ m/ρ of the start where fluid fills its space and no wall moves into it
        (:func:`particell.schemes.hydrostatics.is_enclosed`).

    Attributes
    ----------
    drift
        By what part the volume would have changed by now, were it not kept.
    walls_move
        Whether walls have motions of their own, with which the space may change.
    """

    def __init__(
        self,
        device: Device,
        domain: Domain,
        particles: Particles,
        reference: np.ndarray,
        wanted: bool | None,
    ) -> None:
        self.device, self.domain, self.particles = device, domain, particles
        self.wanted, self.walls_move = wanted, False
        self.drift = 0.0
        self.volume = 0.0  # 0 where nothing is kept
        if wanted:
            density = reference[particles.host("group")]
            fluid = particles.host("is_wall") == 0
            self.volume = float((particles.host("mass") / density)[fluid].sum())
        self._parts = device.zeros((len(particles), 1)) if wanted is not False else None
        self._reduction = Reduction(device)

    def bind(self, fields: dict[str, Any]) -> None:
        """Look up the arrays."""
        if self._parts is not None:
            fields = {**fields, "part": self._parts}
            self._volumes = self.device.bind(updates.fluid_volume, fields)
            self._scale = self.device.bind(updates.scale_density, fields)

    def start(self) -> None:
        """Decide, where that was left open, and measure."""
        if self.wanted is not None or self.walls_move or not self._walls_stay():
            return
        if is_enclosed(self.domain, self.particles):
            self.volume = self._present()

    def _walls_stay(self) -> bool:
        """Whether no wall has a velocity by which it leaves its place, periodic axes aside."""
        p = self.particles
        leaves = (p.host("is_wall") != 0) & (p.host("slides") == 0)
        return not np.any(p.host("v")[leaves][:, ~self.domain.periodic])

    def _present(self) -> float:
        self._volumes(len(self.particles))
        return float(self._reduction.sum(self._parts)[0])

    def keep(self) -> None:
        """Scale densities so that the volume is what it was."""
        if self.volume:
            factor = self._present() / self.volume
            self._scale(len(self.particles), factor)
            self.drift = (1.0 + self.drift) * factor - 1.0

    def state(self) -> tuple[float, float]:
        """The volume that is kept, and the drift, for :meth:`put`."""
        return self.volume, self.drift

    def put(self, state: tuple[float, float]) -> None:
        """Go on with what a run had."""
        self.volume, self.drift = state
