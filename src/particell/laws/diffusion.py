r"""Diffusion of species that are concentrations.

With the amounts :math:`n_i = C_i V_i` (mol), volumes :math:`V_i = m_i/\rho_i`, the kernel's
:math:`F = -W'/r` and the harmonic mean :math:`\bar\kappa_{ij}` of the diffusivities (so that a
neighbour without diffusivity blocks),

.. math:: \frac{dn_i}{dt} = \sum_j 2 \bar\kappa_{ij} V_i V_j F_{ij} s_{ij} (C_j - C_i),

antisymmetric in i and j: amounts are conserved to round-off whatever the volumes do. The factor
:math:`s_{ij}` is 1, or that of :mod:`particell.laws.carriers`, which makes the second moments of
the weights right over the neighbours that carry the species.

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

from typing import Any

from numba import njit

from particell.boundaries.wall import CLOSEST, extrapolation, surface_distance
from particell.compute.loop import FASTMATH, particle_loop
from particell.compute.rounding import nearest_integer
from particell.compute.sweep import Sweep
from particell.laws.law import Adds, Law
from particell.sources.mobile import ALL
from particell.sources.source import Names

#: Steps are limited to this many h²/κ. Where that is not stable (:mod:`.chemistry.exchange`), the
#: explicit exchange of concentrations is divided.
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
    return extrapolation(distance, wall_depth[j], support[i], wall_curvature[j], DIM)


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


class PairSlope(Law):
    """F_ij of all neighbours, which is kept."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """−W'/r, in 1/m^(D+2)."""
        return {"exchange": ij.F}


def pair_slopes(dim: int, kernel: int, uniform: bool) -> Sweep:
    """F_ij of all neighbours, walls included, along row i of ``exchange``."""
    return Sweep(
        "pair_slopes",
        (PairSlope(),),
        (ALL,),
        Names(dim, {"x": dim, "support": 0}),
        kernel,
        uniform,
        targets="all",
        stored=("exchange",),
    )


@particle_loop
def diffuse(
    i,
    x,
    support,
    group,
    start,
    stop,
    neighbours,
    period,
    inverse_period,
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
    SURFACE,
    FLUX,
    SWITCH,
):
    """Exchange of all diffusing species (``columns``) during tau; see the module's docstring.

    ``exchange`` holds 2 V_i V_j F_ij s_ij, ``pair_kappa`` (G, G, S) the mean diffusivity
    of a pair of groups. What comes through surfaces is booked by the fluid particle. With
    ``SWITCH`` particles that hold molecules of a species (``continuous`` of its column
    ``partner``) are left to their jumps.
    """
    g = group[i]
    for m in range(len(columns)):
        s = columns[m]
        if SWITCH and partner[s] >= 0 and continuous[i, partner[s]] == 0:
            continue
        own = concentration[i, s]
        inside, through = 0.0, 0.0
        for k in range(start[i], stop[i]):
            j = neighbours[k]
            other = group[j]
            flux = exchange[k] * pair_kappa[g, other, s]
            if SWITCH and partner[s] >= 0 and status[other, s] < 2:
                flux *= continuous[j, partner[s]] != 0
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
                    area = exchange[k] * (distance + wall_depth[j]) * wall_scale[other]
                    through += area * (inward[other, s] + speed * (value[other, s] - own))
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
                    through += flux * (value[other, s] - own)
            else:
                inside += flux * (concentration[j, s] - own)
        amount[i, s] += tau * (inside + through)
        if SURFACE or FLUX:
            amount_booked[i, s] += tau * through
