"""What a continuation bit for bit needs: a simulation's state by parts, and how it is put back."""

from __future__ import annotations

from typing import Any, Protocol

from particell.description import check_description, description
from particell.errors import InputError
from particell.restored import check_state
from particell.simulated import Simulated
from particell.snapshot import Account

#: Parts that every checkpoint has.
PARTS = {"fields", "neighbours", "clock", "timing", "operations", "account", "worst", "description"}


class Restorable(Simulated, Protocol):
    """A simulation whose state can be kept."""

    account: Account
    watch: Any


def state_of(simulation: Restorable) -> dict[str, Any]:
    """See :meth:`particell.simulation.Simulation.state`."""
    s = simulation
    found = {
        "fields": {name: s.particles.host(name) for name in s.particles},
        "neighbours": s.neighbours.saved(),
        "clock": s.system.clock.saved(),
        "timing": s.timing.saved(),
        "operations": s.operations.saved(),
        "account": s.account.saved(),
        "worst": dict(s.watch.worst),
        "description": description(s),
    }
    if s.chemistry:
        found["chemistry"] = s.chemistry.saved()
    return found


def restore(simulation: Restorable, state: dict[str, Any]) -> None:
    """See :meth:`particell.simulation.Simulation.restore`."""
    s = simulation
    fields = state.get("fields") if isinstance(state, dict) else None
    if isinstance(fields, dict) and "chemistry_every" in state:
        allowed = "of this version: start the run again (its frames can still be read)"
        raise InputError("checkpoint", "of an earlier version of particell", allowed)
    if not isinstance(fields, dict) or not set(state) >= PARTS:
        raise InputError("checkpoint", "another kind of state", "of a simulation")
    check_description(s, state["description"])
    if not isinstance(state["operations"], dict):
        raise InputError("checkpoint", "another kind of state", "of a simulation")
    s.operations.check(state["operations"])
    if set(fields) != set(s.particles):
        raise InputError("checkpoint", "other particles or fields", "of this simulation")
    check_state(s, state)
    s.operations.restore(state["operations"])
    for name in s.particles:  # what is a part of another field comes after that one
        s.particles.set(name, fields[name])
    s.neighbours.restore(state["neighbours"], s.particles)
    s.system.clock.restore(state["clock"])
    s.timing.restore(state["timing"])
    s.account.restore(state["account"])
    s.watch.worst = dict(state["worst"])
    if s.chemistry:
        s.chemistry.restore(state["chemistry"])
    s.solver.renewed()
