r"""Walls whose surface is not known: the boundary volume fraction.

For fluid particle *i* and the wall particles *S* in its support

.. math:: \varphi_i = \sum_{j\in S} V_j W_{ij}, \qquad
          e_i = -\frac{\nabla\varphi}{|\nabla\varphi|}, \quad
          \nabla\varphi = \sum_{j\in S} V_j \nabla_i W_{ij},

φ is the share of the support that lies in the wall: 0 in the bulk, 1/2 on a plane surface, up to 1
inside; e points from the wall into the fluid. The sum is not divided by that over all neighbours,
since then a lone particle anywhere near a wall would look buried.

**Distance.** Over a plane φ is a function of the distance from it, :func:`fraction_profile`;
:math:`d_i` is where that has the value :math:`\varphi_i`. The wall is taken as layers of particles
one spacing apart, the first half a spacing deep: for a support of three spacings its φ differs by
up to 0.02 from that of a continuous half-space, which would be an error of 5 % in the distance of
the first row of fluid. The depth of a wall particle, as seen by i, is
:math:`d_j = e_i\cdot x_{ij} - d_i`, and velocities are extrapolated through the surface with both
as in :mod:`particell.boundaries.wall`.

**Bounce-back.** A particle with :math:`\varphi_i \ge 1/2` at the end of a step that moves into the
wall leaves the way it came,

.. math:: v_i \leftarrow v_w - u + \Delta t\,a_w, \qquad u = v_i - v_w .

The wall's velocity :math:`v_w` and acceleration :math:`a_w` are means over *S* weighted by
:math:`V_j W_{ij}`; what a turning body adds on the way from each particle to the surface point
:math:`x_i - d_i e_i` is taken along, so that they are a rigid body's own there.

It moves into the wall if φ grew during the step and u does not clearly point out, or if u clearly
points in: :math:`u\cdot e_i < -T|u|` with T = 0.3. The sign of :math:`u\cdot e_i` alone does not
tell. On a lattice e is tilted by the arrangement of the nearest wall particles, by up to 11° at a
support of 2.6 spacings in 3D, and a particle that comes in at a smaller angle seems to leave: at
steps of half the support one got four steps deep. The growth of φ is what it did in fact.

A particle is then at most as deep as it went in one step. That holds while a step is no longer, as
seen from the wall, than half the support: deeper in φ is flat, beyond the middle of the layers its
gradient points out of the other side, and e would be that of the lattice's noise. So e is kept
while a particle is inside and the gradient is small or turns round; and a step longer than that
ends beyond the layers. The automatic step stays below (0.25 of the support over the sum of sound
speed and largest speed). At a convex corner φ = 1/2 lies about half a spacing inside the edge, at a
concave one as far outside. Where the surface is known, see
:mod:`particell.boundaries.impenetrable`.

The means over *S* are no composed sweep: they are asked for at a place that is found on the way,
for the few particles that touch a wall, up to several times each.

Source: Jacob, thesis, UCSB 2020, chapter 3, where the sum is divided and particles that leave are
turned too.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numba import njit

from particell.compute.expressions import Vector, call, sqrt, symbol, where
from particell.compute.loop import compiled, particle_loop
from particell.compute.sweep import Sweep
from particell.kernels import kernel_code, normalisation, power, shape_w
from particell.laws.law import Adds, Law
from particell.laws.pairs import image_offset
from particell.sources.mobile import Particles
from particell.sources.source import Names

#: The volume fraction on a plane wall, from which on a particle is bounced back.
SURFACE = 0.5
#: Below this h|∇φ| (1.25 to 1.31 on a plane surface) e is kept inside walls; so is it at depths
#: of more than 0.38 of the support.
FLAT = 0.6
#: Sine of the angle by which e may be wrong: u·e within ±|u| times that says neither in nor out.
TILT = 0.3
#: Intervals of the table of φ between the distances −1 and 1 supports.
TABLE = 400
#: Nodes of the quadratures behind it.
NODES = 96
#: Weight of neighbours beyond the support in means over walls that have none within it.
LEAST = 1e-9


@compiled
def _shapes(q, code):
    """The kernel without its normalisation at many distances."""
    found = np.empty(len(q))
    for k in range(len(q)):
        found[k] = shape_w(q[k], code)
    return found


def layer_density(kernel: str, dim: int, distance: np.ndarray) -> np.ndarray:
    """The kernel integrated over a plane at a distance in supports, in 1/support."""
    code = kernel_code(kernel)
    found = np.zeros(np.shape(distance))
    near = np.abs(distance) < 1.0
    t = np.abs(distance[near])
    if dim == 1:
        values = _shapes(t, code)
    else:
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = 0.5 * np.sqrt(1.0 - t**2)[:, None]
        across = half * (nodes + 1.0)
        r = np.sqrt(t[:, None] ** 2 + across**2)
        w = _shapes(r.ravel(), code).reshape(r.shape)
        ring = 2.0 if dim == 2 else 2.0 * math.pi * across
        values = (half * weights * ring * w).sum(axis=-1)
    found[near] = normalisation(code, dim) * values
    return found


@functools.cache
def fraction_profile(
    kernel: str, dim: int, support: float | None, intervals: int = TABLE
) -> np.ndarray:
    """φ at evenly spread distances from −1 to 1 supports above a plane wall; never increasing.

    Parameters
    ----------
    kernel, dim
        The kernel and the number of dimensions.
    support
        In spacings of the wall's layers, the first of which is half a spacing deep; None for the
        continuous half-space.
    intervals
        One less than the numbers returned.
    """
    distance = np.linspace(-1.0, 1.0, intervals + 1)
    if support is None:
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        middle, half = 0.5 * (1.0 + distance), 0.5 * (1.0 - distance)
        t = middle[:, None] + half[:, None] * nodes
        found = half * (layer_density(kernel, dim, t) * weights).sum(axis=1)
    else:
        layers = (np.arange(math.ceil(2 * support) + 1) + 0.5) / support
        found = layer_density(kernel, dim, distance[:, None] + layers).sum(axis=1) / support
    found = np.maximum.accumulate(found[::-1])[::-1].copy()
    found.flags.writeable = False
    return found


@njit(error_model="numpy")
def profile_distance(fraction, profile):
    """The distance in supports at which a profile has the value ``fraction``, −1 to 1."""
    low, high = 0, len(profile) - 1
    if fraction >= profile[low]:
        return -1.0
    if fraction <= profile[high]:
        return 1.0
    while high - low > 1:
        middle = (low + high) // 2
        if profile[middle] > fraction:
            low = middle
        else:
            high = middle
    part = (profile[low] - fraction) / (profile[low] - profile[high])
    return 2.0 * (low + part) / (len(profile) - 1) - 1.0


class WallMeasure(Law):
    """φ, e and d of a fluid particle, over the walls that are known by their particles alone."""

    own = ("fraction", "gradient")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """V_j W, and V_j F x_ij."""
        volume = where(j.by_fraction > 0.0, j.volume, 0.0)
        return {"fraction": volume * ij.W, "gradient": (volume * ij.F) * ij.x}

    def finish(self, i: Any, sums: Any) -> Adds:
        """The direction stays inside walls where the gradient is small or turns round."""
        phi, gradient, old = sums.fraction, sums.gradient, i.wall_direction
        size = sqrt(gradient.dot(gradient))
        near = (phi > 0.0) & (size > 0.0)
        unclear = (old.dot(gradient) < 0.0) | (size * i.support < FLAT)
        stays = (phi >= SURFACE) & ((old.dot(old) > 0.0) & unclear)
        inverse = 1.0 / where(near, size, 1.0)
        parts = zip(gradient.parts(i.dim), old.parts(i.dim), strict=True)
        direction = [where(near, where(stays, o, g * inverse), 0.0) for g, o in parts]
        return {
            "wall_fraction": phi,
            "wall_distance": i.support * call(profile_distance, (phi, i.profile)),
            "wall_direction": Vector.of("direction", direction),
        }


def measure_walls(dim: int, kernel: int, uniform: bool) -> Sweep:
    """φ, e and d of fluid particles over the walls of the groups marked in ``by_fraction``."""
    fields = {"x": dim, "support": 0, "volume": 0, "wall_fraction": 0, "wall_distance": 0}
    profile = {"profile": lambda _: symbol("array", "profile")}
    names = Names(dim, {**fields, "wall_direction": dim}, {"by_fraction": True}, derived=profile)
    walls = Particles(first="split", last="stop")
    return Sweep("measure_walls", (WallMeasure(),), (walls,), names, kernel, uniform)


@njit(error_model="numpy")
def surface_motion(
    i,
    ox,
    oy,
    oz,
    x,
    v,
    group,
    volume,
    support,
    wall_normal,
    wall_depth,
    wall_acceleration,
    spin,
    chosen,
    only,
    begin,
    end,
    neighbours,
    wraps,
    period,
    inverse_period,
    DIM,
    KERNEL,
):
    """Velocity and acceleration of walls at x_i + o: means over wall neighbours, v before a.

    Over the groups marked in ``chosen``, or the group ``only`` where that is not negative. Each
    particle shows the motion of its surface point, and with its body turns about that.
    """
    total, ux, uy, uz, ax, ay, az = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ry, rz = 0.0, 0.0
    for k in range(begin, end):
        j = neighbours[k]
        g = np.int64(group[j])
        if (only >= 0 and g != only) or (only < 0 and chosen[g] == 0):
            continue
        sx = image_offset(x, i, j, 0, wraps, period, inverse_period)
        sy = image_offset(x, i, j, 1, wraps, period, inverse_period) if DIM > 1 else 0.0
        sz = image_offset(x, i, j, 2, wraps, period, inverse_period) if DIM > 2 else 0.0
        h = 0.5 * (support[i] + support[j])
        q = math.sqrt(sx * sx + sy * sy + sz * sz) / h
        w = volume[j] * (shape_w(q, KERNEL) + LEAST) / power(h, DIM)
        depth = wall_depth[j]
        rx = sx + ox - depth * wall_normal[j, 0]
        if DIM > 1:
            ry = sy + oy - depth * wall_normal[j, 1]
        if DIM > 2:
            rz = sz + oz - depth * wall_normal[j, 2]
        wx, wy, wz = spin[g, 0], spin[g, 1], spin[g, 2]
        total += w
        ux += w * (v[j, 0] + wy * rz - wz * ry)
        ax += w * wall_acceleration[j, 0]
        if DIM > 1:
            uy += w * (v[j, 1] + wz * rx - wx * rz)
            ay += w * wall_acceleration[j, 1]
        if DIM > 2:
            uz += w * (v[j, 2] + wx * ry - wy * rx)
            az += w * wall_acceleration[j, 2]
    inverse = 1.0 / total
    return ux * inverse, uy * inverse, uz * inverse, ax * inverse, ay * inverse, az * inverse


@particle_loop
def bounce_back(
    i,
    x,
    v,
    is_wall,
    group,
    volume,
    support,
    split,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    wall_normal,
    wall_depth,
    wall_acceleration,
    spin,
    by_fraction,
    wall_fraction,
    wall_direction,
    wall_distance,
    fraction_before,
    bounces,
    dt,
    *,
    DIM,
    KERNEL,
):
    """Turn the velocity of fluid particle i where it moves on into a wall.

    ``bounces[i]`` counts how often that happened; ``fraction_before`` is φ a step ago.
    """
    if is_wall[i]:
        return
    deeper = wall_fraction[i] > fraction_before[i]
    fraction_before[i] = wall_fraction[i]
    if wall_fraction[i] < SURFACE:
        return
    ex, d = wall_direction[i, 0], -wall_distance[i]
    ey = wall_direction[i, 1] if DIM > 1 else 0.0
    ez = wall_direction[i, 2] if DIM > 2 else 0.0
    ux, uy, uz, ax, ay, az = surface_motion(
        i,
        d * ex,
        d * ey,
        d * ez,
        x,
        v,
        group,
        volume,
        support,
        wall_normal,
        wall_depth,
        wall_acceleration,
        spin,
        by_fraction,
        -1,
        split[i],
        stop[i],
        neighbours,
        crosses[i] != 0,
        period,
        inverse_period,
        DIM,
        KERNEL,
    )
    square = (v[i, 0] - ux) ** 2
    approach = (v[i, 0] - ux) * ex
    if DIM > 1:
        square += (v[i, 1] - uy) ** 2
        approach += (v[i, 1] - uy) * ey
    if DIM > 2:
        square += (v[i, 2] - uz) ** 2
        approach += (v[i, 2] - uz) * ez
    doubt = TILT * math.sqrt(square)
    if approach >= doubt or (approach >= -doubt and not deeper):
        return
    bounces[i] += 1
    v[i, 0] = 2.0 * ux - v[i, 0] + dt * ax
    if DIM > 1:
        v[i, 1] = 2.0 * uy - v[i, 1] + dt * ay
    if DIM > 2:
        v[i, 2] = 2.0 * uz - v[i, 2] + dt * az
