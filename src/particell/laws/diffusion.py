r"""Diffusion of species that are concentrations.

With the amounts :math:`n_i = C_i V_i` (mol), volumes :math:`V_i = m_i/\rho_i`, the kernel's
:math:`F = -W'/r` and the harmonic mean :math:`\bar\kappa_{ij}` of the diffusivities (so that a
neighbour without diffusivity blocks),

.. math:: \frac{dn_i}{dt} = \sum_j 2 \bar\kappa_{ij} V_i V_j F_{ij} s_{ij} (C_j - C_i),

antisymmetric in i and j: amounts are conserved to round-off whatever the volumes do. The factor
:math:`s_{ij}` is 1, or the symmetric normalisation :math:`2/(n_i + n_j)` with the kernel sum
:math:`n_i = \frac1D \sum_j V_j F_{ij} r_{ij}^2`, which is 1 where the sums are exact.

At wall particles with a surface value :math:`C_w` the difference :math:`C_j - C_i` becomes
:math:`(1 + d_j/d_i)(C_w - C_i)`, see :mod:`particell.boundaries.wall`, with the fluid particle's
diffusivity. At a wall with a flux :math:`q_0 + k (C_{ext} - C_w)` the term of its particle j is

.. math:: a_{ij} \left[q_0 + \frac{C_{ext} - C_i}{1/k + d_i/\kappa_i}\right],\qquad
    a_{ij} = 2 \lambda V_i V_j F_{ij} s_{ij} (d_i + d_j),

which is the exchange with a neighbour whose value is extrapolated along the flux: a linear profile
is steady. The fraction eliminates the surface value C_w from the flux through the distance d_i.
The areas a_ij are scaled by λ such that their sum is the wall's area, see
:mod:`particell.chemistry.fluxes`.

References
----------
Monaghan, Rep. Prog. Phys. 68 (2005) 1703; Jacob, thesis, UCSB 2020, Eq. 11; Morris, Fox & Zhu,
J. Comput. Phys. 136 (1997) 214 (the wall's values).
"""

from __future__ import annotations

from numba import njit

from particell.boundaries.wall import CLOSEST, extrapolation, surface_distance
from particell.compute.loop import FASTMATH, particle_loop
from particell.compute.rounding import nearest_integer
from particell.laws.pairs import pair_f, separation_square

#: Explicit Euler steps are limited to this many h²/κ.
STEP_LIMIT = 0.05


@njit(error_model="numpy", fastmath=FASTMATH)
def distance_from_wall(
    x, wall_normal, wall_depth, wall_curvature, i, j, period, inverse_period, DIM
):
    """Distance of particle i from the surface of wall particle j, in m."""
    tx, ty, tz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    depth = wall_depth[j]
    nx = wall_normal[j, 0]
    tx = x[i, 0] - x[j, 0]
    tx -= period[0] * nearest_integer(tx * inverse_period[0]) + depth * nx
    if DIM > 1:
        ny = wall_normal[j, 1]
        ty = x[i, 1] - x[j, 1]
        ty -= period[1] * nearest_integer(ty * inverse_period[1]) + depth * ny
    if DIM > 2:
        nz = wall_normal[j, 2]
        tz = x[i, 2] - x[j, 2]
        tz -= period[2] * nearest_integer(tz * inverse_period[2]) + depth * nz
    return surface_distance(tx, ty, tz, nx, ny, nz, wall_curvature[j])


@njit(error_model="numpy", fastmath=FASTMATH)
def surface_factor(
    x, support, wall_normal, wall_depth, wall_curvature, i, j, period, inverse_period, DIM
):
    """1 + d_j/d_i for fluid particle i and wall particle j."""
    distance = distance_from_wall(
        x, wall_normal, wall_depth, wall_curvature, i, j, period, inverse_period, DIM
    )
    return extrapolation(distance, wall_depth[j], support[i])


@njit(error_model="numpy", fastmath=FASTMATH)
def wall_distance(
    x, support, wall_normal, wall_depth, wall_curvature, i, j, period, inverse_period, DIM
):
    """d_i of fluid particle i and wall particle j, bounded below as in :func:`surface_factor`."""
    distance = distance_from_wall(
        x, wall_normal, wall_depth, wall_curvature, i, j, period, inverse_period, DIM
    )
    return max(distance, CLOSEST * support[i])


@njit(error_model="numpy", fastmath=FASTMATH)
def exchange_velocity(transfer, diffusivity, distance):
    """1/(1/k + d/κ) in m/s: transfer through the surface and diffusion up to it, in series."""
    if transfer * diffusivity == 0.0:
        return 0.0
    return transfer * diffusivity / (diffusivity + transfer * distance)


@particle_loop
def kernel_sums(
    i,
    x,
    support,
    volume,
    start,
    stop,
    neighbours,
    period,
    inverse_period,
    alpha,
    kernel_sum,
    *,
    DIM,
    KERNEL,
    UNIFORM,
):
    """The sum n_i = (1/D) Σ V_j F_ij r_ij² over all neighbours, walls included."""
    total = 0.0
    h = support[i]
    for k in range(start[i], stop[i]):
        j = neighbours[k]
        r2 = separation_square(x, i, j, period, inverse_period, DIM)
        if not UNIFORM:
            h = 0.5 * (support[i] + support[j])
        total += volume[j] * pair_f(r2, h, alpha, DIM, KERNEL) * r2
    kernel_sum[i] = total / DIM


@particle_loop
def exchange_weights(
    i,
    x,
    support,
    volume,
    kernel_sum,
    start,
    stop,
    neighbours,
    period,
    inverse_period,
    alpha,
    exchange,
    *,
    DIM,
    KERNEL,
    UNIFORM,
    NORMALISE,
):
    """2 V_i V_j F_ij s_ij along row i, for particles that stay where they are."""
    h = support[i]
    for k in range(start[i], stop[i]):
        j = neighbours[k]
        r2 = separation_square(x, i, j, period, inverse_period, DIM)
        if not UNIFORM:
            h = 0.5 * (support[i] + support[j])
        weight = 2.0 * volume[i] * volume[j] * pair_f(r2, h, alpha, DIM, KERNEL)
        if NORMALISE:
            weight *= 2.0 / (kernel_sum[i] + kernel_sum[j])
        exchange[k] = weight


@particle_loop
def diffuse(
    i,
    x,
    support,
    volume,
    group,
    kernel_sum,
    start,
    stop,
    neighbours,
    period,
    inverse_period,
    alpha,
    exchange,
    tau,
    columns,
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
    partner,
    continuous,
    concentration,
    amount,
    amount_booked,
    *,
    DIM,
    KERNEL,
    UNIFORM,
    NORMALISE,
    SURFACE,
    FLUX,
    SWITCH,
    AT_REST,
):
    """Exchange of all diffusing species (``columns``) during tau; see the module's docstring.

    ``pair_kappa`` (G, G, S) holds the mean diffusivity of a pair of groups. What comes through
    surfaces is booked by the fluid particle. With ``SWITCH`` particles that hold molecules of a
    species (``continuous`` of its column ``partner``) are left to their jumps. ``AT_REST`` takes
    the weights of pairs from ``exchange``.
    """
    g = group[i]
    h = support[i]
    for k in range(start[i], stop[i]):
        j = neighbours[k]
        if AT_REST:
            weight = tau * exchange[k]
        else:
            r2 = separation_square(x, i, j, period, inverse_period, DIM)
            if not UNIFORM:
                h = 0.5 * (support[i] + support[j])
            both = volume[i] * volume[j]
            weight = 2.0 * tau * both * pair_f(r2, h, alpha, DIM, KERNEL)
            if NORMALISE:
                weight *= 2.0 / (kernel_sum[i] + kernel_sum[j])
        other = group[j]
        for m in range(len(columns)):
            s = columns[m]
            flux = weight * pair_kappa[g, other, s]
            if SWITCH and partner[s] >= 0:
                if continuous[i, partner[s]] == 0:
                    continue
                if continuous[j, partner[s]] == 0 and status[other, s] < 2:
                    continue
            if FLUX and status[other, s] == 3:
                if receives[g, s] != 0:
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
                    speed = exchange_velocity(transfer[other, s], diffusivity[g, s], distance)
                    flux = weight * (distance + wall_depth[j]) * wall_scale[other]
                    flux *= inward[other, s] + speed * (value[other, s] - concentration[i, s])
                    amount_booked[i, s] += flux
                    amount[i, s] += flux
                continue
            if SURFACE and status[other, s] == 2:
                if flux > 0.0:
                    flux *= surface_factor(
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
                    flux *= value[other, s] - concentration[i, s]
                    amount_booked[i, s] += flux
            else:
                flux *= concentration[j, s] - concentration[i, s]
            amount[i, s] += flux
