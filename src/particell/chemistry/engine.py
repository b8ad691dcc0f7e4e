"""Species and reactions on a set of particles: one split step of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from particell.chemistry import fluxes, jumps, reservoirs
from particell.chemistry.contents import Contents
from particell.chemistry.diffusion import Diffusion
from particell.chemistry.exchange import weight_fields
from particell.chemistry.joint import couples
from particell.chemistry.kinetics import Kinetics
from particell.chemistry.network import Boundaries, build_tables
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import HELD, WALL_FLUX, WALL_VALUE, FluxWall
from particell.chemistry.species import Species, checked_rate
from particell.chemistry.storage import prepare, scratch_fields, table_fields
from particell.chemistry.switching import switch_kind
from particell.compute.batches import batch_size
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.compute.philox import (
    JUMP,
    REACTION,
    RESERVOIR,
    ROUNDING,
    SPONGE,
    check_word,
    stream_key,
)
from particell.errors import InputError
from particell.kernels import kernel_code, normalisation
from particell.laws.diffusion import STEP_LIMIT
from particell.materials import AVOGADRO
from particell.particles import Particles
from particell.representation import block

#: A particle with more reaction events in a step than this would be waited for in vain.
MOST_EVENTS = 10**9
#: Where molecules and concentrations react together, reactions turn over at most this part of
#: anything between two exchanges of particles ...
PART_OF_REACTION = 0.2
#: ... but exchanges are no closer than this part of the limit of diffusion: a molecule that jumps
#: to where it reacts at once is missed with the probability that it jumps on in the same part.
PART_OF_LIMIT = 0.1
#: A step is divided into this many parts at most.
MOST_PARTS = 500


class Chemistry(Contents):
    """Species and reactions on a set of particles.

    Parameters
    ----------
    device
        Where loops run.
    particles
        The particles; the fields ``amount`` (mol), ``amount_booked``, ``count`` (molecules) and
        ``count_booked`` are added where they are missing (see :meth:`add_fields`).
    neighbours
        The neighbour list, valid at every call of :meth:`step`.
    species, reactions, boundaries
        What there is, what it does, and where it is kept or comes in
        (:class:`~particell.chemistry.reservoirs.Reservoir`,
        :class:`~particell.chemistry.reservoirs.FixedValueWall`,
        :class:`~particell.chemistry.reservoirs.FluxWall`).
    kernel
        Name of the smoothing kernel.
    seed
        Seed of all random numbers.
    normalise
        Make the moments of the pairs' weights right over the neighbours that carry a species
        (:mod:`particell.laws.carriers`), or leave the weights as they are.
    depth
        Extent of the dimensions that are not simulated, in m (2D) or m² (1D): a particle of
        volume V holds C V depth 𝒩 molecules. Amounts are in mol per depth.
    splitting
        ``"lie"`` or ``"strang"``, see :meth:`step`; ``"auto"`` is Strang's where molecules and
        concentrations react together and something diffuses, else Lie's.
    at_rest
        The particles never move: what depends on their places alone is computed once.

    Attributes
    ----------
    species, reactions
        What there is, by name, and what it does.
    jumps, events
        Diffusive jumps and stochastic reaction events so far.
    divisions
        Explicit steps that the diffusion of concentrations took in the last step.
    substeps
        Largest number of sub-steps of a particle's deterministic reactions in the last step.
    pace
        Fastest rate in 1/s of reactions of molecules and concentrations together, as the last step
        left them, or as they are before the first one; it decides how a step is divided.
    binomial_cost
        Where the exact walks change from single molecules to whole groups, see
        :mod:`particell.chemistry.jumps`; changes speed only.

    Raises
    ------
    InputError
        For species, reactions and boundaries that do not fit together.
    """

    def __init__(
        self,
        device: Device,
        particles: Particles,
        neighbours: NeighbourList,
        species: Sequence[Species],
        reactions: Sequence[Reaction] = (),
        boundaries: Boundaries = (),
        kernel: str = "wendland-c2",
        seed: int = 0,
        normalise: bool = True,
        depth: float = 1.0,
        splitting: str = "auto",
        at_rest: bool = False,
    ):
        if splitting not in ("auto", "lie", "strang"):
            raise InputError("splitting", splitting, "'auto', 'lie' or 'strang'")
        tables = build_tables(species, reactions, boundaries, particles.groups)
        #: whether the step is divided by the rates of reactions
        self._divides = couples(*tables) and any(len(t.diffusing) for t in tables)
        if splitting == "auto":
            splitting = "strang" if self._divides else "lie"
        self.add_fields(particles, species)
        depth = checked_rate("depth", depth)
        super().__init__(device, neighbours.domain, particles, species, tables, seed, depth)
        self.neighbours, self.splitting = neighbours, splitting
        self.reactions = list(reactions)
        self.binomial_cost = jumps.BINOMIAL_COST
        self.jumps = self.events = self.substeps = self.divisions = 0
        code, dim = kernel_code(kernel), particles.dim
        uniform = bool(neighbours.constants["UNIFORM"])
        kernel_of: dict[str, Any] = {"DIM": dim, "KERNEL": code}
        self._shape = {**kernel_of, "UNIFORM": uniform, "BATCH": batch_size(device)}
        surface, flux, self._reservoirs = (
            any(bool((t.status == status).any()) for t in tables)
            for status in (WALL_VALUE, WALL_FLUX, HELD)
        )
        purposes = (REACTION, JUMP, ROUNDING, SPONGE, RESERVOIR)
        self._keys = {p: stream_key(seed, p) for p in purposes}
        self._switching = [int(s) for s in self.stochastic.switching]
        self._switch = {"SWITCH": bool(self._switching)}
        self._pair = {**kernel_of, "SURFACE": surface, "FLUX": flux, **self._switch}
        strang = splitting == "strang"
        self._fields = scratch_fields(device, particles, tables, surface, flux, strang)
        self._fields.update(
            **weight_fields(device, particles.n, dim, uniform, normalise),
            alpha=normalisation(code, dim),
            depth=self.depth,
            quantum=1 / (self.depth * AVOGADRO),
            most_events=MOST_EVENTS,
        )
        self._time = math.nan
        receives = np.array([g.kind == "fluid" for g in particles.groups])
        self._amounts, self._counts = (table_fields(device, t, receives) for t in tables)
        walls = [b for b in boundaries if isinstance(b, FluxWall)]
        self._diffusion = Diffusion(
            device,
            particles,
            tables,
            receives,
            fluxes.wall_areas(particles, neighbours.domain, walls, self.depth),
            normalise=normalise,
            at_rest=at_rest,
            open_ended=surface or flux or self._reservoirs,
        )
        kinds = self._amounts, self._counts
        self._kinetics = Kinetics(device, particles, tables, kinds, self._fields)
        self.pace = math.inf
        self._rows: Any = None

    def __repr__(self) -> str:
        return f"Chemistry({list(self.species.values())}, {self.reactions})"

    def _repr_html_(self) -> str:
        from particell.chemistry.listing import reaction_table, species_table

        tables = species_table(self.species.values()), reaction_table(self.reactions)
        return block("Species and reactions", *tables)

    def saved(self) -> dict[str, Any]:
        """What a run that goes on needs besides fields, for :meth:`restore`."""
        counted = {name: getattr(self, name) for name in ("events", "jumps", "pace")}
        return {**counted, "remarks": list(self.remarks)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Put the :meth:`saved` state of another run back."""
        self.events, self.jumps, self.pace = (saved[k] for k in ("events", "jumps", "pace"))
        self.remarks[:] = saved["remarks"]
        self._diffusion.forget()

    @property
    def remarks(self) -> list[str]:
        """What was found wrong with laws so far, a line each; every line was a warning once."""
        return self._kinetics.remarks.lines

    def limits(self) -> dict[str, float]:
        """Largest steps in s by name: 0.05 h²/κ for each kind of species.

        For concentrations it is the stability of the explicit step; for molecules, whose
        diffusion is exact for any step, the accuracy of splitting it from reactions and flow.
        """
        result = {}
        smallest = float(self.particles.host("support").min())
        for table, name in (
            (self.deterministic, "diffusion of concentrations"),
            (self.stochastic, "diffusion of molecules"),
        ):
            fastest = float(table.diffusivity.max(initial=0.0))
            if fastest > 0:
                result[name] = STEP_LIMIT * smallest**2 / fastest
        return result

    @property
    def negative_factors(self) -> int:
        """Pairs (counted from both sides) that do not exchange, as their factor would be negative.

        That is a matter of very uneven particles; the factor is 0 for both, so that nothing is
        lost. Of the weights that were computed last.
        """
        return int(self.device.to_host(self._fields["negative"]).sum())

    # --- the step ----------------------------------------------------------------------------

    def step(self, step_index: int, tau: float, time: float = math.nan) -> None:
        """Diffusion and reactions of all species during tau.

        Lie splitting: diffusion, then reactions; of first order in tau. Strang splitting:
        reactions during tau/2, diffusion during tau by Heun's method (jumps of molecules are exact
        anyway), reactions during tau/2; of second order. Reactions go outside as they are cheaper
        than the sum over neighbours, and as a step should end with what is stiff.

        Where molecules and concentrations react together and something diffuses, the step is
        divided so that reactions turn over at most :data:`PART_OF_REACTION` of anything in a part,
        unless a part would be shorter than :data:`PART_OF_LIMIT` of the smallest of :meth:`limits`.

        Parameters
        ----------
        step_index
            Number of the step; with the seed it fixes all random numbers.
        tau
            In s.
        time
            At the end of the step in s, for messages and for laws that depend on it (0 for NaN).

        Raises
        ------
        InputError
            Where the step's number is 2^32 or more: random numbers would be used twice.
        RunError
            Where reactions are too fast to be computed, naming a particle.
        """
        check_word("step of species", step_index)
        self._bind()
        self._time, begin = time, time - tau if time == time else 0.0
        n = self.particles.n
        for numbers in self._thresholds:
            self._switch_kind(n, *numbers, step_index)
        if self._divides and self.pace == math.inf:
            self._measure_pace(step_index)
        parts = self._parts(tau)
        for part in range(parts):
            self._split_step(step_index, tau / parts, part, begin + part * tau / parts)

    def _parts(self, tau: float) -> int:
        """How many split steps a step of tau needs, see :data:`PART_OF_REACTION`."""
        if not self._divides:
            return 1
        shortest = PART_OF_LIMIT * min(self.limits().values())
        longest = PART_OF_REACTION / self.pace if self.pace > 0 else math.inf
        parts = max(1, math.ceil(tau / max(shortest, longest)))
        if parts > MOST_PARTS:
            allowed = f"at most {MOST_PARTS * shortest:.3g} s (reactions of molecules and amounts)"
            raise InputError("step of species", tau, allowed)
        return parts

    def _measure_pace(self, step: int) -> None:
        """How fast reactions are before the first step, with reservoirs as they are held in it."""
        n = self.particles.n
        self._prepare(n)
        self._hold(step)
        self.pace = self._kinetics.first_pace(n, step)

    def _split_step(self, step: int, tau: float, part: int, begin: float) -> None:
        n = self.particles.n
        self._prepare(n)
        self._hold(step)
        strang = self.splitting == "strang"
        if strang:
            self._react(step, 0.5 * tau, 2 * part + 1, begin)
            begin += 0.5 * tau
            self._hold(step)
            self._prepare(n)
        self._diffuse(step, tau, strang, part)
        self._react(step, 0.5 * tau if strang else tau, 2 * part, begin)
        self._hold(step)

    def relax(self, name: str, fraction: Any, target: Any, step_index: int, which: int = 0) -> None:
        """Sponge: C <- C - (C - target) fraction, booked.

        Parameters
        ----------
        name
            The species.
        fraction, target
            Device arrays (n,): part of the difference that is taken, 0 to 1, and mol/m³.
        step_index
            Number of the step (the random numbers of rounding molecules).
        which
            Number of the sponge: each has random numbers of its own.
        """
        check_word("step of species", step_index)
        self._bind()
        table, column = self._column(name)
        n = self.particles.n
        self._prepare(n)
        if table is self.stochastic:
            stream = column + which * len(table.names)
            numbers = np.uint64(step_index), np.uint64(stream)
            self._relax_counts(n, fraction, target, column, *numbers)
            if table.partner[column] < 0:
                return
            column = int(table.partner[column])
        self._relax_amounts(n, fraction, target, column)

    def _diffuse(self, step: int, tau: float, heun: bool, part: int) -> None:
        """All exchange between particles: jumps of molecules first, then that of amounts."""
        n, diffusion = self.particles.n, self._diffusion
        diffusion.measure(n)
        self.jumps += diffusion.jump(n, step, tau, self.binomial_cost, part, self._time)
        if len(self.deterministic.diffusing):
            if self._switching:
                self._prepare(n)
            self.divisions = diffusion.exchange(n, step, tau, heun, self._time)

    def _refresh(self, n: int) -> None:
        if self._reservoirs:
            self._hold_amounts(n)
        self._prepare(n)

    def _hold(self, step: int) -> None:
        if self._reservoirs:
            n = self.particles.n
            if self.deterministic.names:
                self._hold_amounts(n)
            if self.stochastic.names:
                self._hold_counts(n, step)

    def _react(self, step: int, tau: float, part: int, begin: float) -> None:
        kinetics, n = self._kinetics, self.particles.n
        self.events += kinetics.react(n, step, tau, part, begin, self._time)
        self.substeps, self.pace = kinetics.substeps, kinetics.pace()

    # --- binding -----------------------------------------------------------------------------

    def _bind(self) -> None:
        """Look up the loops' arrays, again where the neighbour list has other ones."""
        self.neighbours.want("rows")
        rows = self.neighbours.fields["neighbours"]
        if rows is self._rows:
            return
        self._rows, pairs = rows, len(rows)
        f = self._fields
        f.update(self._diffusion.room(pairs))
        common = {**self.neighbours.fields, **self.particles.fields, **f}
        amounts = {**common, **self._amounts}
        counts = {**common, **self._counts}
        for kind in (amounts, counts):  # one that is missing stands in where it is never read
            for name in ("amount", "count", "continuous"):
                kind.setdefault(name, f[f"no_{name}"])
        bind, switch = self.device.bind, self._switch
        key = {p: {**counts, "key0": k0, "key1": k1} for p, (k0, k1) in self._keys.items()}
        self._prepare = bind(prepare, amounts, COLUMNS=len(self.deterministic.names))
        self._hold_amounts = bind(reservoirs.hold_amounts, amounts)
        self._hold_counts = bind(reservoirs.hold_counts, key[RESERVOIR])
        self._relax_amounts = bind(reservoirs.relax_amounts, amounts, **switch)
        self._relax_counts = bind(reservoirs.relax_counts, key[SPONGE], **switch)
        self._switch_kind = bind(switch_kind, key[ROUNDING])
        self._diffusion.bind(amounts, key[JUMP], pairs, self._shape, self._pair, self._refresh)
        self._kinetics.bind(amounts, key[REACTION], **switch)
        self._thresholds = []
        for s in self._switching:
            each = self.species[self.stochastic.names[s]]
            partner = int(self.stochastic.partner[s])
            self._thresholds.append((s, partner, each.switch_above, each.switch_below))
