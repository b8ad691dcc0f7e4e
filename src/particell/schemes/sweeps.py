"""Densities by summation and pressures of walls: the single-purpose sweeps of the SDPD scheme."""

from __future__ import annotations

import math

from particell.compute.loop import particle_loop
from particell.kernels import power, shape_w
from particell.laws.hydrostatics import rest_height, rest_pressure_at, rest_weight_at
from particell.laws.pairs import image_offset, wall_weight


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
    group,
    density_sum,
    reference,
    density,
    *,
    DIM,
    KERNEL,
    UNIFORM,
    CONTRAST,
):
    """ρ_i = Σ_j m_j W_ij/s over all neighbours, particle i itself included; walls keep theirs.

    s is ``density_sum`` of the particle's group (:mod:`particell.schemes.summation`). With
    ``CONTRAST`` fluids of several ``reference`` densities ρ₀ meet, and m_j is (ρ₀_i/ρ₀_j) m_j.
    """
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
            s = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += s * s
        r = math.sqrt(r2)
        its = mass[j]
        if CONTRAST:
            its *= reference[group[i]] / reference[group[j]]
        if UNIFORM:
            total += its * scale * shape_w(r * inverse_h, KERNEL)
        else:
            h = 0.5 * (hi + support[j])
            total += its * alpha / power(h, DIM) * shape_w(r / h, KERNEL)
    density[i] = total / density_sum[group[i]]


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
    density_sum,
    confinement,
    group,
    wall_acceleration,
    rest_axis,
    rest_weight,
    rest_pressure,
    pressure_term,
    *,
    DIM,
    KERNEL,
    MOVING,
):
    """Pressure of wall particle i, extrapolated from the fluid (Adami, Hu & Adams 2012, Eq. 27).

    P_w = Σ_f (P_f + ρ_f (g − a_w)·(x_w − x_f)) W_wf / Σ_f W_wf, with the acceleration a_w of walls
    that move; the background pressure where no fluid is. What :mod:`particell.laws.hydrostatics`
    takes out of P, and its weight, are not extrapolated: they are known at the wall.
    """
    if not is_wall[i]:
        return
    wraps = crosses[i] != 0
    weights, total = 0.0, 0.0
    own_height = rest_height(i, x, rest_axis, DIM)
    for k in range(start[i], split[i]):
        j = neighbours[k]
        r2, head = 0.0, 0.0
        for d in range(DIM):
            s = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += s * s
            if MOVING:
                head += (gravity[d] - wall_acceleration[i, d]) * s
            else:
                head += gravity[d] * s
        w = wall_weight(r2, support, i, j, KERNEL)
        weights += w
        height = rest_height(j, x, rest_axis, DIM)
        rest = rest_pressure_at(height, rest_axis[DIM + 2], rest_weight, rest_pressure)
        rest += rest_weight_at(height, rest_weight) * rest_axis[DIM + 2] * (own_height - height)
        total += w * (pressure[j] - rest + density[j] * head)
    value = background[group[i]]
    if weights > 0.0:
        rest = rest_pressure_at(own_height, rest_axis[DIM + 2], rest_weight, rest_pressure)
        value = rest + total / weights
    pressure[i] = value
    g = group[i]
    pressure_term[i] = (value + confinement[g]) / (density[i] * density[i] * density_sum[g])
