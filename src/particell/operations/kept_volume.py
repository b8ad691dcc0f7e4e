"""The volume of fluid that fills a closed or periodic space stays what it is.

Continuity integrates the density of each particle by its own neighbours, and nothing binds the sum
of the volumes m/ρ to the space that they fill: it drifts, by a percent or so in ten passages where
particles move with v + δv (the rate of density sees that they crowd, not that δv undoes it) and
as much in closed cavities in three dimensions. The mean pressure drifts with it, by c₀² times that,
which resists shear (:mod:`particell.laws.pressure`). So all densities are scaled every few steps by
the factor that gives the volume back: steps of the flow, not builds of the neighbour list, since
these depend on its skin, and results do not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from particell.compute.loop import particle_loop
from particell.operations.operation import Operation, When
from particell.operations.rest_pressure import is_enclosed
from particell.state import State

#: Steps from one correction to the next. Each is a sum that the host waits for.
EVERY = 5


@particle_loop
def fluid_volume(i, is_wall, mass, density, part):
    """The volume m/ρ of a mobile particle, 0 for walls."""
    part[i, 0] = 0.0 if is_wall[i] else mass[i] / density[i]


@particle_loop
def scale_density(i, is_wall, mass, density, volume, factor):
    """ρ ← ρ factor for mobile particles."""
    if not is_wall[i]:
        density[i] *= factor
        volume[i] = mass[i] / density[i]


class KeptVolume(Operation):
    """Σ m/ρ of the fluid, brought back to what it was.

    Parameters
    ----------
    state
        The state at the start.
    wanted
        True keeps Σ m/ρ₀, the volume at the reference density. False keeps nothing. None keeps
        Σ m/ρ of the start where fluid fills its space and no wall moves into it
        (:func:`particell.operations.rest_pressure.is_enclosed`).

    Attributes
    ----------
    drift
        By what part the volume would have changed by now, were it not kept.
    walls_move
        Whether walls have motions of their own, with which the space may change.
    """

    every = EVERY

    def __init__(self, state: State, wanted: bool | None) -> None:
        self.wanted, self.walls_move = wanted, False
        self.drift = 0.0
        self.volume = 0.0  # 0 where nothing is kept
        if wanted:
            p = state.particles
            reference = np.array([m.density for m in state.group_materials])
            fluid = p.host("is_wall") == 0
            self.volume = float((p.host("mass") / reference[p.host("group")])[fluid].sum())

    def attach(self, state: State) -> None:
        """Bind the loops."""
        if self.wanted is False:
            return
        self._parts = state.device.zeros((state.n, 1))
        self._volumes = state.bind(fluid_volume, {"part": self._parts})
        self._scale = state.bind(scale_density)

    def acts(self) -> Mapping[When, Callable[[State], None]]:
        """It measures at the start, and keeps before densities are brought to a step's end."""
        if self.wanted is False:
            return {}
        return {When.START: self.begin, When.DRIFTED: self.keep}

    def begin(self, state: State) -> None:
        """Decide, where that was left open, and measure; or begin with the volume asked for."""
        if self.wanted:
            self.keep(state)
        if self.wanted is not None or self.walls_move or not _walls_stay(state):
            return
        if is_enclosed(state.domain, state.particles, state.mirrors):
            self.volume = self._present(state)

    def _present(self, state: State) -> float:
        self._volumes(state.n)
        return float(state.reduce.sum(self._parts)[0])

    def keep(self, state: State) -> None:
        """Scale densities so that the volume is what it was."""
        if self.volume:
            factor = self._present(state) / self.volume
            self._scale(state.n, factor)
            self.drift = (1.0 + self.drift) * factor - 1.0

    def counts(self, state: State) -> dict[str, float]:
        """What the volume has been put right by."""
        return {"volume put right": self.drift} if self.volume else {}

    def saved(self) -> dict[str, Any]:
        """See :meth:`.Operation.saved`."""
        return {"volume": self.volume, "drift": self.drift}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """See :meth:`.Operation.restore`."""
        self.volume, self.drift = saved["volume"], saved["drift"]


def _walls_stay(state: State) -> bool:
    """Whether no wall has a velocity by which it leaves its place, periodic axes aside."""
    p = state.particles
    leaves = (p.host("is_wall") != 0) & (p.host("slides") == 0)
    return not np.any(p.host("v")[leaves][:, ~state.domain.periodic])
