"""The steps of exact diffusion: which loop of :mod:`particell.chemistry.jumps` runs when."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from particell.chemistry import jumps
from particell.chemistry.jumprates import jump_rates
from particell.chemistry.origin import origin
from particell.compute.device import Device
from particell.compute.philox import check_word, part_key
from particell.compute.reduce import Reduction
from particell.errors import RunError


class CandidateTable:
    """Conditional probabilities of further candidate jumps, on the device, for one mean number."""

    def __init__(self, device: Device, law: Callable[[float, int], np.ndarray]):
        self.device, self.law = device, law
        self.array = device.zeros(0, np.float64)
        self.mean = math.nan

    def reserve(self, length: int) -> None:
        """A new array, with room for twice a length."""
        self.array = self.device.zeros(2 * length, np.float64)
        self.mean = math.nan

    def fill(self, mean: float, length: int) -> None:
        """Write the table; nothing where it is that of this mean already."""
        if mean != self.mean:
            host = np.zeros(len(self.array))
            host[:length] = self.law(mean, length)
            self.device.write(self.array, host)
            self.mean = mean


class Walks:
    """Diffusion of the species of molecules that share one table of jump rates.

    Parameters
    ----------
    device
        Where loops run.
    fields
        All arrays and numbers of the loops by name (see :mod:`particell.chemistry.storage`).
    constants
        Compile-time constants of the jump rates.
    columns
        The species, by their columns in the field ``count``.
    partner
        The columns of their amounts, -1 for a species that does not switch.
    open_ended
        Whether molecules may come in from outside.
    """

    def __init__(
        self,
        device: Device,
        fields: Mapping[str, Any],
        constants: dict[str, Any],
        columns: list[int],
        partner: np.ndarray,
        open_ended: bool,
    ):
        self.device, self.columns, self.open_ended = device, columns, open_ended
        self.partner = [int(max(0, partner[s])) for s in columns]
        self._fields, self._constants = dict(fields), constants
        self._key = self._fields.pop("key0"), self._fields.pop("key1")
        self._reduction = Reduction(device)
        self._tables = (
            CandidateTable(device, jumps.resident_probabilities),
            CandidateTable(device, jumps.inflow_probabilities),
        )
        self._fastest = 0.0
        self._zeros = np.zeros(fields["counters"].shape, np.int64)
        self._reserve(jumps.rounds_needed(4.0))
        self._bind()

    def _reserve(self, length: int) -> None:
        for table in self._tables:
            table.reserve(length)

    def _bind(self) -> None:
        bind, f = self.device.bind, self._fields
        switch = {"SWITCH": self._constants["SWITCH"]}
        self.rates = self._bound_rates()
        self.moves = [bind(jumps.move, {**f, "further": t.array}, **switch) for t in self._tables]
        self.enter = bind(jumps.enter, f)
        self.collect = bind(jumps.collect, f)
        self.settle = bind(jumps.settle, f, **switch)

    def _bound_rates(self) -> Any:
        c = self._constants
        groups, walls = len(self._fields["status"]), c["SURFACE"] or c["FLUX"]
        sweep = jump_rates(c["DIM"], c["KERNEL"], groups, walls, c["SWITCH"])
        return sweep.bind(self.device, {**self._fields, "s": self.columns[0]}, {})

    def renew(self, n: int, step: int, time: float) -> None:
        """The jump rates of n particles where they are now; step and time (s) are for messages.

        Raises
        ------
        RunError
            Where a jump rate is not finite.
        """
        f = self._fields
        self.rates(n)
        self._fastest = fastest = self._reduction.max(f["leave_rate"])
        if not math.isfinite(fastest):
            field, row = origin(self.device, f, f["leave_rate"])
            particle = int(self.device.to_host(f["id"])[row])
            message = "the rate of a molecule's jumps is not finite"
            raise RunError(message, step=step, time=time, field=field, particle=particle)

    def run(self, n: int, step: int, tau: float, binomial_cost: float, stream: int = 0) -> int:
        """Move the molecules of n particles during tau; the jumps made.

        ``stream`` is the first of the sets of random numbers, two for each species.

        Raises
        ------
        InputError
            Where molecules make so many jumps that random numbers would be used twice.
        """
        fastest = self._fastest
        mean = fastest * tau
        length = jumps.rounds_needed(mean)
        check_word("jumps of a molecule in a step", 2 * length)
        if length > len(self._tables[0].array):
            self._reserve(length)
            self._bind()
        made = 0
        for s, column in zip(self.columns, self.partner, strict=True):
            own = stream + 2 * s
            numbers = (tau, fastest, binomial_cost, s, step)
            if fastest > 0:
                self._tables[0].fill(mean, length)
                made += self._rounds(n, 0, length, True, own, numbers, column)
            if self.open_ended:
                self.enter(n, tau, binomial_cost, s, step, *self._key_of(own + 1, 0))
                jumped, pending = self._count_up()
                self._tables[1].fill(mean, length)
                made += jumped
                made += self._rounds(n, 1, length, pending, own + 1, numbers, column)
            self.settle(n, s, column)
        return made

    def _key_of(self, stream: int, m: int) -> tuple[np.uint64, np.uint64]:
        """The key of a round's random numbers."""
        return part_key(self._key, stream, m)

    def _rounds(
        self,
        n: int,
        first: int,
        last: int,
        pending: bool,
        stream: int,
        numbers: tuple,
        column: int,
    ) -> int:
        """Rounds (from 0 for residents, 1 for those from outside) until all walks are over."""
        made, m = 0, first
        while pending and m < last:
            if m > 0:
                self.collect(n)
            self.moves[first](n, m, *numbers, *self._key_of(stream, m), column)
            jumped, pending = self._count_up()
            made += jumped
            m += 1
        return made

    def _count_up(self) -> tuple[int, bool]:
        """Jumps of a round, and whether molecules are still on the way; counters are emptied."""
        counters = self._fields["counters"]
        totals = self.device.to_host(counters).sum(axis=0)
        self.device.write(counters, self._zeros)
        return int(totals[jumps.JUMPS]), bool(totals[jumps.PENDING])
