"""What a state that is to be restored may hold: looked at before anything compiled sees it.

A checkpoint's digest finds what happened to a file by chance. It is data all the same, and may come
from anybody: a row's number that is out of range would let a loop write where it must not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from particell.errors import InputError
from particell.fields import GIVEN, LOCAL, STATE, Field
from particell.simulated import Simulated
from particell.snapshot import net_totals

#: Fields that a description gives, and that tables and loops are indexed by.
OF_THE_DESCRIPTION = ("group", "is_wall", "slides")
#: Most steps, molecules in a particle, and events: whole numbers that a float holds as well.
MOST = 2**53
#: Places may be beyond the box by so many of its lengths (of walls that move, for example).
FAR = 1e6
#: A particle moves by less than this part of the box's longest edge in a step.
FARTHEST = 1.0
#: Lines of remarks, and characters in one.
MOST_REMARKS, LONGEST_REMARK = 10_000, 10_000


class StateError(InputError):
    """A state with something in it that no simulation has."""

    def __init__(self, what: str, value: object, allowed: str):
        super().__init__(f"checkpoint: {what}", value, allowed)


def check_kind(what: str, found: Any, own: Any) -> None:
    """Refuse a value of another type or shape than a simulation's own; numbers that are no number.

    Raises
    ------
    StateError
        Naming it.
    """
    if isinstance(own, np.ndarray):
        if not isinstance(found, np.ndarray) or found.dtype != own.dtype:
            raise StateError(what, _kind(found), f"an array of {own.dtype}")
        if found.shape != own.shape:
            raise StateError(what, f"of shape {found.shape}", f"of shape {own.shape}")
        if found.dtype.kind == "f" and not np.isfinite(found).all():
            raise StateError(what, "not finite", "finite")
    elif isinstance(own, Mapping):
        if not isinstance(found, Mapping) or set(found) != set(own):
            raise StateError(what, _kind(found), f"with {', '.join(map(str, own)) or 'nothing'}")
        for name, value in own.items():
            check_kind(f"{what} {name}", found[name], value)
    elif isinstance(own, list | tuple):
        if type(found) is not type(own) or len(found) != len(own):
            raise StateError(what, _kind(found), f"a {type(own).__name__} of {len(own)}")
        for k, value in enumerate(own):
            check_kind(f"{what} {k}", found[k], value)
    elif isinstance(own, bool | np.bool_):
        if not isinstance(found, bool | np.bool_):
            raise StateError(what, found, "true or false")
    elif isinstance(own, int | np.integer):
        whole(what, found, -MOST)
    elif isinstance(own, float | np.floating):
        number(what, found)
    elif type(found) is not type(own):
        raise StateError(what, found, f"a {type(own).__name__}")


def whole(what: str, found: Any, least: int = 0, most: int = MOST) -> int:
    """A whole number within limits, or a :class:`StateError`."""
    if isinstance(found, bool) or not isinstance(found, int | np.integer):
        raise StateError(what, found, "a whole number")
    if not least <= found <= most:
        raise StateError(what, found, f"a whole number from {least} to {most}")
    return int(found)


def number(
    what: str, found: Any, least: float = -math.inf, infinite: bool = False, zero: bool = True
) -> float:
    """A number from ``least`` on, or a :class:`StateError`."""
    if isinstance(found, bool) or not isinstance(found, int | float | np.floating):
        raise StateError(what, found, "a number")
    if isinstance(found, int) and abs(found) > MOST:  # which a float may not hold
        raise StateError(what, found, "a number")
    good = found >= least and (infinite or math.isfinite(found)) and (zero or found != 0)
    if not good:
        allowed = "a finite number" if least == -math.inf else f"a number from {least:g} on"
        raise StateError(what, found, allowed if zero else f"{allowed}, not zero")
    return float(found)


def check_state(simulation: Simulated, state: Mapping[str, Any]) -> None:
    """Refuse a state that no simulation of this description has.

    Raises
    ------
    StateError
        Naming the part, what it holds and what is allowed.
    """
    clock = state["clock"]
    check_kind("clock", clock, simulation.system.clock.saved())
    whole("step", clock["step"])
    number("time", clock["time"], 0.0)
    dt = number("dt", clock["dt"], 0.0, zero=False)
    whole("steps of the flow in one of the species", clock["species_every"], 1)
    _check_timing(simulation, state["timing"])
    _check_fields(simulation, state["fields"], dt)
    _check_list(simulation, state["neighbours"])
    _check_operations(simulation, state["operations"])
    _check_account(simulation, state["account"])
    for name, value in _mapping("health", state["worst"]).items():
        number(f"health {name}", value, infinite=True)
    if simulation.chemistry:
        _check_chemistry(simulation, state.get("chemistry"))


def _check_timing(simulation: Simulated, timing: Any) -> None:
    if set(_mapping("timing", timing)) != set(simulation.timing.saved()):
        raise StateError("timing", sorted(map(str, timing)), "with speed and law_limit")
    number("largest speed", timing["speed"], 0.0)
    number("limit of laws", timing["law_limit"], 0.0, infinite=True, zero=False)


def _check_fields(simulation: Simulated, fields: Mapping[str, Any], dt: float) -> None:
    particles = simulation.particles
    for name, declared in particles.declared.items():
        own, found = particles.view(name), fields[name]
        what = f"field '{name}'"
        if not isinstance(found, np.ndarray) or found.dtype != own.dtype:
            raise StateError(what, _kind(found), f"an array of {own.dtype}")
        if found.shape != own.shape:
            raise StateError(what, f"of shape {found.shape}", f"of shape {own.shape}")
        _check_values(what, declared, found)
    order = fields["id"]
    if not np.array_equal(np.sort(order), np.arange(len(particles))):
        raise StateError("field 'id'", "no order of the particles", "every number once")
    for name in OF_THE_DESCRIPTION:
        if not np.array_equal(fields[name], particles.by_id(name)[order]):
            raise StateError(f"field '{name}'", "another", "that of the description")
    for name in ("mass", "support"):
        if not (fields[name] > 0).all():
            raise StateError(f"field '{name}'", "zero or negative", "positive")
    largest = float(particles.view("support").max()) * (1 + 1e-6)
    if fields["support"].max() > largest:
        allowed = f"at most {largest:g} m"
        raise StateError("field 'support'", float(fields["support"].max()), allowed)
    check_places(simulation, "field 'x'", fields["x"])
    reach = float(np.abs(fields["v"]).max(initial=0.0)) * dt
    if reach > FARTHEST * float(simulation.domain.lengths.max()):
        raise StateError("field 'v'", "too fast for the box", "less than its length in a step")


def _check_values(what: str, declared: Field, found: np.ndarray) -> None:
    if declared.name in ("count", "bounces", "reflections"):
        if found.min(initial=0) < 0 or found.max(initial=0) > MOST:
            raise StateError(what, "out of range", f"from 0 to {MOST}")
    elif declared.name == "continuous":
        if found.max(initial=0) > 1:
            raise StateError(what, int(found.max()), "0 or 1")
    elif found.dtype.kind == "f" and declared.role != LOCAL:
        strict = declared.role in (GIVEN, STATE)
        if not (np.isfinite(found).all() if strict else not np.isnan(found).any()):
            raise StateError(what, "not finite", "finite")


def check_places(simulation: Simulated, what: str, x: np.ndarray) -> None:
    """Refuse places that are not finite, or far away from the box."""
    domain = simulation.domain
    support = float(simulation.particles.view("support").max())
    slack = FAR * (domain.lengths + support)
    if not ((x >= domain.lower - slack) & (x <= domain.upper + slack)).all():  # a NaN is not
        raise StateError(what, "far away from the box, or not finite", "in the box")


def _check_list(simulation: Simulated, saved: Any) -> None:
    check_kind("neighbour list", saved, simulation.neighbours.saved())
    whole("builds of the neighbour list", saved["builds"])
    check_places(simulation, "places at the last build", saved["x_built"])


def _check_operations(simulation: Simulated, saved: Mapping[str, Any]) -> None:
    for name, operation in simulation.operations.by_name.items():
        own = operation.saved()
        if type(operation).__module__.startswith(f"{__package__}."):
            check_kind(f"operation '{name}'", saved[name], own)
        else:
            _mapping(f"operation '{name}'", saved[name])


def _check_account(simulation: Simulated, account: Any) -> None:
    own = simulation.account.saved()  # type: ignore[attr-defined]
    if set(_mapping("account", account)) != set(own):
        raise StateError("account", sorted(map(str, account)), f"with {', '.join(own)}")
    for name in ("wall_seconds", "compile_seconds"):
        number(f"account {name}", account[name], 0.0)
    if account["momentum"] is not None:
        check_kind("account momentum", account["momentum"], np.zeros(simulation.domain.dim))
    totals, names = _mapping("account totals", account["totals"]), net_totals(simulation)
    if set(totals) != set(names):
        raise StateError("account totals", sorted(map(str, totals)), f"with {', '.join(names)}")
    for name, value in totals.items():
        number(f"account {name}", value)


def _check_chemistry(simulation: Simulated, saved: Any) -> None:
    assert simulation.chemistry is not None
    own = simulation.chemistry.saved()
    if set(_mapping("chemistry", saved)) != set(own):
        raise StateError("chemistry", sorted(map(str, saved)), f"with {', '.join(own)}")
    for name in ("events", "jumps"):
        whole(f"chemistry {name}", saved[name])
    number("chemistry pace", saved["pace"], 0.0, infinite=True)
    remarks = saved["remarks"]
    good = isinstance(remarks, list) and len(remarks) <= MOST_REMARKS
    if not good or not all(isinstance(r, str) and len(r) <= LONGEST_REMARK for r in remarks):
        raise StateError("chemistry remarks", _kind(remarks), "lines of text")


def _mapping(what: str, found: Any) -> Mapping[str, Any]:
    if not isinstance(found, Mapping):
        raise StateError(what, found, "a table")
    return found


def _kind(found: Any) -> str:
    """What a value is, in a few words."""
    if isinstance(found, np.ndarray):
        return f"an array of {found.dtype}"
    return f"a {type(found).__name__}"
