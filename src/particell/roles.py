"""What groups of particles are to fields: which of them carry one, which bound it.

A field is a fluid's own, but for concentrations and molecules, which are in the groups that hold
the species. Walls that hold a field at their surface (no slip, fixed concentrations) bound it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

#: Fields of a species: ``concentration/L``, ….
OF_SPECIES = ("concentration", "count", "inflow")


@dataclass(frozen=True)
class Role:
    """What a group is to fields.

    Attributes
    ----------
    name
        The group.
    kind
        ``"fluid"`` or ``"wall"``.
    species
        The species that its particles hold; None where nothing is known of it (then all).
    held
        Concentrations in mol/m³ at the surface of a wall, by species.
    sticks
        Whether fluid at the surface of a wall has its velocity.
    """

    name: str
    kind: str = "fluid"
    species: tuple[str, ...] | None = None
    held: Mapping[str, float] = field(default_factory=dict)
    sticks: bool = False

    def as_dict(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Role:
        """From :meth:`as_dict`."""
        species = found.get("species")
        return cls(
            str(found["name"]),
            str(found.get("kind", "fluid")),
            None if species is None else tuple(map(str, species)),
            {str(k): float(v) for k, v in dict(found.get("held", {})).items()},
            bool(found.get("sticks", False)),
        )


def carriers(roles: Sequence[Role], name: str) -> tuple[int, ...]:
    """The groups, by index, whose particles carry a field; all where none is known to."""
    what, _, species = name.partition("/")
    if what in OF_SPECIES and species:
        found = [g for g, r in enumerate(roles) if r.species is None or species in r.species]
    else:
        found = [g for g, r in enumerate(roles) if r.kind == "fluid"]
    return tuple(found or range(len(roles)))


def held_at(role: Role, name: str) -> float | str | None:
    """What a field is at the surface of a wall: a number, ``"its"`` (the wall's own), or None."""
    what, _, species = name.partition("/")
    if what == "concentration" and species in role.held:
        return role.held[species]
    return "its" if name == "velocity" and role.sticks else None
