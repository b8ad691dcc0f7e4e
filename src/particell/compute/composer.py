"""Loops over neighbours, generated from what laws compute.

A :class:`Plan` holds the expressions (:mod:`particell.compute.expressions`) that the laws of a
sweep add for a pair, source of neighbours by source, and what becomes of the sums. From it
:func:`source_of` writes a module with two loops. The first *packs* what is read of a neighbour
alone into one record a particle (whole expressions of j, not only fields), since it is the number
of cache lines touched that gathering costs. The second

1. computes once a particle what does not depend on the neighbour;
2. gathers up to ``BATCH`` neighbours inside the support into columns, one array a quantity;
3. evaluates all laws over the columns in vectors, shared terms once, and adds to the sums;
4. finishes the sums and writes row i.

On a GPU (form ``"cuda"``) 2 and 3 are one: nothing is written per pair.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from particell.compute.batches import BATCH
from particell.compute.emit import Numbering, Writer
from particell.compute.expressions import Node

#: What a value depends on.
NUMBER, OWN, ITS, PAIR = range(4)
_SIDES = {"": NUMBER, "i": OWN, "j": ITS, "pair": PAIR}
#: What is not finite, or no number, for some arguments.
FUNCTIONS = ("call", "sqrt", "log", "exp", "**")
#: Numbers of a record: whole vectors, or parts of one cache line.
WIDTHS = (2, 4, 8, 16, 24, 32, 48, 64, 96, 128)
HEAD = """\
import math

import numpy as np

from particell.compute.batches import batch_row, whole_lanes
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_whole
"""


@dataclass(frozen=True)
class Pass:
    """One source's share of a sweep.

    Attributes
    ----------
    first, last
        The arrays (``start``, ``split``, ``stop``) between whose values the neighbours stand.
    sums
        Components of what every sum gets from a pair, by the sum's name.
    support
        The pair's support where it is not that of i.
    stored
        What is kept of each pair, by the name of an array with an entry for each of the list's.
    """

    first: str
    last: str
    sums: dict[str, tuple[Any, ...]]
    support: Any = None
    stored: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """What a field of particle i becomes: expressions of sums and of i; ``rows`` for (n, D)."""

    values: tuple[Any, ...]
    rows: bool


@dataclass(frozen=True)
class Plan:
    """All that a loop is generated from.

    Attributes
    ----------
    name, title
        Of the loop; what it computes.
    dim
        The number of dimensions.
    passes
        Over the sources.
    results
        What is written, by the field's name.
    targets
        ``"mobile"``, ``"walls"`` or ``"all"``: particles that have rows.
    zeroed
        Fields that are made zero for the others.
    whole
        Fields of whole numbers, which no record holds.
    """

    name: str
    title: str
    dim: int
    passes: tuple[Pass, ...]
    results: dict[str, Result]
    targets: str = "mobile"
    zeroed: tuple[str, ...] = ()
    whole: frozenset[str] = frozenset({"id", "group"})


@dataclass(frozen=True)
class Generated:
    """A module's text, the functions that it calls, and the sizes of what it works with."""

    text: str
    functions: dict[str, Any]
    record: int
    columns: int
    whole_columns: int


def source_of(plan: Plan, form: str) -> Generated:
    """Write the loops of a plan in a form, ``"gather"`` or ``"cuda"``."""
    return _Generator(plan, form).write()


def _indented(lines: Iterable[str], depth: int = 1) -> list[str]:
    return ["    " * depth + line for line in lines]


class _Generator:
    def __init__(self, plan: Plan, form: str):
        self.plan, self.form = plan, form
        self.numbering = Numbering()
        self.functions: dict[str, Any] = {}
        self.arguments: dict[str, None] = {}
        self._levels: dict[int, int] = {}
        self.record: dict[int, int] = {}  # place of each expression of j alone
        self.columns = self.whole_columns = 0

    def write(self) -> Generated:
        roots = [self._roots(p) for p in self.plan.passes]
        for found in roots:
            self._find_packed(found)
        width = next(w for w in WIDTHS if w >= self.plan.dim + len(self.record))
        loop = self._loop(roots, width)
        pack = self._pack(width)
        imports = sorted(
            f"from {f.__module__} import {name}"
            for name, f in ((n, getattr(g, "py_func", g)) for n, g in self.functions.items())
        )
        title = f'"""{self.plan.title}. Generated: not to be edited."""\n'
        text = "\n".join([title, HEAD + "\n".join(imports), "", "", *pack, "", "", *loop, ""])
        text = text.replace("WHOLE_COLUMNS", str(self.whole_columns))
        text = text.replace("COLUMNS", str(self.columns))
        return Generated(text, self.functions, width, self.columns, self.whole_columns)

    # what depends on what

    def _number(self, value: Any) -> Any:
        return self.numbering(value) if isinstance(value, Node) else float(value)

    def _roots(self, p: Pass) -> dict[str, tuple[Any, ...]]:
        """Numbers of all that a pass has to compute."""
        found = {name: tuple(map(self._number, values)) for name, values in p.sums.items()}
        found |= {f"stored {name}": (self._number(v),) for name, v in p.stored.items()}
        if p.support is not None:
            found["support"] = (self._number(p.support),)
        return found

    def level(self, number: int) -> int:
        """Whether a value is of no particle, of i, of j or of the pair."""
        found = self._levels.get(number)
        if found is None:
            node = self.numbering.nodes[number]
            if node.op == "symbol":
                found = _SIDES[node.what[2]]
            else:
                below = {self.level(k) for k in self.numbering.uses(number)} - {NUMBER}
                found = NUMBER if not below else below.pop() if len(below) == 1 else PAIR
            self._levels[number] = found
        return found

    def _is_whole(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        return node.op == "symbol" and node.what[1] in self.plan.whole

    def _is_index(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        return node.op == "symbol" and node.what[0] == "index"

    def _is_early(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        if node.op == "item":
            return self._is_early(self.numbering.uses(number)[0])
        return node.op == "early" or (node.op == "call" and bool(node.what[2]))

    def _split(self, roots: dict[str, tuple[Any, ...]]) -> tuple[list[int], list[int]]:
        """Of a pass: what is gathered into columns, and what has to be known of i before."""
        columns: dict[int, None] = {}
        once: dict[int, None] = {}
        seen: set[int] = set()
        waiting = [n for values in roots.values() for n in values if isinstance(n, int)]
        while waiting:
            number = waiting.pop(0)
            if number in seen:
                continue
            seen.add(number)
            node, level = self.numbering.nodes[number], self.level(number)
            if level in (NUMBER, OWN):
                once.setdefault(number)
            elif level == ITS or self._is_early(number) or node.op == "symbol":
                columns.setdefault(number)
                if level != ITS and node.op != "symbol":
                    waiting += self._own_below(number)
            else:
                waiting += self.numbering.uses(number)
        return list(columns), list(once)

    def _own_below(self, number: int) -> list[int]:
        """What an early value needs of i."""
        found, waiting, seen = [], self.numbering.uses(number), set()
        while waiting:
            below = waiting.pop()
            if below in seen:
                continue
            seen.add(below)
            if self.level(below) in (NUMBER, OWN):
                found.append(below)
            else:
                waiting += self.numbering.uses(below)
        return found

    def _find_packed(self, roots: dict[str, tuple[Any, ...]]) -> None:
        """Give places to the largest expressions of j alone."""
        seen: set[int] = set()
        waiting = [n for values in roots.values() for n in values if isinstance(n, int)]
        while waiting:
            number = waiting.pop(0)
            if number in seen:
                continue
            seen.add(number)
            if self.level(number) != ITS:
                waiting += self.numbering.uses(number)
            elif not self._is_whole(number) and not self._is_index(number):
                self.record.setdefault(number, self.plan.dim + len(self.record))

    def _mirror(self, number: int) -> int:
        """The number of the same expression of i instead of j."""
        made: dict[int, Node] = {}
        for k in self.numbering.under([number]):
            node = self.numbering.nodes[k]
            if node.op == "symbol":
                kind, name, side, component = node.what
                side = "i" if side == "j" else side
                made[k] = Node("symbol", (), (kind, name, side, component))
            else:
                args = (made[self.numbering(a)] if isinstance(a, Node) else a for a in node.args)
                made[k] = Node(node.op, tuple(args), node.what)
        return self.numbering(made[number])

    # text

    def _argument(self, name: str) -> str:
        self.arguments.setdefault(name)
        return name

    def _function(self, function: Any) -> str:
        name = getattr(function, "py_func", function).__name__
        assert self.functions.setdefault(name, function) is function, name
        return name

    def _symbol(self, what: tuple) -> str:
        kind, name, side, component = what
        if kind in ("pair", "sum"):
            return name
        if kind == "index":
            return side
        if kind == "stored":
            return f"{self._argument(name)}[k]"
        if kind == "table":
            return f"{self._argument(name)}[{self._argument('group')}[{side}]]"
        place = [side] if kind == "field" else []
        place += [] if component is None else [str(component)]
        return self._argument(name) + (f"[{', '.join(place)}]" if place else "")

    def _writer(self, prefix: str, names: dict[int, str] | None = None) -> Writer:
        writer = Writer(self.numbering, self._symbol, self._function, prefix)
        writer.names.update(names or {})
        return writer

    def _write(self, writer: Writer, roots: Sequence[int], named: bool = False) -> list[str]:
        """Lines after which ``roots`` have texts; what is used twice, or ``named``, has a name."""
        wanted: set[int] = set()
        waiting = list(roots)
        while waiting:
            number = waiting.pop()
            if number not in wanted and number not in writer.names:
                wanted.add(number)
                waiting += self.numbering.uses(number)
        uses: dict[int, int] = {}
        for number in [*roots, *(k for w in wanted for k in self.numbering.uses(w))]:
            uses[number] = uses.get(number, 0) + 1
        often = {number for number, times in uses.items() if times > 1}
        return writer.write(sorted(wanted), often | set(roots) if named else often)

    def _definition(self, name: str, lines: list[str], vectorise: bool) -> list[str]:
        given = textwrap.wrap(", ".join(["i", *self.arguments]), 92, break_long_words=False)
        return [
            "@particle_loop(vectorise=True)" if vectorise else "@particle_loop",
            f"def {name}(",
            *_indented(given),
            "):",
            *_indented(lines),
        ]

    def _pack(self, width: int) -> list[str]:
        self.arguments = {}
        writer = self._writer("own")
        mirrored = [self._mirror(number) for number in self.record]
        lines = [f"at = i * {width}"]
        lines += [f"record[at + {d}] = {self._argument('x')}[i, {d}]" for d in range(self.plan.dim)]
        lines += self._write(writer, mirrored)
        for number, place in zip(mirrored, self.record.values(), strict=True):
            lines.append(f"record[at + {place}] = {writer.names[number]}")
        self._argument("record")
        return self._definition(f"pack_{self.plan.name}", lines, False)

    def _loop(self, roots: list[dict[str, tuple[Any, ...]]], width: int) -> list[str]:
        plan = self.plan
        self.arguments = {}
        own = self._writer("of_i")
        for number, place in list(self.record.items()):
            own.names[self._mirror(number)] = f"own_{place}"
        parts = [self._split(found) for found in roots]
        once = [number for _, needed in parts for number in needed]
        head = self._skipped()
        head += [f"own = np.uint64(i) * np.uint64({width})", *self._own_record(once, width)]
        head += [f"wraps = {self._argument('crosses')}[i] != 0"]
        head += [f"reach2 = {self._argument('support')}[i] * support[i]"]
        head += self._write(own, once, named=True)
        head += [f"{name} = 0.0" for name in self._accumulators()]
        body: list[str] = []
        for p, found, (columns, _) in zip(plan.passes, roots, parts, strict=True):
            body += self._pass(p, found, columns, own, width)
        return self._definition(
            plan.name, [*head, *body, *self._finish(own)], self.form == "gather"
        )

    def _own_record(self, once: list[int], width: int) -> list[str]:
        """Particle i's own record, as far as it is read."""
        self._argument("record")
        lines = [f"x{d} = record[own + np.uint64({d})]" for d in range(self.plan.dim)]
        for place in self.record.values():
            lines.append(f"own_{place} = record[own + np.uint64({place})]")
        return lines

    def _accumulators(self) -> list[str]:
        names: dict[str, None] = {}
        for p in self.plan.passes:
            for name, values in p.sums.items():
                names |= dict.fromkeys(sum_names(name, len(values)))
        return list(names)

    def _skipped(self) -> list[str]:
        plan = self.plan
        if plan.targets == "all":
            return []
        test = self._argument("is_wall") + "[i] != 0"
        lines = [f"if {test}:" if plan.targets == "mobile" else f"if not {test}:"]
        for name in plan.zeroed:
            lines += _indented(f"{place} = 0.0" for place in self._places(name))
        return [*lines, "    return"]

    def _places(self, name: str) -> list[str]:
        result = self.plan.results[name]
        self._argument(name)
        if not result.rows:
            return [f"{name}[i]"]
        return [f"{name}[i, {d}]" for d in range(len(result.values))]

    def _finish(self, own: Writer) -> list[str]:
        lines: list[str] = []
        for name, result in self.plan.results.items():
            values = [self._number(v) for v in result.values]
            lines += self._write(own, [v for v in values if isinstance(v, int)])
            for place, value in zip(self._places(name), values, strict=True):
                text = own.names[value] if isinstance(value, int) else repr(value)
                lines.append(f"{place} = {text}")
        return lines

    def _pass(
        self,
        p: Pass,
        roots: dict[str, tuple[Any, ...]],
        columns: list[int],
        own: Writer,
        width: int,
    ) -> list[str]:
        gather = self._writer("near", own.names)
        reads = self._neighbour(p, roots, columns, gather, width)
        batches = self.form == "gather"
        pairs = self._writer("t", own.names)
        loads = self._columns(columns, gather, pairs) if batches else []
        if not batches:
            pairs.names.update(gather.names)
        acts = self._act(p, roots, pairs, "begin + q" if batches else "k")
        begin, last = self._argument(p.first), self._argument(p.last)
        if not batches:
            inside = ["if r2 < reach2:"] if not p.stored else ["if True:"]
            loop = [*reads, *inside, *_indented(acts)]
            return [f"for k in range({begin}[i], {last}[i]):", *_indented(loop)]
        stores, fills = self._stores(columns, gather), self._fills(p, roots, columns)
        keep = "c += np.uint64(1)" if p.stored else "c += np.uint64(r2 < reach2)"
        every = "c" if p.stored else "filled"
        base = f"base = batch_row(i) * np.uint64({BATCH} * COLUMNS)"
        whole = f"base_whole = batch_row(i) * np.uint64({BATCH} * WHOLE_COLUMNS)"
        self._argument("columns")
        has_whole = any(self._is_whole(n) for n in columns)
        return [
            base,
            *([whole] if has_whole else []),
            f"begin, last = np.uint64({begin}[i]), np.uint64({last}[i])",
            "while begin < last:",
            f"    end = min(last, begin + np.uint64({BATCH}))",
            "    c = np.uint64(0)",
            "    for k in range(begin, end):",
            *_indented([*reads, *stores, keep], 2),
            *_indented(fills, 1),
            f"    for q in range(np.uint64(0), {every}):",
            *_indented([*loads, *acts], 2),
            "    begin = end",
        ]

    def _neighbour(
        self,
        p: Pass,
        roots: dict[str, tuple[Any, ...]],
        columns: list[int],
        gather: Writer,
        width: int,
    ) -> list[str]:
        """Read neighbour k: offset, distance, what is looked up or decided pair by pair."""
        lines = [
            f"j = {self._argument('neighbours')}[k]",
            f"other = np.uint64(j) * np.uint64({width})",
        ]
        period, inverse = self._argument("period"), self._argument("inverse_period")
        for d in range(self.plan.dim):
            lines.append(f"dx{d} = x{d} - record[other + np.uint64({d})]")
        lines.append("if wraps:")
        for d in range(self.plan.dim):
            lines.append(f"    dx{d} -= {period}[{d}] * nearest_whole(dx{d} * {inverse}[{d}])")
        square = " + ".join(f"dx{d} * dx{d}" for d in range(self.plan.dim))
        lines.append(f"r2 = {square}")
        for number, place in self.record.items():
            gather.names[number] = f"record[other + np.uint64({place})]"
        early = [n for n in columns if self._is_early(n)]
        lines += self._write(gather, early)
        if p.support is not None:
            (number,) = roots["support"]
            lines += self._write(gather, [number])
            lines.append(f"reach2 = {gather.names[number]} * {gather.names[number]}")
        return lines

    def _column(self, columns: list[int], number: int) -> str:
        """Where a column begins, without the pair's place."""
        whole = self._is_whole(number)
        place = [n for n in columns if self._is_whole(n) == whole].index(number)
        self._argument("whole_columns" if whole else "columns")
        if whole:
            self.whole_columns = max(self.whole_columns, place + 1)
            return f"whole_columns[base_whole + np.uint64({place * BATCH})"
        self.columns = max(self.columns, place + 1)
        return f"columns[base + np.uint64({place * BATCH})"

    def _stores(self, columns: list[int], gather: Writer) -> list[str]:
        self._write(gather, columns)
        return [f"{self._column(columns, n)} + c] = {gather.names[n]}" for n in columns]

    def _fills(self, p: Pass, roots: dict[str, tuple[Any, ...]], columns: list[int]) -> list[str]:
        """Fill the last vector with pairs outside the support, which do nothing.

        Their columns hold what was there. Where that could be divided by, or else not be finite,
        it is the last neighbour's.
        """
        if p.stored:
            return []
        self._argument("support")
        risky = self._risky([n for values in roots.values() for n in values], columns)
        lines = [f"filled = whole_lanes(c, {BATCH})", "for q in range(c, filled):"]
        for number in columns:
            place = f"    {self._column(columns, number)} + q]"
            if self._is_offset(number):
                if self.numbering.nodes[number].what[1] == "dx0":
                    lines.append(f"{place} = 2.0 * support[i]")
            elif number in roots.get("support", ()):
                lines.append(f"{place} = support[i]")
            elif number in risky:
                lines.append(f"{place} = {self._column(columns, number)} + c - np.uint64(1)]")
        return lines

    def _is_offset(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        return node.op == "symbol" and node.what[0] == "pair"

    def _risky(self, roots: list[Any], columns: list[int]) -> set[int]:
        """Columns that something is divided by, or that functions are taken of."""
        found: set[int] = set()
        waiting = [(n, False) for n in roots if isinstance(n, int)]
        seen: set[tuple[int, bool]] = set()
        while waiting:
            number, danger = waiting.pop()
            if (number, danger) in seen:
                continue
            seen.add((number, danger))
            if number in columns:
                if danger:
                    found.add(number)
                continue
            node = self.numbering.nodes[number]
            uses = self.numbering.uses(number)
            function = node.op in FUNCTIONS
            divisor = uses[-1] if node.op == "/" and isinstance(node.args[1], Node) else None
            waiting += [(k, danger or function or k == divisor) for k in uses]
        return found

    def _columns(self, columns: list[int], gather: Writer, pairs: Writer) -> list[str]:
        lines = []
        for k, number in enumerate(columns):
            node = self.numbering.nodes[number]
            symbol = node.op == "symbol" and node.what[0] == "pair"
            name = node.what[1] if symbol else f"c{k}"
            pairs.names[number] = name
            lines.append(f"{name} = {self._column(columns, number)} + q]")
        return lines

    def _act(
        self, p: Pass, roots: dict[str, tuple[Any, ...]], pairs: Writer, place: str
    ) -> list[str]:
        """Evaluate the laws of a pair and add to the sums."""
        wanted = [
            n
            for name, values in roots.items()
            if name != "support"
            for n in values
            if isinstance(n, int)
        ]
        lines = self._write(pairs, wanted)
        for name, values in p.sums.items():
            for target, number in zip(sum_names(name, len(values)), roots[name], strict=True):
                if isinstance(number, int):
                    lines.append(f"{target} += {pairs.names[number]}")
                elif number:
                    lines.append(f"{target} += {number!r}")
        for name in p.stored:
            (number,) = roots[f"stored {name}"]
            lines.append(f"{self._argument(name)}[{place}] = {pairs.names[number]}")
        return lines


def sum_names(name: str, components: int) -> list[str]:
    """The variables of a sum."""
    plain = f"sum_{name}".replace(".", "_").lower()
    return [plain] if components == 1 else [f"{plain}_{k}" for k in range(components)]


def sum_symbols(name: str, components: int) -> tuple[Node, ...]:
    """A sum's components as they are known when it is finished."""
    return tuple(
        Node("symbol", (), ("sum", text, "i", None)) for text in sum_names(name, components)
    )
