"""Species and reactions on a set of particles: the state, and one split step of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from particell.chemistry import jumps, massaction, reservoirs, ssa
from particell.chemistry.network import Tables, build_tables, dispatcher
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import HELD, WALL_VALUE, FixedValueWall, Reservoir
from particell.chemistry.species import Species, checked_rate
from particell.chemistry.storage import (
    prepare,
    scratch_fields,
    shared_jump_tables,
    table_fields,
)
from particell.compute.device import Device
from particell.compute.loop import Loop
from particell.compute.neighbours import NeighbourList
from particell.compute.philox import INITIAL, JUMP, REACTION, SPONGE, stream_key
from particell.compute.reduce import Reduction
from particell.errors import InputError, RunError, unknown_name
from particell.kernels import kernel_code, normalisation
from particell.laws import diffusion
from particell.materials import AVOGADRO
from particell.particles import Particles

Values = float | np.ndarray | Callable[[np.ndarray], np.ndarray | float]


class Chemistry:
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
        What there is, what it does, and where it is kept (:class:`Reservoir`,
        :class:`FixedValueWall`).
    kernel
        Name of the smoothing kernel.
    seed
        Seed of all random numbers.
    normalise
        Divide the diffusion of each pair by the mean kernel sum (symmetric).
    depth
        Extent of the dimensions that are not simulated, in m (2D) or m² (1D): a particle of
        volume V holds C V depth 𝒩 molecules. Amounts are in mol per depth.

    Attributes
    ----------
    jumps, events
        Diffusive jumps and stochastic reaction events so far.
    substeps
        Largest number of sub-steps of a particle's deterministic reactions in the last step.
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
        boundaries: Sequence[Reservoir | FixedValueWall] = (),
        kernel: str = "wendland-c2",
        seed: int = 0,
        normalise: bool = False,
        depth: float = 1.0,
    ):
        self.device, self.particles, self.neighbours = device, particles, neighbours
        self.species = {s.name: s for s in species}
        self.deterministic, self.stochastic = build_tables(
            species, reactions, boundaries, particles.groups
        )
        self.add_fields(particles, species)
        self.depth = checked_rate("depth", depth)
        self.normalise, self.binomial_cost = normalise, jumps.BINOMIAL_COST
        self.jumps = self.events = self.substeps = 0
        self._reduction = Reduction(device)
        code, dim = kernel_code(kernel), particles.dim
        self._shape = {
            "DIM": dim,
            "KERNEL": code,
            "UNIFORM": neighbours.constants["UNIFORM"],
        }
        both = (self.deterministic, self.stochastic)
        self._surface = any(bool((t.status == WALL_VALUE).any()) for t in both)
        self._reservoirs = any(bool((t.status == HELD).any()) for t in both)
        self._keys = {p: tuple(stream_key(seed, p)) for p in (REACTION, JUMP, INITIAL, SPONGE)}
        self._fields = scratch_fields(
            device, particles, self.deterministic, self.stochastic, self._surface, normalise
        )
        self._fields.update(alpha=normalisation(code, dim), depth=self.depth)
        self._amounts = table_fields(device, self.deterministic, "amount")
        self._counts = table_fields(device, self.stochastic, "count")
        self._jump_tables = shared_jump_tables(device, self.stochastic)
        self._laws = {
            "C, k": dispatcher(self.deterministic.laws, "C, k"),
            "N, V, k": dispatcher(self.stochastic.laws, "N, V, k"),
        }

    @staticmethod
    def add_fields(particles: Particles, species: Sequence[Species]) -> None:
        """Add the fields of the species to the particles, where they are missing."""
        molecules = sum(s.molecules for s in species)
        for name, columns, kind in (
            ("amount", len(species) - molecules, np.float64),
            ("count", molecules, np.int64),
        ):
            for field in (name, f"{name}_booked"):
                if columns and field not in particles:
                    particles.add(field, columns, kind)

    # --- state -------------------------------------------------------------------------------

    def set_concentration(self, name: str, values: Values, group: str | None = None) -> None:
        """Set a species from concentrations in mol/m³.

        Parameters
        ----------
        name
            The species.
        values
            A number, an array for the particles concerned in memory order, or a function of their
            positions (m, dim).
        group
            The particles concerned; by default all that hold the species.

        Notes
        -----
        Molecules: C V depth 𝒩 is rounded at random without bias, by a random number of
        the particle's own (purpose ``INITIAL``, counter id and species).
        """
        chosen, numbers = self._values(name, values, group)
        if (numbers < 0).any() or not np.isfinite(numbers).all():
            raise InputError(f"concentration of {name}", float(numbers.min()), "finite and >= 0")
        p = self.particles
        amounts = np.zeros(p.n)
        amounts[chosen] = numbers * (p.host("mass") / p.host("density"))[chosen]
        table, column = self._column(name)
        if table is self.deterministic:
            host = p.host("amount").copy()
            host[chosen, column] = amounts[chosen]
            p.set("amount", host)
            return
        expected = self.device.array(amounts * self.depth * AVOGADRO)
        mask = self.device.array(chosen.astype(np.uint8))
        key0, key1 = self._keys[INITIAL]
        extra = {"expected": expected, "chosen": mask, "s": column, "key0": key0, "key1": key1}
        self._run(reservoirs.round_counts, p.n, self._counts, extra)

    def set_count(self, name: str, values: Values, group: str | None = None) -> None:
        """Set the numbers of molecules of a species; ``values`` as in :meth:`set_concentration`."""
        table, column = self._column(name)
        if table is self.deterministic:
            raise InputError("species", name, "one with molecules=True, to have its count set")
        chosen, numbers = self._values(name, values, group)
        whole = np.rint(numbers)
        if (whole != numbers).any() or (whole < 0).any():
            raise InputError(f"count of {name}", values, "whole numbers >= 0")
        host = self.particles.host("count").copy()
        host[chosen, column] = whole.astype(np.int64)
        self.particles.set("count", host)

    def concentration(self, name: str) -> np.ndarray:
        """Concentration of a species in mol/m³, (n,), in memory order, for either kind."""
        table, column = self._column(name)
        p = self.particles
        volume = p.host("mass").astype(float) / p.host("density")
        if table is self.deterministic:
            return p.host("amount")[:, column] / volume
        return p.host("count")[:, column] / (volume * self.depth * AVOGADRO)

    def count(self, name: str) -> np.ndarray:
        """Molecules of a species, int64 (n,), in memory order."""
        table, column = self._column(name)
        if table is self.deterministic:
            raise InputError("species", name, "one with molecules=True, to have a count")
        return self.particles.host("count")[:, column]

    def column(self, name: str) -> int:
        """The species' column in the field ``amount`` or ``count``."""
        return self._column(name)[1]

    def totals(self) -> dict[str, tuple[float | int, float | int]]:
        """For each species its total and what was booked: mol, or whole numbers of molecules.

        The first minus the second is constant: to round-off, or exactly.
        """
        result: dict[str, tuple[float | int, float | int]] = {}
        for table, field in ((self.deterministic, "amount"), (self.stochastic, "count")):
            if table.names:
                total = self._reduction.sum(self.particles[field])
                booked = self._reduction.sum(self.particles[f"{field}_booked"])
                for s, name in enumerate(table.names):
                    result[name] = (total[s].item(), booked[s].item())
        return result

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

    # --- the step ----------------------------------------------------------------------------

    def step(self, step_index: int, tau: float) -> None:
        """Diffusion, then reactions, of all species during tau (Lie splitting).

        Parameters
        ----------
        step_index
            Number of the step; with the seed it fixes all random numbers.
        tau
            In s.
        """
        n = self.particles.n
        self._run(prepare, n, self._amounts, {}, COLUMNS=len(self.deterministic.names))
        self._hold()
        diffusing = bool(len(self.deterministic.diffusing))
        if self.normalise and (diffusing or self._jump_tables):
            self._run(diffusion.kernel_sums, n, {}, {}, **self._shape)
        if diffusing:
            self._run(diffusion.diffuse, n, self._amounts, {"tau": tau}, **self._pair_constants())
        for table, columns in self._jump_tables:
            self._jump(table, columns, step_index, tau)
        if self.deterministic.reactions:
            self._react_amounts(step_index, tau)
        if self.stochastic.reactions:
            self._react_counts(step_index, tau)
        self._hold()

    def relax(self, name: str, fraction: Any, target: Any, step_index: int) -> None:
        """Sponge: C <- C - (C - target) fraction, booked.

        Parameters
        ----------
        name
            The species.
        fraction, target
            Device arrays (n,): part of the difference that is taken, 0 to 1, and mol/m³.
        step_index
            Number of the step (the random numbers of rounding molecules).
        """
        table, column = self._column(name)
        extra = {"fraction": fraction, "target": target, "s": column}
        n = self.particles.n
        fields = self._amounts if table is self.deterministic else self._counts
        self._run(prepare, n, self._amounts, {}, COLUMNS=len(self.deterministic.names))
        if table is self.deterministic:
            self._run(reservoirs.relax_amounts, n, fields, extra)
            return
        key0, key1 = self._keys[SPONGE]
        extra.update(key0=key0, key1=key1, step=np.uint64(step_index))
        self._run(reservoirs.relax_counts, n, fields, extra)

    def _pair_constants(self) -> dict[str, Any]:
        return {**self._shape, "NORMALISE": self.normalise, "SURFACE": self._surface}

    def _hold(self) -> None:
        if self._reservoirs:
            n = self.particles.n
            if self.deterministic.names:
                self._run(reservoirs.hold_amounts, n, self._amounts, {})
            if self.stochastic.names:
                self._run(reservoirs.hold_counts, n, self._counts, {})

    def _jump(self, table: dict[str, Any], columns: list[int], step: int, tau: float) -> None:
        n, f = self.particles.n, self._fields
        if len(f["cumulative"]) < len(self.neighbours.neighbours):
            f["cumulative"] = self.device.zeros(len(self.neighbours.neighbours), np.float32)
        self._run(jumps.jump_rates, n, table, {}, **self._pair_constants())
        fastest = self._reduction.max(f["leave_rate"])
        if not math.isfinite(fastest):
            bad = int(np.argmin(np.isfinite(self.device.to_host(f["leave_rate"]))))
            particle = int(self.particles.host("id")[bad])
            raise RunError(
                "jump rate is not finite", step=step, time=math.nan, field="x", particle=particle
            )
        key0, key1 = self._keys[JUMP]
        mean = fastest * tau
        length = jumps.rounds_needed(mean)
        for s in columns:
            common = {
                **table,
                **self._counts,
                "s": s,
                "tau": tau,
                "fastest": fastest,
                "binomial_cost": self.binomial_cost,
                "step": step,
                "key0": key0,
                "key1": key1,
            }
            common["status"], common["count"] = table["status"], self.particles["count"]
            if fastest > 0:
                f["further"] = self.device.array(jumps.resident_probabilities(mean, length))
                self._rounds(0, length, common, 2 * s)
            if self._surface or self._reservoirs:
                self._run(jumps.enter, n, common, {"stream": 2 * s + 1})
                f["further"] = self.device.array(jumps.inflow_probabilities(mean, length))
                self._rounds(1, length, common, 2 * s + 1)
            self._run(jumps.settle, n, common, {})

    def _rounds(self, first: int, last: int, common: dict[str, Any], stream: int) -> None:
        """Rounds until no molecule may have a further candidate jump."""
        n = self.particles.n
        pending = True
        m = first
        if first > 0:
            pending = self._count_up()
        while pending and m < last:
            if m > 0:
                self._run(jumps.collect, n, common, {})
            self._run(jumps.move, n, common, {"m": m, "stream": stream})
            pending = self._count_up()
            m += 1

    def _count_up(self) -> bool:
        """Read the counters of a round and empty them; whether molecules are still on the way."""
        counters = self._fields["counters"]
        made, pending = self.device.to_host(counters).sum(axis=0)[:2]
        self.jumps += int(made)
        self.device.write(counters, self._fields["zero_counters"])
        return bool(pending)

    def _react_amounts(self, step: int, tau: float) -> None:
        f = self._fields
        extra = {"rows": self.particles.n, "tau": tau}
        lanes = len(f["work"])
        self._run(massaction.react, lanes, self._amounts, extra, LAW=self._laws["C, k"])
        substeps = self.device.to_host(f["substeps"])
        self.substeps = int(substeps.max())
        if substeps.min() < 0:
            first = int(np.argmin(substeps)) * self.particles.n // lanes
            raise RunError(
                "reactions could not be integrated (particles of this lane)",
                step=step,
                time=math.nan,
                field="amount",
                particle=int(self.particles.host("id")[first]),
            )

    def _react_counts(self, step: int, tau: float) -> None:
        key0, key1 = self._keys[REACTION]
        extra = {"tau": tau, "step": step, "key0": key0, "key1": key1}
        n = self.particles.n
        self._run(ssa.react, n, self._counts, extra, LAW=self._laws["N, V, k"])
        counter = self._fields["event_counter"]
        self.events += int(self.device.to_host(counter)[:, 0].sum())
        self.device.write(counter, self._fields["zero_counters"])

    # --- helpers -----------------------------------------------------------------------------

    def _run(self, loop: Loop, n: int, first: dict, extra: dict, **constants: Any) -> None:
        """Run a loop with arguments looked up by name; arrays may have been re-allocated."""
        run = loop.specialise(self.device.backend, **constants)
        places = (extra, first, self._fields, self.particles.fields, self.neighbours.fields)
        arguments = []
        for name in loop.arguments:
            for place in places:
                if name in place:
                    arguments.append(place[name])
                    break
            else:
                raise KeyError(f"{loop.__name__}: {name}")
        run(n, *arguments)

    def _column(self, name: str) -> tuple[Tables, int]:
        for table in (self.deterministic, self.stochastic):
            if name in table.names:
                return table, table.names.index(name)
        raise unknown_name("species", name, self.species)

    def _values(
        self, name: str, values: Values, group: str | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Which particles are meant, and one number for each of them."""
        table, column = self._column(name)
        p = self.particles
        holds = table.present[:, column]
        if group is None:
            chosen = holds[p.host("group")]
        else:
            chosen = p.select(group)
            if not holds[[g.name for g in p.groups].index(group)]:
                raise InputError(f"group of {name}", group, "one that holds the species")
        given = values(p.host("x")[chosen]) if callable(values) else values
        return chosen, np.broadcast_to(np.asarray(given, float), (int(chosen.sum()),))
