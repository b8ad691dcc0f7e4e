"""The rates at which molecules jump between particles and go through walls.

The equations are in :mod:`particell.chemistry.jumps` and, for walls, in
:mod:`particell.laws.diffusion`.
"""

from __future__ import annotations

import numpy as np

from particell.compute.loop import particle_loop
from particell.laws.diffusion import exchange_velocity, surface_factor, wall_distance
from particell.materials import AVOGADRO


@particle_loop
def jump_rates(
    i,
    x,
    support,
    volume,
    depth,
    group,
    start,
    stop,
    neighbours,
    period,
    inverse_period,
    exchange,
    pair_kappa,
    status,
    value,
    inward,
    transfer,
    diffusivity,
    receives,
    wall_scale,
    wall_normal,
    wall_depth,
    wall_curvature,
    s,
    continuous,
    cumulative,
    leave_rate,
    inflow,
    *,
    DIM,
    SURFACE,
    FLUX,
    SWITCH,
):
    """Cumulative jump rates along row i, their total, and the stream that comes in from outside.

    ``leave_rate`` is 0 where molecules vanish (reservoirs, walls with a value). ``inflow`` is in
    molecules/s from walls with a value or a flux; for a reservoir in 1/s, for each of its
    molecules. With ``SWITCH`` what is exchanged between amounts (and with walls) is left out.
    """
    g = group[i]
    is_amount = SWITCH and continuous[i, s] != 0
    inverse_volume = 1.0 / volume[i]
    rate = 0.0
    stream = 0.0
    for k in range(start[i], stop[i]):
        j = neighbours[k]
        other = group[j]
        part = pair_kappa[g, other] * exchange[k] * inverse_volume
        if SWITCH and is_amount and (continuous[j, s] != 0 or status[other] >= 2):
            part = 0.0
        if SURFACE and status[other] == 2 and part > 0.0:
            part *= surface_factor(
                x,
                support,
                wall_normal,
                wall_depth,
                wall_curvature,
                i,
                j,
                period,
                inverse_period,
                DIM,
            )
            stream += part * value[other]
        if FLUX and status[other] == 3 and receives[g] != 0 and not is_amount:
            distance = wall_distance(
                x,
                support,
                wall_normal,
                wall_depth,
                wall_curvature,
                i,
                j,
                period,
                inverse_period,
                DIM,
            )
            part = exchange[k] * inverse_volume * (distance + wall_depth[j]) * wall_scale[other]
            speed = exchange_velocity(transfer[other], diffusivity[g], distance)
            stream += part * (inward[other] + speed * value[other])
            part *= speed
        rate += part
        cumulative[k] = rate
    total = 0.0
    if stop[i] > start[i]:
        total = np.float64(cumulative[stop[i] - 1])
    leave_rate[i] = total if status[g] == 0 else 0.0
    inflow[i] = stream * volume[i] * depth * AVOGADRO
    if status[g] == 1:
        inflow[i] = total
