"""What can be mutated in a source file: one change a line, of what computes.

Operators are turned into their opposites (+ and −, * and /, < and ≥, ``and`` and ``or``, ``min``
and ``max``), a minus or a ``not`` is dropped, constants become twice as large (0 becomes 1),
booleans the other one, the first two arguments of a call change places, and a call or an
assignment to a part of something that stands for itself is left out. Of < the opposite is taken,
not ≤: real numbers that are equal by chance are rare.

Left alone are text, types, imports, decorators, assertions, what is raised and said, and, but in
files that read checkpoints, conditions for raising.
"""

from __future__ import annotations

import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass

OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Lt: ("<", ">="),
    ast.LtE: ("<=", ">"),
    ast.Gt: (">", "<="),
    ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}
SWAPPED = {"min": "max", "max": "min", "floor": "ceil", "ceil": "floor", "sin": "cos", "cos": "sin"}
#: Constants below are guards against a division by zero.
SMALLEST = 1e-100
#: Calls whose arguments may change places, or that only speak.
SILENT = {"min", "max", "warn", "tell", "isinstance", "cast", "Field", "positive", "not_negative"}


@dataclass(frozen=True)
class Mutation:
    """Bytes ``start`` to ``end`` of a file become ``text``; ``line`` is where they begin.

    ``coarse`` is what most often ends in an error of types: taken where there is nothing else.
    """

    start: int
    end: int
    text: str
    line: int
    coarse: bool = False


class Finder:
    """All mutations of one file, in the order of its lines."""

    def __init__(self, source: bytes, refusals: bool = False):
        self.source, self.refusals = source, refusals
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.found: list[Mutation] = []
        self._visit(ast.parse(source))

    def by_line(self) -> dict[int, list[Mutation]]:
        """The mutations of each line that has any."""
        lines: dict[int, list[Mutation]] = {}
        for mutation in self.found:
            lines.setdefault(mutation.line, []).append(mutation)
        fine = {line: [m for m in found if not m.coarse] for line, found in lines.items()}
        return {line: fine[line] or lines[line] for line in sorted(lines)}

    def _span(self, node: ast.AST) -> tuple[int, int]:
        a, b = self.starts[node.lineno - 1], self.starts[node.end_lineno - 1]  # type: ignore[attr-defined]
        return a + node.col_offset, b + node.end_col_offset  # type: ignore[attr-defined]

    def _add(self, start: int, end: int, text: str, coarse: bool = False) -> None:
        line = sum(s <= start for s in self.starts)
        self.found.append(Mutation(start, end, text, line, coarse))

    def _visit(self, node: ast.AST) -> None:
        for child in self._computing(node):
            self._mutate(child)
            self._visit(child)

    def _computing(self, node: ast.AST) -> Iterator[ast.AST]:
        """Parts of a node that compute."""
        if isinstance(node, ast.keyword) and node.arg == "strict":  # of zip, a check
            return
        for name, part in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "type_params"):
                continue
            for child in part if isinstance(part, list) else [part]:
                if isinstance(child, ast.AST) and not self._speaks(child):
                    yield child

    def _speaks(self, node: ast.AST) -> bool:
        kinds = (ast.Import, ast.ImportFrom, ast.Raise, ast.Assert, ast.JoinedStr)
        if isinstance(node, ast.FunctionDef) and node.name in ("__repr__", "__str__"):
            return True
        if isinstance(node, ast.If) and isinstance(node.body[0], ast.Raise) and not node.orelse:
            return not self.refusals
        return isinstance(node, kinds)

    def _mutate(self, node: ast.AST) -> None:
        if isinstance(node, ast.BinOp):
            texts = (node.left, node.right)
            if not any(isinstance(t, ast.JoinedStr) or _is_text(t) for t in texts):
                self._operator(node.left, node.op, node.right)
        elif isinstance(node, ast.BoolOp):
            self._operator(node.values[0], node.op, node.values[1])
        elif isinstance(node, ast.Compare):
            self._operator(node.left, node.ops[0], node.comparators[0])
        elif isinstance(node, ast.AugAssign) and type(node.op) in OPERATORS:
            self._operator(node.target, node.op, node.value)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            start = self._span(node)[0]
            self._add(start, start + (1 if isinstance(node.op, ast.USub) else 4), "")
        elif isinstance(node, ast.Constant):
            self._constant(node)
        elif isinstance(node, ast.Call):
            self._call(node)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            if _name(node.value) not in SILENT:
                self._add(*self._span(node), "pass")
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Attribute):
            self._add(*self._span(node), "pass")

    def _operator(self, left: ast.AST, op: ast.AST, right: ast.AST) -> None:
        if type(op) not in OPERATORS:
            return
        old, new = OPERATORS[type(op)]
        end, start = self._span(left)[1], self._span(right)[0]
        place = self.source.find(old.encode(), end, start)
        if place >= 0:
            self._add(place, place + len(old), new)

    def _constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add(*self._span(node), str(not value))
        elif isinstance(value, int | float) and not 0 < value < SMALLEST:
            self._add(*self._span(node), repr(2 * value if value else value + 1))

    def _call(self, node: ast.Call) -> None:
        name = _name(node)
        if name in SWAPPED:
            end = self._span(node.func)[1]
            self._add(end - len(name), end, SWAPPED[name])
        first, second = (*node.args, None, None)[:2]
        plain = ast.Name | ast.Attribute | ast.Subscript | ast.BinOp | ast.Call
        if isinstance(first, plain) and isinstance(second, plain) and name not in SILENT:
            (a, b), (c, d) = self._span(first), self._span(second)
            s = self.source
            self._add(a, d, (s[c:d] + s[b:c] + s[a:b]).decode(), coarse=True)


def _name(call: ast.Call) -> str:
    function = call.func
    return str(getattr(function, "attr", getattr(function, "id", "")))


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def chosen(source: bytes, seed: str, refusals: bool = False) -> list[Mutation]:
    """One mutation for each line that computes, the same for the same seed and source."""
    lines = Finder(source, refusals).by_line()
    return [random.Random(f"{seed}:{line}").choice(found) for line, found in lines.items()]


def applied(source: bytes, mutation: Mutation) -> bytes:
    """The source with the mutation; what no longer compiles raises a :class:`SyntaxError`."""
    m = mutation
    mutant = source[: m.start] + m.text.encode() + source[m.end :]
    compile(mutant, "mutant", "exec")
    return mutant
