"""What a case file may describe that nobody wants: numbers beyond computing, for example."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particell.boundaries.sponge import Sponge
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.phases import Phase
from particell.schemes.timestep import check_number_of_steps
from particell.simulation import Simulation
from particell.speeds import Scheme


def check_sound(
    domain: Domain, phases: Sequence[Phase], scheme: Scheme, boundaries: Sequence[object]
) -> None:
    """Refuse numbers that are too large or too small to compute with.

    Raises
    ------
    InputError
        Naming what is not finite, or zero.
    """
    for p in phases:
        mass = p.material.density * np.asarray(p.volume)
        if mass.size and not np.all((mass > 1e-200) & (mass < 1e200)):
            raise InputError(f"mass of '{p.name}'", float(mass.flat[0]), "from 1e-200 to 1e200 kg")
        p.velocities()  # refuses what is not finite
        for boundary in boundaries:
            if isinstance(boundary, Sponge):
                for target in (boundary.velocity, *boundary.species.values()):
                    if callable(target):
                        target(p.points)  # refuses what is not finite


def check_steps(simulation: Simulation, until: float, every: float) -> None:
    """Refuse steps that no run gets to the end with, and numbers of molecules beyond counting.

    Raises
    ------
    InputError
        Naming the step or the number.
    """
    particles, dt = simulation.particles, simulation.dt
    if "count" in particles and (counts := particles.host("count")).size and counts.min() < 0:
        raise InputError("initial number of molecules", "too large", "at most 2^63 a particle")
    check_number_of_steps(dt, until)
    chosen = simulation.dt, simulation.chemistry_every
    try:
        simulation.plan(every)
    except InputError:
        raise
    except (ArithmeticError, ValueError):
        allowed = "more alike: steps of the flow and of the chemistry do not fit together"
        raise InputError(
            "time scales", f"dt = {dt:.3g} s, frames of {every:.3g} s", allowed
        ) from None
    simulation.dt, simulation.chemistry_every = chosen
