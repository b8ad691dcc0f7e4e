r"""The sweeps that the transport-velocity scheme adds to those of :mod:`particell.schemes.rates`.

:func:`flux_rates` evaluates the laws of :mod:`particell.laws.transport_velocity` in batches
(:mod:`particell.compute.batches`) of what :func:`pack_flux` has put into records: position,
velocity, δv, ρ, V. :func:`filtered_density` is the density filter.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particell.boundaries.wall import extrapolation, plane_distances, surface_distance
from particell.compute.batches import batch_buffer, batch_row, whole_lanes
from particell.compute.device import Device
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_whole
from particell.kernels import power, shape_f, shape_w
from particell.laws.continuity import (
    density_diffusion,
    density_per_head,
    divergence,
    middle_of_pair,
)
from particell.laws.pairs import image_offset
from particell.laws.transport_velocity import (
    conserving_flux,
    consistent_trace,
    mass_flux,
    uniform_flux,
)

#: Codes of the form of the momentum's flux (``FLUX``).
NONE, UNIFORM_FORM, CONSERVING_FORM = 0, 1, 2
FORMS = {"none": NONE, "uniform": UNIFORM_FORM, "conserving": CONSERVING_FORM}
#: Codes of the pressure's force (``SWITCH`` of :func:`particell.schemes.rates.rates`, where 1 is
#: the symmetric force with the switch).
PRESSURE_FORCES = {"symmetric": 0, "difference": 2}


def flux_fields(
    device: Device, n: int, dim: int, uniform: bool, walls: bool, diffuses: bool, record: int
) -> dict[str, Any]:
    """Records (of ``record`` numbers) and batch of :func:`flux_rates`, by argument name."""
    return {
        "flux_record": device.zeros(n * record),
        "flux_near": batch_buffer(device, n, 2 * dim),
        "flux_matter": batch_buffer(device, n, dim + 2),
        "flux_wall": batch_buffer(device, n if walls else 0, 2),
        "flux_support": batch_buffer(device, 0 if uniform else n),
        "flux_density": batch_buffer(device, n if diffuses else 0),
    }


@particle_loop
def pack_flux(
    i, x, v, flux, transport, volume, density_half, flux_record, half_step, *, DIM, RECORD
):
    """Put what neighbours of i read into its record; δv is the transport velocity less v.

    v is taken to the middle of the step by half a step of the last flux, as in the transport
    velocity.
    """
    at = i * RECORD
    for d in range(DIM):
        velocity = v[i, d] + half_step * flux[i, d]
        flux_record[at + d] = x[i, d]
        flux_record[at + DIM + d] = velocity
        flux_record[at + 2 * DIM + d] = transport[i, d] - velocity
    flux_record[at + 3 * DIM] = density_half[i]
    flux_record[at + 3 * DIM + 1] = volume[i]


@particle_loop(vectorise=True)
def flux_rates(
    i,
    flux_record,
    is_wall,
    support,
    wall_normal,
    wall_depth,
    wall_curvature,
    wall_direction,
    wall_distance,
    start,
    split,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    flux_near,
    flux_matter,
    flux_wall,
    flux_support,
    flux_density,
    group,
    diffusion,
    gravity,
    holds_head,
    buoyancy,
    reference,
    sound_speed,
    exponent,
    equation,
    density_rate,
    flux,
    *,
    DIM,
    RECORD,
    BATCH,
    KERNEL,
    UNIFORM,
    WALLS,
    UNKNOWN,
    FLUX,
    EXACT,
    DELTA,
    HEAD,
    PARTED,
):
    """Density rate (kg/m³/s) of particle i, and its acceleration by δv (m/s²) in ``flux``.

    The batch holds x_ij, v_ij, δv_j, ρ_j, V_j; for walls the factor by which their difference of
    velocity grows (:mod:`particell.boundaries.wall`), and 1 for fluid, 0 for walls, which take no
    part in the fluxes. With ``EXACT`` the density follows v and δv by the consistent gradient; with
    ``DELTA`` it diffuses, as in :func:`particell.schemes.rates.rates`; the batch then holds what
    the pair's density difference is for that.
    """
    if is_wall[i]:
        for d in range(DIM):
            flux[i, d] = 0.0
        density_rate[i] = 0.0
        return
    one, two = np.uint64(1), np.uint64(2)
    dims = np.uint64(DIM)
    own = np.uint64(i) * np.uint64(RECORD)
    xi = flux_record[own]
    yi = flux_record[own + one] if DIM > 1 else 0.0
    zi = flux_record[own + two] if DIM > 2 else 0.0
    at_v, at_s = own + dims, own + dims + dims
    ui = flux_record[at_v]
    vi = flux_record[at_v + one] if DIM > 1 else 0.0
    wi = flux_record[at_v + two] if DIM > 2 else 0.0
    pi = flux_record[at_s]
    qi = flux_record[at_s + one] if DIM > 1 else 0.0
    ri = flux_record[at_s + two] if DIM > 2 else 0.0
    density_i = flux_record[at_s + dims]
    inverse_density = 1.0 / density_i
    wraps = crosses[i] != 0
    hi = support[i]
    inverse_h = 1.0 / hi
    scale = alpha * inverse_h * inverse_h / power(hi, DIM)
    reach2 = hi * hi
    g = group[i]
    per_head = 0.0
    if DELTA and HEAD:
        per_head = density_per_head(density_i, reference[g], sound_speed[g], exponent[g])
    expansion, gain, spread = 0.0, 0.0, 0.0
    txx, tyy, tzz, txy, tyz, tzx = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    gxx, gyy, gzz, gxy, gyz, gzx = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ax, ay, az = 0.0, 0.0, 0.0
    dy, dz, dv, dw, qj, rj = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    width, fields = np.uint64(2 * DIM), np.uint64(DIM + 2)
    row = batch_row(i) * np.uint64(BATCH)
    first_wall = np.uint64(split[i])
    last = np.uint64(stop[i]) if WALLS else first_wall
    begin = np.uint64(start[i])
    while begin < last:
        end = min(last, begin + np.uint64(BATCH))
        c = row
        for k in range(begin, end):
            j = neighbours[k]
            other = np.uint64(j) * np.uint64(RECORD)
            dx = xi - flux_record[other]
            if wraps:
                dx -= period[0] * nearest_whole(dx * inverse_period[0])
            r2 = dx * dx
            if DIM > 1:
                dy = yi - flux_record[other + one]
                if wraps:
                    dy -= period[1] * nearest_whole(dy * inverse_period[1])
                r2 += dy * dy
            if DIM > 2:
                dz = zi - flux_record[other + two]
                if wraps:
                    dz -= period[2] * nearest_whole(dz * inverse_period[2])
                r2 += dz * dz
            at = c * width
            flux_near[at] = dx
            if DIM > 1:
                flux_near[at + one] = dy
            if DIM > 2:
                flux_near[at + two] = dz
            to, of = at + dims, other + dims
            flux_near[to] = ui - flux_record[of]
            if DIM > 1:
                flux_near[to + one] = vi - flux_record[of + one]
            if DIM > 2:
                flux_near[to + two] = wi - flux_record[of + two]
            to, of = c * fields, of + dims
            for d in range(DIM + 2):  # δv, ρ, V
                flux_matter[to + np.uint64(d)] = flux_record[of + np.uint64(d)]
            if PARTED and k < first_wall and equation[group[j]] != equation[g]:
                flux_matter[to + dims] = density_i  # δv carries nothing across the jump
            if not UNIFORM:
                h = 0.5 * (hi + support[j])
                flux_support[c] = h
                reach2 = h * h
            if DELTA:
                density_j = flux_matter[to + dims]
                if HEAD:  # less what it differs by in a fluid at rest
                    weight = middle_of_pair(per_head, density_i, density_j, exponent[g])
                    for d in range(DIM):
                        force = gravity[d]
                        if HEAD == 2:
                            force += 0.5 * (buoyancy[i, d] + buoyancy[j, d])
                        density_j += weight * holds_head[d] * force * flux_near[at + np.uint64(d)]
                if k >= first_wall or (PARTED and equation[group[j]] != equation[g]):
                    density_j = density_i  # walls take no part, and between fluids density jumps
                flux_density[c] = density_j
            if WALLS:
                grow, is_fluid = 1.0, 1.0
                if k >= first_wall:
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
                    grow, is_fluid = extrapolation(distance, depth, hi, wall_curvature[j], DIM), 0.0
                    if UNKNOWN and nx == 0.0 and ny == 0.0 and nz == 0.0:
                        distance, depth = plane_distances(
                            i, dx, dy, dz, wall_direction, wall_distance, DIM
                        )
                        grow = extrapolation(distance, depth, hi, 0.0, DIM)
                flux_wall[c * two] = grow
                flux_wall[c * two + one] = is_fluid
            c += np.uint64(r2 < reach2)
        filled = row + whole_lanes(c - row, BATCH)
        for q in range(c, filled):  # outside the support: without effect
            flux_near[q * width] = 2.0 * hi
            if not UNIFORM:
                flux_support[q] = hi
        for q in range(row, filled):
            at, to = q * width, q * fields
            dx = flux_near[at]
            du = flux_near[at + dims]
            pj = flux_matter[to]
            r2 = dx * dx
            if DIM > 1:
                dy = flux_near[at + one]
                dv = flux_near[at + dims + one]
                qj = flux_matter[to + one]
                r2 += dy * dy
            if DIM > 2:
                dz = flux_near[at + two]
                dw = flux_near[at + dims + two]
                rj = flux_matter[to + two]
                r2 += dz * dz
            density_j = flux_matter[to + dims]
            volume_j = flux_matter[to + dims + one]
            r = math.sqrt(r2)
            if UNIFORM:
                f = scale * shape_f(r * inverse_h, KERNEL)
            else:
                inverse = 1.0 / flux_support[q]
                f = alpha * power(inverse, DIM) * inverse * inverse * shape_f(r * inverse, KERNEL)
            weight = volume_j * f
            own_x = pi * dx + qi * dy + ri * dz
            its_x = pj * dx + qj * dy + rj * dz
            grow, inner = 1.0, weight
            if WALLS:
                grow = flux_wall[q * two]
                inner *= flux_wall[q * two + one]
            if EXACT:
                moving = -density_i * weight * grow
                relative = inner * (density_i - density_j)
                mu = moving * du + relative * pi
                txx += weight * dx * dx
                gxx += mu * dx
                if DIM > 1:
                    mv = moving * dv + relative * qi
                    tyy += weight * dy * dy
                    txy += weight * dx * dy
                    gyy += mv * dy
                    gxy += mu * dy + mv * dx
                if DIM > 2:
                    mw = moving * dw + relative * ri
                    tzz += weight * dz * dz
                    tyz += weight * dy * dz
                    tzx += weight * dz * dx
                    gzz += mw * dz
                    gyz += mv * dz + mw * dy
                    gzx += mw * dx + mu * dz
            else:
                along = (du * dx + dv * dy + dw * dz + own_x - its_x) * grow
                expansion += divergence(weight, along)
                gain += mass_flux(inner, density_i, density_j, own_x, its_x)
            if DELTA:
                part = density_diffusion(weight, density_i, flux_density[q])
                spread += part if UNIFORM else flux_support[q] * part
            ratio = density_j * inverse_density
            if FLUX == 1:
                along = uniform_flux(inner, ratio, its_x)
                ax += along * du
                ay += along * dv
                az += along * dw
            if FLUX == 2:
                mine = conserving_flux(inner, ratio, own_x)
                its = conserving_flux(inner, 1.0, its_x)
                ax += mine * ui + its * (ui - du)
                ay += mine * vi + its * (vi - dv)
                az += mine * wi + its * (wi - dw)
        begin = end
    if EXACT:
        if DIM == 1:
            tyy = 1.0
        if DIM < 3:
            tzz = 1.0
        rate = consistent_trace(txx, tyy, tzz, txy, tyz, tzx, gxx, gyy, gzz, gxy, gyz, gzx)
    else:
        rate = -density_i * expansion + gain
    if DELTA:
        if UNIFORM:
            spread *= hi
        rate += diffusion[g] * spread
    density_rate[i] = rate
    flux[i, 0] = ax
    if DIM > 1:
        flux[i, 1] = ay
    if DIM > 2:
        flux[i, 2] = az


@particle_loop
def filtered_density(
    i,
    x,
    is_wall,
    group,
    mass,
    volume,
    density,
    support,
    start,
    split,
    neighbours,
    crosses,
    period,
    inverse_period,
    gravity,
    holds_head,
    buoyancy,
    reference,
    sound_speed,
    exponent,
    density_half,
    *,
    DIM,
    KERNEL,
    HEAD,
):
    """Shepard filter: Σ m W / Σ V W over i and the fluid of its group; walls keep their density.

    Masses of neighbours are taken at the height of i: what their density differs by in a fluid at
    rest (:mod:`particell.laws.continuity`) is no noise, and beside walls, where neighbours are on
    one side, it would be smoothed away. A uniform density stays uniform. It is written to
    ``density_half``, since neighbours still read the old one.
    """
    density_half[i] = density[i]
    if is_wall[i]:
        return
    w = shape_w(0.0, KERNEL)
    above, below = mass[i] * w, volume[i] * w
    wraps = crosses[i] != 0
    g, per_head = group[i], 0.0
    if HEAD:
        per_head = density_per_head(density[i], reference[g], sound_speed[g], exponent[g])
    for k in range(start[i], split[i]):
        j = neighbours[k]
        if group[j] != group[i]:
            continue
        r2, head = 0.0, 0.0
        for d in range(DIM):
            s = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += s * s
            if HEAD:
                force = gravity[d]
                if HEAD == 2:
                    force += 0.5 * (buoyancy[i, d] + buoyancy[j, d])
                head += holds_head[d] * force * s
        h = 0.5 * (support[i] + support[j])
        w = shape_w(math.sqrt(r2) / h, KERNEL) * power(support[i] / h, DIM)
        above += mass[j] * w
        if HEAD:
            rest = middle_of_pair(per_head, density[i], density[j], exponent[g]) * head
            above += volume[j] * rest * w
        below += volume[j] * w
    density_half[i] = above / below
