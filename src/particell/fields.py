"""Fields: what particles carry, each declared once.

A declaration says how much room a field takes, what may stand in it, its unit and what becomes of
it; allocation, frames, checks and checkpoints follow from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.checks import checked
from particell.errors import InputError
from particell.units import check_unit

#: What the rate of a field is called, after the field's name.
RATE = "_rate"
#: What a field is: given and never changed, part of the state (never infinite), made anew from the
#: state (some distances are infinite where nothing is near), or used in part of the space only.
GIVEN, STATE, WORK, LOCAL = "given", "state", "work", "local"
ROLES = (GIVEN, STATE, WORK, LOCAL)


@checked
@dataclass(frozen=True)
class Field:
    """A number, or several, that every particle carries.

    One of your own is passed to a scheme as ``fields=[Field(...)]``. Laws read it by its name and
    add to ``NAME_rate``, its rate along a particle's path. It is in frames, checkpoints and
    messages like any other field. Wall particles keep what they have.

    Parameters
    ----------
    name
        A word, by which laws, frames and ``simulation.particles`` know it.
    initial
        Its value at first, of all particles; ``simulation.particles.set(name, values)`` sets others
        (values in memory order).
    unit
        For readers of frames: text such as ``"K"`` or ``"kg/m^3"``, empty for a plain number.
    components
        Numbers a particle, of a vector the dimension; 0 for a number without an axis of its own.
    role
        ``"state"``: never infinite; ``"given"``: does not change either; ``"work"``: made anew from
        the state, never NaN; ``"local"``: without meaning in parts of the space.
    kind
        NumPy's type; that of the device's real numbers where it is left out.
    part_of
        Name of a field of which this one is a part that is taken away before the next step: none
        where that field is set.

    Raises
    ------
    InputError
        Where the name is no word, or a role or a unit is unknown.
    """

    name: str
    initial: float = 0.0
    unit: str = ""
    components: int = 0
    role: str = STATE
    kind: Any = None
    part_of: str = ""

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or self.name.startswith("_"):
            raise InputError("name", self.name, "a word of letters, digits and _")
        if self.role not in ROLES:
            raise InputError("role", self.role, f"one of {', '.join(ROLES)}")
        try:
            np.dtype(self.kind)
        except TypeError:
            raise InputError("kind", self.kind, "a type of NumPy's") from None
        check_unit("unit", self.unit)
        if self.components < 0:
            raise InputError("components", self.components, "zero or more")

    @property
    def rate(self) -> Field:
        """Its rate along a particle's path, to which laws add."""
        unit = f"{self.unit}/s" if self.unit else ""
        return Field(self.name + RATE, 0.0, unit, self.components, WORK)


def work(name: str, components: int = 0, kind: Any = None) -> Field:
    """A field that is made anew from the state."""
    return Field(name, components=components, role=WORK, kind=kind)
