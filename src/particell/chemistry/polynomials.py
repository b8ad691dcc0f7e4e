"""Formulas multiplied out, and taken apart into what adds and what is taken away."""

from __future__ import annotations

from particell.chemistry.formula import (
    ONE,
    ZERO,
    Call,
    Number,
    Operation,
    Symbol,
    Time,
    Tree,
    call,
    operation,
)

#: Highest power that is expanded.
HIGHEST_POWER = 8
#: A formula of more terms than this is left as it is.
MOST_TERMS = 200
#: Functions that are never negative.
_POSITIVE = (
    *("abs", "arccos", "arccosh", "cosh", "exp", "hypot", "sqrt"),
    *("<", "<=", ">", ">=", "==", "!=", "and", "or", "not"),
)

#: Exponents of species, sorted by name: ``(("A", 2), ("B", 1))`` is A²B.
Monomial = tuple[tuple[str, int], ...]
Polynomial = dict[Monomial, float]


def polynomial(tree: Tree) -> Polynomial | None:
    """The tree multiplied out; None where it is no polynomial of the species, or a long one."""
    known: dict[int, Polynomial | None] = {}

    def expand(node: Tree) -> Polynomial | None:
        if id(node) not in known:
            found = _expand(node)
            known[id(node)] = None if found is not None and len(found) > MOST_TERMS else found
        return known[id(node)]

    def _expand(node: Tree) -> Polynomial | None:
        if isinstance(node, Number):
            return {(): node.value} if node.value else {}
        if isinstance(node, Symbol):
            return {((node.name, 1),): 1.0}
        if not isinstance(node, Operation):
            return None
        left = expand(node.left)
        if left is None:
            return None
        if node.operator == "^":
            return _power(left, node.right)
        right = expand(node.right)
        if right is None:
            return None
        if node.operator == "*":
            return _product(left, right)
        if node.operator == "/":
            constant = right.get((), 0.0) if set(right) == {()} else 0.0
            return {m: c / constant for m, c in left.items()} if constant else None
        return _sum(left, right, 1.0 if node.operator == "+" else -1.0)

    return expand(tree)


def _sum(left: Polynomial, right: Polynomial, sign: float) -> Polynomial:
    total = dict(left)
    for monomial, coefficient in right.items():
        total[monomial] = total.get(monomial, 0.0) + sign * coefficient
    return {m: c for m, c in total.items() if c}


def _power(base: Polynomial, exponent: Tree) -> Polynomial | None:
    if not isinstance(exponent, Number) or exponent.value not in range(HIGHEST_POWER + 1):
        return None
    result: Polynomial | None = {(): 1.0}
    for _ in range(int(exponent.value)):
        if result is not None:
            result = _product(result, base)
    return result


def _product(left: Polynomial, right: Polynomial) -> Polynomial | None:
    if len(left) * len(right) > MOST_TERMS**2:
        return None
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
    """Two trees that are never negative whose difference the tree is; None where none are found.

    Concentrations and the time count as never negative. Differences are taken out of sums,
    products, numerators and choices; negative numbers count as such.
    """
    known: dict[int, tuple[Tree, Tree] | None] = {}

    def parts(node: Tree) -> tuple[Tree, Tree] | None:
        if id(node) not in known:
            known[id(node)] = _parts(node)
        return known[id(node)]

    def _parts(node: Tree) -> tuple[Tree, Tree] | None:
        if isinstance(node, Number):
            return (node, ZERO) if node.value >= 0 else (ZERO, Number(-node.value))
        if isinstance(node, Symbol | Time):
            return node, ZERO
        if isinstance(node, Call):
            return _of_function(node, [parts(a) for a in node.arguments])
        left = parts(node.left)
        if node.operator == "^":
            even = isinstance(node.right, Number) and node.right.value % 2 == 0
            return (node, ZERO) if even or (left is not None and left[1] == ZERO) else None
        right = parts(node.right)
        if left is None or right is None:
            return None
        return _of_operation(node.operator, left, right)

    return parts(tree)


def _of_operation(
    operator: str, left: tuple[Tree, Tree], right: tuple[Tree, Tree]
) -> tuple[Tree, Tree] | None:
    (a, b), (c, d) = left, right
    if operator == "+":
        return operation("+", a, c), operation("+", b, d)
    if operator == "-":
        return operation("+", a, d), operation("+", b, c)
    if operator == "*":
        return (
            operation("+", operation("*", a, c), operation("*", b, d)),
            operation("+", operation("*", a, d), operation("*", b, c)),
        )
    if d == ZERO:
        return operation("/", a, c), operation("/", b, c) if b != ZERO else ZERO
    return None


def _of_function(node: Call, arguments: list[tuple[Tree, Tree] | None]) -> tuple[Tree, Tree] | None:
    if node.function in _POSITIVE:
        return node, ZERO
    if node.function == "where" and arguments[1] is not None and arguments[2] is not None:
        (a, b), (c, d) = arguments[1], arguments[2]
        condition = node.arguments[0]
        return call("where", condition, a, c), call("where", condition, b, d)
    inner = [a for a in arguments if a is not None and a[1] == ZERO]
    every = ("ceil", "clip", "floor", "minimum", "round", "tanh", "arctan", "arcsinh", "sinh")
    if node.function in every and len(inner) == len(arguments):
        return node, ZERO
    if node.function == "maximum" and inner:
        return node, ZERO
    return None


def root(tree: Tree, degree: Tree) -> Tree:
    """The root of a degree."""
    if degree == Number(2.0):
        return call("sqrt", tree)
    return operation("^", tree, operation("/", ONE, degree))
