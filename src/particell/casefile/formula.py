"""Formulas of a case file: arithmetic on its constants and on positions, never executed as code.

A formula is text after ``=``. Python's own parser turns it into a tree; everything that is not a
number, a name, an operator or a function of :data:`FUNCTIONS` is refused, and the tree is worked
out node by node with numpy, in the order in which Python would. It is worked out a second time with
units, which finds lengths that are added to times.
"""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from particell.compute import expressions as loops
from particell.errors import InputError, unknown_name
from particell.materials import AVOGADRO, BOLTZMANN
from particell.units import registry

#: Name: function and number of arguments.
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "abs": (np.abs, 1),
    "arctan2": (np.arctan2, 2),
    "ceil": (np.ceil, 1),
    "clip": (np.clip, 3),
    "cos": (np.cos, 1),
    "exp": (np.exp, 1),
    "floor": (np.floor, 1),
    "hypot": (np.hypot, 2),
    "log": (np.log, 1),
    "maximum": (np.maximum, 2),
    "minimum": (np.minimum, 2),
    "round": (np.rint, 1),
    "sin": (np.sin, 1),
    "sqrt": (np.sqrt, 1),
    "tan": (np.tan, 1),
    "tanh": (np.tanh, 1),
    "where": (np.where, 3),
}
_NUMPY = {name: function for name, (function, _) in FUNCTIONS.items()}
#: Whole numbers of metres are not whole numbers of micrometres.
_PLAIN = ("ceil", "floor", "round")
#: Constants that are always there: value and unit.
BUILT_IN = {"pi": (math.pi, ""), "avogadro": (AVOGADRO, "1/mol"), "boltzmann": (BOLTZMANN, "J/K")}
AXES = ("x", "y", "z")
TIME = "t"
RESERVED = (*FUNCTIONS, *BUILT_IN, *AXES, TIME)

_BINARY: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.And: lambda a, b: a & b if isinstance(a, loops.Node) else np.logical_and(a, b),
    ast.Or: lambda a, b: a | b if isinstance(a, loops.Node) else np.logical_or(a, b),
}
#: Functions that formulas have where they become loops.
_IN_LOOPS: dict[str, Callable[..., Any]] = {
    "abs": lambda x: loops.where(x < 0.0, -x, x),
    "clip": lambda x, low, high: loops.minimum(loops.maximum(x, low), high),
    "cos": loops.cos,
    "exp": loops.exp,
    "hypot": lambda x, y: loops.sqrt(x * x + y * y),
    "log": loops.log,
    "maximum": loops.maximum,
    "minimum": loops.minimum,
    "sin": loops.sin,
    "sqrt": loops.sqrt,
    "tan": lambda x: loops.sin(x) / loops.cos(x),
    "tanh": loops.tanh,
    "where": loops.where,
}
_UNARY: dict[type[ast.AST], Callable[[Any], Any]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: np.logical_not,
}
LONGEST, DEEPEST = 1000, 60
ALLOWED = "'=' and a formula of numbers, constants, + - * / ** < > and " + ", ".join(FUNCTIONS)


def is_formula(value: object) -> bool:
    """Whether a value of a case file is a formula."""
    return isinstance(value, str) and value.lstrip().startswith("=")


@dataclass(frozen=True)
class Formula:
    """A formula that holds nothing but arithmetic.

    Parameters
    ----------
    key
        What it is of, for messages.
    text
        As it stands in the file.

    Attributes
    ----------
    names
        The constants, coordinates or species in it.

    Raises
    ------
    InputError
        Where there is anything else in it.
    """

    key: str
    text: str
    tree: ast.expr = field(init=False, compare=False, repr=False)
    names: frozenset[str] = field(init=False, compare=False)

    def __post_init__(self) -> None:
        body = self.text.strip().removeprefix("=").strip()
        try:
            if len(body) > LONGEST:
                raise self.error(f"at most {LONGEST} characters long")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's, about things that are refused below
                tree = ast.parse(body, mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            if isinstance(error, InputError):
                raise
            raise self.error(ALLOWED) from None
        names: set[str] = set()
        self._check(tree, names, 0)
        object.__setattr__(self, "tree", tree)
        object.__setattr__(self, "names", frozenset(names))

    def error(self, allowed: str) -> InputError:
        """That this formula is not allowed."""
        return InputError(self.key, self.text, allowed)

    def _check(self, node: ast.AST, names: set[str], depth: int) -> None:
        if depth > DEEPEST:
            raise self.error(f"nested at most {DEEPEST} times")
        inner: list[ast.expr]
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            self._number(node)
            return
        if isinstance(node, ast.Name):
            if node.id in FUNCTIONS:
                raise self.error(f"written with arguments where it says '{node.id}'")
            names.add(node.id)
            return
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            inner = [node.left, node.right]
        elif isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
            inner = [node.operand]
        elif isinstance(node, ast.BoolOp):
            inner = node.values
        elif isinstance(node, ast.Compare) and all(type(op) in _BINARY for op in node.ops):
            inner = [node.left, *node.comparators]
            if len(inner) > 2:
                raise self.error("of one comparison at a time: a < x and x < b")
        elif isinstance(node, ast.Call):
            inner = self._arguments(node)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
            raise self.error("with powers written as **")
        else:
            raise self.error(ALLOWED)
        for child in inner:
            self._check(child, names, depth + 1)

    def _arguments(self, call: ast.Call) -> list[ast.expr]:
        if not isinstance(call.func, ast.Name) or call.keywords:
            raise self.error(ALLOWED)
        name = call.func.id
        if name not in FUNCTIONS:
            raise unknown_name(f"function in {self.key}", name, FUNCTIONS)
        number = FUNCTIONS[name][1]
        starred = any(isinstance(argument, ast.Starred) for argument in call.args)
        if len(call.args) != number or starred:
            raise self.error(f"with {number} argument{'s'[: number > 1]} of {name}")
        return call.args

    def _number(self, node: ast.Constant) -> float:
        try:
            number = float(node.value)  # type: ignore[arg-type]
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error("of finite numbers")
        return number

    def require(self, known: Collection[str]) -> None:
        """Refuse names that are not known."""
        for name in sorted(self.names):
            if name not in known:
                raise unknown_name(f"name in {self.key}", name, known)

    def value(self, values: Mapping[str, Any]) -> Any:
        """What it comes to, with numbers or arrays for its names.

        Raises
        ------
        InputError
            Where numbers have no such result.
        """
        try:
            with np.errstate(all="ignore"):
                found = self._value(self.tree, values)
        except (ArithmeticError, ValueError, TypeError) as error:
            raise self._without_result(error) from None
        if isinstance(found, complex):
            raise self.error("a formula with a real result")
        return found

    def traced(self, values: Mapping[str, Any]) -> Any:
        """What a law computes of it, with what laws are given for its names.

        Raises
        ------
        InputError
            For what loops cannot do.
        """
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Not):
                raise self.error("a formula without 'not', in a force")
            name = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
            if name and name not in _IN_LOOPS:
                raise self.error(f"a formula without {name}, in a force")
        return self._value(self.tree, values, _IN_LOOPS)

    def _without_result(self, error: Exception) -> InputError:
        """What is wrong where working it out fails."""
        if isinstance(error, InputError):
            return error
        return self.error(f"a formula with a result ({error})")

    def _value(
        self,
        node: ast.expr,
        values: Mapping[str, Any],
        functions: Mapping[str, Callable[..., Any]] = _NUMPY,
    ) -> Any:
        if isinstance(node, ast.Constant):
            return self._number(node)
        if isinstance(node, ast.Name):
            return values[node.id]
        if isinstance(node, ast.UnaryOp):
            return _UNARY[type(node.op)](self._value(node.operand, values, functions))
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            arguments = [self._value(a, values, functions) for a in node.args]
            return self._call(functions[node.func.id], node.func.id, arguments)
        if isinstance(node, ast.BinOp):
            operands, rule = [node.left, node.right], _BINARY[type(node.op)]
        elif isinstance(node, ast.BoolOp):
            operands, rule = node.values, _BINARY[type(node.op)]
        else:
            assert isinstance(node, ast.Compare)
            operands, rule = [node.left, *node.comparators], _BINARY[type(node.ops[0])]
        found = self._value(operands[0], values, functions)
        for operand in operands[1:]:
            found = rule(found, self._value(operand, values, functions))
        return found

    def _call(self, function: Callable[..., Any], name: str, arguments: list[Any]) -> Any:
        if name in _PLAIN and not getattr(arguments[0], "unitless", True):
            raise self.error(f"with a number without unit in {name}")
        return function(*arguments)

    def dimension(self, quantities: Mapping[str, Any]) -> Any:
        """Its result with units: one of pint's quantities.

        Raises
        ------
        InputError
            Where units do not go together.
        """
        import pint

        units = registry()
        try:
            with np.errstate(all="ignore"):
                found = self._value(self.tree, quantities)
        except pint.PintError as error:
            raise self.error(f"a formula whose units go together ({error})") from None
        except (ArithmeticError, ValueError, TypeError) as error:
            raise self._without_result(error) from None
        return found if hasattr(found, "dimensionality") else units.Quantity(found, "")

    def check_unit(self, quantities: Mapping[str, Any], unit: str) -> None:
        """Refuse a result of another dimension than a unit's; zero has any."""
        found = self.dimension(quantities)
        if found.dimensionless and not np.any(found.magnitude):
            return
        target = registry().Unit(unit)
        moles = found.dimensionality.get("[substance]", 0)
        if moles and "[substance]" not in target.dimensionality:
            found = found * registry().Quantity("avogadro_constant") ** moles
        if found.dimensionality != target.dimensionality:
            words = f"a formula in {unit or 'plain numbers'}"
            raise self.error(f"{words} ('{found.units}' is of another dimension)")
