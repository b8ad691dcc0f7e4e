r"""Boundaries of species: reservoirs, walls with a surface value or a flux, sponges.

What comes in through them is *booked*: the fields ``amount_booked`` and ``count_booked`` hold, for
each particle and species, what came in (+) and went out (-) there since the beginning, so that the
total minus the sum of what was booked is constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from particell.checks import checked
from particell.chemistry.binomial import stochastic_round
from particell.chemistry.species import checked_rate
from particell.compute.loop import particle_loop
from particell.errors import InputError
from particell.laws.diffusion import FREE as FREE
from particell.laws.diffusion import HELD as HELD
from particell.laws.diffusion import WALL_FLUX as WALL_FLUX
from particell.laws.diffusion import WALL_VALUE as WALL_VALUE
from particell.materials import AVOGADRO


@checked
@dataclass(frozen=True)
class Reservoir:
    """Particles in which species are kept at a value.

    Molecules that enter vanish, those that leave are replaced; both are booked.

    Parameters
    ----------
    group
        The particles.
    values
        Concentrations in mol/m³ by species; species that are not named are free.

    Notes
    -----
    Molecules are kept at a whole number of mean λ = C V 𝒩: λ rounded up or down at random without
    bias, anew for each particle and step. (A number of each particle's own for the whole run would
    be right in the mean of many runs only, its surplus would stay where it is.) What goes out does
    not depend on that number: it is a Poisson stream at the rate of λ molecules, so that the number
    of molecules outside is right in the mean for any λ, and Poisson, without the noise of rounding.
    """

    group: str
    values: Mapping[str, float]

    def __post_init__(self) -> None:
        _check_values(self)


@checked
@dataclass(frozen=True)
class FixedValueWall:
    r"""A wall whose surface has fixed concentrations.

    Wall particle j takes, for fluid particle i, the value extrapolated through the surface
    (:mod:`particell.boundaries.wall`). Molecules go out at the rate
    :math:`2\kappa_i V_j F_{ij} s_{ij}(1 + d_j/d_i)` each, and come in as a Poisson stream of that
    rate times :math:`C_w V_i 𝒩`.

    Parameters
    ----------
    group
        The wall's particles.
    values
        Surface concentrations in mol/m³ by species; the wall is impermeable to others.

    Notes
    -----
    The surface is that of the wall's phase (``Phase(..., surface=)``; those of ``channel_walls``
    and ``box_walls`` have one). For a wall without, each particle has the value at its own place
    and nothing is extrapolated: of first order, an error of about half a spacing over the distance
    that the concentration changes over.
    """

    group: str
    values: Mapping[str, float]

    def __post_init__(self) -> None:
        _check_values(self)


@checked
@dataclass(frozen=True)
class FluxWall:
    r"""A wall with a given flux, or with a flux in proportion to a difference (Neumann, Robin).

    .. math:: q = q_0 + k\,(C_{ext} - C_w)

    is what enters the fluid, in mol/m²/s, C_w the concentration at the surface; see
    :mod:`particell.chemistry.fluxes`. Walls are impermeable to species that they do not name.

    Parameters
    ----------
    group
        The wall's particles.
    flux
        q_0 >= 0 by species, in mol/m²/s. (A sink is a transfer to C_ext = 0.)
    transfer
        (k in m/s, C_ext in mol/m³) by species.
    area
        Area of the surface that fluid touches, in m² (in 2D its length times the domain's depth);
        what enters is q times this area exactly. By default it is found from the wall's
        particles, which are right for plane and curved walls of two or more regular layers.
    """

    group: str
    flux: Mapping[str, float] = field(default_factory=dict)
    transfer: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    area: float | None = None

    def __post_init__(self) -> None:
        key = f"FluxWall {self.group}"
        for name in ("flux", "transfer"):
            if not isinstance(getattr(self, name), Mapping):
                raise InputError(f"{name} of {key}", getattr(self, name), "a table by species")
        if not self.flux and not self.transfer:
            raise InputError(f"flux of {key}", self.flux, "a flux or a transfer of some species")
        for name, flux in self.flux.items():
            checked_rate(f"flux of {name} in {key}", flux)
        for name, pair in self.transfer.items():
            if not isinstance(pair, tuple | list) or len(pair) != 2:
                raise InputError(f"transfer of {name} in {key}", pair, "a pair (k, C_ext)")
            for number in pair:
                checked_rate(f"transfer of {name} in {key}", number)
        if self.area is not None and checked_rate(f"area of {key}", self.area) == 0:
            raise InputError(f"area of {key}", self.area, "positive")

    @property
    def values(self) -> dict[str, float]:
        """C_ext by species, 0 where only a flux is given."""
        external = {name: float(pair[1]) for name, pair in self.transfer.items()}
        return {**dict.fromkeys(self.flux, 0.0), **external}


def _check_values(boundary: Reservoir | FixedValueWall) -> None:
    kind = type(boundary).__name__
    if not isinstance(boundary.values, Mapping) or not boundary.values:
        raise InputError(
            f"values of {kind} {boundary.group}", boundary.values, "a table by species"
        )
    for name, value in boundary.values.items():
        checked_rate(f"value of {name} in {kind} {boundary.group}", value)


@particle_loop
def hold_amounts(i, group, volume, status, value, amount, amount_booked):
    """Bring the amounts of reservoirs back to C V and book the difference."""
    g = group[i]
    for s in range(status.shape[1]):
        if status[g, s] == 1:
            kept = value[g, s] * volume[i]
            amount_booked[i, s] += kept - amount[i, s]
            amount[i, s] = kept


@particle_loop
def hold_counts(i, step, id, key0, key1, group, volume, depth, status, value, count, count_booked):
    """Bring the molecules of reservoirs back to C V 𝒩, rounded without bias; book it.

    The random number is the step's: within a step a particle is brought back to the same number.
    """
    g = group[i]
    for s in range(status.shape[1]):
        if status[g, s] == 1:
            expected = value[g, s] * volume[i] * depth * AVOGADRO
            kept = stochastic_round(
                expected, np.uint64(id[i]), np.uint64(step), np.uint64(s), key0, key1
            )
            count_booked[i, s] += kept - count[i, s]
            count[i, s] = kept


@particle_loop
def relax_amounts(
    i, fraction, target, s, partner, continuous, volume, amount, amount_booked, *, SWITCH
):
    """Sponge: n <- n - (n - C_target V) f with the particle's own f in [0, 1]; booked.

    ``fraction`` (n,) is f, ``target`` (n,) the concentration in mol/m³, s the species' column.
    With ``SWITCH`` only where the species is an amount.
    """
    if SWITCH and partner[s] >= 0 and continuous[i, partner[s]] == 0:
        return
    change = (target[i] * volume[i] - amount[i, s]) * fraction[i]
    amount[i, s] += change
    amount_booked[i, s] += change


@particle_loop
def relax_counts(
    i,
    fraction,
    target,
    s,
    step,
    stream,
    volume,
    depth,
    id,
    key0,
    key1,
    group,
    status,
    continuous,
    count,
    count_booked,
    *,
    SWITCH,
):
    """Sponge for molecules: the change (C_target V 𝒩 - N) f, rounded without bias; booked."""
    if SWITCH and continuous[i, s] != 0:
        return
    if status[group[i], s] == 0 and fraction[i] > 0.0:
        change = (target[i] * volume[i] * depth * AVOGADRO - count[i, s]) * fraction[i]
        # rounding what is taken away keeps the number from going below zero
        taken = stochastic_round(-change, np.uint64(id[i]), step, stream, key0, key1)
        count[i, s] -= taken
        count_booked[i, s] -= taken


@particle_loop
def round_counts(i, expected, s, id, chosen, key0, key1, count):
    """Initial numbers of molecules: ``expected`` rounded at random without bias, where chosen."""
    if chosen[i] != 0:
        zero = np.uint64(0)
        count[i, s] = stochastic_round(
            expected[i], np.uint64(id[i]), zero, np.uint64(s), key0, key1
        )
