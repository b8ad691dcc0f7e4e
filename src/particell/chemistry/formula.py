"""Formulas of species and time as trees: folded, searched and worked out.

Trees come from a file's MathML (see :mod:`particell.chemistry.sbml`) or from the rate laws of a
case file; both have the functions of :data:`FUNCTIONS`. They are expanded in
:mod:`particell.chemistry.polynomials` and become machine code in
:mod:`particell.chemistry.lawcode`. No text of a file is ever looked at as a program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.errors import InputError

_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "^": lambda a, b: a**b,
}


def _truth(rule: Callable[..., Any]) -> Callable[..., Any]:
    """A rule whose answer is 1 or 0, of arguments that hold where they are not 0."""
    return lambda *arguments: np.where(rule(*arguments), 1.0, 0.0)


@dataclass(frozen=True)
class Function:
    """What a function of formulas is.

    Attributes
    ----------
    value
        Works it out for numbers and arrays.
    arguments
        How many it has.
    code
        Its text in compiled laws, with ``{0}``, ``{1}`` … for the arguments.
    condition
        Whether the text is true or false, instead of a number.
    """

    value: Callable[..., Any]
    arguments: int
    code: str
    condition: bool = False


#: The functions of formulas by name, those of case files among them; ``"<"`` and the like are
#: called as functions too. What is true is 1, what is false 0.
FUNCTIONS: dict[str, Function] = {
    "abs": Function(np.abs, 1, "abs({0})"),
    "arccos": Function(np.arccos, 1, "math.acos({0})"),
    "arccosh": Function(np.arccosh, 1, "math.acosh({0})"),
    "arcsin": Function(np.arcsin, 1, "math.asin({0})"),
    "arcsinh": Function(np.arcsinh, 1, "math.asinh({0})"),
    "arctan": Function(np.arctan, 1, "math.atan({0})"),
    "arctan2": Function(np.arctan2, 2, "math.atan2({0}, {1})"),
    "arctanh": Function(np.arctanh, 1, "math.atanh({0})"),
    "ceil": Function(np.ceil, 1, "float(math.ceil({0}))"),
    "clip": Function(np.clip, 3, "min(max({0}, {1}), {2})"),
    "cos": Function(np.cos, 1, "math.cos({0})"),
    "cosh": Function(np.cosh, 1, "math.cosh({0})"),
    "exp": Function(np.exp, 1, "math.exp({0})"),
    "floor": Function(np.floor, 1, "float(math.floor({0}))"),
    "hypot": Function(np.hypot, 2, "math.hypot({0}, {1})"),
    "log": Function(np.log, 1, "math.log({0})"),
    "maximum": Function(np.maximum, 2, "max({0}, {1})"),
    "minimum": Function(np.minimum, 2, "min({0}, {1})"),
    "round": Function(np.rint, 1, "float(round({0}))"),
    "sin": Function(np.sin, 1, "math.sin({0})"),
    "sinh": Function(np.sinh, 1, "math.sinh({0})"),
    "sqrt": Function(np.sqrt, 1, "math.sqrt({0})"),
    "tan": Function(np.tan, 1, "math.tan({0})"),
    "tanh": Function(np.tanh, 1, "math.tanh({0})"),
    "where": Function(lambda c, a, b: np.where(c, a, b), 3, "({1} if {0} else {2})"),
    "<": Function(_truth(np.less), 2, "({0} < {1})", True),
    "<=": Function(_truth(np.less_equal), 2, "({0} <= {1})", True),
    ">": Function(_truth(np.greater), 2, "({0} > {1})", True),
    ">=": Function(_truth(np.greater_equal), 2, "({0} >= {1})", True),
    "==": Function(_truth(np.equal), 2, "({0} == {1})", True),
    "!=": Function(_truth(np.not_equal), 2, "({0} != {1})", True),
    "and": Function(_truth(np.logical_and), 2, "({0} and {1})", True),
    "or": Function(_truth(np.logical_or), 2, "({0} or {1})", True),
    "not": Function(_truth(np.logical_not), 1, "(not {0})", True),
}


@dataclass(frozen=True)
class Number:
    """A number."""

    value: float


@dataclass(frozen=True)
class Symbol:
    """The concentration of a species in mol/m³."""

    name: str


@dataclass(frozen=True)
class Time:
    """The time since the beginning in s."""


@dataclass(frozen=True)
class Operation:
    """One of ``+ - * / ^`` of two trees."""

    operator: str
    left: Tree
    right: Tree


@dataclass(frozen=True)
class Call:
    """One of :data:`FUNCTIONS` of trees."""

    function: str
    arguments: tuple[Tree, ...]


Tree = Number | Symbol | Time | Operation | Call
#: Parts of a formula, at most, and how deep they may be in each other to become a program.
MOST_PARTS, MOST_DEPTH = 20_000, 320
ZERO, ONE = Number(0.0), Number(1.0)


def operation(operator: str, left: Tree, right: Tree) -> Tree:
    """A tree with numbers put together and without ``0 +``, ``1 *`` and the like.

    Raises
    ------
    ArithmeticError, ValueError
        Where numbers have no such result (division by zero).
    """
    if isinstance(left, Number) and isinstance(right, Number):
        return _finite(_OPERATORS[operator](left.value, right.value))
    if operator == "/" and right == ZERO:
        raise ZeroDivisionError("division by zero")
    if (operator in "+-" and right == ZERO) or (operator in "*/^" and right == ONE):
        return left
    if (operator == "+" and left == ZERO) or (operator == "*" and left == ONE):
        return right
    if operator == "*" and ZERO in (left, right):
        return ZERO
    if operator == "^" and right == ZERO:
        return ONE
    return Operation(operator, left, right)


def call(function: str, *arguments: Tree) -> Tree:
    """A function of trees, worked out where they are numbers.

    Raises
    ------
    ValueError
        Where numbers have no such result (the logarithm of 0).
    """
    if all(isinstance(a, Number) for a in arguments):
        with np.errstate(all="ignore"):
            values = [a.value for a in arguments if isinstance(a, Number)]
            return _finite(FUNCTIONS[function].value(*values))
    if function == "where":
        condition, one, other = arguments
        if isinstance(condition, Number):
            return one if condition.value else other
        if one == other:
            return one
    return Call(function, arguments)


def _finite(value: Any) -> Number:
    if isinstance(value, complex) or not np.isfinite(value):
        raise ValueError("not a finite real number")
    return Number(float(value))


def children(tree: Tree) -> tuple[Tree, ...]:
    """The trees that a tree is made of."""
    if isinstance(tree, Operation):
        return tree.left, tree.right
    return tree.arguments if isinstance(tree, Call) else ()


def extent(tree: Tree) -> tuple[int, int]:
    """How many different parts a tree has, and how deep they are in each other.

    A tree may have parts in common, which are computed once.
    """
    found: dict[int, int] = {}
    waiting = [tree]
    while waiting:
        node = waiting[-1]
        inner = [found.get(id(child)) for child in children(node)]
        if None in inner:
            waiting += [child for child in children(node) if id(child) not in found]
            continue
        waiting.pop()
        found[id(node)] = 1 + max((depth for depth in inner if depth is not None), default=0)
    return len(found), found[id(tree)]


def nodes(tree: Tree) -> Iterator[Tree]:
    """All parts of a tree, each object once."""
    seen: set[int] = set()
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if id(node) not in seen:
            seen.add(id(node))
            yield node
            waiting += reversed(children(node))


def symbols(tree: Tree) -> Iterator[str]:
    """The species in a tree, perhaps with repetitions."""
    return (node.name for node in nodes(tree) if isinstance(node, Symbol))


def timed(tree: Tree) -> bool:
    """Whether the time is in a tree."""
    return any(isinstance(node, Time) for node in nodes(tree))


def value(tree: Tree, concentrations: Mapping[str, Any], time: Any = 0.0) -> Any:
    """What a tree comes to.

    Parameters
    ----------
    tree
        A formula.
    concentrations
        Numbers or arrays in mol/m³ by species.
    time
        In s.
    """
    known: dict[int, Any] = {}

    def work(node: Tree) -> Any:
        if id(node) in known:
            return known[id(node)]
        if isinstance(node, Number):
            found: Any = node.value
        elif isinstance(node, Symbol):
            if node.name not in concentrations:
                raise InputError("concentrations", list(concentrations), f"with {node.name}")
            found = concentrations[node.name]
        elif isinstance(node, Time):
            found = time
        elif isinstance(node, Operation):
            left, right = np.float64(1.0) * work(node.left), work(node.right)
            found = _OPERATORS[node.operator](left, right)
        else:
            found = FUNCTIONS[node.function].value(*[work(a) for a in node.arguments])
        known[id(node)] = found
        return found

    with np.errstate(all="ignore"):
        return work(tree)
