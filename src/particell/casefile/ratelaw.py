"""Rate laws of a case file: formulas of species, turned into the trees that chemistry compiles."""

from __future__ import annotations

import ast
from collections.abc import Mapping

from particell.casefile.formula import Formula
from particell.casefile.scope import Scope
from particell.chemistry.formula import Law, Number, Symbol, Tree, operation
from particell.units import registry

_SIGNS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "^",
}


def law_of(key: str, text: str, scope: Scope, molecules: bool) -> Law:
    """The law of a formula of species (in mol/m³) and constants.

    Raises
    ------
    InputError
        For other functions than + - * / **, unknown names, and another unit than mol/m³/s.
    """
    formula = Formula(key, text if text.lstrip().startswith("=") else f"={text}")
    constants = {k: v for k, v in scope.constants.values.items() if k not in scope.species}
    formula.require({*constants, *scope.species})
    one = registry().Quantity(1.0, "mol/m^3")
    quantities = scope.constants.quantities | dict.fromkeys(scope.species, one)
    formula.check_unit(quantities, "mol/m^3/s")
    try:
        return Law(_tree(formula, formula.tree, constants), molecules)
    except (ArithmeticError, ValueError) as error:
        if hasattr(error, "allowed"):
            raise
        raise formula.error(f"a formula with a result ({error})") from None


def _tree(formula: Formula, node: ast.expr, constants: Mapping[str, float]) -> Tree:
    if isinstance(node, ast.Constant):
        return Number(float(node.value))  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return Number(constants[node.id]) if node.id in constants else Symbol(node.id)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inner = _tree(formula, node.operand, constants)
        return inner if isinstance(node.op, ast.UAdd) else operation("*", Number(-1.0), inner)
    if isinstance(node, ast.BinOp):
        left, right = (_tree(formula, n, constants) for n in (node.left, node.right))
        return operation(_SIGNS[type(node.op)], left, right)
    raise formula.error("a formula of + - * / and ** alone")
