"""Walls of particles: velocities extrapolated through the surface, the fluid's own properties.

See :mod:`particell.boundaries.wall` for the extrapolation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from numba import njit

from particell.boundaries.wall import (
    CLOSEST,
    extrapolation,
    missed,
    plane_distances,
    surface_distance,
)
from particell.compute.expressions import Number, Vector, call, early, maximum, symbol
from particell.laws.viscosity import TINY, sheared
from particell.sources.source import Pair, Side, Source

#: What laws see of a wall particle: the properties of the fluid that meets it.
FLUIDS_OWN = ("transverse", "radial", "thermal", "kernel_sum")


@njit
def seen_wall(
    i,
    j,
    dx,
    dy,
    dz,
    support,
    wall_normal,
    wall_depth,
    wall_curvature,
    wall_direction,
    wall_distance,
    DIM,
    UNKNOWN,
):
    """The factor of differences, d_i, d_j and the normal of the surface between i and j."""
    depth = wall_depth[j]
    nx = wall_normal[j, 0]
    ny = wall_normal[j, 1] if DIM > 1 else 0.0
    nz = wall_normal[j, 2] if DIM > 2 else 0.0
    curvature = wall_curvature[j]
    tx, ty, tz = dx - depth * nx, dy - depth * ny, dz - depth * nz
    distance = surface_distance(tx, ty, tz, nx, ny, nz, curvature)
    if UNKNOWN and nx == 0.0 and ny == 0.0 and nz == 0.0:
        distance, depth = plane_distances(i, dx, dy, dz, wall_direction, wall_distance, DIM)
        curvature = 0.0
        nx = wall_direction[i, 0]
        ny = wall_direction[i, 1] if DIM > 1 else 0.0
        nz = wall_direction[i, 2] if DIM > 2 else 0.0
    grow = extrapolation(distance, depth, support, curvature, DIM)
    return grow, distance, depth, nx, ny, nz


class WallPair(Pair):
    """A pair of fluid and wall; ``missed`` is q_ij of :mod:`particell.boundaries.wall`."""

    distance: Number
    depth: Number
    normal: tuple[Number, ...]

    @cached_property
    def v(self) -> Vector:
        """v_i − v_j, extrapolated."""
        own, its = (getattr(s, n) for s, n in zip((self.i, self.j), self._velocity, strict=True))
        parts = zip(own.parts(self.dim), its.parts(self.dim), strict=True)
        return Vector.of("v", (self.extrapolation * (p - q) for p, q in parts))

    @property
    def above(self) -> Number:
        """d_i, bounded below as in the extrapolation."""
        return maximum(self.distance, CLOSEST * self.i.support)

    @property
    def missed(self) -> Number:
        """What the extrapolation misses of quadratic profiles, by the friction's shear along it."""
        along: Number = 0.0
        for n, d in zip(self.normal, self.x.parts(self.dim), strict=False):
            along = along + n * d
        square = along * along / (self.square + TINY)
        share = call(sheared, (self.i.transverse, self.i.radial, square, self.dim))
        q = call(missed, (self.distance, self.depth, self.i.support, self.extrapolation))
        return early(q * share)


@dataclass(frozen=True)
class Walls(Source):
    """Wall particles of a row.

    Attributes
    ----------
    unknown
        Whether some have no known surface.
    velocity, its
        The names of the velocity of the fluid and of the wall that ij.v is made of.
    weighed
        The array along the list that has the pairs' weights, if they are kept.
    """

    unknown: bool = False
    velocity: str = "v"
    its: str = "v"
    weighed: str = ""
    first: str = "split"
    last: str = "stop"

    def see(self, i: Side, j: Side, kernel: int, uniform: bool) -> tuple[Side, Side, Any]:
        """i, j and the pair as laws see them."""
        dim = i.names.dim
        dx: list[Number] = [symbol("pair", f"dx{d}", "pair") for d in range(dim)]
        dx += [0.0] * (3 - dim)
        surface = ("direction", "distance") if self.unknown else ("normal", "depth")  # not read
        names = ("normal", "depth", "curvature", *surface)
        arrays = [symbol("array", f"wall_{name}") for name in names]
        args = (i.index, j.index, *dx, i.support, *arrays, dim, self.unknown)
        grow, distance, depth, *normal = call(seen_wall, args, 6, early=True)
        known = {n for n in FLUIDS_OWN if n in i.names}
        j = j.replace(**{name: getattr(i, name) for name in known})
        pair = WallPair(i, j, kernel, uniform, (self.velocity, self.its), True, grow)
        pair.distance, pair.depth, pair.normal = distance, depth, tuple(normal[:dim])
        pair.weighed = self.weighed
        return i, j, pair
