"""Particles at rest: for reaction and diffusion without flow."""

from __future__ import annotations

import math
from dataclasses import dataclass

from particell.checks import checked
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.particles import Particles
from particell.schemes.checks import check_kernel


@checked
@dataclass(frozen=True)
class Static:
    """No flow: particles keep their places and densities.

    Parameters
    ----------
    kernel, support
        As for :class:`~particell.schemes.sdpd.SDPD`; they serve the species' diffusion.
    """

    kernel: str = "lucy"
    support: float = 2.0
    skin: float = 1e-9
    density: str = "continuity"
    fluctuations: bool = False
    gravity: None = None

    def __post_init__(self) -> None:
        check_kernel(self.kernel, self.support)
        if not 0 < self.skin <= 1:
            raise InputError("skin", self.skin, "between 0 and 1 supports")

    def solver(
        self,
        device: Device,
        domain: Domain,
        particles: Particles,
        neighbours: NeighbourList,
        materials: list[Fluid],
        seed: int,
        depth_factor: float,
    ) -> StaticSolver:
        """What holds the particles still."""
        return StaticSolver(particles, neighbours)


class StaticSolver:
    """Builds the neighbour list once; a step does nothing."""

    def __init__(self, particles: Particles, neighbours: NeighbourList):
        self.particles, self.neighbours = particles, neighbours
        self.time, self.law_limit = 0.0, math.inf  # nothing depends on them

    def initialise(self, step: int, dt: float) -> None:
        """Build the neighbour list."""
        self.neighbours.build(self.particles)

    def restore(self) -> None:
        """Nothing to do: the neighbour list was put back."""

    def step(self, step: int, dt: float) -> None:
        """Nothing moves."""

    def finish(self, step: int, dt: float) -> None:
        """Nothing moved."""
