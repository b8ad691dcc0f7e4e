r"""The sweep over pairs of the SDPD scheme: which laws act in it.

One body serves the density rate, the forces, or both at once (the compile-time constants
``DENSITY`` and ``FORCE``): the velocity-Verlet integrator needs them at different times, the
trapezoidal one at the same time. The laws themselves are in :mod:`particell.laws`.

It works on batches (:mod:`particell.compute.batches`). What is read of a neighbour is packed into
a record first (:func:`pack`): position, velocity, and from ``MATTER[D]`` on ρ, V, m, P/ρ².
Row i of the neighbour list holds its mobile neighbours first and then the wall neighbours, for
which the difference of velocity is extrapolated through the wall's surface
(:mod:`particell.boundaries.wall`). A pair that is gathered without being inside the support does
not act: the kernel's slope F is zero there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particell.boundaries.wall import (
    MOST_MISSED,
    extrapolation,
    missed,
    plane_distances,
    surface_distance,
)
from particell.boundaries.wall_friction import slowed
from particell.compute.batches import batch_buffer, batch_row, whole_lanes
from particell.compute.device import Device
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_whole
from particell.kernels import power, shape_f
from particell.laws.continuity import (
    density_diffusion,
    density_per_head,
    divergence,
    middle_of_pair,
)
from particell.laws.fluctuations import noise_amplitudes, pair_numbers
from particell.laws.hydrostatics import rest_height, rest_pressure_at, rest_weight_at
from particell.laws.pressure import pressure_acceleration
from particell.laws.shifting import crowding
from particell.laws.transport_velocity import switched_term
from particell.laws.viscosity import harmonic_mean, pair_friction, sheared

TINY = 1e-300
#: Numbers in a record, and the place of ρ, by dimension: padded, so that whole vectors are loaded.
RECORD = {1: 8, 2: 8, 3: 16}
MATTER = {1: 4, 2: 4, 3: 8}
#: Numbers that a pair of two materials has besides.
MIXTURE = 3


def batch_fields(
    device: Device,
    n: int,
    dim: int,
    uniform: bool,
    walls: bool,
    mixed: bool,
    noise: bool,
    normal: bool,
) -> dict[str, Any]:
    """The records and the batch that :func:`pack` and :func:`rates` need, by argument name."""

    def buffer(needed: bool, width: int = 1, dtype: type | None = None) -> Any:
        return batch_buffer(device, n if needed else 0, width, dtype)

    return {
        "record": device.zeros(n * RECORD[dim]),
        "near": buffer(True, 2 * dim),
        "near_matter": buffer(True, 4),
        "near_wall": buffer(walls),
        "near_bend": buffer(walls and not noise),
        "near_support": buffer(not uniform),
        "near_mixture": buffer(mixed, MIXTURE),
        "near_id": buffer(noise, dtype=np.int64),
        "near_sum": buffer(normal),
        "kernel_sum": device.zeros(n if normal else 1),
    }


@particle_loop
def pack(
    i,
    x,
    v,
    volume,
    mass,
    pressure_term,
    density,
    group,
    density_sum,
    rest_axis,
    rest_weight,
    rest_pressure,
    a,
    wall_friction,
    record,
    half_step,
    lead,
    *,
    DIM,
    RECORD,
    MATTER,
    LEAD,
    HELD,
):
    """Put what neighbours of i read into its record: P' for P, of :mod:`.laws.hydrostatics`.

    With ``LEAD`` the velocity is that at the end of the half step in s which is yet to come, by the
    acceleration at its beginning; ``lead`` is the part of that which is taken.
    """
    at = i * RECORD
    for d in range(DIM):
        record[at + d] = x[i, d]
        record[at + DIM + d] = v[i, d]
    if LEAD:
        ay = a[i, 1] if DIM > 1 else 0.0
        az = a[i, 2] if DIM > 2 else 0.0
        ax, ay, az = a[i, 0], ay, az
        if HELD:
            ax, ay, az = slowed(i, wall_friction, half_step, ax, ay, az, DIM, HELD)
        record[at + DIM] += lead * half_step * ax
        if DIM > 1:
            record[at + DIM + 1] += lead * half_step * ay
        if DIM > 2:
            record[at + DIM + 2] += lead * half_step * az
    record[at + MATTER] = density[i]
    record[at + MATTER + 1] = volume[i]
    record[at + MATTER + 2] = mass[i]
    height = rest_height(i, x, rest_axis, DIM)
    rest = rest_pressure_at(height, rest_axis[DIM + 2], rest_weight, rest_pressure)
    square = density[i] * density[i] * density_sum[group[i]]  # as that of the pressure's term
    record[at + MATTER + 3] = pressure_term[i] - rest / square


@particle_loop(vectorise=True)
def rates(
    i,
    record,
    id,
    group,
    is_wall,
    support,
    wall_normal,
    wall_depth,
    wall_curvature,
    wall_direction,
    wall_distance,
    kernel_sum,
    start,
    split,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    transverse,
    radial,
    diffusion,
    thermal,
    gravity,
    holds_head,
    x,
    v,
    rest_axis,
    rest_weight,
    buoyancy,
    reference,
    sound_speed,
    exponent,
    equation,
    near,
    near_matter,
    near_wall,
    near_bend,
    near_support,
    near_mixture,
    near_id,
    near_sum,
    a,
    density_rate,
    shift,
    step,
    key0,
    key1,
    inverse_dt,
    wall_friction,
    *,
    DIM,
    RECORD,
    MATTER,
    BATCH,
    KERNEL,
    UNIFORM,
    MIXED,
    DENSITY,
    FORCE,
    RADIAL,
    DELTA,
    HEAD,
    PARTED,
    LEAD,
    NOISE,
    GAUSSIAN,
    WALLS,
    SHIFT,
    SWITCH,
    NORMAL,
    UNKNOWN,
    PARABOLIC,
    CONTRAST,
):
    """Density rate (kg/m³/s) and acceleration (m/s²) of particle i.

    ``shift`` receives the sum of :mod:`particell.laws.shifting` (with the forces).
    ``transverse``, ``radial`` and ``thermal`` (k_B T) are tables by group; ``diffusion`` is
    2 δ c₀ by group, ``equation`` the number of its equation of state; with ``HEAD`` the part of a
    fluid at rest is taken from density differences, with that of ``buoyancy`` where it is 2.
    ``inverse_dt`` is 1/dt, by which the squared noise grows. With ``LEAD`` the record's velocity is
    ahead of v (:func:`pack`). The arrays
    ``near…`` are the batch: differences of position and velocity, the neighbour's ρ, V, m, P/ρ²,
    the factor of a wall's difference of velocity, the pair's support, its friction coefficients
    and k_B T where they differ, the neighbour's id, the pair's mean kernel sum. With ``PARABOLIC``
    friction beside walls is exact for quadratic profiles, ``near_bend`` being the pair's part of C
    in :mod:`particell.boundaries.wall`. With ``NORMAL``
    friction is divided by that; with ``CONTRAST`` there are fluids of several reference densities
    (:mod:`particell.laws.pressure`); with ``UNKNOWN`` some walls have no known surface. The
    friction with walls is :mod:`particell.boundaries.wall_friction`'s Γ too, in ``wall_friction``.
    """
    if is_wall[i]:
        for d in range(DIM):
            if FORCE:
                a[i, d] = 0.0
        if DENSITY:
            density_rate[i] = 0.0
        return
    # unsigned numbers spare the test for negative indices
    own = np.uint64(i) * np.uint64(RECORD)
    xi = record[own]
    yi = record[own + np.uint64(1)] if DIM > 1 else 0.0
    zi = record[own + np.uint64(2)] if DIM > 2 else 0.0
    ui = record[own + np.uint64(DIM)]
    vi = record[own + np.uint64(DIM + 1)] if DIM > 1 else 0.0
    wi = record[own + np.uint64(DIM + 2)] if DIM > 2 else 0.0
    wraps = crosses[i] != 0
    g = group[i]
    hi = support[i]
    inverse_h = 1.0 / hi
    scale = alpha * inverse_h * inverse_h / power(hi, DIM)
    reach2 = hi * hi
    density_i = record[own + np.uint64(MATTER)]
    volume_i = record[own + np.uint64(MATTER + 1)]
    inverse_mass = 1.0 / record[own + np.uint64(MATTER + 2)]
    term_i = record[own + np.uint64(MATTER + 3)]
    if CONTRAST:
        term_i *= reference[g] * reference[g]
    inverse_density = volume_i * inverse_mass
    transverse_ij = transverse[g]
    radial_ij = radial[g]
    strength = 2.0 * thermal[g] * inverse_dt
    per_head = 0.0
    if DELTA and DENSITY and HEAD:
        per_head = density_per_head(density_i, reference[g], sound_speed[g], exponent[g])
    id_i = id[i]
    ax, ay, az = 0.0, 0.0, 0.0
    expansion, spread = 0.0, 0.0
    sx, sy, sz = 0.0, 0.0, 0.0
    bx, by, bz, bend, whole = 0.0, 0.0, 0.0, 0.0, 0.0
    held = 0.0
    hxx, hxy, hxz, hyy, hyz, hzz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    dy, dz, dv, dw = 0.0, 0.0, 0.0, 0.0
    width = np.uint64(2 * DIM)
    # the numbers of ``matter`` that are used, V at v_at: a gap would be vectorised by gathers
    v_at = np.uint64(1) if DELTA and DENSITY else np.uint64(0)
    fields = v_at + (np.uint64(3) if FORCE else np.uint64(1))
    row = batch_row(i) * np.uint64(BATCH)
    first_wall = np.uint64(split[i])
    last = np.uint64(stop[i]) if WALLS else first_wall
    begin = np.uint64(start[i])
    while begin < last:
        end = min(last, begin + np.uint64(BATCH))
        c = row
        fluid_end = row
        for k in range(begin, end):
            j = neighbours[k]
            other = np.uint64(j) * np.uint64(RECORD)
            dx = xi - record[other]
            if wraps:
                dx -= period[0] * nearest_whole(dx * inverse_period[0])
            du = ui - record[other + np.uint64(DIM)]
            r2 = dx * dx
            if DIM > 1:
                dy = yi - record[other + np.uint64(1)]
                if wraps:
                    dy -= period[1] * nearest_whole(dy * inverse_period[1])
                dv = vi - record[other + np.uint64(DIM + 1)]
                r2 += dy * dy
            if DIM > 2:
                dz = zi - record[other + np.uint64(2)]
                if wraps:
                    dz -= period[2] * nearest_whole(dz * inverse_period[2])
                dw = wi - record[other + np.uint64(DIM + 2)]
                r2 += dz * dz
            at = c * width
            near[at] = dx
            if DIM == 1:
                near[at + np.uint64(1)] = du
            if DIM == 2:
                near[at + np.uint64(1)] = dy
                near[at + np.uint64(2)] = du
                near[at + np.uint64(3)] = dv
            if DIM == 3:
                near[at + np.uint64(1)] = dy
                near[at + np.uint64(2)] = dz
                near[at + np.uint64(3)] = du
                near[at + np.uint64(4)] = dv
                near[at + np.uint64(5)] = dw
            to = c * fields
            if DELTA and DENSITY:
                density_j = record[other + np.uint64(MATTER)]
                if HEAD:  # less what it differs by in a fluid at rest
                    weight = middle_of_pair(per_head, density_i, density_j, exponent[g])
                    for d in range(DIM):
                        force = gravity[d]
                        if HEAD == 2:
                            force += 0.5 * (buoyancy[i, d] + buoyancy[j, d])
                        density_j += weight * holds_head[d] * force * near[at + np.uint64(d)]
                near_matter[to] = density_j
            near_matter[to + v_at] = record[other + np.uint64(MATTER + 1)]
            if FORCE:
                near_matter[to + v_at + np.uint64(1)] = record[other + np.uint64(MATTER + 2)]
                near_matter[to + v_at + np.uint64(2)] = record[other + np.uint64(MATTER + 3)]
            if NOISE:
                near_id[c] = id[j]
            if not UNIFORM:
                h = 0.5 * (hi + support[j])
                near_support[c] = h
                reach2 = h * h
            gj = group[j]
            if CONTRAST and FORCE:
                ours, its = reference[g], reference[gj]
                near_matter[to + v_at + np.uint64(1)] *= 1.0 / (ours * its)
                near_matter[to + v_at + np.uint64(2)] *= its * its
            if PARTED and DELTA and DENSITY and equation[gj] != equation[g]:
                near_matter[to] = density_i  # between two fluids density jumps
            if WALLS:
                grow, missing = 1.0, 0.0
                if k >= first_wall:
                    if LEAD and FORCE:  # friction with walls is implicit, from v itself
                        for d in range(DIM):
                            ahead = record[own + np.uint64(DIM + d)] - v[i, d]
                            near[at + np.uint64(DIM + d)] -= ahead
                    depth = wall_depth[j]
                    nx = wall_normal[j, 0]
                    ny = wall_normal[j, 1] if DIM > 1 else 0.0
                    nz = wall_normal[j, 2] if DIM > 2 else 0.0
                    distance = surface_distance(
                        dx - depth * nx,
                        dy - depth * ny,
                        dz - depth * nz,
                        nx,
                        ny,
                        nz,
                        wall_curvature[j],
                    )
                    grow = extrapolation(distance, depth, hi, wall_curvature[j], DIM)
                    if UNKNOWN and nx == 0.0 and ny == 0.0 and nz == 0.0:
                        distance, depth = plane_distances(
                            i, dx, dy, dz, wall_direction, wall_distance, DIM
                        )
                        grow = extrapolation(distance, depth, hi, 0.0, DIM)
                        nx = wall_direction[i, 0]
                        ny = wall_direction[i, 1] if DIM > 1 else 0.0
                        nz = wall_direction[i, 2] if DIM > 2 else 0.0
                    if PARABOLIC:
                        along = (nx * dx + ny * dy + nz * dz) ** 2 / (r2 + TINY)
                        missing = missed(distance, depth, hi, grow)
                        missing *= sheared(transverse[g], radial[g], along, DIM)
                    if DELTA and DENSITY:
                        near_matter[to] = density_i  # walls take no part in δ
                    gj = g  # and have the friction of the fluid
                near_wall[c] = grow
                if PARABOLIC:
                    near_bend[c] = missing
            if MIXED:
                along_i = transverse[g] + radial[g]
                along_j = transverse[gj] + radial[gj]
                across_ij = harmonic_mean(transverse[g], transverse[gj])
                put = c * np.uint64(MIXTURE)
                near_mixture[put] = across_ij
                near_mixture[put + np.uint64(1)] = harmonic_mean(along_i, along_j) - across_ij
                near_mixture[put + np.uint64(2)] = harmonic_mean(thermal[g], thermal[gj])
            if NORMAL:  # that of walls, at the edge of what there is, is no measure
                other_sum = kernel_sum[j] if k < first_wall else kernel_sum[i]
                near_sum[c] = 0.5 * (kernel_sum[i] + other_sum)
            c += np.uint64(r2 < reach2)
            if SWITCH or WALLS:
                fluid_end = c if k < first_wall else fluid_end
        filled = row + whole_lanes(c - row, BATCH)
        for q in range(c, filled):  # outside the support: without effect
            near[q * width] = 2.0 * hi
            if not UNIFORM:
                near_support[q] = hi
            if NORMAL:
                near_sum[q] = 1.0
        for q in range(row, filled):
            at = q * width
            dx = near[at]
            du = near[at + np.uint64(DIM)]
            r2 = dx * dx
            if DIM > 1:
                dy = near[at + np.uint64(1)]
                dv = near[at + np.uint64(DIM + 1)]
                r2 += dy * dy
            if DIM > 2:
                dz = near[at + np.uint64(2)]
                dw = near[at + np.uint64(DIM + 2)]
                r2 += dz * dz
            if WALLS:
                grow = near_wall[q]
                du *= grow
                dv *= grow
                dw *= grow
            vx = du * dx + dv * dy + dw * dz
            r = math.sqrt(r2)
            if UNIFORM:
                f = scale * shape_f(r * inverse_h, KERNEL)
            else:
                inverse = 1.0 / near_support[q]
                f = alpha * power(inverse, DIM) * inverse * inverse * shape_f(r * inverse, KERNEL)
            to = q * fields
            volume_j = near_matter[to + v_at]
            weight = volume_j * f
            if DENSITY:
                expansion += divergence(weight, vx)
                if DELTA:
                    part = density_diffusion(weight, density_i, near_matter[to])
                    spread += part if UNIFORM else near_support[q] * part
            if FORCE:
                mass_j = near_matter[to + v_at + np.uint64(1)]
                term_j = near_matter[to + v_at + np.uint64(2)]
                if MIXED:
                    put = q * np.uint64(MIXTURE)
                    transverse_ij = near_mixture[put]
                    radial_ij = near_mixture[put + np.uint64(1)]
                    strength = 2.0 * near_mixture[put + np.uint64(2)] * inverse_dt
                friction = pair_friction(weight, inverse_density)
                if NORMAL:
                    friction /= near_sum[q]
                if SWITCH:
                    if SWITCH == 2:
                        own_term = -term_i
                    else:
                        own_term = switched_term(term_i, term_j) if q < fluid_end else term_i
                    along = pressure_acceleration(mass_j, own_term, term_j, f)
                else:
                    along = pressure_acceleration(mass_j, term_i, term_j, f)
                across = transverse_ij * friction
                rubbing = 0.0
                if RADIAL:
                    inverse_r = 1.0 / (r + TINY)
                    rubbing = radial_ij * friction * vx * inverse_r * inverse_r
                if PARABOLIC:
                    bend += friction * near_bend[q]
                    whole += friction * r2
                    bx -= across * du + rubbing * dx
                    by -= across * dv + rubbing * dy
                    bz -= across * dw + rubbing * dz
                    across = 0.0
                else:
                    along -= rubbing
                if WALLS:
                    near_wall[q] = friction * grow  # for what follows
                if NOISE:
                    n0, n1, n2 = pair_numbers(id_i, near_id[q], step, key0, key1, GAUSSIAN, DIM)
                    fading = friction * inverse_mass * strength
                    if WALLS:  # friction with a wall is 'grow' times larger: so is noise squared
                        fading *= grow
                    s, s_radial = noise_amplitudes(transverse_ij, radial_ij, fading)
                    if RADIAL:
                        projected = (n0 * dx + n1 * dy + n2 * dz) * inverse_r
                        along += (s_radial - s) * projected * inverse_r
                    ax += s * n0
                    ay += s * n1
                    az += s * n2
                ax += along * dx - across * du
                ay += along * dy - across * dv
                az += along * dz - across * dw
                if SHIFT:
                    push = crowding(volume_i, volume_j, f)
                    sx += push * dx
                    sy += push * dy
                    sz += push * dz
        if FORCE and WALLS:
            for q in range(fluid_end, c):
                hold = near_wall[q]
                held += hold
                if RADIAL:
                    at = q * width
                    dx = near[at]
                    dy = near[at + np.uint64(1)] if DIM > 1 else 0.0
                    dz = near[at + np.uint64(2)] if DIM > 2 else 0.0
                    hold /= dx * dx + dy * dy + dz * dz + TINY
                    hxx += hold * dx * dx
                    hxy += hold * dx * dy
                    hxz += hold * dx * dz
                    hyy += hold * dy * dy
                    hyz += hold * dy * dz
                    hzz += hold * dz * dz
        begin = end
    if DENSITY:
        if UNIFORM:
            spread *= hi
        density_rate[i] = -density_i * expansion + diffusion[g] * spread
    if SHIFT:
        shift[i, 0] = sx
        if DIM > 1:
            shift[i, 1] = sy
        if DIM > 2:
            shift[i, 2] = sz
    if FORCE:
        if PARABOLIC:
            more = 1.0 / (1.0 - min(DIM * bend / (whole + TINY), MOST_MISSED))
            ax += more * bx
            ay += more * by
            az += more * bz
            held *= more
            if RADIAL:
                hxx, hxy, hxz = more * hxx, more * hxy, more * hxz
                hyy, hyz, hzz = more * hyy, more * hyz, more * hzz
        height = rest_height(i, x, rest_axis, DIM)
        lift = rest_weight_at(height, rest_weight) * inverse_density
        a[i, 0] = ax + gravity[0] - lift * rest_axis[0]
        if DIM > 1:
            a[i, 1] = ay + gravity[1] - lift * rest_axis[1]
        if DIM > 2:
            a[i, 2] = az + gravity[2] - lift * rest_axis[2]
        if WALLS:
            held *= transverse[g]
            wall_friction[i, 0] = held + radial[g] * hxx
            if RADIAL and DIM == 2:
                wall_friction[i, 1] = radial[g] * hxy
                wall_friction[i, 2] = held + radial[g] * hyy
            if RADIAL and DIM == 3:
                wall_friction[i, 1] = radial[g] * hxy
                wall_friction[i, 2] = radial[g] * hxz
                wall_friction[i, 3] = held + radial[g] * hyy
                wall_friction[i, 4] = radial[g] * hyz
                wall_friction[i, 5] = held + radial[g] * hzz
