"""What a continuation bit for bit needs: a simulation's state, and how it is put back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.errors import InputError
from particell.laws.digest import scheme_text

if TYPE_CHECKING:
    from particell.simulation import Simulation

_LIST = ("cell", "cell_start", "start", "split", "stop", "crosses", "neighbours", "x_built")
_COUNTERS = ("step", "time", "dt", "chemistry_every")
_KEYS = {"list", "capacity", "builds", "speed", "seed", "first_momentum", *_COUNTERS}


def state_of(simulation: Simulation) -> dict[str, Any]:
    """See :meth:`particell.simulation.Simulation.state`."""
    s = simulation
    s.start()
    chemistry = s.chemistry
    return {
        "fields": {name: s.particles.host(name) for name in s.particles},
        "list": {name: np.array(s.device.to_host(s.neighbours.fields[name])) for name in _LIST},
        "capacity": s.neighbours.capacity,
        "builds": s.neighbours.builds,
        **{name: getattr(s, name) for name in _COUNTERS},
        "speed": s._speed,
        "wall_seconds": s._wall_seconds,
        "compile_seconds": s._compile_seconds,
        "seed": s.seed,
        "description": description(s),
        "first_momentum": s._first_momentum,
        "first_totals": dict(s._first_totals),
        "kept_volume": s.solver.kept_volume.state() if hasattr(s.solver, "kept_volume") else None,
        "rest": s.solver.rest.state() if hasattr(s.solver, "rest") else None,
        "law_limit": s.solver.law_limit,
        "events": chemistry.events if chemistry else 0,
        "jumps": chemistry.jumps if chemistry else 0,
        "pace": chemistry.pace if chemistry else math.inf,
        "worst": dict(s.watch.worst),
        "remarks": list(chemistry.remarks) if chemistry else [],
        "crossings": s.carriage.crossings if s.carriage else None,
    }


def description(simulation: Simulation) -> dict[str, str]:
    """What a simulation was made of, as text that is the same for the same description."""
    s = simulation
    chemistry = s.chemistry
    return {
        "domain": repr(s.domain),
        "materials": repr(s.materials),
        "scheme": scheme_text(s.scheme),
        "precision": str(s.device.real),
        "species": repr([*chemistry.species.values()] if chemistry else []),
        "rates": repr([[t.rate.tolist(), t.value.tolist()] for t in chemistry.tables])
        if chemistry
        else "[]",
    }


def restore(simulation: Simulation, state: dict[str, Any]) -> None:
    """See :meth:`particell.simulation.Simulation.restore`."""
    s = simulation
    fields = state.get("fields") if isinstance(state, dict) else None
    if not isinstance(fields, dict) or not set(state) >= _KEYS:
        raise InputError("checkpoint", "another kind of state", "of a simulation")
    same = set(fields) == set(s.particles) and all(
        values.shape == s.particles[name].shape for name, values in fields.items()
    )
    if not same or state["seed"] != s.seed:
        raise InputError("checkpoint", "other particles, fields or seed", "of this simulation")
    now = description(s)
    for part, text in state.get("description", now).items():
        if now.get(part) != text:
            raise InputError(f"{part} of the checkpoint", text, f"as now: {now.get(part)}")
    for name in s.particles:  # what is a part of another field comes after that one
        s.particles.set(name, fields[name])
    s.neighbours.restore(state["capacity"], state["builds"], state["list"])
    for name in _COUNTERS:
        setattr(s, name, state[name])
    s._speed, s._wall_seconds = state["speed"], state["wall_seconds"]
    s._compile_seconds = state["compile_seconds"]
    s._first_momentum = state["first_momentum"]
    s._first_totals = dict(state["first_totals"])
    s.watch.worst = dict(state.get("worst", {}))
    if s.chemistry:
        s.chemistry.events, s.chemistry.jumps = state["events"], state["jumps"]
        s.chemistry.pace = state.get("pace", math.inf)
        s.chemistry.remarks[:] = state.get("remarks", [])
    if s.carriage:
        s.carriage.crossings = state.get("crossings") or (0.0, 0.0)
    if state.get("kept_volume") is not None:
        s.solver.kept_volume.put(state["kept_volume"])  # type: ignore[union-attr]
    if state.get("rest") is not None:
        s.solver.rest.restore(state["rest"])  # type: ignore[union-attr]
    s.solver.law_limit = state.get("law_limit", math.inf)
    s.solver.restore()
    s.constraints.restored()
    s.resumed, s.resumed_plan = True, state.get("plan")
    s.resumed_averages = state.get("averages", {})
    s._started = True
