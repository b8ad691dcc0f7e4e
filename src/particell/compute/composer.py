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

import re
from typing import Any

from particell.compute.batches import BATCH
from particell.compute.dependence import SEEING
from particell.compute.emit import Writer
from particell.compute.lanes import LanesGenerator
from particell.compute.plan import Pass, Plan, sum_names
from particell.compute.writing import Generated, Generator, indented


def source_of(plan: Plan, form: str) -> Generated:
    """Write the loops of a plan in a form, ``"gather"``, ``"lanes"`` or ``"cuda"``."""
    generator = LanesGenerator(plan) if form == "lanes" else _Generator(plan, form)
    return generator.write()


class _Generator(Generator):
    """The forms for one particle after the other."""

    def __init__(self, plan: Plan, form: str):
        super().__init__(plan)
        self.form = form

    def write(self) -> Generated:
        """See the base."""
        loop = self._loop(self.values.roots, self.width)
        self.arguments = {}
        lines = [f"at = i * {self.width}", *self._record()]
        pack = self._definition(f"pack_{self.plan.name}", "i", lines, "@particle_loop")
        return self._module(loop, pack if self._packed else [])

    def _loop(self, roots: list[dict[str, tuple[Any, ...]]], width: int) -> list[str]:
        plan = self.plan
        self.arguments = {}
        own = self._writer("of_i")
        for number, place in list(self.values.record.items()):
            own.names[self.values.mirror(number)] = f"own_{place}"
        parts = [self.values.split(found) for found in roots]
        once = [number for _, needed in parts for number in needed]
        head = self._skipped()
        if self._packed:
            head += [f"own = np.uint64(i) * np.uint64({width})", *self._own_place()]
        at = len(head)
        if self.values.placed:
            head += [f"wraps = {self._argument('crosses')}[i] != 0"]
            head += [f"reach2 = {self._argument('support')}[i] * support[i]"]
        head += self._write(own, once, named=True)
        head += [f"{name} = 0.0" for name in self._accumulators()]
        body: list[str] = []
        for p, found, (columns, _) in zip(plan.passes, roots, parts, strict=True):
            body += self._pass(p, found, columns, own, width)
        lines = [*head, *body, *self._finish(own)]
        read = set(re.findall(r"\bown_\d+\b", "\n".join(lines)))
        places = [k for k in self.values.record.values() if f"own_{k}" in read]
        loads = [f"own_{k} = record[own + np.uint64({k})]" for k in places]
        lines = [line.replace("group[i]", "own_group") for line in lines]
        if any("own_group" in line for line in lines):  # once, whatever is written meanwhile
            loads.append("own_group = group[i]")
        lines[at:at] = loads
        vectorise = self.form == "gather" and not all(p.weighed for p in plan.passes)
        decorator = "@particle_loop" + ("(vectorise=True)" if vectorise else "")
        return self._definition(plan.name, "i", lines, decorator)

    def _skipped(self) -> list[str]:
        plan = self.plan
        if plan.targets == "all":
            return []
        test = self._argument("is_wall") + "[i] != 0"
        lines = [f"if {test}:" if plan.targets == "mobile" else f"if not {test}:"]
        return [*lines, *indented([*self._zeros(), "return"])]

    def _own_place(self) -> list[str]:
        """Where particle i is, from its own record: rounded as its neighbours see it."""
        self._argument("record")
        if not self.values.placed:
            return []
        return [f"x{d} = record[own + np.uint64({d})]" for d in range(self.plan.dim)]

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
        batches = self.form == "gather" and not p.weighed
        pairs = self._writer("t", own.names)
        loads = self._columns(columns, gather, pairs) if batches else []
        if not batches:
            pairs.names.update(gather.names)
        acts = self._act(p, roots, pairs)
        keeps = self._keep(p, roots, pairs, "begin + q" if batches else "k")
        begin, last = f"{self._argument(p.first)}[i]", f"{self._argument(p.last)}[i]"
        if p.itself:  # after the others
            last += " + 1"
        if not batches:
            inside = [*reads, *acts]
            if p.weighed and any(map(self.values.is_early, columns)):  # dear ones
                test = f"if {self._argument(p.weighed)}[k] != 0.0:"
                inside = [test, *indented(inside)]
            elif not (p.stored or p.weighed):
                inside = [*reads, "if r2 < reach2:", *indented(acts)]
            loop = [f"for k in range({begin}, {last}):", *indented([*inside, *keeps])]
            return self._where(roots, own, loop)
        stores, fills = self._stores(columns, gather), self._fills(p, roots, columns)
        keep = "c += np.uint64(1)" if p.stored else "c += np.uint64(r2 < reach2)"
        whole_vectors = not p.stored and all(
            self.values.vanishes(v) for name in p.sums for v in roots[name]
        )
        every = "filled" if whole_vectors else "c"
        base = f"base = batch_row(i) * np.uint64({BATCH} * COLUMNS)"
        whole = f"base_whole = batch_row(i) * np.uint64({BATCH} * WHOLE_COLUMNS)"
        self._argument("columns")
        has_whole = any(self.values.is_whole(n) for n in columns)
        lines = [
            base,
            *([whole] if has_whole else []),
            f"begin, last = np.uint64({begin}), np.uint64({last})",
            "while begin < last:",
            f"    end = min(last, begin + np.uint64({BATCH}))",
            "    c = np.uint64(0)",
            "    for k in range(begin, end):",
            *indented([*reads, *stores, keep], 2),
            *indented(fills, 1),
            f"    for q in range(np.uint64(0), {every}):",
            *indented([*loads, *acts, *keeps], 2),
            "    begin = end",
        ]
        return self._where(roots, own, lines)

    @staticmethod
    def _where(roots: dict[str, tuple[Any, ...]], own: Writer, lines: list[str]) -> list[str]:
        """Lines under the condition on i that a pass may have."""
        if "only" not in roots:
            return lines
        return [f"if {own.names[roots['only'][0]]}:", *indented(lines)]

    def _neighbour(
        self,
        p: Pass,
        roots: dict[str, tuple[Any, ...]],
        columns: list[int],
        gather: Writer,
        width: int,
    ) -> list[str]:
        """Read neighbour k: offset, distance, what is looked up or decided pair by pair."""
        row = f"{self._argument('neighbours')}[k]"
        if p.itself:
            row = f"np.uint64({row}) if k < {self._argument(p.last)}[i] else np.uint64(i)"
        lines = [f"j = {row}"]
        if self._packed:
            lines.append(f"other = np.uint64(j) * np.uint64({width})")
        for number, place in self.values.record.items():
            gather.names[number] = f"record[other + np.uint64({place})]"
        if not p.weighed or self.values.needs_places(roots):
            lines += self._offset(p, roots, gather)
        early = [n for n in columns if self.values.is_early(n)]
        lines += self._write(gather, early)
        if p.support is not None and not p.weighed:
            (number,) = roots["support"]
            lines += self._write(gather, [number])
            lines.append(f"reach2 = {gather.names[number]} * {gather.names[number]}")
        return lines

    def _offset(self, p: Pass, roots: dict[str, tuple[Any, ...]], gather: Writer) -> list[str]:
        """x_i − x_j of the nearest images, or as j is seen, and its square."""
        lines = []
        period, inverse = self._argument("period"), self._argument("inverse_period")
        for d in range(self.plan.dim):
            lines.append(f"dx{d} = x{d} - record[other + np.uint64({d})]")
        lines.append("if wraps:")
        for d in range(self.plan.dim):
            lines.append(f"    dx{d} -= {period}[{d}] * nearest_whole(dx{d} * {inverse}[{d}])")
        if p.offset:
            lines += self._write(gather, list(roots["offset"]), named=True)
            seen = [gather.names[number] for number in roots["offset"]]
            lines += [f"dx{d} = {name}" for d, name in enumerate(seen)]
        square = " + ".join(f"dx{d} * dx{d}" for d in range(self.plan.dim))
        lines.append(f"r2 = {square}")
        return lines

    def _column(self, columns: list[int], number: int) -> str:
        """Where a column begins, without the pair's place."""
        whole = self.values.is_whole(number)
        place = [n for n in columns if self.values.is_whole(n) == whole].index(number)
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
        it is the last neighbour's; where it could be infinite itself, zero.
        """
        if p.stored:
            return []
        self._argument("support")
        wanted = [n for name, values in roots.items() if name not in SEEING for n in values]
        risky = self.values.risky(wanted, columns)
        lines = [f"filled = whole_lanes(c, {BATCH})", "for q in range(c, filled):"]
        for number in columns:
            place = f"    {self._column(columns, number)} + q]"
            if self.values.is_offset(number):
                if self.values.numbering.nodes[number].what[1] == "dx0":
                    lines.append(f"{place} = 2.0 * support[i]")
            elif number in roots.get("support", ()):
                lines.append(f"{place} = support[i]")
            elif number in risky:
                lines.append(f"{place} = {self._column(columns, number)} + c - np.uint64(1)]")
            elif not self.values.is_finite(number):
                lines.append(f"{place} = 0.0")
        return lines

    def _columns(self, columns: list[int], gather: Writer, pairs: Writer) -> list[str]:
        lines = []
        for k, number in enumerate(columns):
            node = self.values.numbering.nodes[number]
            symbol = node.op == "symbol" and node.what[0] == "pair"
            name = node.what[1] if symbol else f"c{k}"
            pairs.names[number] = name
            lines.append(f"{name} = {self._column(columns, number)} + q]")
        return lines

    def _act(self, p: Pass, roots: dict[str, tuple[Any, ...]], pairs: Writer) -> list[str]:
        """Evaluate the laws of a pair and add to the sums."""
        wanted = [
            n
            for name, values in roots.items()
            if name not in SEEING
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
        return lines

    def _keep(
        self, p: Pass, roots: dict[str, tuple[Any, ...]], pairs: Writer, place: str
    ) -> list[str]:
        """Write what is kept of a pair."""
        lines = []
        for name, total in p.running.items():
            lines.append(f"{self._argument(name)}[{place}] = {sum_names(total, 1)[0]}")
        for name in p.stored:
            (number,) = roots[f"stored {name}"]
            lines.append(f"{self._argument(name)}[{place}] = {pairs.names[number]}")
        return lines
