"""What a shift carries of species, in time: which loop of the law runs when."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from particell.chemistry import crossings
from particell.chemistry.contents import Contents
from particell.compute.device import Device
from particell.compute.philox import CARRIAGE, stream_key
from particell.compute.reduce import Reduction
from particell.compute.threads import available_threads
from particell.errors import InputError
from particell.laws import species_flux
from particell.operations.operation import Operation, When
from particell.schemes.flow import Flow
from particell.state import State


class Carriage(Operation):
    """Moves what particles hold between them by :mod:`particell.laws.species_flux`.

    Parameters
    ----------
    species
        What particles hold.
    flow
        Whose shift carries it.

    Attributes
    ----------
    molecules
        The part of it for species that are molecules, None where there is no such species.

    Raises
    ------
    InputError
        For species that switch between molecules and amounts.
    """

    when = When.HALF

    def __init__(self, species: Contents, flow: Flow):
        for name, each in species.species.items():
            if each.switches:
                raise InputError(
                    "species_flux", True, f"False with a species that switches ('{name}')"
                )
        self.species, self.flow = species, flow
        self.molecules: Molecules | None = None
        self._rows: Any = None
        self._kinds: list[Amounts] = []

    def attach(self, state: State) -> None:
        """Make what carries amounts, and what carries molecules."""
        fluid = np.array([g.kind == "fluid" for g in state.particles.groups])[:, None]
        tables = self.species.deterministic
        if tables.names:
            carries = tables.present & fluid
            self._kinds.append(Amounts(state.device, carries, state.particles["amount"]))
        tables = self.species.stochastic
        if tables.names:
            carries = tables.present & fluid
            self.molecules = Molecules(state.device, carries, state.n, state.seed)
            self._kinds.append(self.molecules)

    @property
    def crossings(self) -> tuple[float, float]:
        """Expected and unmet numbers of molecules so far."""
        m = self.molecules
        return (m.expected, m.unmet) if m else (0.0, 0.0)

    def counts(self, state: State) -> dict[str, float]:
        """What particles owed and did not hold, as a part of what was to cross."""
        return {"molecules' flux not met": self.molecules.unmet_part} if self.molecules else {}

    def saved(self) -> dict[str, Any]:
        """See :meth:`.Operation.saved`."""
        return {"crossings": self.crossings}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """See :meth:`.Operation.restore`."""
        if self.molecules:
            self.molecules.expected, self.molecules.unmet = saved["crossings"]

    def __call__(self, state: State) -> None:
        """Carry all species during a time step."""
        state.neighbours.want("rows")
        rows = state.neighbours.fields["neighbours"]
        if self._rows is not rows:  # those of the neighbour list are new
            self._rows = rows
            self._bind(state, len(rows))
        clock = state.clock
        self._pair_shifts(state.n, half_step=0.5 * clock.dt)
        for kind in self._kinds:
            kind.apply(state.n, clock.step, clock.dt)

    def _bind(self, state: State, pairs: int) -> None:
        shifts = {
            "own_shift": state.device.zeros(pairs, np.float64),
            "its_shift": state.device.zeros(pairs, np.float64),
        }
        self._pair_shifts = self.flow.bound(self.flow.sweeps().pair_shifts(), **shifts)
        for kind in self._kinds:
            kind.bind(self.flow.fields(shifts))


class Amounts:
    """The flux of a set of species by the midpoint rule (Euler's would let fronts grow).

    Parameters
    ----------
    device
        Where loops run.
    carries
        bool (G, S), which group carries which species.
    content
        Device array (n, S), what particles hold; moved in place.
    """

    def __init__(self, device: Device, carries: np.ndarray, content: Any):
        self.device, self.content = device, content
        n, self.columns = content.shape
        self._reduction = Reduction(device)
        self._half = device.zeros((n, self.columns), np.float64)
        self._fields: dict[str, Any] = {
            "carries": device.array(carries.astype(np.float64)),
            "part": device.zeros((n, 2 * self.columns), np.float64),
            "mean": device.zeros(self.columns, np.float64),
            "deviation": device.zeros((n, self.columns), np.float64),
            "amount": content,
            "carried": self._half,
        }

    def bind(self, common: dict[str, Any]) -> dict[str, Any]:
        """Look up the loops' arrays: its own and the common ones; returns them all."""
        fields = {**common, **self._fields}
        bind, columns = self.device.bind, {"COLUMNS": self.columns}
        self._parts = bind(species_flux.species_parts, fields, **columns)
        self._deviations = [
            bind(species_flux.deviations, {**fields, "amount": amount}, **columns)
            for amount in (self.content, self._half)
        ]
        self._carry = species_flux.bound_carry(self.device, fields, self.columns)
        return fields

    def apply(self, n: int, step: int, dt: float) -> None:
        """Carry the species of n particles during dt in s."""
        self._go_half_way(n, dt)
        self._carry(n, dt)
        self.device.copy(self._half, self.content)

    def _go_half_way(self, n: int, dt: float) -> None:
        """Leave the deviations at the middle of the step in their field."""
        self._parts(n)
        sums = self._reduction.sum(self._fields["part"])
        mass = sums[self.columns :]
        mean = np.where(mass > 0, sums[: self.columns] / np.where(mass > 0, mass, 1.0), 0.0)
        self.device.write(self._fields["mean"], mean)
        self._deviations[0](n)
        self._carry(n, 0.5 * dt)
        self._deviations[1](n)


class Molecules(Amounts):
    """The same for molecules: numbers drawn about the flux of the step's middle.

    Parameters
    ----------
    device, carries
        As for :class:`Amounts`.
    n
        Number of particles.
    seed
        Of the simulation.

    Attributes
    ----------
    expected, unmet
        Mean number of molecules that were to cross so far, and how many of them particles did not
        hold.
    """

    def __init__(self, device: Device, carries: np.ndarray, n: int, seed: int):
        super().__init__(device, carries, device.zeros((n, carries.shape[1]), np.float64))
        self.expected = self.unmet = 0.0
        threads = available_threads() if device.backend == "cpu" else 1
        key0, key1 = stream_key(seed, CARRIAGE)
        self._fields |= {
            "landed": device.zeros((threads, n), np.int64),
            "moved": device.zeros((n, 2), np.float64),
            "key0": key0,
            "key1": key1,
        }

    @property
    def unmet_part(self) -> float:
        """The part of the molecules that were to cross that particles did not hold."""
        return self.unmet / self.expected if self.expected else 0.0

    def bind(self, common: dict[str, Any]) -> dict[str, Any]:
        """See :meth:`Amounts.bind`."""
        fields = super().bind(common)
        bind, numbers = self.device.bind, {**fields, "number": self.content}
        self._as_numbers = bind(crossings.as_numbers, numbers, COLUMNS=self.columns)
        self._send = bind(crossings.send, fields)
        self._receive = bind(crossings.receive, fields)
        return fields

    def apply(self, n: int, step: int, dt: float) -> None:
        """Carry the species of n particles during dt in s; ``step`` fixes the random numbers."""
        self._as_numbers(n)
        self._go_half_way(n, dt)
        for s in range(self.columns):
            self._send(n, s, step, dt)
            self._receive(n, s)
            expected, unmet = self._reduction.sum(self._fields["moved"])
            self.expected += float(expected)
            self.unmet += float(unmet)
