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

from dataclasses import dataclass
from typing import Any

from particell.compute.expressions import Number, where
from particell.compute.sweep import Sweep
from particell.laws.law import Adds, Law
from particell.sources.mobile import ALL, Particles
from particell.sources.source import Names, Source
from particell.sources.walls import Walls

#: Steps are limited to this many h²/κ. Where that is not stable (:mod:`.chemistry.exchange`), the
#: explicit exchange of concentrations is divided.
STEP_LIMIT = 0.05
#: What a group is to a species: its particles hold it freely, as a reservoir, or are a wall's.
FREE, HELD, WALL_VALUE, WALL_FLUX = 0, 1, 2, 3
#: All neighbours, and those that are no walls, with weights that are kept.
WEIGHED = Particles(last="stop", weighed="exchange")
WEIGHED_MOBILE = Particles(weighed="exchange")
WEIGHED_WALLS = Walls(weighed="exchange")


def exchange_velocity(transfer: Number, diffusivity: Number, distance: Number) -> Number:
    """1/(1/k + d/κ) in m/s: transfer through the surface and diffusion up to it, in series."""
    product = transfer * diffusivity
    return product / where(product == 0.0, 1.0, diffusivity + transfer * distance)


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


def weighed_sources(walls: bool) -> tuple[Source, ...]:
    """All neighbours with kept weights; walls by themselves where their surface matters."""
    return (WEIGHED_MOBILE, WEIGHED_WALLS) if walls else (WEIGHED,)


@dataclass(frozen=True)
class Diffusion(Law):
    """Exchange of a species during tau, with weights 2 V_i V_j F_ij s_ij that are kept.

    Attributes
    ----------
    switch
        Particles that hold molecules of the species (``continuous`` is 0) are left to their jumps.
    """

    switch: bool = False

    own = ("inside", "through")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """What comes from j, in mol/s: of particles, and through the surface of walls."""
        weight = ij.kept("exchange")
        flow = weight * ij.of_groups("pair_kappa", "column")
        if self.switch:
            jumps = (j.status < WALL_VALUE) & (j.continuous == 0)
            flow = where(jumps, 0.0, flow)
        inside = flow * (j.concentration - i.concentration)
        if not ij.wall:
            return {"inside": inside}
        held = where(flow > 0.0, flow * ij.extrapolation * (j.value - i.concentration), 0.0)
        speed = exchange_velocity(j.transfer, i.diffusivity, ij.above)
        area = weight * (ij.above + ij.depth) * j.wall_scale
        stream = area * (j.inward + speed * (j.value - i.concentration))
        stream = where((j.status == WALL_FLUX) & (i.receives != 0), stream, 0.0)
        return {
            "inside": where(j.status < WALL_VALUE, inside, 0.0),
            "through": where(j.status == WALL_VALUE, held, stream),
        }

    def finish(self, i: Any, sums: Any) -> Adds:
        """Amounts after tau; what came through surfaces is booked by the particle."""
        gain, through = i.tau * (sums.inside + sums.through), i.tau * sums.through
        if self.switch:
            gain, through = (where(i.continuous == 0, 0.0, v) for v in (gain, through))
        return {"amount": i.amount + gain, "amount_booked": i.amount_booked + through}


def diffuse(dim: int, kernel: int, groups: int, walls: bool, switch: bool) -> Sweep:
    """Exchange of one species, that of the number ``column``, during ``tau``.

    With ``switch`` the column of ``continuous`` is the number ``counted``.
    """
    fields: dict[str, int | str] = {"x": dim, "support": 0, "continuous": "counted"}
    fields |= dict.fromkeys(("concentration", "amount", "amount_booked"), "column")
    of_groups = ("status", "value", "inward", "transfer", "diffusivity", "receives")
    tables: dict[str, bool | str] = dict.fromkeys(of_groups, "column")
    names = Names(dim, fields, {**tables, "wall_scale": True}, frozenset({"tau"}), groups=groups)
    return Sweep(
        "diffuse_beside_walls" if walls else "diffuse",
        (Diffusion(switch),),
        weighed_sources(walls),
        names,
        kernel,
        uniform=True,
        targets="all",
        exact=True,
    )
