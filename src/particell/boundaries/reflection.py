"""Elastic reflection: a particle that crosses a surface is mirrored back and turned around.

A safeguard at solid walls made of particles, and the whole wall of a channel with perfect slip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from particell.checks import checked
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_integer
from particell.errors import InputError
from particell.geometry.shapes import Ball, HalfSpace


@checked
@dataclass(frozen=True)
class Reflection:
    """Fluid particles stay outside a body.

    Parameters
    ----------
    body
        What must not be entered: a :class:`HalfSpace` or a :class:`Ball` (circle, sphere). To
        keep particles inside a ball give ``inside=True``.
    inside
        Particles stay inside the ball instead of outside.
    """

    body: HalfSpace | Ball
    inside: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.body, HalfSpace | Ball):
            raise InputError("body", self.body, "a HalfSpace, Circle or Sphere")
        if self.inside and not isinstance(self.body, Ball):
            raise InputError("inside", True, "False for a half-space")


def surface_table(reflections: list[Reflection], dim: int) -> np.ndarray:
    """One row a surface: (radius or 0 for a plane, side, point or centre, normal)."""
    rows = np.zeros((len(reflections), 2 + 2 * dim))
    for row, reflection in zip(rows, reflections, strict=True):
        body = reflection.body
        row[1] = -1.0 if reflection.inside else 1.0
        if isinstance(body, HalfSpace):
            row[2 : 2 + dim], row[2 + dim :] = body.point, body.direction
        else:
            row[0], row[2 : 2 + dim] = body.radius, body.center
    return rows


@particle_loop
def reflect(i, x, v, is_wall, surfaces, number, period, inverse_period, reflections, *, DIM):
    """Mirror particle i at every surface it has crossed; its normal velocity changes sign.

    ``reflections[i]`` counts how often that happened. A circle's periodic image is met by taking
    the minimum image of the distance from its centre.
    """
    if is_wall[i]:
        return
    for s in range(number):
        radius = surfaces[s, 0]
        side = surfaces[s, 1]
        square, along, flow = 0.0, 0.0, 0.0
        for d in range(DIM):
            offset = x[i, d] - surfaces[s, 2 + d]
            if radius > 0.0:
                offset -= period[d] * nearest_integer(offset * inverse_period[d])
                flow += offset * v[i, d]
            else:
                along += offset * surfaces[s, 2 + DIM + d]
                flow += v[i, d] * surfaces[s, 2 + DIM + d]
            square += offset * offset
        distance = along
        if radius > 0.0:
            r = math.sqrt(square)
            distance = r - radius
            flow /= r + 1e-300
        if side * distance >= 0.0:
            continue
        reflections[i] += 1
        for d in range(DIM):
            normal = surfaces[s, 2 + DIM + d]
            if radius > 0.0:
                offset = x[i, d] - surfaces[s, 2 + d]
                offset -= period[d] * nearest_integer(offset * inverse_period[d])
                normal = offset / (r + 1e-300)
            x[i, d] -= 2.0 * distance * normal
            if side * flow < 0.0:
                v[i, d] -= 2.0 * flow * normal
