"""The form of a sweep in which the lanes of vectors are particles near each other.

:mod:`particell.compute.clusters` has the lists. For every entry the neighbour's record is read
once, and the laws are evaluated for all particles of the cluster in vectors, one particle a lane.
Nothing is gathered; but two to three times as many pairs are evaluated as are within the support.
Those beyond do not act, since the kernel is zero there, nor does a particle on itself, since all
differences are. What does not vanish by that, or might not be finite, is left out explicitly.

Functions that branch (those of walls) are called before, lane by lane, where pairs are within the
support. Each lane adds up its own sums in the order of the list, so that they do not depend on
which particles stand in the other lanes.
"""

from __future__ import annotations

import re
from typing import Any

from particell.compute.bins import LANES, SLOT_BITS
from particell.compute.dependence import CONDITIONS, ITS, NUMBER, OWN
from particell.compute.emit import Writer
from particell.compute.plan import Pass, Plan, sum_names
from particell.compute.writing import Generated, Generator, indented

#: All lanes. That it is one times eight is not known when the loop is compiled: LLVM would unroll
#: it, instead of making vectors of it.
EACH = "for l in range(lane_count):"
Roots = dict[str, tuple[Any, ...]]


class LanesGenerator(Generator):
    """See the module."""

    def __init__(self, plan: Plan):
        super().__init__(plan)
        assert not any(p.along_rows for p in plan.passes), "what is kept of pairs stands along rows"
        self._place: dict[Any, int] = {}  # of what is kept for each lane

    def write(self) -> Generated:
        """See the base."""
        loop = self._loop()
        self.arguments = {}
        member = self._argument("member")
        lines = [f"i = {member}[s]", f"at = s * {self.width}", *self._record()]
        pack = self._definition(f"pack_{self.plan.name}", "s", lines, "@particle_loop")
        self.columns = len(self._place)
        return self._module(loop, pack)

    def _lane(self, what: Any) -> str:
        """What is kept for lane l."""
        place = self._place.setdefault(what, len(self._place))
        self._argument("lanes")
        return f"lanes[base + np.uint64({LANES * place}) + l]"

    # what has to be known before

    def _needed(self, number: int, early: bool, found: dict[str, dict[int, None]]) -> None:
        """Sort what a value of a pair needs by where it is computed."""
        if number in found["early" if early else "seen"]:
            return
        found["early" if early else "seen"][number] = None
        level = self.values.level(number)
        if level == NUMBER:
            found["numbers"][number] = None
        elif level == OWN:
            if not self.values.is_whole(number) and not self.values.is_index(number):
                found["own"][number] = None
        elif level == ITS and number in self.values.record:
            found["its"][number] = None
        else:
            calls = not early and self._is_apart(number)
            if calls:
                found["apart"][number] = None
            for below in self.values.numbering.uses(number):
                self._needed(below, early or calls, found)

    def _is_apart(self, number: int) -> bool:
        """Whether a value is computed lane by lane: early ones that are more than arithmetic."""
        if not self.values.is_early(number):
            return False
        nodes = self.values.numbering.nodes
        return any(nodes[k].op == "call" for k in self.values.numbering.under([number]))

    def _found(self, roots: Roots) -> dict[str, dict[int, None]]:
        names = ("numbers", "own", "its", "apart", "early", "seen")
        found: dict[str, dict[int, None]] = {name: {} for name in names}
        for values in roots.values():
            for number in values:
                if isinstance(number, int):
                    self._needed(number, False, found)
        return found

    # the loop

    def _loop(self) -> list[str]:
        self.arguments = {}
        parts = [self._found(roots) for roots in self.values.roots]
        numbers = self._writer("n")
        head = self._write(numbers, [n for f in parts for n in f["numbers"]], named=True)
        own = list(dict.fromkeys(n for f in parts for n in f["own"]))
        body = self._own_values(own, numbers)
        for p, roots, found in zip(self.plan.passes, self.values.roots, parts, strict=True):
            body += self._pass(p, roots, found, numbers, own)
        body += self._finished(numbers, own)
        lines = [f"first = c * np.uint64({LANES})", *self._skipped()]
        lines.append(f"lane_count = {self._argument('octets')} * np.uint64({LANES})")
        lines += ["base = batch_row(c) * np.uint64(COLUMNS_OF_LANES)", *head, *body]
        columns = str(LANES * len(self._place))
        lines = [line.replace("COLUMNS_OF_LANES", columns) for line in lines]
        decorator = "@particle_loop(vectorise=True, reassociate=False)"
        return self._definition(self.plan.name, "c", lines, decorator)

    def _skipped(self) -> list[str]:
        """Clusters are of one kind: what has no sums is left."""
        targets = self.plan.targets
        if targets == "all":
            return []
        test = f"{self._argument('is_wall')}[{self._argument('member')}[first]] != 0"
        zeros = self._zeros()
        lines = [f"if {test}:" if targets == "mobile" else f"if not {test}:"]
        if zeros:
            size = f"{self._argument('cluster_size')}[c]"
            zeros = [f"for l in range({size}):", "    i = member[first + l]", *indented(zeros)]
        return [*lines, *indented([*zeros, "return"])]

    def _own_values(self, own: list[int], numbers: Writer) -> list[str]:
        """What is of particle i alone, for each lane; sums begin."""
        writer = self._writer("of_i", numbers.names)
        for number, place in self.values.record.items():
            writer.names[self.values.mirror(number)] = f"own_{place}"
        lines = self._write(writer, own)
        self._argument("record")
        for d in range(self.plan.dim):
            lines.append(f"{self._lane(('x', d))} = record[own + np.uint64({d})]")
        if self._reach_is_own():
            lines.append(f"{self._lane('reach2')} = {self._argument('support')}[i] * support[i]")
        for number in own:
            value = writer.names[number]
            value = f"1.0 if {value} else 0.0" if self._is_condition(number) else value
            lines.append(f"{self._lane(number)} = {value}")
        lines += [f"{self._lane(name)} = 0.0" for name in self._accumulators()]
        return [EACH, *indented(self._with_own(lines))]

    def _is_condition(self, number: int) -> bool:
        return self.values.numbering.nodes[number].op in CONDITIONS

    def _names_of(self, kept: dict[Any, str]) -> dict[Any, str]:
        """The texts of values that are kept for lanes."""
        return {k: f"({v} != 0.0)" if self._is_condition(k) else v for k, v in kept.items()}

    def _reach_is_own(self) -> bool:
        """Whether some pass needs to know what is within the support of i."""
        return any(
            p.support is None and (self._found(roots)["apart"] or any(self._left_out(p, roots)))
            for p, roots in zip(self.plan.passes, self.values.roots, strict=True)
        )

    def _with_own(self, lines: list[str]) -> list[str]:
        """Before lines of a lane: the particle, and of its own record what they read."""
        text = "\n".join(lines)
        before = []
        if re.search(r"\bi\b", text):
            before.append(f"i = {self._argument('member')}[first + l]")
        if re.search(r"\bown\b|\bown_\d", text):
            before.append(f"own = (first + l) * np.uint64({self.width})")
        for place in self.values.record.values():
            if re.search(rf"\bown_{place}\b", text):
                before.append(f"own_{place} = record[own + np.uint64({place})]")
        return [*before, *lines]

    def _with_lanes(self, lines: list[str], kept: dict[Any, str]) -> list[str]:
        """Before lines of a lane: what they read of what is kept for it."""
        text = "\n".join(lines)
        read = {what: name for what, name in kept.items() if re.search(rf"\b{name}\b", text)}
        return [*(f"{name} = {self._lane(what)}" for what, name in read.items()), *lines]

    # pairs

    def _pass(
        self,
        p: Pass,
        roots: Roots,
        found: dict[str, dict[int, None]],
        numbers: Writer,
        own: list[int],
    ) -> list[str]:
        dim, width = self.plan.dim, self.width
        names = dict(numbers.names)
        kept: dict[Any, str] = {number: f"o{k}" for k, number in enumerate(own)}
        names |= self._names_of(kept)
        its = {n: place for n, place in self.values.record.items() if n in found["its"]}
        names |= {number: f"b{place}" for number, place in its.items()}
        offset = [f"dx{d} = {self._lane(('x', d))} - y{d} - s{d}" for d in range(dim)]
        if p.offset:
            writer = self._writer("away", names)
            offset += self._write(writer, list(roots["offset"]), named=True)
            seen = [writer.names[number] for number in roots["offset"]]
            offset += [f"dx{d} = {name}" for d, name in enumerate(seen)]
        offset.append("r2 = " + " + ".join(f"dx{d} * dx{d}" for d in range(dim)))
        apart = self._apart(p, roots, found, names, kept, offset)
        kept |= {("apart", number): f"e{k}" for k, number in enumerate(found["apart"])}
        pairs = self._writer("t", names)
        pairs.names |= {number: kept["apart", number] for number in found["apart"]}
        acts = self._act(p, roots, pairs)
        inner = self._with_own(self._with_lanes([*offset, *acts], kept))
        begin, last = (self._argument(f"cluster_{name}") for name in (p.first, p.last))
        shift, entries = self._argument("shifts"), self._argument("cluster_entries")
        lines = [
            f"entry = np.uint64({entries}[k])",
            f"slot = entry & np.uint64({(1 << SLOT_BITS) - 1})",
            f"image = (entry >> np.uint64({SLOT_BITS})) * np.uint64({dim})",
            f"other = slot * np.uint64({width})",
            *(f"s{d} = {shift}[image + np.uint64({d})]" for d in range(dim)),
            *(f"y{d} = record[other + np.uint64({d})]" for d in range(dim)),
            *(f"b{place} = record[other + np.uint64({place})]" for place in its.values()),
        ]
        text = "\n".join([*apart, *inner])
        if re.search(r"\bj\b", text):
            lines.append(f"j = {self._argument('member')}[slot]")
        if re.search(r"\bitself\b", text):
            lines.append("itself = slot - first")
        lines += [*apart, EACH, *indented(inner)]
        loop = f"for k in range(np.uint64({begin}[c]), np.uint64({last}[c])):"
        return self._where(roots, kept, [loop, *indented(lines)])

    def _where(self, roots: Roots, kept: dict[Any, str], lines: list[str]) -> list[str]:
        """Lines for clusters of which some particle meets the condition that a pass may have."""
        if "only" not in roots:
            return lines
        own = self._with_lanes([f"some |= {kept[roots['only'][0]]} != 0.0"], kept)
        return ["some = False", EACH, *indented(own), "if some:", *indented(lines)]

    def _apart(
        self,
        p: Pass,
        roots: Roots,
        found: dict[str, dict[int, None]],
        names: dict[int, str],
        kept: dict[Any, str],
        offset: list[str],
    ) -> list[str]:
        """A loop over the lanes of its own for functions that branch, where pairs are in reach."""
        if not found["apart"]:
            return []
        writer = self._writer("near", names)
        reach = self._reach(p, roots, writer)
        lines = self._write(writer, list(found["apart"]))
        zeros = []
        for number in found["apart"]:
            place = self._lane(("apart", number))
            lines.append(f"{place} = {writer.names[number]}")
            zeros.append(f"{place} = 0.0")
        inner = [*offset, *reach, "if r2 < reach2:", *indented(lines), "else:", *indented(zeros)]
        return [EACH, *indented(self._with_own(self._with_lanes(inner, kept)))]

    def _reach(self, p: Pass, roots: Roots, writer: Writer) -> list[str]:
        """The square of the pair's support."""
        if p.support is None:
            return [f"reach2 = {self._lane('reach2')}"]
        (number,) = roots["support"]
        lines = self._write(writer, [number])
        return [*lines, f"reach2 = {writer.names[number]} * {writer.names[number]}"]

    def _left_out(self, p: Pass, roots: Roots) -> list[bool]:
        """Of all components of sums, whether pairs that do not act are to be left out."""
        if p.only is not None:
            return [True for name in p.sums for _ in roots[name]]
        meets_itself = not p.itself and not (
            (p.first == "split" and self.plan.targets == "mobile")
            or (p.last == "split" and self.plan.targets == "walls")
        )
        return [
            not self.values.vanishes(v)
            or (meets_itself and not self.values.vanishes_alone(v))
            or self.values.hazardous(v)
            for name in p.sums
            for v in roots[name]
        ]

    def _act(self, p: Pass, roots: Roots, pairs: Writer) -> list[str]:
        """Evaluate the laws of the pairs and add to the sums."""
        wanted = [n for name in p.sums for n in roots[name] if isinstance(n, int)]
        left_out = self._left_out(p, roots)
        lines: list[str] = []
        if any(left_out):
            lines += self._reach(p, roots, pairs)
            tests = ["(r2 < reach2)"]
            tests += [] if p.itself else ["(l != itself)"]
            tests += [pairs.names[n] for n in roots.get("only", ())]
            lines.append(f"near = {' & '.join(tests)}")
        lines += self._write(pairs, wanted)
        targets = [t for name, values in p.sums.items() for t in sum_names(name, len(values))]
        numbers = [v for name in p.sums for v in roots[name]]
        for target, number, masked in zip(targets, numbers, left_out, strict=True):
            if not isinstance(number, int) and not number:
                continue
            value = pairs.names[number] if isinstance(number, int) else repr(number)
            lines.append(
                f"{self._lane(target)} += {f'{value} if near else 0.0' if masked else value}"
            )
        return lines

    def _finished(self, numbers: Writer, own: list[int]) -> list[str]:
        """Finish the sums and write the rows of the cluster's particles."""
        kept: dict[Any, str] = {number: f"o{k}" for k, number in enumerate(own)}
        writer = self._writer("t", numbers.names | self._names_of(kept))
        kept |= {name: name for name in self._accumulators()}
        for number, place in self.values.record.items():
            writer.names[self.values.mirror(number)] = f"own_{place}"
        lines = self._with_own(self._with_lanes(self._finish(writer), kept))
        return [f"for l in range({self._argument('cluster_size')}[c]):", *indented(lines)]
