r"""Walls with a known surface that nothing penetrates: bounce-back at the surface itself.

A fluid particle that ends a step beyond the surface of a wall goes back on the path it came, as
seen from the wall. With its depth δ, the surface's outward normal *n* and its velocity
:math:`\tilde u = \tilde v - v_w` relative to the wall, with which it was moved,

.. math:: x_i \leftarrow x_i - 2 s\,\tilde u, \qquad
          s = \min\left(\frac{\delta}{|\tilde u\cdot n|}, \Delta t\right),

mirrors the path at the surface: exactly on a plane, and on a convex body it ends outside. Where it
is still inside (cavities, corners) it is mirrored along the normal; and if that does not help in a
few trials it is put back to where it was, as seen from the wall, when the step began. If
:math:`u = v_i - v_w` points into the wall,

.. math:: v_i \leftarrow v_w - u + \Delta t\,a_w .

Distances are those of the wall's :class:`~particell.geometry.shapes.Shape` in the frame of its
body (of the periodic image to which its nearest particle belongs), corners included
(:mod:`particell.geometry.program`): what has been outside stays outside, at any speed at which a
particle does not leave its wall neighbours behind in one step.
This is no sum over neighbours, and so no composed sweep: of them only the nearest one is wanted, of
which body by body a program is evaluated, and again after each trial.
:math:`v_w` and :math:`a_w` are those of :mod:`particell.boundaries.volume_fraction`, which is also
what acts at walls without a known surface.
"""

from __future__ import annotations

import math

import numpy as np

from particell.boundaries.volume_fraction import surface_motion
from particell.compute.loop import particle_loop
from particell.geometry.program import program_distance
from particell.laws.pairs import image_offset

#: Trials to find a place outside all walls; the first goes along the path, the last to its start.
TRIALS = 5
#: How far beyond the surface a particle is put besides, in supports: more than round-off.
CLEAR = 1e-9
#: Step of the differences for a surface's normal, in supports.
STEP = 1e-5


@particle_loop
def turn_back(
    i,
    x,
    v,
    transport,
    is_wall,
    slides,
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
    body_point,
    rotation,
    spin,
    solid,
    first_code,
    codes,
    numbers,
    bounces,
    dt,
    *,
    DIM,
    KERNEL,
):
    """Put particle i back outside the walls of groups marked in ``solid``.

    ``bounces[i]`` counts how often that happened.
    """
    if is_wall[i] != 0 or split[i] == stop[i]:
        return
    wraps = crosses[i] != 0
    sx, sy, sz, px, py, pz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ux, uy, uz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    mx, my, mz = 0.0, 0.0, 0.0
    # where and with what velocity it arrived; these change below
    ox, oy, oz = x[i, 0], 0.0, 0.0
    tx, ty, tz = transport[i, 0], 0.0, 0.0
    if DIM > 1:
        oy, ty = x[i, 1], transport[i, 1]
    if DIM > 2:
        oz, tz = x[i, 2], transport[i, 2]
    clear, step = CLEAR * support[i], STEP * support[i]
    for trial in range(TRIALS):
        outside = True
        for g in range(len(solid)):
            if solid[g] == 0:
                continue
            # the nearest one tells which periodic image of the body it is
            least, j = np.inf, neighbours[split[i]]
            for k in range(split[i], stop[i]):
                other = neighbours[k]
                if group[other] != g:
                    continue
                r2 = 0.0
                for d in range(DIM):
                    s = image_offset(x, i, other, d, wraps, period, inverse_period)
                    r2 += s * s
                if r2 < least:
                    least, j = r2, other
            if least == np.inf:
                continue
            sx = image_offset(x, i, j, 0, wraps, period, inverse_period)
            if DIM > 1:
                sy = image_offset(x, i, j, 1, wraps, period, inverse_period)
            if DIM > 2:
                sz = image_offset(x, i, j, 2, wraps, period, inverse_period)
            px = body_point[j, 0] + rotation[g, 0] * sx
            if DIM == 2:
                px += rotation[g, 2] * sy
                py = body_point[j, 1] + rotation[g, 1] * sx + rotation[g, 3] * sy
            if DIM == 3:
                px += rotation[g, 3] * sy + rotation[g, 6] * sz
                py = body_point[j, 1] + rotation[g, 1] * sx
                py += rotation[g, 4] * sy + rotation[g, 7] * sz
                pz = body_point[j, 2] + rotation[g, 2] * sx
                pz += rotation[g, 5] * sy + rotation[g, 8] * sz
            a, b = first_code[g], first_code[g + 1]
            distance = program_distance(px, py, pz, a, b, codes, numbers, DIM)
            if distance >= 0.0:
                continue
            outside = False
            if trial == 0:
                bounces[i] += 1
            # the outward normal, by differences in the body's frame, turned into this one
            gx = program_distance(px + step, py, pz, a, b, codes, numbers, DIM)
            gx -= program_distance(px - step, py, pz, a, b, codes, numbers, DIM)
            gy, gz = 0.0, 0.0
            if DIM > 1:
                gy = program_distance(px, py + step, pz, a, b, codes, numbers, DIM)
                gy -= program_distance(px, py - step, pz, a, b, codes, numbers, DIM)
            if DIM > 2:
                gz = program_distance(px, py, pz + step, a, b, codes, numbers, DIM)
                gz -= program_distance(px, py, pz - step, a, b, codes, numbers, DIM)
            size = math.sqrt(gx * gx + gy * gy + gz * gz) + 1e-300
            gx, gy, gz = gx / size, gy / size, gz / size
            nx = rotation[g, 0] * gx
            if DIM == 2:
                nx += rotation[g, 1] * gy
                ny = rotation[g, 2] * gx + rotation[g, 3] * gy
            if DIM == 3:
                nx += rotation[g, 1] * gy + rotation[g, 2] * gz
                ny = rotation[g, 3] * gx + rotation[g, 4] * gy + rotation[g, 5] * gz
                nz = rotation[g, 6] * gx + rotation[g, 7] * gy + rotation[g, 8] * gz
            ux, uy, uz, ax, ay, az = surface_motion(
                i,
                -distance * nx,
                -distance * ny,
                -distance * nz,
                x,
                v,
                group,
                volume,
                support,
                wall_normal,
                wall_depth,
                wall_acceleration,
                spin,
                solid,
                g,
                split[i],
                stop[i],
                neighbours,
                wraps,
                period,
                inverse_period,
                DIM,
                KERNEL,
            )
            # the path as seen from the body, which a surface that slides does not take along
            own = 0.0 if slides[j] != 0 else 1.0
            mx, my, mz = tx - own * ux, ty - own * uy, tz - own * uz
            along = mx * nx + my * ny + mz * nz
            lift = 2.0 * (clear - distance)
            if trial == TRIALS - 1:
                x[i, 0] = ox - dt * mx
                if DIM > 1:
                    x[i, 1] = oy - dt * my
                if DIM > 2:
                    x[i, 2] = oz - dt * mz
            elif trial == 0 and along < 0.0 and -along * dt > clear - distance:
                back = lift / along
                x[i, 0] += back * mx
                if DIM > 1:
                    x[i, 1] += back * my
                if DIM > 2:
                    x[i, 2] += back * mz
            else:
                x[i, 0] += lift * nx
                if DIM > 1:
                    x[i, 1] += lift * ny
                if DIM > 2:
                    x[i, 2] += lift * nz
            approach = (v[i, 0] - ux) * nx
            if DIM > 1:
                approach += (v[i, 1] - uy) * ny
            if DIM > 2:
                approach += (v[i, 2] - uz) * nz
            if approach < 0.0:
                v[i, 0] = 2.0 * ux - v[i, 0] + dt * ax
                if DIM > 1:
                    v[i, 1] = 2.0 * uy - v[i, 1] + dt * ay
                if DIM > 2:
                    v[i, 2] = 2.0 * uz - v[i, 2] + dt * az
        if outside:
            break
