"""What a continuation bit for bit needs: a simulation's state by parts, and how it is put back."""

from __future__ import annotations

from typing import Any, Protocol

from particell.errors import InputError
from particell.laws.digest import scheme_text
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


def description(simulation: Simulated) -> dict[str, str]:
    """What a simulation was made of, as text that is the same for the same description."""
    s = simulation
    chemistry = s.chemistry
    return {
        "domain": repr(s.domain),
        "materials": repr(s.materials),
        "scheme": scheme_text(s.scheme),
        "forces": "" if s.static else "; ".join(f.described() for f in s.solver.flow.forces),
        "precision": str(s.device.real),
        "forms": repr(s.solver.forms()),
        "seed": repr(s.seed),
        "mirrors": repr(s.system.mirrors),
        "species": repr([*chemistry.species.values()] if chemistry else []),
        "rates": repr([[t.rate.tolist(), t.value.tolist()] for t in chemistry.tables])
        if chemistry
        else "[]",
    }


def restore(simulation: Restorable, state: dict[str, Any]) -> None:
    """See :meth:`particell.simulation.Simulation.restore`."""
    s = simulation
    fields = state.get("fields") if isinstance(state, dict) else None
    if isinstance(fields, dict) and "chemistry_every" in state:
        allowed = "of this version: start the run again (its frames can still be read)"
        raise InputError("checkpoint", "of an earlier version of particell", allowed)
    if not isinstance(fields, dict) or not set(state) >= PARTS:
        raise InputError("checkpoint", "another kind of state", "of a simulation")
    now = description(s)
    for part, text in state["description"].items():
        if now.get(part) != text:
            raise InputError(f"{part} of the checkpoint", text, f"as now: {now.get(part)}")
    s.operations.check(state["operations"])
    same = set(fields) == set(s.particles) and all(
        values.shape == s.particles[name].shape for name, values in fields.items()
    )
    if not same:
        raise InputError("checkpoint", "other particles or fields", "of this simulation")
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
