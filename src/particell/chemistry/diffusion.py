"""The diffusion of a split step: which loops run, and when weights and rates are made anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from particell.chemistry.exchange import exchanges
from particell.chemistry.network import Tables
from particell.chemistry.storage import average, remember, shared_jump_tables
from particell.chemistry.walks import Walks
from particell.compute.device import Device
from particell.errors import RunError
from particell.particles import Particles


class Diffusion:
    """Exchange between particles: jumps of molecules, and steps of concentrations.

    Parameters
    ----------
    device
        Where loops run.
    particles
        The particles.
    tables
        Those of concentrations and those of molecules.
    receives
        Which groups take what comes through walls, (G,).
    areas
        Of the walls with a flux in m^(dim - 1), by group.
    normalise, at_rest
        See :class:`~particell.chemistry.engine.Chemistry`.
    open_ended
        Whether molecules may come in from outside.

    Attributes
    ----------
    exchanges, walks
        The sets of weights of pairs, and the species of molecules by their jump rates.
    measured
        Whether weights are those of where particles are.
    """

    def __init__(
        self,
        device: Device,
        particles: Particles,
        tables: tuple[Tables, Tables],
        receives: np.ndarray,
        areas: Mapping[int, float],
        *,
        normalise: bool,
        at_rest: bool,
        open_ended: bool,
    ):
        self.device, self.particles = device, particles
        self.deterministic, self.stochastic = tables
        self.areas, self._normalise, self._open_ended = areas, normalise, open_ended
        self.exchanges, self._exchange_of = exchanges(
            device, particles.n, *tables, receives, normalise
        )
        self._jump_tables = shared_jump_tables(device, self.stochastic, receives)
        self.walks: list[Walks] = []
        # at rest, weights and rates are kept; tables of jumps share an array, and what switches
        # changes the rates
        switching = len(self.stochastic.switching) > 0
        self._at_rest = at_rest
        self._rates_last = at_rest and len(self._jump_tables) < 2 and not switching
        self.measured = self._rated = False

    def forget(self) -> None:
        """What was found is of other places, it may be."""
        self.measured = self._rated = False

    def room(self, pairs: int) -> dict[str, Any]:
        """The array that all jump rates use, for a neighbour list with room for ``pairs``."""
        return {"cumulative": self.device.zeros(pairs, np.float32)} if self._jump_tables else {}

    def bind(
        self,
        amounts: dict[str, Any],
        counts: dict[str, Any],
        pairs: int,
        shape: dict[str, Any],
        constants: dict[str, Any],
        refresh: Callable[[int], None],
    ) -> None:
        """Look up the loops' arrays; those of molecules with the key of their random numbers.

        ``refresh`` holds reservoirs and makes concentrations anew, between two parts of a step.
        """
        self.forget()
        self._refresh = refresh
        for each in self.exchanges:
            each.bind(amounts, pairs, shape, constants, self._normalise)
        columns = {"COLUMNS": len(self.deterministic.names)}
        self._remember = self.device.bind(remember, amounts, **columns)
        self._average = self.device.bind(average, amounts, **columns)
        self.walks = [
            Walks(
                self.device,
                {**counts, **self._exchange_of[columns[0]].fields, **table},
                constants,
                columns,
                self.stochastic.partner,
                self._open_ended,
            )
            for table, columns in self._jump_tables
        ]

    def measure(self, n: int) -> None:
        """What diffusion needs of places, where it is not known: pairs' weights, walls' areas."""
        if self.measured:
            return
        self.measured = self._at_rest
        for each in self.exchanges:
            each.measure(n, self.areas)

    def jump(self, n: int, step: int, tau: float, cost: float, part: int, time: float) -> int:
        """Move the molecules of n particles during tau; the jumps made.

        ``cost`` is the ``binomial_cost`` of :mod:`particell.chemistry.jumps`, ``part`` tells apart
        the random numbers of the parts of a step, and the time is for messages.
        """
        made, stream = 0, 2 * len(self.stochastic.names)
        for walks in self.walks:
            if not self._rated:
                walks.renew(n, step, time)
            made += walks.run(n, step, tau, cost, stream * part)
        self._rated = self._rates_last
        return made

    def exchange(self, n: int, step: int, tau: float, heun: bool, time: float) -> int:
        """Diffusion of concentrations during tau, by Euler's or Heun's method; the steps it took.

        Raises
        ------
        RunError
            Where the weights are not finite.
        """
        for each in self.exchanges:
            if each.broken is not None:
                field, row = each.broken
                particle = int(self.particles.host("id")[row])
                message = "the exchange by diffusion is not finite"
                raise RunError(message, step=step, time=time, field=field, particle=particle)
        fastest = max(each.rate for each in self.exchanges)
        divisions = max(1, math.ceil(0.5 * tau * fastest * (1 - 1e-12)))
        for part in range(divisions):
            if part > 0:
                self._refresh(n)
            self._explicit_step(n, tau / divisions, heun)
        return divisions

    def _explicit_step(self, n: int, tau: float, heun: bool) -> None:
        if heun:
            self._remember(n)
        for each in self.exchanges:
            each.diffuse(n, tau)
        if heun:
            self._refresh(n)
            for each in self.exchanges:
                each.diffuse(n, tau)
            self._average(n)
