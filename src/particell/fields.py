"""Fields of one's own: numbers that particles carry, with a rate that laws give."""

from __future__ import annotations

from dataclasses import dataclass

from particell.checks import checked
from particell.errors import InputError

#: What the rate of a field is called, after the field's name.
RATE = "_rate"


@checked
@dataclass(frozen=True)
class Field:
    """A number that particles carry along and that laws change.

    Laws read it by its name and add to ``NAME_rate``, its rate along a particle's path. It is in
    frames, checkpoints and messages like any other field. Wall particles keep what they have.

    Parameters
    ----------
    name
        A word, by which laws, frames and ``simulation.particles`` know it.
    initial
        Its value at first, of all particles; ``simulation.particles.set(name, values)`` sets others
        (values in memory order).

    Raises
    ------
    InputError
        Where the name is no word.
    """

    name: str
    initial: float = 0.0

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or self.name.startswith("_"):
            raise InputError("name", self.name, "a word of letters, digits and _")
