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
    offset
        Components of x_i minus the place where j is seen, where that is not its own; of the
        difference of both places (symbols of the kind ``"apart"``) and of what is known of i, j.
    itself
        Whether i, which its row does not hold, is seen by itself too.
    only
        A condition on i without which nobody is seen.
    weighed
        The array along the list that has pairs' weights, where these are kept: all that are listed
        act, however far they are; where the weight is zero nothing is added.
    running
        Sums that are kept pair by pair as they grow, by the name of an array along the list.
    """

    first: str
    last: str
    sums: dict[str, tuple[Any, ...]]
    support: Any = None
    stored: dict[str, Any] = field(default_factory=dict)
    offset: tuple[Any, ...] = ()
    itself: bool = False
    only: Any = None
    weighed: str = ""
    running: dict[str, str] = field(default_factory=dict)

    @property
    def along_rows(self) -> bool:
        """Whether it reads or keeps something of each pair, which stands along rows."""
        return bool(self.stored or self.running or self.weighed)

    def values(self) -> list[Any]:
        """All that it computes."""
        summed = [v for values in self.sums.values() for v in values]
        return [*summed, *self.stored.values(), self.support, *self.offset, self.only]


@dataclass(frozen=True)
class Result:
    """What a field of particle i becomes: expressions of sums and of i.

    ``rows`` for fields (n, D); ``column`` is the number of the one that is written.
    """

    values: tuple[Any, ...]
    rows: bool
    column: str = ""


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

    def reads_of_neighbours(self) -> set[str]:
        """Fields of j that pairs need."""
        return {"x"} | _read([v for p in self.passes for v in p.values()], "j")

    def reads(self) -> set[str]:
        """Fields of i that pairs and the sums' end need."""
        values = [v for p in self.passes for v in p.values()]
        values += [v for result in self.results.values() for v in result.values]
        also = {"x", "support"} | ({"is_wall"} if self.targets != "all" else set())
        return also | _read(values, "i")


def sum_names(name: str, components: int) -> list[str]:
    """The variables of a sum."""
    plain = f"sum_{name}_".replace(".", "__")
    return [plain] if components == 1 else [f"{plain}_{k}" for k in range(components)]


def sum_symbols(name: str, components: int) -> tuple[Node, ...]:
    """A sum's components as they are known when it is finished."""
    return tuple(
        Node("symbol", (), ("sum", text, "i", None)) for text in sum_names(name, components)
    )


def _read(values: list[Any], side: str) -> set[str]:
    """Fields of the particle on a side that values are made of.

    Of a function that takes the particle's place all arrays count that it takes too: it may read
    any of them there.
    """
    found: set[str] = set()
    waiting, seen = [v for v in values if isinstance(v, Node)], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        waiting += [a for a in node.args if isinstance(a, Node)]
        if node.op == "symbol":
            kind, name, its, _ = node.what
            if its == side and kind in ("field", "table"):
                found.add("group" if kind == "table" else name)
            elif kind == "groups" and its:
                found.add("group")
        elif node.op == "call":
            symbols = [a.what for a in node.args if isinstance(a, Node) and a.op == "symbol"]
            if any(kind == "index" and its == side for kind, _, its, _ in symbols):
                found |= {n for kind, n, _, part in symbols if kind == "array" and part is None}
    return found
