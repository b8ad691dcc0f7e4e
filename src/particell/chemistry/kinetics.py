"""The reactions of a split step: which loop runs, and what to say where it cannot go on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particell.chemistry import hybrid, massaction, ssa
from particell.chemistry.integrators import MOST_SUBSTEPS
from particell.chemistry.joint import couples
from particell.chemistry.lawcode import dispatcher
from particell.chemistry.network import Tables
from particell.chemistry.remarks import Remarks
from particell.chemistry.storage import joint_fields
from particell.compute.device import Device
from particell.errors import InputError, RunError
from particell.particles import Particles

#: A time in s in which nothing reacts, and reactions leave behind how fast they are.
INSTANT = 1e-150


class Kinetics:
    """Reactions of concentrations, of molecules, or of both together.

    Parameters
    ----------
    device
        Where loops run.
    particles
        The particles, for messages.
    tables
        Those of concentrations and those of molecules.
    fields
        Their arrays for the loops, see :func:`particell.chemistry.storage.table_fields`.
    scratch
        Work arrays, see :func:`particell.chemistry.storage.scratch_fields`.

    Attributes
    ----------
    remarks
        What was found wrong with laws.
    substeps
        Largest number of sub-steps of a particle's deterministic reactions in the last step.

    Raises
    ------
    InputError
        For laws that cannot be used together.
    """

    def __init__(
        self,
        device: Device,
        particles: Particles,
        tables: tuple[Tables, Tables],
        fields: tuple[dict[str, Any], dict[str, Any]],
        scratch: dict[str, Any],
    ):
        self.device, self.particles = device, particles
        self.deterministic, self.stochastic = tables
        self._scratch = scratch
        self._together = couples(*tables)
        if self._together and self.deterministic.timed:
            wrong = "laws that depend on the time"
            allowed = "left out where molecules and concentrations react together"
            raise InputError("reactions", wrong, allowed)
        self._joint = joint_fields(device, tables, fields[0]) if self._together else {}
        self.remarks = Remarks(device, tables, fields)
        self._laws = {
            "RATE_LAW": dispatcher(self.deterministic.laws, "C, k"),
            "LAW": dispatcher(self.stochastic.laws, "N, V, k"),
        }
        self.substeps = 0

    def bind(self, amounts: dict[str, Any], counts: dict[str, Any], SWITCH: bool) -> None:
        """Look up the loops' arrays; those of molecules with the key of their random numbers."""
        bind, law = self.device.bind, self._laws
        if self._together:
            joint = {**counts, **self._joint}
            self._react_together = bind(hybrid.react, joint, **law, SWITCH=SWITCH)
            return
        self._react_counts = bind(ssa.react, counts, LAW=law["LAW"])
        if self.deterministic.reactions:
            rate_law = law["RATE_LAW"]
            self._react_amounts = bind(massaction.react, amounts, LAW=rate_law, SWITCH=SWITCH)

    def react(self, n: int, step: int, tau: float, part: int, begin: float, end: float) -> int:
        """All reactions of n particles during tau from the time ``begin`` on; the events.

        ``part`` tells apart the random numbers of the parts of a step; the time ``end`` of the step
        is for messages.

        Raises
        ------
        RunError
            Where reactions are too fast to be computed, naming a particle.
        """
        lanes, events = len(self._scratch["work"]), 0
        if self._together:
            self._react_together(lanes, n, tau, step, part)
        elif self.deterministic.reactions:
            self._react_amounts(lanes, n, tau, begin)
        if self._together or self.deterministic.reactions:
            self._look_at_substeps(n, step, end)
        if self.stochastic.reactions:
            if not self._together:
                self._react_counts(n, tau, step, part)
            events = self._count_events(step, end)
        self.remarks.look()
        return events

    def first_pace(self, n: int, step: int) -> float:
        """The :meth:`pace` of concentrations and numbers as they are."""
        self._react_together(len(self._scratch["work"]), n, INSTANT, step, 0)
        return self.pace()

    def pace(self) -> float:
        """Fastest rate in 1/s of reactions of both kinds together as they left it; else inf."""
        if not self._together:
            return math.inf
        return float(self.device.to_host(self._scratch["pace"]).max())

    def _look_at_substeps(self, n: int, step: int, time: float) -> None:
        substeps = self.device.to_host(self._scratch["substeps"])
        self.substeps = int(substeps.max())
        if substeps.min() >= 0:
            return
        row = -1 - int(substeps[substeps < 0][0])
        what = "rates of reactions overflow, or are not finite"
        if row >= n:
            what = f"more than {MOST_SUBSTEPS:.3g} sub-steps of reactions in one step"
        self._fail(what, "amount", row % n, step, time)

    def _count_events(self, step: int, time: float) -> int:
        f = self._scratch
        events = int(self.device.to_host(f["event_counter"])[:, 0].sum())
        self.device.write(f["event_counter"], f["zero_counters"])
        if self.device.to_host(f["broken"])[0]:
            failed = self.device.to_host(f["failed"])
            row = int(np.flatnonzero(failed)[0])
            what = "propensities of reactions overflow, or are not finite"
            if failed[row] == 2:
                what = f"more than {f['most_events']:.3g} reactions in one step"
            self._fail(what, "count", row, step, time)
        return events

    def _fail(self, message: str, field: str, row: int, step: int, time: float) -> None:
        message += self.remarks.not_finite()
        particle = int(self.particles.host("id")[row])
        raise RunError(message, step=step, time=time, field=field, particle=particle)
