r"""What a shift carries between particles of species that are concentrations.

Particles move with :math:`\tilde v = v + \delta v`, the fluid with *v*. By default amounts ride
with the particles; what the fluid carries past them is the flux

.. math::

   \frac{dn_i}{dt} = \sum_j V_i V_j\,(C'_i\,\delta v_i + C'_j\,\delta v_j)\cdot\nabla_iW_{ij},
   \qquad C'_i = \frac{n_i - \bar Y m_i}{V_i},\quad \bar Y = \frac{\sum n}{\sum m},

antisymmetric in i and j: amounts are conserved to round-off. It stands for
:math:`V\,\nabla\cdot(C'\delta v)`, while what is wanted is :math:`V\,\delta v\cdot\nabla C`: no
flux that conserves amounts can be that, since volumes (masses) are not exchanged with the shift.
The difference is :math:`C'\,\nabla\cdot\delta v`. With C' the deviation from the mean content per
mass it vanishes for a uniform species, which stays uniform to round-off (with C itself it would
follow every change of the arrangement); elsewhere it is noise in proportion to the deviation, zero
on the average while particles stay evenly spread.

For concentrations only: the flux takes from a particle in proportion to what its neighbour holds,
and so, too, more than the particle has. An amount may become slightly negative at a front; a number
of molecules must not, and no way of drawing whole molecules is then without bias.

Units: n in mol (per depth), V in m^D, C in mol/m³, δv in m/s, F in 1/m^(D+2).

Source: Adami, Hu & Adams, J. Comput. Phys. 241 (2013) 292, the form of their momentum flux; Jacob,
thesis, UCSB 2020.
"""

from __future__ import annotations

import math

from numba import njit

from particell.compute.loop import particle_loop
from particell.kernels import power, shape_f
from particell.laws.pairs import image_offset


@njit
def species_flux(weight, content_i, content_j, shift_dot_x_i, shift_dot_x_j):
    """The pair's part of dn_i/dt; ``weight`` is V_i V_j F_ij, the last two δv·x_ij of i and j."""
    return -weight * (content_i * shift_dot_x_i + content_j * shift_dot_x_j)


@particle_loop
def species_parts(i, group, mass, carries, amount, part, *, COLUMNS):
    """For each species what particle i holds and its mass, where it takes part; else 0."""
    for s in range(COLUMNS):
        takes = carries[group[i], s]
        part[i, s] = amount[i, s] * takes
        part[i, COLUMNS + s] = mass[i] * takes


@particle_loop
def deviations(i, mass, volume, amount, mean, deviation, *, COLUMNS):
    """C' of particle i."""
    for s in range(COLUMNS):
        deviation[i, s] = (amount[i, s] - mean[s] * mass[i]) / volume[i]


@particle_loop
def carry(
    i,
    x,
    v,
    transport,
    group,
    volume,
    support,
    start,
    split,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    carries,
    deviation,
    amount,
    carried,
    tau,
    *,
    DIM,
    KERNEL,
    COLUMNS,
):
    """``carried`` = amounts of particle i after the flux of the deviations during tau."""
    for s in range(COLUMNS):
        carried[i, s] = amount[i, s]
    g = group[i]
    wraps = crosses[i] != 0
    for k in range(start[i], split[i]):
        j = neighbours[k]
        r2, own, its = 0.0, 0.0, 0.0
        for d in range(DIM):
            offset = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += offset * offset
            own += (transport[i, d] - v[i, d]) * offset
            its += (transport[j, d] - v[j, d]) * offset
        h = 0.5 * (support[i] + support[j])
        f = alpha / (power(h, DIM) * h * h) * shape_f(math.sqrt(r2) / h, KERNEL)
        weight = tau * volume[i] * volume[j] * f
        for s in range(COLUMNS):
            both = weight * carries[g, s] * carries[group[j], s]
            carried[i, s] += species_flux(both, deviation[i, s], deviation[j, s], own, its)
