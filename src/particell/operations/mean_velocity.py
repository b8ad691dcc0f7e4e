"""Flow rates that are kept: the fluid's mean velocity is put right at the end of every step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particell.boundaries.mean_velocity import MeanVelocity, add_velocity, axial_momentum
from particell.errors import InputError
from particell.operations.operation import Operation, When
from particell.state import State


class KeepMeans(Operation):
    """All mean velocities that a simulation keeps.

    Raises
    ------
    InputError
        Where an axis is not periodic.
    """

    when = When.END

    def __init__(self, means: Sequence[MeanVelocity], periodic: np.ndarray):
        for mean in means:
            if mean.axis not in np.flatnonzero(periodic):
                raise InputError("axis of MeanVelocity", mean.axis, "that of a periodic direction")
        self.means = list(means)

    def attach(self, state: State) -> None:
        """Bind the loops."""
        self._momentum = state.device.zeros((state.n, 1), np.float64)
        particles = state.particles
        mass = np.where(particles.view("is_wall") == 0, particles.view("mass"), 0.0)
        self._mass = float(state.reduce.sum(mass[:, None])[0])
        more = {"momentum": self._momentum}
        self._loops = [
            (
                mean.velocity,
                state.bind(axial_momentum, more, AXIS=mean.axis),
                state.bind(add_velocity, AXIS=mean.axis),
            )
            for mean in self.means
        ]

    def __call__(self, state: State) -> None:
        """Add what is missing to all fluid particles."""
        for velocity, measure, add in self._loops:
            measure(state.n)
            now = float(state.reduce.sum(self._momentum)[0]) / self._mass
            add(state.n, velocity - now)
