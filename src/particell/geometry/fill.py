"""Filling shapes with particles: lattices, rings, jitter, and relaxed ("packed") arrangements."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from particell.checks import checked, finite, not_negative, positive
from particell.errors import InputError, unknown_name
from particell.geometry.domain import Domain
from particell.geometry.pairs import neighbour_pairs
from particell.geometry.shapes import Ball, Box, Shape

#: Displacements in spacings: of a jittered lattice, and before packing.
JITTER, SHAKEN = 0.1, 0.3
ARRANGEMENTS = ("square", "hexagonal", "jittered", "packed")
#: More points than anybody has memory for.
MOST_POINTS = 1e10


def _fits_in_memory(number: float, spacing: float) -> None:
    if not number <= MOST_POINTS:  # a NaN too
        allowed = f"larger: more than {MOST_POINTS:g} particles fit in no memory"
        raise InputError("spacing", spacing, allowed)


def fitting_spacing(domain: Domain, spacing: float) -> np.ndarray:
    """Spacings (dim,) nearest to ``spacing`` that divide the domain's edges evenly."""
    positive("spacing", spacing)
    with np.errstate(over="ignore"):
        numbers = np.round(domain.lengths / spacing)
    _fits_in_memory(numbers.prod(), spacing)
    if np.any(numbers < 1):
        raise InputError("spacing", spacing, f"at most the shortest edge, {domain.lengths.min():g}")
    return domain.lengths / numbers


@checked
def lattice(
    domain: Domain, spacing: float, shape: Shape | None = None, kind: str = "square"
) -> np.ndarray:
    """Points of a lattice inside a domain, and inside a shape if one is given.

    Parameters
    ----------
    domain
        The box that holds the points; the lattice fits it evenly, points at cell centres.
    spacing
        Wanted distance of neighbours, in m; see :func:`fitting_spacing`.
    shape
        Only points inside this shape are kept.
    kind
        ``"square"`` (cubic in 3D) or ``"hexagonal"`` (2D only: rows along x, shifted by half).

    Returns
    -------
    ndarray
        Points (n, dim) in m.
    """
    if kind == "hexagonal" and domain.dim == 2:
        points = _hexagonal(domain, spacing)
    elif kind == "square":
        steps = fitting_spacing(domain, spacing)
        axes = [
            low + (np.arange(round(length / step)) + 0.5) * step
            for low, length, step in zip(domain.lower, domain.lengths, steps, strict=True)
        ]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, domain.dim)
    else:
        raise InputError("kind", kind, "'square', or 'hexagonal' in 2D")
    return points if shape is None else points[shape.contains(points)]


def _hexagonal(domain: Domain, spacing: float) -> np.ndarray:
    """Rows along x whose number is even, so that the lattice is periodic in y too."""
    # the area of a particle stays spacing**2
    across = spacing * math.sqrt(2 / math.sqrt(3))
    columns = max(1, round(domain.lengths[0] / across))
    rows = max(2, 2 * round(domain.lengths[1] / (across * math.sqrt(3))))
    step_x, step_y = domain.lengths[0] / columns, domain.lengths[1] / rows
    k, row = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    x = domain.lower[0] + (k + 0.25 + 0.5 * (row % 2)) * step_x
    y = domain.lower[1] + (row + 0.5) * step_y
    return np.stack([x, y], axis=-1).reshape(-1, 2)


@checked
def jittered(points: np.ndarray, amplitude: float, seed: int) -> np.ndarray:
    """Points displaced by independent normal numbers of the given amplitude (m)."""
    not_negative("amplitude", amplitude)
    not_negative("seed", seed)
    points = finite("points", points)
    return points + amplitude * np.random.default_rng(seed).standard_normal(points.shape)


def wrapped(domain: Domain, points: np.ndarray) -> np.ndarray:
    """Points (n, D) that left through a periodic edge, in again on the other side."""
    return np.where(
        domain.periodic, domain.lower + (points - domain.lower) % domain.lengths, points
    )


@checked
def arranged(
    domain: Domain,
    spacing: float,
    kind: str,
    seed: int,
    fixed: np.ndarray | None = None,
) -> np.ndarray:
    """Fill a domain in one of the arrangements that cases offer.

    Parameters
    ----------
    domain, spacing
        As for :func:`lattice`; no particle is placed outside of the domain.
    kind
        ``"square"`` (a line in 1D, cubic in 3D), ``"hexagonal"``, ``"jittered"`` (a square lattice
        whose points are displaced at random by :data:`JITTER` spacings) or ``"packed"``.
    seed
        Of the random displacements.
    fixed
        Points outside (walls), which ``"packed"`` keeps its distance from.

    Returns
    -------
    ndarray
        Points (n, dim) in m; jittered and packed ones all stand for the same volume.
    """
    if kind not in ARRANGEMENTS:
        raise unknown_name("kind", kind, ARRANGEMENTS)
    not_negative("seed", seed)
    points = lattice(domain, spacing, kind="hexagonal" if kind == "hexagonal" else "square")
    if kind not in ("jittered", "packed"):
        return points
    amplitude = JITTER if kind == "jittered" else SHAKEN
    moved = jittered(points, amplitude * spacing, seed)
    inside = np.clip(moved, domain.lower + 0.2 * spacing, domain.upper - 0.2 * spacing)
    points = wrapped(domain, np.where(domain.periodic, moved, inside))
    if kind == "jittered":
        return points
    lower = np.where(domain.periodic, -np.inf, domain.lower)
    upper = np.where(domain.periodic, np.inf, domain.upper)
    room = None if domain.periodic.all() else Box(list(lower), list(upper))
    return packed(points, domain, spacing, fixed, keep_inside=room)


@checked
def rings(ball: Ball, inner: float, outer: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Particles on concentric circles that fill the ring inner < r < outer of a circle.

    Parameters
    ----------
    ball
        A circle: its centre is used.
    inner, outer
        Radii in m; ``inner`` may be zero.
    spacing
        Wanted distance of neighbours in m.

    Returns
    -------
    points, volumes
        Points (n, 2) in m and their areas (n,) in m², which add up to the ring's area.
    """
    points, volumes = [], []
    for low, high in _layers(inner, outer, spacing, 2):
        area = math.pi * (high**2 - low**2)
        # the radius that halves the layer's area, or its centre of mass for a wedge
        radius = 2 / 3 * (high**3 - low**3) / (high**2 - low**2)
        number = max(1, round(area / spacing**2))
        if low == 0 and number <= 2:
            number, radius = 1, 0.0
        angle = 2 * math.pi * (np.arange(number) + 0.5) / number
        points.append(ball.center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
        volumes.append(np.full(number, area / number))
    return np.concatenate(points), np.concatenate(volumes)


@checked
def shells(ball: Ball, inner: float, outer: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Particles on concentric spheres that fill the shell inner < r < outer: :func:`rings` in 3D.

    On each sphere they start on a spiral of equal areas (Fibonacci's) and are spread evenly by
    repulsion; all of one sphere stand for the same volume.

    Parameters
    ----------
    ball
        A sphere: its centre is used.
    inner, outer
        Radii in m; ``inner`` may be zero.
    spacing
        Wanted distance of neighbours in m.

    Returns
    -------
    points, volumes
        Points (n, 3) in m and their volumes (n,) in m³, which add up to the shell's volume.
    """
    if len(ball.center) != 3:
        raise InputError("ball", ball, "a sphere in 3 dimensions ('rings' are for 2)")
    points, volumes = [], []
    for low, high in _layers(inner, outer, spacing, 3):
        volume = 4 / 3 * math.pi * (high**3 - low**3)
        # the centre of mass of a narrow cone's part in the layer
        radius = 3 / 4 * (high**4 - low**4) / (high**3 - low**3)
        number = max(1, round(volume / spacing**3))
        if low == 0 and number <= 2:
            number, radius = 1, 0.0
        points.append(ball.center + radius * _on_sphere(number))
        volumes.append(np.full(number, volume / number))
    return np.concatenate(points), np.concatenate(volumes)


def _layers(inner: float, outer: float, spacing: float, dim: int) -> Iterable[tuple[float, float]]:
    """Inner and outer radii of the layers of particles between two radii."""
    if not 0 <= inner < outer:
        raise InputError("inner", inner, f"between 0 and 'outer' = {outer:g}")
    positive("spacing", spacing)
    _fits_in_memory((outer / spacing) ** dim, spacing)
    layers = max(1, round((outer - inner) / spacing))
    return pairwise(np.linspace(inner, outer, layers + 1))


def _on_sphere(number: int, iterations: int = 50) -> np.ndarray:
    """Points (n, 3) spread evenly on the unit sphere."""
    k = np.arange(number) + 0.5
    z, angle = 1.0 - 2.0 * k / number, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    points = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=-1)
    if number < 2:
        return points
    reach = 2.4 * math.sqrt(4.0 * math.pi / number)
    for _ in range(iterations):
        pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
        i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
        offset = points[i] - points[j]
        r = np.linalg.norm(offset, axis=1)
        weight = (1.0 - r / reach) ** 2 / (r / reach)
        total = np.bincount(i, weight, number).clip(1e-12)
        push = np.stack([np.bincount(i, weight * offset[:, d], number) for d in range(3)], axis=-1)
        shift = push * (0.5 / total[:, None])
        points += shift - points * (points * shift).sum(axis=1, keepdims=True)
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        if np.abs(shift).max() < 1e-3 * reach:
            break
    return points


@checked
def around(
    domain: Domain,
    spacing: float,
    ball: Ball,
    fixed: np.ndarray | None = None,
    reach: float = 6.0,
) -> np.ndarray:
    """A lattice around a ball, with as many points as fit beside it, those near it packed.

    Parameters
    ----------
    domain, spacing
        As for :func:`lattice`.
    ball
        What stays free: the points nearest to its centre are left out, as many as fit in it.
    fixed
        Points (m, dim) that push but do not move: walls, what fills the ball.
    reach
        How near to the ball points are packed, in spacings.

    Returns
    -------
    ndarray
        Points (n, dim) in m, sorted along the first axis.
    """
    not_negative("reach", reach)
    everything = lattice(domain, spacing)
    gap = ball.signed_distance(everything)
    left_out = round(ball.volume(domain.dim) * len(everything) / domain.volume)
    points = everything[np.argsort(gap, kind="stable")[left_out:]]
    near = ball.signed_distance(points) < reach * spacing
    others = points[~near] if fixed is None else np.concatenate([points[~near], fixed])
    points[near] = packed(points[near], domain, spacing, others, keep_inside=~ball)
    return points[np.lexsort(points.T[::-1])]


@checked
def packed(
    points: np.ndarray,
    domain: Domain,
    spacing: float,
    fixed: np.ndarray | None = None,
    keep_inside: Shape | None = None,
    tolerance: float = 2e-3,
    iterations: int = 400,
) -> np.ndarray:
    """Relax points until they are evenly spread, by the transport-velocity shift alone.

    Each iteration moves point i by a step along Σ_j (1 − q)² e_ij with q = r/h and h 2.4 spacings,
    away from where neighbours crowd. (Lucy's F x_ij = 12 α (1 − q)² x_ij / h² would vanish where
    two points meet, and points would gather in pairs.)

    Parameters
    ----------
    points
        Points (n, D) to be moved, in m.
    domain
        Gives the periodic faces.
    spacing
        Distance of neighbours in m.
    fixed
        Points (m, D) that push but do not move: walls, bodies.
    keep_inside
        Points that leave this shape are put back on the near side of its surface.
    tolerance
        Stop when no point moves by more than this part of the spacing.
    iterations
        Largest number of iterations.

    Returns
    -------
    ndarray
        Points (n, D) in m.
    """
    positive("spacing", spacing)
    positive("iterations", iterations)
    support = 2.4 * spacing
    not_negative("tolerance", tolerance)
    moving = finite("points", points)
    if moving.ndim != 2 or moving.shape[1] != domain.dim:
        raise InputError("points", moving.shape, f"of shape (n, {domain.dim})")
    others = np.empty((0, domain.dim)) if fixed is None else np.asarray(fixed, dtype=float)
    if not len(moving):
        return moving
    for _ in range(iterations):
        everything = np.concatenate([moving, others])
        shift = np.zeros_like(moving)
        i, _, offset = neighbour_pairs(everything, domain, support, len(moving))
        r = np.linalg.norm(offset, axis=1)
        weight = np.maximum(0.0, 1.0 - r / support) ** 2 / (r / support + 1e-3)
        for d in range(domain.dim):
            shift[:, d] = np.bincount(i, weight * offset[:, d], minlength=len(moving))
        # the stiffness against a single displacement is about the sum of weights itself
        shift *= 0.5 / np.bincount(i, weight, minlength=len(moving)).clip(1e-12)[:, None]
        length = np.linalg.norm(shift, axis=1, keepdims=True)
        shift *= np.minimum(1.0, 0.1 * spacing / np.maximum(length, 1e-300))
        moving += shift
        if keep_inside is not None:
            moving = _put_back(moving, keep_inside, 0.3 * spacing)
        moving = wrapped(domain, moving)
        if np.abs(shift).max() < tolerance * spacing:
            break
    return moving


def _put_back(points: np.ndarray, shape: Shape, margin: float) -> np.ndarray:
    distance = shape.signed_distance(points) + margin
    out = distance > 0
    if np.any(out):
        points = points.copy()
        normal = shape.normal(points[out], 1e-3 * margin)
        points[out] -= distance[out, None] * normal
    return points
