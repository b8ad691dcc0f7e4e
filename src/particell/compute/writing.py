"""What the generators of loops have in common: names, arguments, lines, a module of two loops."""

from __future__ import annotations

import keyword
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from particell.compute.dependence import Dependence
from particell.compute.emit import Writer
from particell.compute.plan import Plan, sum_names
from particell.laws.digest import digest, is_own

#: Numbers of a record: whole vectors, or parts of one cache line.
WIDTHS = (2, 4, 8, 16, 24, 32, 48, 64, 96, 128)
#: Names of variables in loops.
LOCALS = re.compile(
    r"(i|j|k|l|q|c|s|at|own|other|wraps|r2|reach2|begin|last|end|filled|base|base_whole|math|np"
    r"|thread|n|first|entry|slot|image|itself|near|some|lane_count|own_group"
    r"|(x|y|s|b|o|e|n|dx|c|t|own|own_|of_i|near|away)\d+|sum_\w+)"
)
IMPORTS = """\
import math

import numpy as np

from particell.compute.batches import batch_row, whole_lanes
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_whole
"""


@dataclass(frozen=True)
class Generated:
    """A module's text, functions of the user's that it calls, the sizes of what it works with.

    ``renamed`` has names of fields by those of arguments, where they differ.
    """

    text: str
    functions: dict[str, Any]
    record: int
    columns: int
    whole_columns: int
    renamed: dict[str, str]


def indented(lines: Iterable[str], depth: int = 1) -> list[str]:
    """The lines further to the right."""
    return ["    " * depth + line for line in lines]


class Generator:
    """Writes the loops of a plan; a form derives from it and writes :meth:`write`."""

    def __init__(self, plan: Plan):
        self.plan = plan
        self.values = Dependence(plan)
        self.functions: dict[str, Any] = {}
        self.given: dict[str, Any] = {}  # those of the user's, which are not imported
        self.arguments: dict[str, None] = {}
        self.renamed: dict[str, str] = {}  # names of fields, by those of arguments
        self.columns = self.whole_columns = 0
        #: whether anything is read of neighbours' records
        self._packed = self.values.placed or bool(self.values.record)
        self.width = next(w for w in WIDTHS if w >= plan.dim + len(self.values.record))

    def write(self) -> Generated:
        """The module."""
        raise NotImplementedError

    def _module(self, loop: list[str], pack: list[str]) -> Generated:
        imports = sorted(
            f"from {f.__module__} import {name}"
            for name, f in ((n, getattr(g, "py_func", g)) for n, g in self.functions.items())
            if name not in self.given
        )
        title = f'"""{self.plan.title}. Generated: not to be edited."""\n'
        text = "\n".join([title, IMPORTS + "\n".join(imports), "", "", *pack, "", "", *loop, ""])
        text = text.replace("WHOLE_COLUMNS", str(self.whole_columns))
        text = text.replace("COLUMNS", str(self.columns))
        sizes = (self.width, self.columns, self.whole_columns)
        return Generated(text, self.given, *sizes, self.renamed)

    def _argument(self, name: str) -> str:
        """The argument's name, another one where that is a variable of the loop or a keyword."""
        if keyword.iskeyword(name) or LOCALS.fullmatch(name):
            self.renamed[f"{name}_field"] = name
            name = f"{name}_field"
        self.arguments.setdefault(name)
        return name

    def _function(self, function: Any) -> str:
        name = getattr(function, "py_func", function).__name__
        if is_own(function):  # another body is another name, and so another file
            name = f"{name.strip('<>')}_{digest(function, f'what {name} of a law reads')}"
            self.given[name] = function
        assert self.functions.setdefault(name, function) is function or name in self.given, name
        return name

    def _symbol(self, what: tuple) -> str:
        kind, name, side, component = what
        if kind in ("pair", "apart", "sum"):
            return name
        if kind == "index":
            return side
        if kind == "stored":
            return f"{self._argument(name)}[k]"
        place = [side] if kind == "field" else []
        if kind == "table":
            place = [f"{self._argument('group')}[{side}]"]
        if kind == "groups":
            group = self._argument("group") if side else ""
            place = [f"{group}[i]", f"{group}[j]"] if side else ["0", "0"]
        if isinstance(component, str):
            component = self._argument(component)
        place += [] if component is None else [str(component)]
        return self._argument(name) + (f"[{', '.join(place)}]" if place else "")

    def _writer(self, prefix: str, names: dict[int, str] | None = None) -> Writer:
        writer = Writer(self.values.numbering, self._symbol, self._function, prefix)
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
                waiting += self.values.numbering.uses(number)
        uses: dict[int, int] = {}
        for number in [*roots, *(k for w in wanted for k in self.values.numbering.uses(w))]:
            uses[number] = uses.get(number, 0) + 1
        often = {number for number, times in uses.items() if times > 1}
        return writer.write(sorted(wanted), often | set(roots) if named else often)

    def _definition(self, name: str, index: str, lines: list[str], decorator: str) -> list[str]:
        given = textwrap.wrap(", ".join([index, *self.arguments]), 92, break_long_words=False)
        return [decorator, f"def {name}(", *indented(given), "):", *indented(lines)]

    def _record(self) -> list[str]:
        """Fill the record of particle i, which stands ``at``."""
        writer = self._writer("own")
        mirrored = [self.values.mirror(number) for number in self.values.record]
        lines = []
        if self.values.placed:
            x = self._argument("x")
            lines = [f"record[at + {d}] = {x}[i, {d}]" for d in range(self.plan.dim)]
        lines += self._write(writer, mirrored)
        for number, place in zip(mirrored, self.values.record.values(), strict=True):
            lines.append(f"record[at + {place}] = {writer.names[number]}")
        self._argument("record")
        return lines

    def _accumulators(self) -> list[str]:
        names: dict[str, None] = {}
        for p in self.plan.passes:
            for name, values in p.sums.items():
                names |= dict.fromkeys(sum_names(name, len(values)))
        return list(names)

    def _places(self, name: str) -> list[str]:
        result = self.plan.results[name]
        self._argument(name)
        if result.column:
            return [f"{name}[i, {self._argument(result.column)}]"]
        if not result.rows:
            return [f"{name}[i]"]
        return [f"{name}[i, {d}]" for d in range(len(result.values))]

    def _zeros(self) -> list[str]:
        """What fields of a particle become that has no sums."""
        return [f"{place} = 0.0" for name in self.plan.zeroed for place in self._places(name)]

    def _finish(self, own: Writer) -> list[str]:
        lines: list[str] = []
        for name, result in self.plan.results.items():
            values = [self.values.number(v) for v in result.values]
            lines += self._write(own, [v for v in values if isinstance(v, int)])
            for place, value in zip(self._places(name), values, strict=True):
                text = own.names[value] if isinstance(value, int) else repr(value)
                lines.append(f"{place} = {text}")
        return lines
