r"""What a shift carries between particles of their species.

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

How whole molecules cross at this mean flux is in :mod:`particell.chemistry.crossings`.

Units: n in mol (per depth) or molecules, V in m^D, C in n per V, δv in m/s, F in 1/m^(D+2).

Source: Adami, Hu & Adams, J. Comput. Phys. 241 (2013) 292, the form of their momentum flux; Jacob,
thesis, UCSB 2020.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from numba import njit

from particell.compute.device import Device
from particell.compute.expressions import call
from particell.compute.loop import particle_loop
from particell.compute.sweep import Sweep
from particell.laws.law import Adds, Law
from particell.sources.mobile import Particles
from particell.sources.source import Names


@njit
def species_flux(own_shift, its_shift, own_content, its_content):
    """The pair's part of dn_i/dt; shifts as in :class:`PairShifts`, contents are C' of i and j."""
    return -(own_content * own_shift + its_content * its_shift)


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


class PairShifts(Law):
    """V_i V_j F_ij δv·x_ij with δv of the particle and of its neighbour, which are kept."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """In m^D/s."""
        weight = i.volume * j.volume * ij.F
        own, its = i.shift_velocity.dot(ij.x), j.shift_velocity.dot(ij.x)
        return {"own_shift": weight * own, "its_shift": weight * its}


class Carried(Law):
    """The flux of deviations that a shift carries, during tau."""

    own = ("gain",)

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """What comes from j in mol/s."""
        shifts = ij.kept("own_shift"), ij.kept("its_shift")
        flux = call(species_flux, (*shifts, i.deviation, j.deviation))
        return {"gain": j.carries * flux}

    def finish(self, i: Any, sums: Any) -> Adds:
        """Amounts after the flux."""
        return {"carried": i.amount + i.tau * i.carries * sums.gain}


def carry(dim: int) -> Sweep:
    """``carried`` = amounts of species ``column`` after the flux of deviations during ``tau``."""
    columns = dict.fromkeys(("deviation", "amount", "carried"), "column")
    names = Names(dim, columns, {"carries": "column"}, frozenset({"tau"}))
    weighed = Particles(weighed="own_shift")
    return Sweep("carry", (Carried(),), (weighed,), names, 0, True, targets="all", exact=True)


def bound_carry(
    device: Device, fields: Mapping[str, Any], columns: int
) -> Callable[[int, float], None]:
    """:func:`carry` of n particles' species, one after the other, as f(n, tau)."""
    dim = fields["x"].shape[1]
    run = carry(dim).bind(device, fields, {})

    def carry_all(n: int, tau: float) -> None:
        for column in range(columns):
            run(n, column=column, tau=tau)

    return carry_all
