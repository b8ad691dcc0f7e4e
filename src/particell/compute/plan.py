"""What a loop over neighbours is generated from: expressions, and what becomes of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from particell.compute.expressions import Node


@dataclass(frozen=True)
class Pass:
    """One source's share of a sweep.

    Attributes
    ----------
    first, last
        The arrays (``start``, ``split``, ``stop``) between whose values the neighbours stand.
    sums
        Components of what every sum gets from a pair, by the sum's name.
    support
        The pair's support where it is not that of i.
    stored
        What is kept of each pair, by the name of an array with an entry for each of the list's.
    """

    first: str
    last: str
    sums: dict[str, tuple[Any, ...]]
    support: Any = None
    stored: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """What a field of particle i becomes: expressions of sums and of i; ``rows`` for (n, D)."""

    values: tuple[Any, ...]
    rows: bool


@dataclass(frozen=True)
class Plan:
    """All that a loop is generated from.

    Attributes
    ----------
    name, title
        Of the loop; what it computes.
    dim
        The number of dimensions.
    passes
        Over the sources.
    results
        What is written, by the field's name.
    targets
        ``"mobile"``, ``"walls"`` or ``"all"``: particles that have rows.
    zeroed
        Fields that are made zero for the others.
    whole
        Fields of whole numbers, which no record holds.
    """

    name: str
    title: str
    dim: int
    passes: tuple[Pass, ...]
    results: dict[str, Result]
    targets: str = "mobile"
    zeroed: tuple[str, ...] = ()
    whole: frozenset[str] = frozenset({"id", "group"})


def sum_names(name: str, components: int) -> list[str]:
    """The variables of a sum."""
    plain = f"sum_{name}_".replace(".", "__")
    return [plain] if components == 1 else [f"{plain}_{k}" for k in range(components)]


def sum_symbols(name: str, components: int) -> tuple[Node, ...]:
    """A sum's components as they are known when it is finished."""
    return tuple(
        Node("symbol", (), ("sum", text, "i", None)) for text in sum_names(name, components)
    )
