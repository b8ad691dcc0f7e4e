"""What a simulation is at an instant: particles, their neighbours, where they are, and the time.

All that acts on particles (stages of a scheme, operations, species) is given the state, and the
state knows of none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from particell.chemistry.contents import Contents
from particell.compute.device import Device
from particell.compute.loop import Loop
from particell.compute.neighbours import NeighbourList
from particell.compute.reduce import Reduction
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.particles import Particles
from particell.phases import Phase
from particell.sources.images import Plane


@dataclass
class Clock:
    """The time, within steps too.

    Attributes
    ----------
    step, time
        Whole steps done, and the time then in s.
    dt
        The time step in s.
    now
        The time in s that positions have reached, in the middle of a step too.
    species_every
        Steps of the flow in one of the species.
    """

    step: int = 0
    time: float = 0.0
    dt: float = 0.0
    now: float = 0.0
    species_every: int = 1

    def tick(self) -> None:
        """A step is done."""
        self.step, self.time = self.step + 1, self.time + self.dt
        self.now = self.time

    def saved(self) -> dict[str, Any]:
        """What :meth:`restore` puts back."""
        return {name: getattr(self, name) for name in ("step", "time", "dt", "species_every")}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on at another clock's time."""
        for name in ("step", "time", "dt", "species_every"):
            setattr(self, name, saved[name])
        self.now = self.time


class State:
    """The state that everything acts on.

    Parameters
    ----------
    device, domain
        Where loops run; the box.
    particles, neighbours
        The particles, and their neighbour list.
    phases, materials
        What the particles were described as; the materials, with sound speeds, by the index that
        the particles' groups have.
    seed
        Of all random numbers.
    depth
        Extent of the dimensions that are not simulated, in m.
    mirrors
        Planes of symmetry, in which particles are seen.

    Attributes
    ----------
    clock
        The :class:`Clock`.
    reduce
        Sums and maxima over all particles (:class:`.Reduction`), the same whoever holds which.
    species
        What particles hold of species, None where there are none.
    """

    def __init__(
        self,
        device: Device,
        domain: Domain,
        particles: Particles,
        neighbours: NeighbourList,
        phases: Sequence[Phase],
        materials: Sequence[Fluid],
        seed: int,
        depth: float,
        mirrors: tuple[Plane, ...] = (),
    ):
        self.device, self.domain, self.seed, self.depth = device, domain, seed, depth
        self.mirrors = mirrors
        self.particles, self.neighbours = particles, neighbours
        self.phases, self.materials = list(phases), list(materials)
        self.species: Contents | None = None
        self.reduce = Reduction(device)
        self.clock = Clock()

    @property
    def n(self) -> int:
        """Number of particles."""
        return len(self.particles)

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return self.domain.dim

    @property
    def depth_factor(self) -> float:
        """depth^(3−D) in m^(3−D): masses of particles are in kg per that."""
        return self.depth ** (3 - self.dim)

    @property
    def step(self) -> int:
        """Steps done."""
        return self.clock.step

    @property
    def time(self) -> float:
        """The time in s, in the middle of a step that which positions have reached."""
        return self.clock.now

    @property
    def dt(self) -> float:
        """The time step in s."""
        return self.clock.dt

    @property
    def group_materials(self) -> list[Fluid]:
        """The material of every group."""
        return [self.materials[g.material] for g in self.particles.groups]

    def bind(
        self, loop: Loop, more: Mapping[str, Any] | None = None, **constants: Any
    ) -> Callable[..., None]:
        """A loop over particles with its arguments looked up among the fields, and ``more``.

        Parameters
        ----------
        loop
            A :func:`~particell.compute.loop.particle_loop`.
        more
            Arrays and numbers by name besides fields and neighbour list.
        **constants
            The loop's compile-time constants.

        Returns
        -------
        callable
            ``f(n, *missing)`` with what is still missing, in the loop's order.
        """
        fields = {**self.neighbours.fields, **self.particles.fields, **(more or {})}
        return self.device.bind(loop, fields, **constants)
