"""From a description (phases, scheme) to arrays of particles and a neighbour list."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.errors import InputError
from particell.fields import GIVEN, WORK, Field, work
from particell.filling import check_filling
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.particles import Group, Particles
from particell.phases import Phase
from particell.sources.images import Plane
from particell.state import State
from particell.units import place

#: Particles of two phases that are nearer than this part of their size overlap: a filling made
#: twice, or walls put into the fluid.
TOO_NEAR = 0.2
#: Particles nearer than this part of their size never part again.
SAME_PLACE = 1e-6


def build_state(
    domain: Domain,
    phases: list[Phase],
    scheme: Any,
    sound_speed: float | None,
    device: Device,
    seed: int,
    mirrors: tuple[Plane, ...] = (),
) -> State:
    """Particles, materials and a neighbour list from a description.

    Raises
    ------
    InputError
        For what cannot be simulated.
    """
    materials, index = build_materials(phases, sound_speed)
    particles = build_particles(device, domain, phases, index, scheme.support, scheme.at_rest)
    neighbours = build_neighbours(device, domain, particles, scheme.skin or 0.1)
    depth = depth_of(domain, phases)
    return State(device, domain, particles, neighbours, phases, materials, seed, depth, mirrors)


def depth_of(domain: Domain, phases: Sequence[Phase]) -> float:
    """Extent of the dimensions that are not simulated, in m: the smallest spacing by default."""
    if domain.depth is not None:
        return domain.depth
    return min((p.particle_spacing for p in phases), default=1.0)


def build_materials(
    phases: list[Phase], sound_speed: float | None
) -> tuple[list[Fluid], list[int]]:
    """The distinct materials, with sound speeds, and the index of each phase's material."""
    materials: list[Fluid] = []
    index = []
    for phase in phases:
        if phase.material not in materials:
            materials.append(phase.material)
        index.append(materials.index(phase.material))
    complete = [
        m if m.sound_speed is not None or sound_speed is None else m.with_sound_speed(sound_speed)
        for m in materials
    ]
    return complete, index


def build_particles(
    device: Device,
    domain: Domain,
    phases: list[Phase],
    materials: list[int],
    support: float,
    static: bool = False,
) -> Particles:
    """All phases' particles in one set; ``support`` is in particle spacings."""
    check_phases(domain, phases)
    check_overlap(domain, phases)
    check_filling(domain, phases, static)
    groups = [
        Group(p.name, p.kind, material) for p, material in zip(phases, materials, strict=True)
    ]
    sizes = [len(p.points) for p in phases]
    particles = Particles(device, sum(sizes), domain.dim, groups)
    concatenate = np.concatenate
    particles.set("x", concatenate([p.points for p in phases]))
    particles.set("v", concatenate([p.velocities() for p in phases]))
    particles.set("group", np.repeat(np.arange(len(phases)), sizes))
    particles.set("is_wall", np.repeat([p.kind == "wall" for p in phases], sizes))
    particles.set("slides", np.repeat([p.slides for p in phases], sizes))
    density = np.repeat([p.material.density for p in phases], sizes)
    volume = concatenate([p.volume for p in phases])  # type: ignore[arg-type]
    particles.set("density", density)
    particles.set("mass", density * volume)
    spacing = np.array([p.particle_spacing for p in phases])
    if np.ptp(spacing) < 1e-9 * spacing.max():
        spacing[:] = spacing.max()  # equal but for round-off: the fast, uniform loops apply
    particles.set("support", np.repeat(support * spacing, sizes))
    particles.add(Field("volume", role=WORK), volume)
    if any(p.kind == "wall" for p in phases):
        add_wall_geometry(particles, phases)
    return particles


def check_phases(domain: Domain, phases: list[Phase]) -> None:
    """Refuse what cannot be simulated, in one line.

    Raises
    ------
    InputError
        For no particles, names used twice, wrong dimensions, or fluid outside the domain.
    """
    if sum(len(p.points) for p in phases) == 0:
        raise InputError("phases", [p.name for p in phases], "at least one particle")
    names = [p.name for p in phases]
    for name in names:
        if names.count(name) > 1:
            raise InputError("phase", name, "a name used once")
    for p in phases:
        if p.dim != domain.dim:
            raise InputError(f"points of '{p.name}'", p.points.shape, f"of shape (n, {domain.dim})")
        if p.kind == "fluid" and len(p.points):
            outside = np.any((p.points < domain.lower) | (p.points > domain.upper), axis=1)
            if outside.any():
                point = p.points[np.flatnonzero(outside)[0]]
                allowed = f"in the domain, from {place(domain.lower)} to {place(domain.upper)}"
                raise InputError(f"points of '{p.name}'", place(point), allowed)


def check_overlap(
    domain: Domain, phases: Sequence[Phase], within_phase: float = SAME_PLACE
) -> None:
    """Refuse particles of two phases that overlap, and of one phase that are at the same place.

    Overlapping is nearer than :data:`TOO_NEAR` of the smaller one's size, which is volume^(1/D), or
    its spacing where that is less; the same place is nearer than ``within_phase`` of it, by default
    :data:`SAME_PLACE`, as the points of a phase may be at random. Periodic images count.

    Raises
    ------
    InputError
        Naming the phases and a place where they overlap.
    """
    points = np.concatenate([p.points for p in phases])
    if len(points) < 2:
        return
    phase = np.repeat(np.arange(len(phases)), [len(p.points) for p in phases])
    size = np.concatenate(
        [np.minimum(np.asarray(p.volume) ** (1 / domain.dim), p.particle_spacing) for p in phases]
    )
    tree = domain.tree(points)
    i, j = tree.query_pairs(TOO_NEAR * float(size.max()), output_type="ndarray").T
    offset = domain.shortest(tree.data[i] - tree.data[j])
    allowed = np.where(phase[i] == phase[j], within_phase, TOO_NEAR) * np.minimum(size[i], size[j])
    bad = np.flatnonzero(np.linalg.norm(offset, axis=1) < allowed)
    if bad.size:
        first, second = min(zip(i[bad], j[bad], strict=True))
        names = sorted({phases[phase[first]].name, phases[phase[second]].name})
        raise InputError(
            "phases",
            " and ".join(names),
            f"without particles on top of each other: there are two at {place(points[first])}",
        )


def add_wall_geometry(particles: Particles, phases: list[Phase]) -> None:
    """Normal, depth and curvature of the surface nearest to each wall particle."""
    dim = particles.dim
    normal = np.zeros((particles.n, dim))
    depth, curvature = np.zeros(particles.n), np.zeros(particles.n)
    first = 0
    for p in phases:
        rows = slice(first, first + len(p.points))
        first += len(p.points)
        if p.kind != "wall" or p.surface is None or not len(p.points):  # the normal stays zero
            continue
        step = 1e-3 * p.particle_spacing
        normal[rows] = p.surface.normal(p.points, step)
        depth[rows] = np.maximum(0.0, -p.surface.signed_distance(p.points))
        foot = p.points + depth[rows, None] * normal[rows]
        limit = 1.0 / (0.5 * p.particle_spacing)
        curvature[rows] = np.clip(p.surface.curvature(foot, 10 * step), -limit, limit)
    particles.add(work("wall_normal", dim), normal)
    particles.add(Field("wall_depth", role=GIVEN), depth)
    particles.add(Field("wall_curvature", role=GIVEN), curvature)


def build_neighbours(
    device: Device, domain: Domain, particles: Particles, skin: float
) -> NeighbourList:
    """A neighbour list for the particles; ``skin`` is a part of the largest support.

    Raises
    ------
    InputError
        Where support and skin exceed half of a periodic edge.
    """
    support = particles.host("support")
    h = float(support.max())
    reach = h * (1 + skin)
    short = domain.lengths[domain.periodic]
    if short.size and 2 * reach > short.min():
        raise InputError(
            "support",
            h,
            f"at most half of the shortest periodic edge ({short.min():g} m), with skin",
        )
    x = particles.host("x")
    lower = np.where(domain.periodic, domain.lower, np.minimum(domain.lower, x.min(axis=0)))
    upper = np.where(domain.periodic, domain.upper, np.maximum(domain.upper, x.max(axis=0)))
    return NeighbourList(
        device,
        domain,
        particles,
        h,
        skin * h,
        lower,
        upper,
        uniform=bool(support.min() == support.max()),
        walls=bool(particles.host("is_wall").any()),
    )
