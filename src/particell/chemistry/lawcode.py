"""Formulas of species as machine code.

Trees are written as the text of a Python function, node by node: the only words in it are those of
this module and of :data:`~particell.chemistry.formula.FUNCTIONS`, numbers, and the function's
arguments, so that nothing of a file can be called or looked up. All laws of a network become one
function, whose text says which it is: loops that were compiled with it are kept on disk under its
digest.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from numba import njit
from numba.extending import overload

from particell.chemistry.formula import (
    FUNCTIONS,
    MOST_DEPTH,
    MOST_PARTS,
    Call,
    Number,
    Operation,
    Symbol,
    Time,
    Tree,
    children,
    extent,
    nodes,
    symbols,
    timed,
)
from particell.errors import InputError, unknown_name
from particell.materials import AVOGADRO

#: Whole powers up to this one are multiplied out, exactly.
HIGHEST_POWER = 8
#: Brackets within brackets beyond this get a line of their own.
DEEPEST = 12
#: A difference is round-off within this part of what is subtracted.
ROUND_OFF = 1e-9
#: The time in s stands after the concentrations times this, small beside most of them: what is
#: resolved of a concentration follows from the largest.
CLOCK = 1e-9
_SCOPE = {
    "math": math,
    "__builtins__": {"abs": abs, "float": float, "max": max, "min": min, "round": round},
}


@dataclass(frozen=True)
class Law:
    """A rate that is compiled once the species' columns are known.

    Parameters
    ----------
    tree
        The rate in mol/m³/s, of concentrations in mol/m³ and the time in s.
    molecules
        Whether the species are molecules: then the function is the propensity ``f(N, V, k)``, the
        rate at the concentrations N/(V 𝒩) times V 𝒩; else it is ``f(C, k)``, where the time
        times :data:`CLOCK` stands after the species.
    taken
        What is subtracted from the rate, where the difference must not be negative: below
        round-off it is NaN then, which stops a run.
    """

    tree: Tree
    molecules: bool = False
    taken: Tree | None = None

    @property
    def timed(self) -> bool:
        """Whether it depends on the time."""
        return timed(self.tree)

    @property
    def arguments(self) -> str:
        """The arguments of the compiled function."""
        return "N, V, k" if self.molecules else "C, k"

    def body(self, names: Sequence[str]) -> tuple[str, ...]:
        """The lines of the function.

        Parameters
        ----------
        names
            The species in the order of the function's array.
        """
        columns = {name: k for k, name in enumerate(names)}
        trees = [self.tree] if self.taken is None else [self.tree, self.taken]
        for tree in trees:
            size, depth = extent(tree)
            if size > MOST_PARTS or depth > MOST_DEPTH:
                allowed = f"of at most {MOST_PARTS} parts, nested at most {MOST_DEPTH} times"
                raise InputError("rate law", f"of {size} parts, nested {depth} times", allowed)
        for tree in trees:
            for name in symbols(tree):
                if name not in columns:
                    raise unknown_name("species in a rate law", name, names)
        try:
            return tuple(_Writer(columns, self.molecules).lines(trees))
        except RecursionError:
            raise InputError("rate law", "nested too deeply", "nested less deeply") from None

    def bind(self, names: Sequence[str]) -> Any:
        """The compiled function for species in this order."""
        text = "\n".join([f"def law({self.arguments}):", *self.body(names)])
        return njit(error_model="numpy")(_function(text, "law"))


def dispatcher(laws: Sequence[Any], arguments: str) -> Any:
    """One compiled function ``f(m, *arguments)`` of several; None for none.

    Parameters
    ----------
    laws
        Lines of laws (:meth:`Law.body`) and functions.
    arguments
        Of each of them.
    """
    if not laws:
        return None
    lines = [f"def choose(m, {arguments}):"]
    functions = {}
    for m, law in enumerate(laws):
        lines.append(f"    if m == {m}:")
        if isinstance(law, tuple):
            lines += [f"    {line}" for line in law]
        else:
            functions[f"law{m}"] = law
            lines.append(f"        return 1.0 * law{m}({arguments})")
    text = "\n".join([*lines, "    return 0.0"])
    if not functions:
        return _dispatcher(text, arguments)
    scope = {**_SCOPE, **functions}
    exec(text, scope)
    return njit(error_model="numpy")(scope["choose"])


def _function(text: str, name: str) -> Any:
    """The function of a text."""
    scope = dict(_SCOPE)
    exec(text, scope)
    return scope[name]


@cache
def _dispatcher(text: str, arguments: str) -> Any:
    """The function ``choose`` of a text, made once.

    Compiled code knows it by a rule for its type. (A function compiled by Numba would be known by
    its address in this process, and nothing that was compiled with it could be kept on disk.)
    ``disk_key`` tells apart the loops that were compiled with such functions.
    """
    choose = _function(text, "choose")
    choose.disk_key = hashlib.sha256(text.encode()).hexdigest()[:16]
    rule = _function(f"def rule(m, {arguments}):\n    return choose", "rule")
    rule.__globals__["choose"] = choose
    overload(choose, jit_options={"error_model": "numpy"})(rule)
    return choose


class _Writer:
    """Writes the text of trees; what is used twice, or deep inside, gets a line of its own."""

    def __init__(self, columns: Mapping[str, int], molecules: bool):
        self.columns, self.molecules = columns, molecules
        self.made: list[str] = []
        self.known: dict[int, tuple[str, int]] = {}
        self.counts: dict[tuple[str, float], str] = {}
        self.uses: dict[int, int] = {}

    def lines(self, trees: Sequence[Tree]) -> list[str]:
        """A function's lines, indented once."""
        for tree in trees:
            for node in nodes(tree):
                for child in children(node):
                    self.uses[id(child)] = self.uses.get(id(child), 0) + 1
        texts = [self.number(tree)[0] for tree in trees]
        rate = texts[0]
        if len(texts) > 1:
            self.made += [f"p = {texts[0]}", f"q = {texts[1]}"]
            rate = f"(p - q if p >= q else (0.0 if q - p <= {ROUND_OFF!r} * p else math.nan))"
        factor = f"k * (V * {AVOGADRO!r})" if self.molecules else "k"
        return [f"    {line}" for line in [*self.made, f"return {factor} * {rate}"]]

    def number(self, node: Tree) -> tuple[str, int]:
        """The text of a tree's number, and how deep its brackets are."""
        if id(node) in self.known:
            return self.known[id(node)]
        text, depth = self._number(node)
        shared = self.uses.get(id(node), 0) > 1 and children(node)
        if shared or depth > DEEPEST:
            name = f"a{len(self.made)}"
            self.made.append(f"{name} = {text}")
            text, depth = name, 0
        self.known[id(node)] = text, depth
        return text, depth

    def _number(self, node: Tree) -> tuple[str, int]:
        if isinstance(node, Number):
            return (repr(node.value) if node.value >= 0 else f"({node.value!r})"), 0
        if isinstance(node, Time):
            return f"(C[{len(self.columns)}] / {CLOCK!r})", 1
        if isinstance(node, Symbol):
            return self._species(node.name, 1.0), 0
        if isinstance(node, Call):
            if FUNCTIONS[node.function].condition:
                condition, depth = self.condition(node)
                return f"(1.0 if {condition} else 0.0)", depth + 1
            return self._call(node)
        left, right, product = node.left, node.right, node.operator == "*"
        if self.molecules and product and isinstance(left, Number) and isinstance(right, Symbol):
            return self._species(right.name, left.value), 0
        return self._operation(node)

    def _operation(self, node: Operation) -> tuple[str, int]:
        left, depth = self.number(node.left)
        if node.operator == "^" and isinstance(node.right, Number):
            power = node.right.value
            if power == int(power) and abs(power) <= HIGHEST_POWER:
                return f"({left} ** {int(power)})", depth + 1
        right, deep = self.number(node.right)
        operator = "**" if node.operator == "^" else node.operator
        return f"({left} {operator} {right})", max(depth, deep) + 1

    def _call(self, node: Call) -> tuple[str, int]:
        first = self.condition if node.function == "where" else self.number
        parts = [first(node.arguments[0]), *(self.number(a) for a in node.arguments[1:])]
        text = FUNCTIONS[node.function].code.format(*(part for part, _ in parts))
        return text, max(depth for _, depth in parts) + 1

    def condition(self, node: Tree) -> tuple[str, int]:
        """The text of whether a tree is true."""
        if isinstance(node, Call) and FUNCTIONS[node.function].condition:
            inner = self.condition if node.function in ("and", "or", "not") else self.number
            parts = [inner(a) for a in node.arguments]
            text = FUNCTIONS[node.function].code.format(*(part for part, _ in parts))
            return text, max(depth for _, depth in parts) + 1
        text, depth = self.number(node)
        return f"({text} != 0.0)", depth + 1

    def _species(self, name: str, scale: float) -> str:
        """The concentration of a species times a scale.

        With molecules it is a count times the scale of one: exactly 1 where the particle is the
        compartment and amounts are counted, so that they can be compared with whole numbers.
        """
        column = self.columns[name]
        if not self.molecules:
            return f"C[{column}]"
        if (name, scale) not in self.counts:
            one, number = f"u{len(self.counts)}", f"n{len(self.counts)}"
            self.made += [
                f"{one} = {scale!r} / (V * {AVOGADRO!r})",
                f"{number} = N[{column}] * (1.0 if abs({one} - 1.0) < {ROUND_OFF!r} else {one})",
            ]
            self.counts[name, scale] = number
        return self.counts[name, scale]
