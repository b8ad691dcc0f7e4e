r"""The sweeps over pairs of the SDPD scheme: which laws act in which loop.

One body serves the density rate, the forces, or both at once (the compile-time constants
``DENSITY`` and ``FORCE``): the velocity-Verlet integrator needs them at different times, the
trapezoidal one at the same time. The laws themselves are in :mod:`particell.laws`.

Row i of the neighbour list holds its mobile neighbours first. They are visited without a branch:
the kernel's slope F is zero beyond the support. Then come the wall neighbours, for which the
difference of velocity is extrapolated through the wall's surface
(:mod:`particell.boundaries.wall`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.boundaries.wall import extrapolation, surface_distance
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_integer
from particell.kernels import power, shape_f, shape_w
from particell.laws.continuity import density_diffusion, divergence
from particell.laws.fluctuations import noise_amplitudes, pair_numbers
from particell.laws.pressure import pressure_acceleration
from particell.laws.shifting import crowding
from particell.laws.viscosity import harmonic_mean, pair_friction

TINY = 1e-300


@njit
def kernel_slope(r, h, alpha, KERNEL, DIM):
    """F(r) = −W'(r)/r for support h, with ``alpha`` = normalisation (W h^DIM at q-shape 1)."""
    inverse = 1.0 / h
    return alpha / (power(h, DIM) * h * h) * shape_f(r * inverse, KERNEL)


@particle_loop
def rates(
    i,
    x,
    v,
    id,
    group,
    is_wall,
    mass,
    volume,
    density,
    pressure_term,
    support,
    wall_normal,
    wall_depth,
    wall_curvature,
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
    a,
    density_rate,
    shift,
    step,
    key0,
    key1,
    inverse_dt,
    *,
    DIM,
    KERNEL,
    UNIFORM,
    MIXED,
    DENSITY,
    FORCE,
    RADIAL,
    DELTA,
    NOISE,
    GAUSSIAN,
    WALLS,
    SHIFT,
):
    """Density rate (kg/m³/s) and acceleration (m/s²) of particle i.

    ``shift`` receives the sum of :mod:`particell.laws.shifting` (with the forces).
    ``transverse``, ``radial`` and ``thermal`` (k_B T) are tables by group; ``diffusion`` is
    2 δ h c₀ by group. ``inverse_dt`` is 1/dt, by which the squared noise grows.
    """
    if is_wall[i]:
        for d in range(DIM):
            if FORCE:
                a[i, d] = 0.0
        if DENSITY:
            density_rate[i] = 0.0
        return
    xi = x[i, 0]
    yi = x[i, 1] if DIM > 1 else 0.0
    zi = x[i, 2] if DIM > 2 else 0.0
    ui = v[i, 0]
    vi = v[i, 1] if DIM > 1 else 0.0
    wi = v[i, 2] if DIM > 2 else 0.0
    wraps = crosses[i] != 0
    g = group[i]
    hi = support[i]
    inverse_h = 1.0 / hi
    scale = alpha * inverse_h * inverse_h / power(hi, DIM)
    density_i = density[i]
    volume_i = volume[i]
    term_i = pressure_term[i]
    transverse_i = transverse[g]
    radial_i = radial[g]
    inverse_mass = 1.0 / mass[i]
    inverse_density = volume_i * inverse_mass
    strength = 2.0 * thermal[g] * inverse_dt
    ax, ay, az = 0.0, 0.0, 0.0
    expansion, spread = 0.0, 0.0
    sx, sy, sz = 0.0, 0.0, 0.0
    dy, dz, dv, dw = 0.0, 0.0, 0.0, 0.0
    for k in range(np.uint64(start[i]), np.uint64(split[i])):  # unsigned: no test for k < 0
        j = neighbours[k]
        dx = xi - x[j, 0]
        if wraps:
            dx -= period[0] * nearest_integer(dx * inverse_period[0])
        du = ui - v[j, 0]
        r2 = dx * dx
        vx = du * dx
        if DIM > 1:
            dy = yi - x[j, 1]
            if wraps:
                dy -= period[1] * nearest_integer(dy * inverse_period[1])
            dv = vi - v[j, 1]
            r2 += dy * dy
            vx += dv * dy
        if DIM > 2:
            dz = zi - x[j, 2]
            if wraps:
                dz -= period[2] * nearest_integer(dz * inverse_period[2])
            dw = wi - v[j, 2]
            r2 += dz * dz
            vx += dw * dz
        r = math.sqrt(r2)
        inverse_r = 1.0 / (r + TINY) if RADIAL else 0.0
        if UNIFORM:
            f = scale * shape_f(r * inverse_h, KERNEL)
        else:
            f = kernel_slope(r, 0.5 * (hi + support[j]), alpha, KERNEL, DIM)
        volume_j = volume[j]
        weight = volume_j * f
        if DENSITY:
            expansion += divergence(weight, vx)
            if DELTA:
                spread += density_diffusion(weight, density_i, density[j])
        if FORCE:
            transverse_ij, radial_ij = transverse_i, radial_i
            if MIXED:
                other = group[j]
                transverse_ij = harmonic_mean(transverse_i, transverse[other])
                if RADIAL:
                    along_i = transverse_i + radial_i
                    along_j = transverse[other] + radial[other]
                    radial_ij = harmonic_mean(along_i, along_j) - transverse_ij
                if NOISE:
                    strength = 2.0 * harmonic_mean(thermal[g], thermal[other]) * inverse_dt
            friction = pair_friction(weight, inverse_density)
            along = pressure_acceleration(mass[j], term_i, pressure_term[j], f)
            across = transverse_ij * friction
            if RADIAL:
                along -= radial_ij * friction * vx * inverse_r * inverse_r
            ax += along * dx - across * du
            ay += along * dy - across * dv
            az += along * dz - across * dw
            if SHIFT:
                push = crowding(volume_i, volume_j, f)
                sx += push * dx
                sy += push * dy
                sz += push * dz
            if NOISE and f > 0.0:  # drawing costs more than the branch
                n0, n1, n2 = pair_numbers(id[i], id[j], step, key0, key1, GAUSSIAN, DIM)
                s, s_radial = noise_amplitudes(
                    transverse_ij, radial_ij, friction * inverse_mass * strength
                )
                ax += s * n0
                ay += s * n1
                az += s * n2
                if RADIAL:
                    projected = (n0 * dx + n1 * dy + n2 * dz) * inverse_r
                    extra = (s_radial - s) * projected * inverse_r
                    ax += extra * dx
                    ay += extra * dy
                    az += extra * dz
    if WALLS:
        for k in range(split[i], stop[i]):
            j = neighbours[k]
            dx = xi - x[j, 0]
            if wraps:
                dx -= period[0] * nearest_integer(dx * inverse_period[0])
            nx, ny, nz = wall_normal[j, 0], 0.0, 0.0
            if DIM > 1:
                dy = yi - x[j, 1]
                if wraps:
                    dy -= period[1] * nearest_integer(dy * inverse_period[1])
                ny = wall_normal[j, 1]
            if DIM > 2:
                dz = zi - x[j, 2]
                if wraps:
                    dz -= period[2] * nearest_integer(dz * inverse_period[2])
                nz = wall_normal[j, 2]
            depth = wall_depth[j]
            distance = surface_distance(
                dx - depth * nx, dy - depth * ny, dz - depth * nz, nx, ny, nz, wall_curvature[j]
            )
            grow = extrapolation(distance, depth, hi)
            du = grow * (ui - v[j, 0])
            dv = grow * (vi - v[j, 1]) if DIM > 1 else 0.0
            dw = grow * (wi - v[j, 2]) if DIM > 2 else 0.0
            r2 = dx * dx + dy * dy + dz * dz
            vx = du * dx + dv * dy + dw * dz
            r = math.sqrt(r2)
            inverse_r = 1.0 / (r + TINY)
            f = kernel_slope(r, 0.5 * (hi + support[j]), alpha, KERNEL, DIM)
            volume_j = volume[j]
            weight = volume_j * f
            if DENSITY:
                expansion += divergence(weight, vx)
            if FORCE:
                friction = pair_friction(weight, inverse_density)
                along = pressure_acceleration(mass[j], term_i, pressure_term[j], f)
                across = transverse_i * friction
                if RADIAL:
                    along -= radial_i * friction * vx * inverse_r * inverse_r
                ax += along * dx - across * du
                ay += along * dy - across * dv
                az += along * dz - across * dw
                if SHIFT:
                    push = crowding(volume_i, volume_j, f)
                    sx += push * dx
                    sy += push * dy
                    sz += push * dz
                if NOISE:
                    # the friction with the wall is 'grow' times larger, and so is its noise squared
                    n0, n1, n2 = pair_numbers(id[i], id[j], step, key0, key1, GAUSSIAN, DIM)
                    s, s_radial = noise_amplitudes(
                        transverse_i, radial_i, grow * friction * inverse_mass * strength
                    )
                    projected = (n0 * dx + n1 * dy + n2 * dz) * inverse_r
                    extra = (s_radial - s) * projected * inverse_r
                    ax += s * n0 + extra * dx
                    ay += s * n1 + extra * dy
                    az += s * n2 + extra * dz
    if DENSITY:
        density_rate[i] = -density_i * expansion + diffusion[g] * spread
    if SHIFT:
        shift[i, 0] = sx
        if DIM > 1:
            shift[i, 1] = sy
        if DIM > 2:
            shift[i, 2] = sz
    if FORCE:
        a[i, 0] = ax + gravity[0]
        if DIM > 1:
            a[i, 1] = ay + gravity[1]
        if DIM > 2:
            a[i, 2] = az + gravity[2]


@particle_loop
def summed_density(
    i,
    x,
    is_wall,
    mass,
    support,
    start,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    density,
    *,
    DIM,
    KERNEL,
    UNIFORM,
):
    """ρ_i = Σ_j m_j W_ij over all neighbours, particle i itself included; walls keep theirs."""
    if is_wall[i]:
        return
    hi = support[i]
    inverse_h = 1.0 / hi
    scale = alpha / power(hi, DIM)
    total = mass[i] * scale * shape_w(0.0, KERNEL)
    wraps = crosses[i] != 0
    for k in range(start[i], stop[i]):
        j = neighbours[k]
        r2 = 0.0
        for d in range(DIM):
            s = x[i, d] - x[j, d]
            if wraps:
                s -= period[d] * nearest_integer(s * inverse_period[d])
            r2 += s * s
        r = math.sqrt(r2)
        if UNIFORM:
            total += mass[j] * scale * shape_w(r * inverse_h, KERNEL)
        else:
            h = 0.5 * (hi + support[j])
            total += mass[j] * alpha / power(h, DIM) * shape_w(r / h, KERNEL)
    density[i] = total


@particle_loop
def wall_pressure(
    i,
    x,
    is_wall,
    pressure,
    density,
    support,
    start,
    split,
    neighbours,
    crosses,
    period,
    inverse_period,
    gravity,
    background,
    group,
    pressure_term,
    *,
    DIM,
    KERNEL,
):
    """Pressure of wall particle i, extrapolated from the fluid (Adami, Hu & Adams 2012, Eq. 27).

    P_w = Σ_f (P_f + ρ_f g·(x_w − x_f)) W_wf / Σ_f W_wf; the background pressure where no fluid is.
    """
    if not is_wall[i]:
        return
    wraps = crosses[i] != 0
    weights, total = 0.0, 0.0
    for k in range(start[i], split[i]):
        j = neighbours[k]
        r2, head = 0.0, 0.0
        for d in range(DIM):
            s = x[i, d] - x[j, d]
            if wraps:
                s -= period[d] * nearest_integer(s * inverse_period[d])
            r2 += s * s
            head += gravity[d] * s
        w = shape_w(math.sqrt(r2) / (0.5 * (support[i] + support[j])), KERNEL)
        weights += w
        total += w * (pressure[j] + density[j] * head)
    value = background[group[i]]
    if weights > 0.0:
        value = total / weights
    pressure[i] = value
    pressure_term[i] = value / (density[i] * density[i])
