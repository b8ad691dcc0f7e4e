"""Rate laws of a case file: formulas of species, turned into the trees that chemistry compiles."""

from __future__ import annotations

import ast
from collections.abc import Mapping

from particell.casefile.formula import TIME, Formula
from particell.casefile.scope import Scope
from particell.chemistry.formula import Number, Symbol, Time, Tree, call, operation, timed
from particell.chemistry.lawcode import Law
from particell.units import registry

_SIGNS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "^",
}
_RULES: dict[type[ast.AST], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.And: "and",
    ast.Or: "or",
}


def law_of(key: str, text: str, scope: Scope, molecules: bool) -> Law:
    """The law of a formula of species (in mol/m³), constants and the time t.

    Raises
    ------
    InputError
        For what no formula of a case file has, unknown names, and another unit than mol/m³/s.
    """
    formula = Formula(key, text if text.lstrip().startswith("=") else f"={text}")
    constants = {k: v for k, v in scope.constants.values.items() if k not in scope.species}
    formula.require({*constants, *scope.species, TIME})
    one = registry().Quantity(1.0, "mol/m^3")
    quantities = scope.constants.quantities | dict.fromkeys(scope.species, one)
    quantities.setdefault(TIME, registry().Quantity(1.0, "s"))
    formula.check_unit(quantities, "mol/m^3/s")
    try:
        tree = _tree(formula, formula.tree, constants)
    except (ArithmeticError, ValueError) as error:
        if hasattr(error, "allowed"):
            raise
        raise formula.error(f"a formula with a result ({error})") from None
    if molecules and timed(tree):
        raise formula.error(f"without the time {TIME}, where species are molecules")
    return Law(tree, molecules)


def _tree(formula: Formula, node: ast.expr, constants: Mapping[str, float]) -> Tree:
    if isinstance(node, ast.Constant):
        return Number(float(node.value))  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        if node.id in constants:
            return Number(constants[node.id])
        return Time() if node.id == TIME else Symbol(node.id)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inner = _tree(formula, node.operand, constants)
        return inner if isinstance(node.op, ast.UAdd) else operation("*", Number(-1.0), inner)
    if isinstance(node, ast.BinOp):
        left, right = (_tree(formula, n, constants) for n in (node.left, node.right))
        return operation(_SIGNS[type(node.op)], left, right)
    if isinstance(node, ast.UnaryOp):
        return call("not", _tree(formula, node.operand, constants))
    if isinstance(node, ast.Call):
        assert isinstance(node.func, ast.Name)
        return call(node.func.id, *(_tree(formula, n, constants) for n in node.args))
    if isinstance(node, ast.Compare):
        operands, rule = [node.left, *node.comparators], _RULES[type(node.ops[0])]
    else:
        assert isinstance(node, ast.BoolOp)
        operands, rule = node.values, _RULES[type(node.op)]
    first, *rest = (_tree(formula, n, constants) for n in operands)
    for each in rest:
        first = call(rule, first, each)
    return first
