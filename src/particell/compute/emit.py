"""Lines of Python that compute expressions, each of them once and as early as it can be."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from particell.compute.expressions import Node

#: Where a value is known: of no particle, of particle i, of a pair when it is gathered, in vectors.
NUMBER, OWN, GATHERED, PAIR = range(4)

_INFIX = {"+", "-", "*", "/", "<", "<=", ">", ">=", "==", "!=", "and", "or"}
_CALLS = {"max": "max", "min": "min"}
_CALLS |= {name: f"math.{name}" for name in ("sqrt", "exp", "log", "sin", "cos", "tanh")}


class Numbering:
    """Gives equal expressions the same number, whoever wrote them."""

    def __init__(self) -> None:
        self._known: dict[int, int] = {}
        self._keys: dict[tuple, int] = {}
        self._held: list[Node] = []  # identities stay taken
        self.nodes: list[Node] = []
        self.arguments: list[tuple] = []

    def __call__(self, node: Node) -> int:
        """The number of a node, below which all that it is made of have theirs."""
        known = self._known.get(id(node))
        if known is not None:
            return known
        stack = [node]
        while stack:
            top = stack[-1]
            if id(top) in self._known:
                stack.pop()
                continue
            waiting = [a for a in top.args if isinstance(a, Node) and id(a) not in self._known]
            if waiting:
                stack += waiting
                continue
            stack.pop()
            arguments = tuple(
                ("node", self._known[id(a)]) if isinstance(a, Node) else ("plain", _plain_key(a))
                for a in top.args
            )
            key = (top.op, top.what, arguments)
            number = self._keys.get(key)
            if number is None:
                number = self._keys[key] = len(self.nodes)
                self.nodes.append(top)
                self.arguments.append(arguments)
            self._known[id(top)] = number
            self._held.append(top)
        return self._known[id(node)]

    def uses(self, number: int) -> list[int]:
        """The numbers of what a node is made of."""
        return [value for kind, value in self.arguments[number] if kind == "node"]

    def under(self, roots: Iterable[int]) -> list[int]:
        """All that ``roots`` are made of, themselves included, in the order of computation."""
        found: set[int] = set()
        waiting = list(roots)
        while waiting:
            number = waiting.pop()
            if number not in found:
                found.add(number)
                waiting += self.uses(number)
        return sorted(found)


def _plain_key(value: Any) -> Any:
    return (type(value).__name__, repr(value)) if isinstance(value, float | int) else value


def literal(value: Any) -> str:
    """A plain number as Python text."""
    if isinstance(value, bool | np.bool_):
        return repr(bool(value))
    if isinstance(value, int | np.integer):
        return repr(int(value))
    number = float(value)
    if math.isfinite(number):
        return repr(number)
    return "math.nan" if math.isnan(number) else "math.inf" if number > 0 else "-math.inf"


class Writer:
    """Writes assignments for numbered expressions and remembers their names.

    Parameters
    ----------
    numbering
        Of the expressions.
    symbol
        The text of a symbol, by its ``what``.
    function
        The name under which a called function stands in the generated module.
    prefix
        Of the names that it gives.
    """

    def __init__(
        self,
        numbering: Numbering,
        symbol: Callable[[tuple], str],
        function: Callable[[Any], str],
        prefix: str,
    ):
        self.numbering, self._symbol, self._function = numbering, symbol, function
        self.names: dict[int, str] = {}
        self._prefix = prefix
        self._count = itertools.count()

    def text(self, number: int) -> str:
        """The name of a value, or the expression of a symbol."""
        return self.names[number]

    def give(self, number: int, name: str) -> None:
        """Let a value be known under a name."""
        self.names[number] = name

    def write(self, wanted: Iterable[int], often: set[int]) -> list[str]:
        """Lines for all ``wanted`` numbers, in their order; those in ``often`` get names."""
        lines: list[str] = []
        for number in wanted:
            if number in self.names:
                continue
            node = self.numbering.nodes[number]
            if node.op == "symbol":
                self.names[number] = self._symbol(node.what)
                continue
            if node.op == "call" and node.what[1] > 1:
                results = [f"{self._prefix}{next(self._count)}" for _ in range(node.what[1])]
                lines.append(f"{', '.join(results)} = {self._expression(number)}")
                self.names[number] = " ".join(results)
                continue
            if node.op == "item":
                self.names[number] = self.names[self.numbering.uses(number)[0]].split()[node.what]
                continue
            if node.op == "early":
                self.names[number] = self.names[self.numbering.uses(number)[0]]
                continue
            expression = self._expression(number)
            if number in often or node.op in ("call", "where"):
                name = f"{self._prefix}{next(self._count)}"
                lines.append(f"{name} = {expression}")
                self.names[number] = name
            else:
                self.names[number] = f"({expression})"
        return lines

    def _expression(self, number: int) -> str:
        node = self.numbering.nodes[number]
        parts = [
            self.names[value] if kind == "node" else self._plain(value, argument)
            for (kind, value), argument in zip(
                self.numbering.arguments[number], node.args, strict=True
            )
        ]
        if node.op in _INFIX:
            return f"{parts[0]} {node.op} {parts[1]}"
        if node.op == "neg":
            return f"-{parts[0]}"
        if node.op == "**":
            if parts[1].startswith("-"):  # Numba's whole powers of 0 raise, whatever they are told
                return f"1.0 / {parts[0]} ** {parts[1][1:]}"
            return f"{parts[0]} ** {parts[1]}"
        if node.op == "where":
            return f"{parts[1]} if {parts[0]} else {parts[2]}"
        if node.op in _CALLS:
            return f"{_CALLS[node.op]}({', '.join(parts)})"
        assert node.op == "call", node.op
        return f"{self._function(node.what[0])}({', '.join(parts)})"

    @staticmethod
    def _plain(_: Any, argument: Any) -> str:
        return argument if isinstance(argument, str) else literal(argument)
