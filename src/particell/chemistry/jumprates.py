"""The rates at which molecules jump between particles and go through walls.

The equations are in :mod:`particell.chemistry.jumps` and, for walls, in
:mod:`particell.laws.diffusion`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from particell.chemistry.reservoirs import FREE, HELD, WALL_FLUX, WALL_VALUE
from particell.compute.expressions import call, where
from particell.compute.sweep import Sweep
from particell.laws.diffusion import exchange_velocity, weighed_sources
from particell.laws.law import Adds, Law
from particell.materials import AVOGADRO
from particell.sources.source import Names


@njit
def as_kept(rate):
    """A sum as the last of the cumulative rates has it, in single precision."""
    return np.float64(np.float32(rate))


@dataclass(frozen=True)
class JumpRates(Law):
    """Rates of jumps of one species, and what comes in from outside.

    Attributes
    ----------
    switch
        What is exchanged between amounts (and with walls) is left out.
    """

    switch: bool = False

    own = ("rate", "stream")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """From i to j in 1/s; from a wall in mol/m^D/s."""
        weight = ij.kept("exchange") * (1.0 / i.volume)
        rate = ij.of_groups("pair_kappa") * weight
        if self.switch:
            amounts = (i.continuous != 0) & ((j.continuous != 0) | (j.status >= WALL_VALUE))
            rate = where(amounts, 0.0, rate)
        if not ij.wall:
            return {"rate": rate}
        grown = where((j.status == WALL_VALUE) & (rate > 0.0), rate * ij.extrapolation, rate)
        stream = where(j.status == WALL_VALUE, where(rate > 0.0, grown * j.value, 0.0), 0.0)
        takes = (j.status == WALL_FLUX) & (i.receives != 0)
        if self.switch:
            takes = takes & (i.continuous == 0)
        area = weight * (ij.above + ij.depth) * j.wall_scale
        speed = exchange_velocity(j.transfer, i.diffusivity, ij.above)
        return {
            "rate": where(takes, area * speed, grown),
            "stream": where(takes, area * (j.inward + speed * j.value), stream),
        }

    def finish(self, i: Any, sums: Any) -> Adds:
        """The rate of leaving, 0 where molecules vanish (reservoirs, walls with a value).

        The stream is in molecules/s; for a reservoir in 1/s, for each of its molecules.
        """
        total = call(as_kept, (sums.rate,))
        stream = sums.stream * i.volume * i.depth * AVOGADRO
        return {
            "leave_rate": where(i.status == FREE, total, 0.0),
            "inflow": where(i.status == HELD, total, stream),
        }


def jump_rates(dim: int, kernel: int, groups: int, walls: bool, switch: bool) -> Sweep:
    """``leave_rate`` and ``inflow``, and the rates along rows as ``cumulative`` sums.

    With ``switch`` the column of ``continuous`` is the number ``s``.
    """
    fields: dict[str, int | str] = {"x": dim, "support": 0, "volume": 0, "continuous": "s"}
    of_groups = ("status", "value", "inward", "transfer", "diffusivity", "receives", "wall_scale")
    names = Names(
        dim,
        {**fields, "leave_rate": 0, "inflow": 0},
        dict.fromkeys(of_groups, True),
        frozenset({"depth"}),
        groups=groups,
    )
    return Sweep(
        "jump_rates_beside_walls" if walls else "jump_rates",
        (JumpRates(switch),),
        weighed_sources(walls),
        names,
        kernel,
        uniform=True,
        targets="all",
        running={"cumulative": "rate"},
        exact=True,
    )
