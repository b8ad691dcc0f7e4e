"""Small particle systems for the tests of chemistry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
import pytest

from particell.chemistry.engine import Chemistry
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.compute.threads import set_threads
from particell.fields import Field
from particell.geometry.domain import Domain
from particell.particles import Group, Particles


@dataclass
class Lattice:
    """A (disturbed) lattice of side^dim particles in a box of length ``length``."""

    side: int = 6
    dim: int = 2
    length: float = 1e-5
    depth: float = 1e-6
    disturb: float = 0.0
    periodic: str | None = None
    groups: Sequence[Group] = (Group("fluid", "fluid", 0),)
    group_of: Callable[[np.ndarray], np.ndarray] | None = None
    support: float = 3.0
    walls: dict[str, Any] = field(default_factory=dict)

    def particles(self) -> tuple[Device, Particles, NeighbourList]:
        device = Device()
        axes = "xyz"[: self.dim] if self.periodic is None else self.periodic
        domain = Domain((0,) * self.dim, (self.length,) * self.dim, periodic=axes)
        n, dx = self.side**self.dim, self.length / self.side
        particles = Particles(device, n, self.dim, list(self.groups))
        line = (np.arange(self.side) + 0.5) * dx
        x = np.stack(np.meshgrid(*[line] * self.dim, indexing="ij"), -1).reshape(n, self.dim)
        noise = np.random.default_rng(3)
        x = x + self.disturb * dx * noise.uniform(-1, 1, x.shape)
        particles.set("x", x)
        particles.set("support", self.support * dx)
        volume = dx**self.dim
        particles.set("density", 1000.0)
        spread = 1 + self.disturb * noise.uniform(-1, 1, n)
        particles.set("mass", 1000.0 * volume * spread)
        if self.group_of is not None:
            group = np.asarray(self.group_of(x), np.int32)
            particles.set("group", group)
            is_wall = np.array([g.kind == "wall" for g in self.groups])[group]
            particles.set("is_wall", is_wall.astype(np.uint8))
        for name, values in self.walls.items():
            given = np.asarray(values(x), float)
            components = given.shape[1] if given.ndim > 1 else 0
            particles.add(Field(name, components=components), given)
        reach = self.support * dx
        neighbours = NeighbourList(
            device,
            domain,
            particles,
            reach,
            0.1 * reach,
            domain.lower,
            domain.upper,
            True,
            self.group_of is not None,
        )
        return device, particles, neighbours

    def chemistry(self, species, reactions=(), boundaries=(), **options) -> Chemistry:
        device, particles, neighbours = self.particles()
        Chemistry.add_fields(particles, species)
        neighbours.build(particles)
        options.setdefault("depth", self.depth ** (3 - self.dim))
        options.setdefault("normalise", False)
        return Chemistry(device, particles, neighbours, species, reactions, boundaries, **options)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Tiny systems run on one thread: waiting for others would take longer than the work."""
    set_threads(1)
    yield
    set_threads(numba.config.NUMBA_NUM_THREADS)


@pytest.fixture
def lattice() -> type[Lattice]:
    return Lattice


FLUID = Group("fluid", "fluid", 0)
LEFT, RIGHT = Group("left", "wall", 0), Group("right", "wall", 0)


@pytest.fixture
def wall_lattice() -> Callable[..., Lattice]:
    """Fluid between two walls of three layers, x = 6/16 and x = 16/16 of the box."""
    side, length = 16, 1e-5
    dx = length / side

    def group_of(x):
        layer = np.floor(x[:, 0] / dx)
        return np.where(layer < 3, 2, np.where(layer < 6, 1, 0))

    def normal(x):
        sign = np.where(x[:, 0] < 3 * dx, -1.0, np.where(x[:, 0] < 6 * dx, 1.0, 0.0))
        return np.stack([sign] + [0 * sign] * (x.shape[1] - 1), axis=1)

    def depth(x):
        return np.where(x[:, 0] < 3 * dx, x[:, 0], np.where(x[:, 0] < 6 * dx, 6 * dx - x[:, 0], 0))

    walls = {"wall_normal": normal, "wall_depth": depth, "wall_curvature": lambda x: 0 * x[:, 0]}

    def make(**options: Any) -> Lattice:
        return Lattice(
            side=side,
            length=length,
            groups=(FLUID, LEFT, RIGHT),
            group_of=group_of,
            walls=walls,
            **options,
        )

    return make
