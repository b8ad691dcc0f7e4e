"""MathML of an SBML file, as libSBML has parsed it, as trees."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, reduce
from itertools import pairwise
from typing import Any

from particell.chemistry.formula import (
    MOST_PARTS,
    ONE,
    ZERO,
    Call,
    Number,
    Tree,
    call,
    extent,
    operation,
)
from particell.chemistry.polynomials import root
from particell.errors import InputError
from particell.materials import AVOGADRO

Lookup = Callable[[str], Tree]
TOO_LARGE = f"one of at most {MOST_PARTS} parts"
#: The same of functions, by an estimate that may be too large.
MOST_WRITTEN_OUT = 1_000_000
#: Functions within functions.
DEEPEST = 50
#: What has no value: NaN.
UNDEFINED = Call("sqrt", (Number(-1.0),))

_OPERATORS = {"PLUS": "+", "TIMES": "*", "DIVIDE": "/", "POWER": "^", "FUNCTION_POWER": "^"}
_FUNCTIONS = {
    "ABS": "abs", "CEILING": "ceil", "EXP": "exp", "FLOOR": "floor", "LN": "log",
    "SIN": "sin", "COS": "cos", "TAN": "tan", "SINH": "sinh", "COSH": "cosh", "TANH": "tanh",
    "ARCSIN": "arcsin", "ARCCOS": "arccos", "ARCTAN": "arctan", "ARCSINH": "arcsinh",
    "ARCCOSH": "arccosh", "ARCTANH": "arctanh",
}  # fmt: skip
#: One over the function, or the function of one over the argument.
_INVERSE = {"SEC": "cos", "CSC": "sin", "COT": "tan", "SECH": "cosh", "CSCH": "sinh",
            "COTH": "tanh"}  # fmt: skip
_OF_INVERSE = {"ARCSEC": "arccos", "ARCCSC": "arcsin", "ARCCOT": "arctan", "ARCSECH": "arccosh",
               "ARCCSCH": "arcsinh", "ARCCOTH": "arctanh"}  # fmt: skip
_RELATIONS = {"EQ": "==", "GEQ": ">=", "GT": ">", "LEQ": "<=", "LT": "<"}
_CHAINS = {"FUNCTION_MAX": "maximum", "FUNCTION_MIN": "minimum", "LOGICAL_AND": "and",
           "LOGICAL_OR": "or"}  # fmt: skip
_EMPTY = {"PLUS": 0.0, "TIMES": 1.0, "LOGICAL_AND": 1.0, "LOGICAL_OR": 0.0, "LOGICAL_XOR": 0.0}
_CONSTANTS = {"CONSTANT_E": math.e, "CONSTANT_PI": math.pi, "CONSTANT_TRUE": 1.0,
              "CONSTANT_FALSE": 0.0, "NAME_AVOGADRO": AVOGADRO}  # fmt: skip


def refuse_growth(model: Any) -> None:
    """Refuse functions of a file that call each other until nobody can follow.

    Raises
    ------
    InputError
        Naming the function that is too large with all that it calls, or calls itself.
    """
    definitions = model.getListOfFunctionDefinitions()
    functions = {f.getId(): f.getMath() for f in (definitions[k] for k in range(len(definitions)))}
    sizes: dict[str, int] = {}

    def size(node: Any, within: tuple[str, ...]) -> int:
        total = 1 + sum(size(node.getChild(k), within) for k in range(node.getNumChildren()))
        name = node.getName()
        if node.isFunction() and name in functions and functions[name] is not None:
            total *= size_of(name, within)
        if total > MOST_WRITTEN_OUT:
            raise InputError(f"function '{within[-1]}'", "with all that it calls", TOO_LARGE)
        return total

    def size_of(name: str, within: tuple[str, ...]) -> int:
        if name in within:
            raise InputError(f"function '{name}'", "one that calls itself", TOO_LARGE)
        if name not in sizes:
            sizes[name] = size(functions[name], (*within, name))
        return sizes[name]

    try:
        for name, body in functions.items():
            if body is not None:
                size_of(name, ())
    except RecursionError:
        raise InputError("functions", "nested", "nested less deeply") from None


@cache
def _names() -> dict[int, str]:
    """The names of libSBML's kinds of nodes, without ``AST_``."""
    import libsbml

    found = {v: k[4:] for k, v in vars(libsbml).items() if k.startswith("AST_") and v is not None}
    return {v: k for v, k in found.items() if isinstance(v, int)}


def tree_of(
    node: Any, lookup: Lookup, time: Tree, where: str, functions: Mapping[str, Any]
) -> Tree:
    """A formula of libSBML as a tree.

    Parameters
    ----------
    node
        Its root.
    lookup
        What a name stands for.
    time
        What the time stands for, in the file's unit.
    where
        The formula, for messages.
    functions
        The file's own functions, by name.

    Raises
    ------
    InputError
        For functions that have no value here (delays, rates of change), and numbers without one.
    """

    def fail(part: Any, allowed: str) -> InputError:
        import libsbml

        text = " ".join(str(libsbml.formulaToL3String(part)).split())
        return InputError(where, text, allowed)

    def own(part: Any, arguments: Sequence[Tree], depth: int) -> Tree:
        """A function of the file with its arguments put in."""
        body = functions[part.getName()].getMath()
        last = body.getNumChildren() - 1 if body is not None else -1
        if last != len(arguments) or depth > DEEPEST:
            raise fail(part, "a call of a function with its arguments")
        bound = {body.getChild(k).getName(): a for k, a in enumerate(arguments)}
        return build(body.getChild(last), lambda n: bound[n] if n in bound else lookup(n), depth)

    left = MOST_PARTS

    def build(part: Any, lookup: Lookup, depth: int) -> Tree:
        nonlocal left
        left -= 1
        if left < 0:
            raise InputError(where, "a formula with all its functions", TOO_LARGE)
        kind = _names().get(part.getType(), "")
        if kind == "NAME":
            return lookup(part.getName())
        if kind == "NAME_TIME":
            return time
        if kind in _CONSTANTS:
            return Number(_CONSTANTS[kind])
        if part.isNumber():
            value = float(part.getValue())
            if not math.isfinite(value):
                raise fail(part, "a finite number")
            return Number(value)
        try:
            parts = [build(part.getChild(k), lookup, depth) for k in range(part.getNumChildren())]
            if kind == "FUNCTION" and part.getName() in functions:
                return own(part, parts, depth + 1)
            found = _combined(kind, parts)
        except (ArithmeticError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise fail(part, f"a number ({error})") from None
        if found is None:
            raise fail(part, "of arithmetic, its functions and choices: no delay, no rateOf")
        return found

    try:
        found = build(node, lookup, 0)
    except RecursionError:
        raise InputError(where, "a formula", "nested less deeply") from None
    if extent(found)[0] > MOST_PARTS:
        raise InputError(where, "a formula with all that it refers to", TOO_LARGE)
    return found


def _combined(kind: str, parts: Sequence[Tree]) -> Tree | None:
    """One of MathML's functions; None where it is none that has a value here."""
    name = kind.removeprefix("FUNCTION_")
    if not parts:
        return Number(_EMPTY[kind]) if kind in _EMPTY else None
    if kind == "MINUS":
        return operation("*", Number(-1.0), parts[0]) if len(parts) == 1 else _minus(*parts)
    if kind in _OPERATORS:
        return reduce(lambda a, b: operation(_OPERATORS[kind], a, b), parts)
    if kind in _CHAINS:
        return reduce(lambda a, b: call(_CHAINS[kind], a, b), parts)
    if kind.startswith("RELATIONAL_"):
        return _relation(kind.removeprefix("RELATIONAL_"), parts)
    if name in _FUNCTIONS:
        return call(_FUNCTIONS[name], parts[0])
    if name in _INVERSE:
        return operation("/", ONE, call(_INVERSE[name], parts[0]))
    if name in _OF_INVERSE:
        return call(_OF_INVERSE[name], operation("/", ONE, parts[0]))
    rule = _OTHERS.get(kind)
    return rule(*parts) if rule else None


def _minus(left: Tree, right: Tree) -> Tree:
    return operation("-", left, right)


def _relation(name: str, parts: Sequence[Tree]) -> Tree:
    """a < b < c holds where both do."""
    if name == "NEQ":
        return call("!=", *parts)
    pairs = [call(_RELATIONS[name], a, b) for a, b in pairwise(parts)]
    return reduce(lambda a, b: call("and", a, b), pairs)


def _logarithm(*parts: Tree) -> Tree:
    base, number = parts if len(parts) == 2 else (Number(10.0), parts[0])
    return operation("/", call("log", number), call("log", base))


def _root(*parts: Tree) -> Tree:
    degree, number = parts if len(parts) == 2 else (Number(2.0), parts[0])
    return root(number, degree)


def _piecewise(*parts: Tree) -> Tree:
    """Pairs of a value and its condition, perhaps another value at the end.

    Without one there is no value where no condition holds.
    """
    pairs = list(zip(parts[::2], parts[1::2], strict=False))
    total = parts[-1] if len(parts) % 2 else UNDEFINED
    for value, condition in reversed(pairs):
        total = call("where", condition, value, total)
    return total


def _xor(*parts: Tree) -> Tree:
    truths = [call("!=", part, ZERO) for part in parts]
    return reduce(lambda a, b: call("!=", a, b), truths)


def _quotient(a: Tree, b: Tree) -> Tree:
    """The whole part of a/b, towards zero."""
    ratio = operation("/", a, b)
    return call("where", call("<", ratio, ZERO), call("ceil", ratio), call("floor", ratio))


def _factorial(number: Tree) -> Tree:
    if not isinstance(number, Number):
        raise ValueError("the factorial of what varies")
    return Number(math.gamma(number.value + 1.0))


_OTHERS: dict[str, Callable[..., Tree]] = {
    "FUNCTION_LOG": _logarithm,
    "FUNCTION_ROOT": _root,
    "FUNCTION_PIECEWISE": _piecewise,
    "FUNCTION_QUOTIENT": _quotient,
    "FUNCTION_REM": lambda a, b: _minus(a, operation("*", b, _quotient(a, b))),
    "FUNCTION_FACTORIAL": _factorial,
    "LOGICAL_NOT": lambda a: call("not", a),
    "LOGICAL_XOR": _xor,
    "LOGICAL_IMPLIES": lambda a, b: call("or", call("not", a), b),
}
