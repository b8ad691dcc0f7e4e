"""Species and reactions on a set of particles: one split step of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from particell.chemistry import fluxes, hybrid, jumps, massaction, reservoirs, ssa
from particell.chemistry.contents import Contents
from particell.chemistry.exchange import exchanges, weight_fields
from particell.chemistry.integrators import MOST_SUBSTEPS
from particell.chemistry.lawcode import dispatcher
from particell.chemistry.network import Boundaries, build_tables
from particell.chemistry.reactions import Reaction
from particell.chemistry.remarks import Remarks
from particell.chemistry.reservoirs import HELD, WALL_FLUX, WALL_VALUE, FluxWall
from particell.chemistry.species import Species, checked_rate
from particell.chemistry.storage import (
    average,
    joint_fields,
    prepare,
    remember,
    scratch_fields,
    shared_jump_tables,
    table_fields,
)
from particell.chemistry.switching import switch_kind
from particell.chemistry.walks import Walks
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
from particell.errors import InputError, RunError
from particell.kernels import kernel_code, normalisation
from particell.laws import diffusion
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
#: A time in s in which nothing reacts, and reactions leave behind how fast they are.
INSTANT = 1e-150


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
        together = hybrid.couples(*tables)
        #: whether the step is divided by the rates of reactions
        self._divides = together and any(len(t.diffusing) for t in tables)
        if splitting == "auto":
            splitting = "strang" if self._divides else "lie"
        self.add_fields(particles, species)
        depth = checked_rate("depth", depth)
        super().__init__(device, neighbours.domain, particles, species, tables, seed, depth)
        self.neighbours, self.splitting = neighbours, splitting
        self.reactions = list(reactions)
        self.normalise, self.binomial_cost = normalise, jumps.BINOMIAL_COST
        self.jumps = self.events = self.substeps = self.divisions = 0
        code, dim = kernel_code(kernel), particles.dim
        uniform = bool(neighbours.constants["UNIFORM"])
        self._shape: dict[str, Any] = {
            "DIM": dim,
            "KERNEL": code,
            "UNIFORM": uniform,
            "BATCH": batch_size(device),
        }
        surface, flux, self._reservoirs = (
            any(bool((t.status == status).any()) for t in tables)
            for status in (WALL_VALUE, WALL_FLUX, HELD)
        )
        self._open_ended = surface or flux or self._reservoirs
        purposes = (REACTION, JUMP, ROUNDING, SPONGE, RESERVOIR)
        self._keys = {p: tuple(stream_key(seed, p)) for p in purposes}
        self._switching = [int(s) for s in self.stochastic.switching]
        self._switch = {"SWITCH": bool(self._switching)}
        self._pair = {"DIM": dim, "KERNEL": code, "SURFACE": surface, "FLUX": flux, **self._switch}
        strang = splitting == "strang"
        self._fields = scratch_fields(
            device, particles, self.deterministic, self.stochastic, surface, flux, strang
        )
        self._fields.update(
            **weight_fields(device, particles.n, dim, uniform, normalise),
            alpha=normalisation(code, dim),
            depth=self.depth,
            quantum=1 / (self.depth * AVOGADRO),
            most_events=MOST_EVENTS,
        )
        self._time = math.nan
        receives = np.array([g.kind == "fluid" for g in particles.groups])
        self._amounts = table_fields(device, self.deterministic, receives)
        self._counts = table_fields(device, self.stochastic, receives)
        self._jump_tables = shared_jump_tables(device, self.stochastic, receives)
        walls = [b for b in boundaries if isinstance(b, FluxWall)]
        self._areas = fluxes.wall_areas(particles, neighbours.domain, walls, self.depth)
        self._exchanges, self._exchange_of = exchanges(
            device, particles.n, self.deterministic, self.stochastic, receives, normalise
        )
        if together and self.deterministic.timed:
            wrong = "laws that depend on the time"
            allowed = "left out where molecules and concentrations react together"
            raise InputError("reactions", wrong, allowed)
        self._together, self.pace = together, math.inf
        self._joint = joint_fields(device, tables, self._amounts) if together else {}
        self._remarks = Remarks(device, tables, (self._amounts, self._counts))
        self._laws = {
            "C, k": dispatcher(self.deterministic.laws, "C, k"),
            "N, V, k": dispatcher(self.stochastic.laws, "N, V, k"),
        }
        self._rows: Any = None
        # at rest, weights and rates are kept; tables of jumps share an array, and what switches
        # changes the rates
        self._at_rest = at_rest
        self._rates_last = at_rest and len(self._jump_tables) < 2 and not self._switching
        self._measured = self._rated = False

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
        self._measured = self._rated = False  # of other places, it may be

    @property
    def remarks(self) -> list[str]:
        """What was found wrong with laws so far, a line each; every line was a warning once."""
        return self._remarks.lines

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
                result[name] = diffusion.STEP_LIMIT * smallest**2 / fastest
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
        self._react_together(len(self._fields["work"]), n, INSTANT, step, 0)
        self.pace = self._pace_left()

    def _pace_left(self) -> float:
        return float(self.device.to_host(self._fields["pace"]).max())

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
        n = self.particles.n
        diffusing = bool(len(self.deterministic.diffusing))
        stream = 2 * len(self.stochastic.names)
        if not self._measured:
            self._measure(n)
        for walks in self._walks:
            if not self._rated:
                walks.renew(n, step, self._time)
            self.jumps += walks.run(n, step, tau, self.binomial_cost, stream * part)
        self._rated = self._rates_last
        if not diffusing:
            return
        if self._switching:
            self._prepare(n)
        for each in self._exchanges:
            if each.broken is not None:
                self._fail("the exchange by diffusion is not finite", *each.broken, step)
        fastest = max(each.rate for each in self._exchanges)
        self.divisions = max(1, math.ceil(0.5 * tau * fastest * (1 - 1e-12)))
        for part in range(self.divisions):
            if part > 0:
                self._prepare_again(n)
            self._exchange_amounts(n, tau / self.divisions, heun)

    def _exchange_amounts(self, n: int, tau: float, heun: bool) -> None:
        """One step of the diffusion of concentrations, by Euler's or Heun's method."""
        if heun:
            self._remember(n)
        for each in self._exchanges:
            each.diffuse(n, tau)
        if heun:
            self._prepare_again(n)
            for each in self._exchanges:
                each.diffuse(n, tau)
            self._average(n)

    def _prepare_again(self, n: int) -> None:
        if self._reservoirs:
            self._hold_amounts(n)
        self._prepare(n)

    def _measure(self, n: int) -> None:
        """What diffusion needs of the particles' places: weights of pairs, areas of walls."""
        self._measured = self._at_rest
        for each in self._exchanges:
            each.measure(n, self._areas)

    def _hold(self, step: int) -> None:
        if self._reservoirs:
            n = self.particles.n
            if self.deterministic.names:
                self._hold_amounts(n)
            if self.stochastic.names:
                self._hold_counts(n, step)

    def _react(self, step: int, tau: float, part: int, begin: float) -> None:
        """All reactions during tau from a time on.

        ``part`` tells apart the random numbers of the parts of a step.
        """
        n, f = self.particles.n, self._fields
        lanes = len(f["work"])
        if self._together:
            self._react_together(lanes, n, tau, step, part)
            self.pace = self._pace_left()
        elif self.deterministic.reactions:
            self._react_amounts(lanes, n, tau, begin)
        if self._together or self.deterministic.reactions:
            substeps = self.device.to_host(f["substeps"])
            self.substeps = int(substeps.max())
            if substeps.min() < 0:
                row = -1 - int(substeps[substeps < 0][0])
                what = "rates of reactions overflow, or are not finite"
                if row >= n:
                    what = f"more than {MOST_SUBSTEPS:.3g} sub-steps of reactions in one step"
                self._fail(what, "amount", row % n, step)
        if self.stochastic.reactions:
            if not self._together:
                self._react_counts(n, tau, step, part)
            counter = f["event_counter"]
            self.events += int(self.device.to_host(counter)[:, 0].sum())
            self.device.write(counter, f["zero_counters"])
            if self.device.to_host(f["broken"])[0]:
                failed = self.device.to_host(f["failed"])
                row = int(np.flatnonzero(failed)[0])
                what = "propensities of reactions overflow, or are not finite"
                if failed[row] == 2:
                    what = f"more than {f['most_events']:.3g} reactions in one step"
                self._fail(what, "count", row, step)
        self._remarks.look()

    def _fail(self, message: str, field: str, row: int, step: int) -> None:
        message += self._remarks.not_finite()
        particle = int(self.particles.host("id")[row])
        raise RunError(message, step=step, time=self._time, field=field, particle=particle)

    # --- binding -----------------------------------------------------------------------------

    def _bind(self) -> None:
        """Look up the loops' arrays, again where the neighbour list has other ones."""
        self.neighbours.want("rows")
        rows = self.neighbours.fields["neighbours"]
        if rows is self._rows:
            return
        self._rows, self._measured, self._rated = rows, False, False
        f = self._fields
        if self._jump_tables:
            f["cumulative"] = self.device.zeros(len(rows), np.float32)
        common = {**self.neighbours.fields, **self.particles.fields, **f}
        amounts = {**common, **self._amounts}
        counts = {**common, **self._counts}
        for kind in (amounts, counts):  # one that is missing stands in where it is never read
            for name in ("amount", "count", "continuous"):
                kind.setdefault(name, f[f"no_{name}"])
        self._bind_exchange(amounts, counts)
        self._bind_reactions(amounts, counts)

    def _bind_exchange(self, amounts: dict[str, Any], counts: dict[str, Any]) -> None:
        bind = self.device.bind
        columns = len(self.deterministic.names)
        self._prepare = bind(prepare, amounts, COLUMNS=columns)
        for each in self._exchanges:
            each.bind(amounts, len(self._rows), self._shape, self._pair, self.normalise)
        self._remember = bind(remember, amounts, COLUMNS=columns)
        self._average = bind(average, amounts, COLUMNS=columns)
        self._hold_amounts = bind(reservoirs.hold_amounts, amounts)
        self._hold_counts = bind(reservoirs.hold_counts, self._with_key(counts, RESERVOIR))
        self._relax_amounts = bind(reservoirs.relax_amounts, amounts, **self._switch)
        sponge = self._with_key(counts, SPONGE)
        self._relax_counts = bind(reservoirs.relax_counts, sponge, **self._switch)
        jumping = self._with_key(counts, JUMP)
        partner = self.stochastic.partner
        self._walks = [
            Walks(
                self.device,
                {**jumping, **self._exchange_of[columns[0]].fields, **t},
                self._pair,
                columns,
                partner,
                self._open_ended,
            )
            for t, columns in self._jump_tables
        ]

    def _bind_reactions(self, amounts: dict[str, Any], counts: dict[str, Any]) -> None:
        bind = self.device.bind
        law, rate_law = {"LAW": self._laws["N, V, k"]}, self._laws["C, k"]
        reacting = self._with_key(counts, REACTION)
        if self._together:
            both = {**law, "RATE_LAW": rate_law, **self._switch}
            self._react_together = bind(hybrid.react, {**reacting, **self._joint}, **both)
        else:
            self._react_counts = bind(ssa.react, reacting, **law)
            if self.deterministic.reactions:
                self._react_amounts = bind(massaction.react, amounts, LAW=rate_law, **self._switch)
        self._switch_kind = bind(switch_kind, self._with_key(counts, ROUNDING))
        self._thresholds = []
        for s in self._switching:
            each = self.species[self.stochastic.names[s]]
            partner = int(self.stochastic.partner[s])
            self._thresholds.append((s, partner, each.switch_above, each.switch_below))

    def _with_key(self, fields: dict[str, Any], purpose: int) -> dict[str, Any]:
        key0, key1 = self._keys[purpose]
        return {**fields, "key0": key0, "key1": key1}
