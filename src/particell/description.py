"""What a simulation was made of, as text that is the same for the same description.

Checkpoints hold it: a run goes on only as what it began as. Of what a script brings, functions
count by their code and by the values that they refer to, as these are when the simulation is made:
lists and tables too, but those that a function itself appends to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from particell.errors import InputError
from particell.laws.digest import described, digest, scheme_text
from particell.simulated import Simulated


def described_parts(
    boundaries: Sequence[Any],
    forces: Sequence[Any],
    reactions: Sequence[Any],
    operations: Sequence[Any],
    observables: Mapping[str, Callable[..., float]],
    **options: Any,
) -> dict[str, str]:
    """What a simulation is given besides particles, a scheme and species, before it is used.

    Parameters
    ----------
    boundaries, forces, reactions, operations, observables, **options
        As for :class:`.Simulation`.
    """
    functions = [f"{name} {_code(function)}" for name, function in sorted(observables.items())]
    return {
        "boundaries": _listed(boundaries),
        "given forces": _listed(forces),
        "reactions": _listed(reactions),
        "operations": _listed(operations, lenient=True),
        "observables": "; ".join(functions),
        "options": ", ".join(f"{name} = {value!r}" for name, value in options.items()),
    }


def description(simulation: Simulated) -> dict[str, str]:
    """All of a simulation, by parts."""
    s = simulation
    chemistry = s.chemistry
    return {
        **s.described,
        "domain": repr(s.domain),
        "depth": repr(float(s.system.depth)),
        "groups": repr(s.particles.groups),
        "surfaces": _listed(p.surface for p in s.phases if p.surface is not None),
        "materials": repr(s.materials),
        "scheme": scheme_text(s.scheme),
        "forces": "" if s.static else "; ".join(f.described() for f in s.solver.flow.forces),
        "precision": str(s.device.real),
        "forms": repr(s.solver.forms()),
        "seed": repr(s.seed),
        "species": repr([*chemistry.species.values()] if chemistry else []),
        "rates": repr([[t.rate.tolist(), t.value.tolist()] for t in chemistry.tables])
        if chemistry
        else "[]",
    }


def check_description(simulation: Simulated, found: Any) -> None:
    """Refuse what another simulation says of itself.

    Raises
    ------
    InputError
        Naming the part, what it was and what it is.
    """
    now = description(simulation)
    if not isinstance(found, Mapping) or set(found) != set(now):
        raise InputError("checkpoint", "another kind of state", "of a simulation")
    for part, text in now.items():
        if found[part] != text:
            before, after = _apart(str(found[part]), text)
            raise InputError(f"{part} of the checkpoint", before, f"as now: {after}")


def _apart(before: str, after: str) -> tuple[str, str]:
    """Two texts without what is the same at their beginnings and ends, by whole parts of lists."""
    one, other = before.split(", "), after.split(", ")
    while len(one) > 1 and len(other) > 1 and one[0] == other[0]:
        one, other = one[1:], other[1:]
    while len(one) > 1 and len(other) > 1 and one[-1] == other[-1]:
        one, other = one[:-1], other[:-1]
    return ", ".join(one), ", ".join(other)


def _listed(items: Iterable[Any], lenient: bool = False) -> str:
    return "; ".join(_text(item, lenient) for item in items)


def _text(item: Any, lenient: bool) -> str:
    try:
        return described(item, lenient)
    except (InputError, TypeError):  # it holds something that cannot be compared, or is no object
        if lenient:
            return type(item).__qualname__
        return _text(item, True)


def _code(function: Any) -> str:
    try:
        return digest(function, "observable", lenient=True)
    except InputError:
        return type(function).__qualname__
