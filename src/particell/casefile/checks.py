"""What a case file may describe that nobody wants: particles on top of each other, for example."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from particell.boundaries.sponge import Sponge
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.phases import Phase
from particell.simulation import Simulation
from particell.speeds import Scheme

#: More steps than anybody waits for.
MOST_STEPS = 1e12
#: Particles nearer to each other than this part of their spacing overlap.
TOO_NEAR = 0.2


def check_overlap(domain: Domain, phases: Sequence[Phase]) -> None:
    """Refuse particles that are nearer to each other than :data:`TOO_NEAR` spacings.

    Raises
    ------
    InputError
        Naming the phases and a place where they overlap.
    """
    points = np.concatenate([p.points for p in phases])
    phase = np.repeat(np.arange(len(phases)), [len(p.points) for p in phases])
    spacing = np.array([p.particle_spacing for p in phases])
    periods = np.where(domain.periodic, domain.lengths, 0.0)
    origin = points.min(axis=0)
    wrapped = points - np.where(domain.periodic, domain.lower, origin)
    wrapped = np.where(domain.periodic, np.mod(wrapped, domain.lengths), wrapped)
    wrapped[wrapped >= np.where(domain.periodic, domain.lengths, np.inf)] = 0.0
    reach = TOO_NEAR * spacing[phase]
    near, nearest = cKDTree(wrapped, boxsize=periods).query(
        wrapped, k=2, distance_upper_bound=float(reach.max())
    )
    # the nearest is the particle itself, or one at the same place
    other = np.where(nearest[:, 0] == np.arange(len(points)), nearest[:, 1], nearest[:, 0])
    distance, other = near[:, 1], np.minimum(other, len(points) - 1)
    bad = np.flatnonzero(distance < np.minimum(reach, reach[other]))
    if bad.size:
        i, j = bad[0], other[bad[0]]
        names = sorted({phases[phase[i]].name, phases[phase[j]].name})
        raise InputError(
            "phases",
            " and ".join(names),
            f"without particles on top of each other: there are two at {points[i].tolist()} m",
        )


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
        if not np.all(np.isfinite(p.velocities())):
            raise InputError(f"velocity of '{p.name}'", "nan or inf", "finite")
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
    if not (math.isfinite(dt) and dt > 0 and until / dt <= MOST_STEPS):
        raise InputError("dt", dt, f"at least {until / MOST_STEPS:.3g} s, for a run of {until:g} s")
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
