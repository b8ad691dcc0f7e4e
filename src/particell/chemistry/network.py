"""Species, reactions and boundaries as tables that loops read by the particle's group."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from particell.chemistry.lawcode import Law
from particell.chemistry.reactions import HIGHEST_ORDER, Reaction
from particell.chemistry.reservoirs import (
    FREE,
    HELD,
    WALL_FLUX,
    WALL_VALUE,
    FixedValueWall,
    FluxWall,
    Reservoir,
)
from particell.chemistry.species import Species
from particell.errors import InputError, shown, unknown_name
from particell.particles import Group

Boundaries = Sequence[Reservoir | FixedValueWall | FluxWall]


@dataclass
class Tables:
    """The tables of one kind of species: all concentrations, or all molecules.

    With G groups, S species of this kind and R one-way reactions:

    Attributes
    ----------
    names
        The species.
    present
        bool (G, S), whether a group holds a species.
    diffusivity
        float64 (G, S), in m²/s.
    pair_diffusivity
        float64 (G, G, S), the diffusivity between a particle of the first and one of the second
        group, see :func:`pair_diffusivity`.
    status
        int64 (G, S): ``FREE``, ``HELD`` (a reservoir), ``WALL_VALUE`` or ``WALL_FLUX``.
    value
        float64 (G, S), the concentration that is kept, or outside of a flux wall, in mol/m³.
    flux, transfer
        float64 (G, S), of flux walls: in mol/m²/s, and in m/s.
    reactants
        int64 (R, 3), the species of the rate's factors, -1 for none; equal ones are neighbours.
        In the tables of molecules S + a stands for column a of the concentrations.
    repeats
        int64 (R, 3), how often the factor's species came before (falling factorials).
    net
        int64 (R, S), change of each species by one event.
    rate
        float64 (G, R), rate constants, 0 where the reaction does not take place.
    volume_power
        int64 (R,): the propensity holds (V 𝒩)**volume_power.
    law
        int64 (R,): 0 for mass action, m + 1 for the m-th function of ``laws``.
    laws
        User-given rate laws or propensities: functions, or the lines of formulas.
    partner
        int64 (S,), for a species that switches its column in the tables of the other kind; -1.
    takes_part
        uint8 (R, S), whether a species takes part in a reaction.
    shared
        uint8 (R,), of molecules: 1 for a reaction that stands in both tables, as all its species
        may be amounts.
    net_amount
        int64 (R, A), of molecules: change of each concentration, in molecules.
    labels
        The reactions as they were written, for messages.
    timed
        Whether a law depends on the time.
    """

    names: list[str]
    present: np.ndarray
    diffusivity: np.ndarray
    pair_diffusivity: np.ndarray
    status: np.ndarray
    value: np.ndarray
    reactants: np.ndarray
    repeats: np.ndarray
    net: np.ndarray
    rate: np.ndarray
    volume_power: np.ndarray
    law: np.ndarray
    laws: list[Any]
    flux: np.ndarray
    transfer: np.ndarray
    partner: np.ndarray
    takes_part: np.ndarray
    shared: np.ndarray
    net_amount: np.ndarray
    labels: list[str]
    timed: bool = False

    @property
    def switching(self) -> np.ndarray:
        """Columns of the species that switch."""
        return np.flatnonzero(self.partner >= 0)

    @property
    def reactions(self) -> int:
        """Number of one-way reactions."""
        return len(self.net)

    @property
    def diffusing(self) -> np.ndarray:
        """Columns of the species that diffuse somewhere or come through a wall."""
        moving = self.pair_diffusivity.any(axis=(0, 1)) | (self.status == WALL_FLUX).any(axis=0)
        return np.flatnonzero(moving).astype(np.int64)


def pair_diffusivity(diffusivity: np.ndarray, status: np.ndarray) -> np.ndarray:
    """Diffusivities between groups, (G, G, S), from those of the groups, (G, S).

    The harmonic mean, so that a group without diffusivity blocks. A wall that has a surface value
    takes the diffusivity of the fluid particle and has no exchange of its own to compute; between
    two particles that are held nothing needs to be exchanged.
    """
    one, other = diffusivity[:, None, :], diffusivity[None, :, :]
    total = one + other
    mean = np.divide(2 * one * other, total, out=np.zeros_like(total), where=total > 0)
    mean = np.where(status[None, :, :] == WALL_VALUE, one + 0 * other, mean)
    mean[np.broadcast_to((status == WALL_VALUE)[:, None, :], mean.shape)] = 0.0
    mean[(status != FREE)[:, None, :] & (status != FREE)[None, :, :]] = 0.0
    return mean


#: What tables of every group and loops over all of it are made for.
MOST = {"species": 1000, "reactions": 10_000}


def build_tables(
    species: Sequence[Species],
    reactions: Sequence[Reaction],
    boundaries: Boundaries,
    groups: Sequence[Group],
) -> tuple[Tables, Tables]:
    """The tables of concentrations and those of molecules.

    Raises
    ------
    InputError
        For unknown names, doubled species, reactions that take place nowhere, and rate laws that
        do not fit the kind of their species.
    """
    for what, given in (("species", species), ("reactions", reactions)):
        if len(given) > MOST[what]:
            raise InputError(f"number of {what}", len(given), f"at most {MOST[what]}")
    known = {s.name: s for s in species}
    if len(known) < len(species):
        raise InputError("species", [s.name for s in species], "distinct names")
    group_index = {g.name: k for k, g in enumerate(groups)}
    _check_names(known, reactions, boundaries, group_index)
    kinds: dict[bool, list[Reaction]] = {False: [], True: []}
    for reaction in reactions:
        taking_part = [known[name] for name in reaction.names]
        whole = any(s.molecules for s in taking_part)
        _check_law(reaction, taking_part, whole)
        if whole:
            kinds[True].append(reaction)
        if all(not s.molecules or s.switches for s in taking_part):
            kinds[False].append(reaction)
    amounts = [s for s in species if not s.molecules or s.switches]
    counts = [s for s in species if s.molecules]
    first = _tables(amounts, kinds[False], boundaries, groups, None)
    second = _tables(counts, kinds[True], boundaries, groups, first)
    for s in second.switching:
        first.partner[second.partner[s]] = s
        # what a reservoir keeps are its molecules
        held = first.status[:, second.partner[s]] == HELD
        first.status[held, second.partner[s]] = FREE
    return first, second


def _check_law(reaction: Reaction, species: Sequence[Species], molecules: bool) -> None:
    """Refuse rate laws that do not fit the kind of the species."""
    label = reaction.label
    own = reaction.rate_law is not None or reaction.propensity is not None
    if not molecules and (reaction.units == "molecules" or reaction.propensity is not None):
        raise InputError(
            "reaction", label, "between molecules where it has a propensity or units='molecules'"
        )
    if molecules and reaction.rate_law is not None:
        raise InputError("reaction", label, "given a propensity, not a rate_law, for molecules")
    if own and len({s.molecules for s in species}) > 1:
        raise InputError("reaction", label, "of mass action, with molecules and concentrations")
    if any(s.switches for s in species) and (own or reaction.units == "molecules"):
        raise InputError(
            "reaction", label, "of mass action in units of concentration, with species that switch"
        )


def _check_names(
    known: Mapping[str, Species],
    reactions: Sequence[Reaction],
    boundaries: Boundaries,
    groups: Mapping[str, int],
) -> None:
    def check(what: str, names: Sequence[str], allowed: Mapping[str, Any]) -> None:
        for name in names:
            if name not in allowed:
                raise unknown_name(what, name, allowed)

    for s in known.values():
        check(f"group in only_in of species {s.name}", list(s.only_in or ()), groups)
        if isinstance(s.diffusivity, Mapping):
            check(f"group in diffusivity of species {s.name}", list(s.diffusivity), groups)
    for r in reactions:
        check(f"species in reaction {r.label}", r.names, known)
        check(f"group in only_in of reaction {r.label}", list(r.only_in or ()), groups)
        for rate in (r.forward, r.backward):
            if isinstance(rate, Mapping):
                check(f"group in a rate of reaction {r.label}", list(rate), groups)
    for b in boundaries:
        check(f"group of {type(b).__name__}", [b.group], groups)
        check(f"species of {type(b).__name__} {b.group}", list(b.values), known)


def _tables(
    species: list[Species],
    reactions: list[Reaction],
    boundaries: Boundaries,
    groups: Sequence[Group],
    other: Tables | None,
) -> Tables:
    """The tables of one kind of species; ``other`` are those of concentrations, for molecules."""
    names = [s.name for s in species]
    shape = (len(groups), len(names))
    present = np.array(
        [[s.is_in(g.name, g.kind) for s in species] for g in groups], dtype=bool
    ).reshape(shape)
    status, value = np.zeros(shape, np.int64), np.zeros(shape)
    flux, transfer = np.zeros(shape), np.zeros(shape)
    group_names = [g.name for g in groups]
    for boundary in boundaries:
        g = group_names.index(boundary.group)
        if groups[g].kind != "wall" and not isinstance(boundary, Reservoir):
            kind = f"group of {type(boundary).__name__}"
            raise InputError(kind, boundary.group, "a wall: its particles know their surface")
        for name, concentration in boundary.values.items():
            if name not in names:
                continue
            s = names.index(name)
            if status[g, s] != FREE:
                raise InputError(f"{name} in {boundary.group}", concentration, "set only once")
            held = isinstance(boundary, Reservoir)
            status[g, s] = HELD if held else WALL_VALUE
            if isinstance(boundary, FluxWall):
                status[g, s] = WALL_FLUX
                flux[g, s] = boundary.flux.get(name, 0.0)
                transfer[g, s] = boundary.transfer.get(name, (0.0, 0.0))[0]
            value[g, s] = concentration
            present[g, s] = held
    diffusivity = np.array(
        [[s.diffusivity_in(g.name) for s in species] for g in groups], dtype=float
    ).reshape(shape)
    diffusivity *= present
    directions = [(r, False) for r in reactions] + [(r, True) for r in reactions if r.reversible]
    count = len(directions)
    tables = Tables(
        names=names,
        present=present,
        diffusivity=diffusivity,
        pair_diffusivity=pair_diffusivity(diffusivity, status),
        status=status,
        value=value,
        reactants=np.full((count, HIGHEST_ORDER), -1, np.int64),
        repeats=np.zeros((count, HIGHEST_ORDER), np.int64),
        net=np.zeros((count, len(names)), np.int64),
        rate=np.zeros((len(groups), count)),
        volume_power=np.zeros(count, np.int64),
        law=np.zeros(count, np.int64),
        laws=[],
        flux=flux,
        transfer=transfer,
        partner=np.full(len(names), -1, np.int64),
        takes_part=np.zeros((count, len(names)), np.uint8),
        shared=np.zeros(count, np.uint8),
        net_amount=np.zeros((count, len(other.names) if other else 0), np.int64),
        labels=[r.label for r, _ in directions],
    )
    if other is not None:
        for s, each in enumerate(species):
            if each.switches:
                tables.partner[s] = other.names.index(each.name)
    for r, (reaction, back) in enumerate(directions):
        _fill_reaction(tables, r, reaction, back, groups, other)
    return tables


def _fill_reaction(
    tables: Tables,
    r: int,
    reaction: Reaction,
    back: bool,
    groups: Sequence[Group],
    other: Tables | None,
) -> None:
    sides = (reaction.reactants or {}, reaction.products or {})
    left, right = sides[::-1] if back else sides
    for side, sign in ((left, -1), (right, 1)):
        for name, coefficient in side.items():
            if name in tables.names:
                tables.net[r, tables.names.index(name)] += sign * coefficient
                tables.takes_part[r, tables.names.index(name)] = 1
            elif other is not None:
                tables.net_amount[r, other.names.index(name)] += sign * coefficient
    if other is not None:
        tables.shared[r] = all(name in other.names for name in reaction.names)
    law = reaction.rate_law or reaction.propensity
    if law is not None:
        if isinstance(law, Law):  # a formula with the species' names in it
            tables.laws.append(law.body(tables.names))
            tables.timed |= law.timed
            if law.timed and other is not None:
                without = "without the time, where species are molecules"
                raise InputError("law of reaction", reaction.label, without)
        else:
            _check_call(reaction, law, len(tables.names))
            tables.laws.append(law if hasattr(law, "py_func") else njit(law))
        tables.law[r] = len(tables.laws)
    else:
        for place, (name, repeat) in enumerate(_factors(left)):
            tables.reactants[r, place] = _slot(name, tables, other)
            tables.repeats[r, place] = repeat
        if reaction.units == "concentration":
            tables.volume_power[r] = 1 - sum(left.values())
    rate = reaction.backward if back else reaction.forward
    allowed = np.ones(len(groups), dtype=bool)
    missing: dict[int, list[str]] = {g: [] for g in range(len(groups))}
    for name in reaction.names:
        holds = tables if name in tables.names else other
        assert holds is not None
        column = holds.present[:, holds.names.index(name)]
        allowed &= column
        for index in np.flatnonzero(~column).tolist():
            missing[index].append(name)
    for g, group in enumerate(groups):
        named = reaction.only_in is None or group.name in reaction.only_in
        if reaction.only_in is not None and named and not allowed[g]:
            raise InputError(
                f"only_in of reaction {reaction.label}",
                group.name,
                f"a group that holds all its species ({', '.join(missing[g])} cannot be there)",
            )
        if named and allowed[g]:
            tables.rate[g, r] = rate.get(group.name, 0.0) if isinstance(rate, Mapping) else rate
    if not allowed.any():
        raise InputError(
            "reaction", reaction.label, "between species that some group holds together"
        )


def _check_call(reaction: Reaction, law: Any, species: int) -> None:
    """Refuse a rate law or propensity that cannot be evaluated, or gives no number."""
    own = reaction.rate_law is not None
    numbers = np.ones(species, dtype=float if own else np.int64)
    arguments = (numbers, 1.0) if own else (numbers, 1.0, 1.0)
    function = getattr(law, "py_func", law)
    try:
        with np.errstate(all="ignore"):
            float(function(*arguments))
    except ArithmeticError:
        pass  # at these numbers only, perhaps
    except Exception as error:
        name = "rate_law" if own else "propensity"
        allowed = f"a function f({'C, k' if own else 'N, V, k'}) of numbers ({shown(error)})"
        raise InputError(f"{name} of {reaction.label}", law, allowed) from None


def _factors(side: Mapping[str, int]) -> Iterator[tuple[str, int]]:
    """Each factor of a rate, with how often its species came before."""
    for name, coefficient in side.items():
        for repeat in range(coefficient):
            yield name, repeat


def _slot(name: str, tables: Tables, other: Tables | None) -> int:
    """Number of a species as it stands in ``reactants``."""
    if name in tables.names:
        return tables.names.index(name)
    assert other is not None
    return len(tables.names) + other.names.index(name)
