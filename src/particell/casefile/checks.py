"""What a case file may describe that nobody wants: particles on top of each other, for example."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from particell.boundaries.sponge import Sponge
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.phases import Phase
from particell.speeds import Scheme

#: Particles nearer to each other than this part of their spacing overlap.
TOO_NEAR = 0.2


def check_overlap(domain: Domain, phases: Sequence[Phase]) -> None:
    """Refuse particles that are nearer to each other than :data:`TOO_NEAR` spacings.

    Raises
    ------
    InputError
        Naming the phases and a place where they overlap.
    """
    if not sum(len(p.points) for p in phases):
        raise InputError("phases", [p.name for p in phases], "with at least one particle")
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
