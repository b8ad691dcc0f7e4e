"""Formulas of species: + - * / and powers, as trees that are expanded, split and compiled.

Trees come from a file's MathML (see :mod:`particell.chemistry.sbml`). They are turned into machine
code node by node: the only names in the compiled function are its arguments, and no text of the
file is ever looked at as a program.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numba import njit

from particell.errors import unknown_name
from particell.materials import AVOGADRO

_OPERATORS: dict[str, tuple[Callable[[Any, Any], Any], type[ast.operator]]] = {
    "+": (lambda a, b: a + b, ast.Add),
    "-": (lambda a, b: a - b, ast.Sub),
    "*": (lambda a, b: a * b, ast.Mult),
    "/": (lambda a, b: a / b, ast.Div),
    "^": (lambda a, b: a**b, ast.Pow),
}
#: Highest power that is expanded.
HIGHEST_POWER = 8

#: Exponents of species, sorted by name: ``(("A", 2), ("B", 1))`` is A²B.
Monomial = tuple[tuple[str, int], ...]
Polynomial = dict[Monomial, float]


@dataclass(frozen=True)
class Number:
    """A number."""

    value: float


@dataclass(frozen=True)
class Symbol:
    """The concentration of a species in mol/m³."""

    name: str


@dataclass(frozen=True)
class Operation:
    """One of ``+ - * / ^`` of two trees."""

    operator: str
    left: Tree
    right: Tree


Tree = Number | Symbol | Operation
ZERO, ONE = Number(0.0), Number(1.0)


def operation(operator: str, left: Tree, right: Tree) -> Tree:
    """A tree with numbers put together and without ``0 +``, ``1 *`` and the like.

    Raises
    ------
    ArithmeticError, ValueError
        Where numbers have no such result (division by zero).
    """
    if isinstance(left, Number) and isinstance(right, Number):
        value = _OPERATORS[operator][0](left.value, right.value)
        if isinstance(value, complex) or value - value != 0:
            raise ValueError("not a finite real number")
        return Number(float(value))
    if operator == "/" and right == ZERO:
        raise ZeroDivisionError("division by zero")
    if (operator in "+-" and right == ZERO) or (operator in "*/^" and right == ONE):
        return left
    if (operator == "+" and left == ZERO) or (operator == "*" and left == ONE):
        return right
    if operator == "*" and ZERO in (left, right):
        return ZERO
    return Operation(operator, left, right)


def symbols(tree: Tree) -> Iterator[str]:
    """The species in a tree, with repetitions."""
    if isinstance(tree, Symbol):
        yield tree.name
    elif isinstance(tree, Operation):
        yield from symbols(tree.left)
        yield from symbols(tree.right)


def polynomial(tree: Tree) -> Polynomial | None:
    """The tree multiplied out; None where it is no polynomial of the species."""
    if isinstance(tree, Number):
        return {(): tree.value} if tree.value else {}
    if isinstance(tree, Symbol):
        return {((tree.name, 1),): 1.0}
    left = polynomial(tree.left)
    if left is None:
        return None
    if tree.operator == "^":
        return _power(left, tree.right)
    right = polynomial(tree.right)
    if right is None:
        return None
    if tree.operator == "*":
        return _product(left, right)
    if tree.operator == "/":
        constant = right.get((), 0.0) if set(right) == {()} else 0.0
        return {m: c / constant for m, c in left.items()} if constant else None
    sign = 1.0 if tree.operator == "+" else -1.0
    total = dict(left)
    for monomial, coefficient in right.items():
        total[monomial] = total.get(monomial, 0.0) + sign * coefficient
    return {m: c for m, c in total.items() if c}


def _power(base: Polynomial, exponent: Tree) -> Polynomial | None:
    if not isinstance(exponent, Number) or exponent.value not in range(HIGHEST_POWER + 1):
        return None
    result: Polynomial = {(): 1.0}
    for _ in range(int(exponent.value)):
        result = _product(result, base)
    return result


def _product(left: Polynomial, right: Polynomial) -> Polynomial:
    total: Polynomial = {}
    for one, a in left.items():
        for other, b in right.items():
            exponents = dict(one)
            for name, power in other:
                exponents[name] = exponents.get(name, 0) + power
            key = tuple(sorted(exponents.items()))
            total[key] = total.get(key, 0.0) + a * b
    return {m: c for m, c in total.items() if c}


def split(tree: Tree) -> tuple[Tree, Tree] | None:
    """Two trees without differences whose difference the tree is; None where there are none.

    Differences are taken out of sums, products, and numerators; negative numbers count as such.
    """
    if isinstance(tree, Number):
        return (tree, ZERO) if tree.value >= 0 else (ZERO, Number(-tree.value))
    if isinstance(tree, Symbol):
        return tree, ZERO
    left, right = split(tree.left), split(tree.right)
    if left is None or right is None:
        return None
    (a, b), (c, d) = left, right
    if tree.operator == "+":
        return operation("+", a, c), operation("+", b, d)
    if tree.operator == "-":
        return operation("+", a, d), operation("+", b, c)
    if tree.operator == "*":
        return (
            operation("+", operation("*", a, c), operation("*", b, d)),
            operation("+", operation("*", a, d), operation("*", b, c)),
        )
    if tree.operator == "/" and d == ZERO:
        return operation("/", a, c), operation("/", b, c) if b != ZERO else ZERO
    if tree.operator == "^" and b == ZERO:
        return operation("^", a, tree.right), ZERO
    return None


@dataclass(frozen=True)
class Law:
    """A rate that Numba compiles once the species' columns are known.

    Parameters
    ----------
    tree
        The rate in mol/m³/s, of concentrations in mol/m³.
    molecules
        Whether the species are molecules: then the function is the propensity ``f(N, V, k)``, the
        rate at the concentrations N/(V 𝒩) times V 𝒩; else it is ``f(C, k)``.
    """

    tree: Tree
    molecules: bool = False

    def bind(self, names: Sequence[str]) -> Any:
        """The compiled function.

        Parameters
        ----------
        names
            The species in the order of the function's array.
        """
        columns = {name: k for k, name in enumerate(names)}
        for name in symbols(self.tree):
            if name not in columns:
                raise unknown_name("species in a rate law", name, names)
        body = _expression(self.tree, columns, self.molecules)
        arguments = ["C", "k"]
        if self.molecules:
            body = ast.BinOp(body, ast.Mult(), _molecules_per_concentration())
            arguments = ["N", "V", "k"]
        body = ast.BinOp(ast.Name("k", ast.Load()), ast.Mult(), body)
        function = ast.Lambda(
            ast.arguments([], [ast.arg(a) for a in arguments], None, [], [], None, []), body
        )
        code = compile(ast.fix_missing_locations(ast.Expression(function)), "<rate law>", "eval")
        # Nothing can be called or looked up: the tree above has arguments, numbers and operators.
        return njit(error_model="numpy")(eval(code, {"__builtins__": {}}))


def _molecules_per_concentration() -> ast.expr:
    return ast.BinOp(ast.Name("V", ast.Load()), ast.Mult(), ast.Constant(AVOGADRO))


def _expression(tree: Tree, columns: Mapping[str, int], molecules: bool) -> ast.expr:
    if isinstance(tree, Number):
        return ast.Constant(float(tree.value))
    if isinstance(tree, Symbol):
        array = ast.Name("N" if molecules else "C", ast.Load())
        item: ast.expr = ast.Subscript(array, ast.Constant(columns[tree.name]), ast.Load())
        return ast.BinOp(item, ast.Div(), _molecules_per_concentration()) if molecules else item
    left = _expression(tree.left, columns, molecules)
    if tree.operator == "^" and isinstance(tree.right, Number):
        value = tree.right.value
        if value == int(value) and abs(value) <= HIGHEST_POWER:  # exact and fast
            return ast.BinOp(left, ast.Pow(), ast.Constant(int(value)))
    right = _expression(tree.right, columns, molecules)
    return ast.BinOp(left, _OPERATORS[tree.operator][1](), right)
