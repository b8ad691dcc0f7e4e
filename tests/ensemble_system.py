"""A line of particles with A ⇌ B that diffuses, as molecules: what the tests of ensembles realise.

Both convert and spread linearly and start as independent Poisson numbers, so that the numbers of
all particles are independent Poisson numbers at all times, about means that are known exactly.
"""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass

import numpy as np

import particell as pc
from particell.ensemble import realisation_seed
from particell.recipe import Context, Recipe

NUMBER, SPACING, DIFFUSIVITY = 12, 1.0, 0.1
FORWARD, BACKWARD, UNTIL, EVERY = 0.7, 0.3, 2.0, 0.5
MEAN, WAVE = 600.0, 2 * np.pi / NUMBER


def build(seed: int, shift: float = 0.0) -> pc.Simulation:
    """The line; with molecules only of A, Poisson about MEAN (1 + cos(k x)/2)."""
    line = pc.Domain((0,), (NUMBER * SPACING,), periodic="x", depth=1.0)
    phase = pc.fluid(line, pc.Fluid(density=1.0, viscosity=1.0), SPACING)
    points = phase.points + shift
    simulation = pc.Simulation(
        line,
        pc.Phase("fluid", phase.material, points, SPACING),
        pc.Static(support=1.8),
        [pc.Species("A", DIFFUSIVITY, molecules=True), pc.Species("B", DIFFUSIVITY, True)],
        [pc.Reaction("A <-> B", FORWARD, BACKWARD)],
        seed=seed,
        dt=0.05,
        normalise_diffusion=True,
    )
    expected = MEAN * (1 + 0.5 * np.cos(WAVE * simulation.particles.host("x")[:, 0]))
    simulation.chemistry.set_count("A", np.random.default_rng(seed).poisson(expected))
    return simulation


@dataclass(frozen=True)
class Line(Recipe):
    """The line as a recipe that is no case."""

    shift: float = 0.0
    name, title, until, every = "line", "A line of particles", UNTIL, EVERY

    def identity(self) -> dict[str, float]:
        return {"shift": self.shift}

    def build(self, context: Context) -> pc.Simulation:
        return build(context.seed, self.shift)


def exact(x: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Means of A and B: three neighbours are the central difference, whose modes are cosines."""
    decay = 2 * DIFFUSIVITY / SPACING**2 * (1 - np.cos(WAVE * SPACING))
    total = MEAN * (1 + 0.5 * np.cos(WAVE * x) * np.exp(-decay * time))
    both = FORWARD + BACKWARD
    share = (BACKWARD + FORWARD * np.exp(-both * time)) / both
    return total * share, total * (1 - share)


def elsewhere(seed: int) -> pc.Simulation:
    """Particles at places that depend on the seed."""
    return build(seed, shift=0.1 * (seed % 97) / 97)


def deadly(seed: int) -> pc.Simulation:
    """Realisation 1 of master seed 1 takes its process down."""
    if seed == realisation_seed(1, 1):
        os._exit(9)
    return build(seed)


def interrupting(seed: int) -> pc.Simulation:
    """Realisation 1 of master seed 1 gets Ctrl-C half way, as long as HALT is set."""
    simulation = build(seed)
    plain = simulation.observables

    def observables() -> dict[str, float]:
        if os.environ.get("HALT") and 0.4 * UNTIL < simulation.time < 0.6 * UNTIL:
            signal.raise_signal(signal.SIGINT)
        return plain()

    if seed == realisation_seed(1, 1):
        simulation.observables = observables
    return simulation
