"""What depends on what among the expressions of a plan: of particle i, of j, or of the pair."""

from __future__ import annotations

from typing import Any

from particell.compute.emit import Numbering
from particell.compute.expressions import Node
from particell.compute.plan import Pass, Plan
from particell.kernels import power, shape_f, shape_w

#: What a value depends on.
NUMBER, OWN, ITS, PAIR = range(4)
_SIDES = {"": NUMBER, "i": OWN, "j": ITS, "pair": PAIR}
#: Roots of a pass that decide whom it sees, and where.
SEEING = ("support", "offset", "only")
#: Fields that are finite as long as a run is not broken; others may hold infinity.
FINITE = {"x", "v", "a", "mass", "volume", "support", "density", "density_half", "density_rate"}
FINITE |= {"pressure", "pressure_term", "transport", "shift", "flux", "kernel_sum", "buoyancy"}
#: What is true or false, which no record and no column holds.
CONDITIONS = ("<", "<=", ">", ">=", "==", "!=", "and", "or")
#: What is not finite, or no number, for some arguments.
FUNCTIONS = ("call", "sqrt", "log", "exp", "**")


class Dependence:
    """The numbered expressions of a plan, and where each of them can be computed.

    Attributes
    ----------
    roots
        Pass by pass, the numbers of all that it has to compute, by name.
    placed
        Whether places are looked at; they are then the first numbers of a record.
    record
        The largest expressions of j alone, and their places in a particle's record.
    """

    def __init__(self, plan: Plan):
        self.plan = plan
        self.numbering = Numbering()
        self._levels: dict[int, int] = {}
        self._vanishing: dict[int, bool] = {}
        self._alone: dict[int, bool] = {}
        self.record: dict[int, int] = {}
        self.roots = [self._roots(p) for p in plan.passes]
        self.placed = not all(p.weighed for p in plan.passes) or any(
            map(self.needs_places, self.roots)
        )
        self._first = plan.dim if self.placed else 0
        for found in self.roots:
            self._find_packed(found)

    def number(self, value: Any) -> Any:
        """The number of a node; a plain number as a float."""
        return self.numbering(value) if isinstance(value, Node) else float(value)

    def _roots(self, p: Pass) -> dict[str, tuple[Any, ...]]:
        """Numbers of all that a pass has to compute."""
        found = {name: tuple(map(self.number, values)) for name, values in p.sums.items()}
        found |= {f"stored {name}": (self.number(v),) for name, v in p.stored.items()}
        if p.support is not None:
            found["support"] = (self.number(p.support),)
        if p.only is not None:
            found["only"] = (self.number(p.only),)
        return found | {"offset": tuple(map(self.number, p.offset))}

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

    def is_whole(self, number: int) -> bool:
        """Whether a value is a field of whole numbers, which no record holds."""
        node = self.numbering.nodes[number]
        return node.op == "symbol" and node.what[1] in self.plan.whole

    def is_index(self, number: int) -> bool:
        """Whether a value is a particle's place."""
        node = self.numbering.nodes[number]
        return node.op == "symbol" and node.what[0] == "index"

    def is_early(self, number: int) -> bool:
        """Whether a value is computed where neighbours are gathered."""
        node = self.numbering.nodes[number]
        if node.op == "item":
            return self.is_early(self.numbering.uses(number)[0])
        return node.op == "early" or (node.op == "call" and bool(node.what[2]))

    def split(self, roots: dict[str, tuple[Any, ...]]) -> tuple[list[int], list[int]]:
        """Of a pass: what is gathered into columns, and what has to be known of i before."""
        columns: dict[int, None] = {}
        once: dict[int, None] = {}
        seen: set[int] = set()
        for number in roots["offset"]:  # computed where neighbours are gathered
            once |= dict.fromkeys(self._own_below(number))
        waiting = [
            n for k, values in roots.items() if k != "offset" for n in values if isinstance(n, int)
        ]
        while waiting:
            number = waiting.pop(0)
            if number in seen:
                continue
            seen.add(number)
            node, level = self.numbering.nodes[number], self.level(number)
            if level in (NUMBER, OWN):
                once.setdefault(number)
            elif node.op not in CONDITIONS and (
                level == ITS or self.is_early(number) or node.op == "symbol"
            ):
                columns.setdefault(number)
                if level != ITS and node.op != "symbol":
                    waiting += self._own_below(number)
            else:
                waiting += self.numbering.uses(number)
        return list(columns), list(once)

    def _own_below(self, number: int) -> list[int]:
        """What a value that is computed early needs of i."""
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
            if self.level(number) != ITS or self.numbering.nodes[number].op in CONDITIONS:
                waiting += self.numbering.uses(number)
            elif not self.is_whole(number) and not self.is_index(number):
                self.record.setdefault(number, self._first + len(self.record))

    def vanishes(self, value: Any) -> bool:
        """Whether a value is zero beyond the support: it has the kernel as a factor."""
        if not isinstance(value, int):
            return value == 0.0
        found = self._vanishing.get(value)
        if found is None:  # once: expressions share their terms
            found = self._vanishing[value] = self._vanishes(value)
        return found

    def _vanishes(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        # whole numbers are numbers of expressions here, and not what stands in a law
        values = (self.numbering(a) if isinstance(a, Node) else float(a) for a in node.args[:3])
        parts = [self.vanishes(value) for value in values]
        if node.op == "*":
            return any(parts)
        if node.op in ("+", "-", "neg", "max", "min", "early"):
            return all(parts)
        if node.op in ("/", "sqrt"):
            return parts[0]
        if node.op == "where":
            return parts[1] and parts[2]
        return node.op == "call" and node.what[0] in (shape_f, shape_w)

    def vanishes_alone(self, value: Any) -> bool:
        """Whether a value is zero for a particle with itself, by what differs between the two."""
        if not isinstance(value, int):
            return value == 0.0
        found = self._alone.get(value)
        if found is None:
            found = self._alone[value] = self._vanishes_alone(value)
        return found

    def _vanishes_alone(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        parts = [
            self.numbering(a) if isinstance(a, Node) else float(a)
            for a in node.args
            if isinstance(a, Node | int | float)
        ]
        if node.op == "symbol":
            return self.is_offset(number)
        if node.op == "*":
            return any(map(self.vanishes_alone, parts))
        if node.op == "-" and len(self.numbering.uses(number)) == 2:
            one, other = map(self.mirror, self.numbering.uses(number))
            if one == other:
                return True
        if node.op in ("+", "-", "neg", "max", "min", "early"):
            return all(map(self.vanishes_alone, parts))
        if node.op in ("/", "sqrt"):
            return self.vanishes_alone(parts[0])
        if node.op == "where":
            return all(map(self.vanishes_alone, parts[1:]))
        return False

    def reads_along_rows(self) -> bool:
        """Whether anything is read that is kept of pairs."""
        whats = (node.what for node in self.numbering.nodes if node.op == "symbol")
        return any(what[0] == "stored" for what in whats)

    def is_dear(self, value: Any) -> bool:
        """Whether a value takes functions of pairs that no vector computes quickly."""
        if not isinstance(value, int):
            return False
        waiting, seen = [value], set()
        while waiting:
            number = waiting.pop()
            if number in seen or self.level(number) != PAIR or self.is_early(number):
                continue
            seen.add(number)
            node = self.numbering.nodes[number]
            cheap = node.op == "call" and node.what[0] in (shape_f, shape_w, power)
            if node.op in FUNCTIONS and node.op != "sqrt" and not cheap:
                return True
            waiting += self.numbering.uses(number)
        return False

    def hazardous(self, value: Any) -> bool:
        """Whether a value of a pair may not be finite where it should vanish.

        That is where something of the pair is divided by (but for 1/(r + ε)), a function other than
        the kernel taken, or a field read that may hold infinity.
        """
        if not isinstance(value, int):
            return False
        below = self.numbering.under([value])
        return not self.is_finite(value) or any(map(self._is_hazard, below))

    def _is_hazard(self, number: int) -> bool:
        node = self.numbering.nodes[number]
        if self.level(number) != PAIR:
            return False
        if node.op == "/" and isinstance(node.args[1], Node):
            divisor = self.numbering.uses(number)[-1]
            below = self.numbering.nodes[divisor]
            bounded = below.op == "+" and any(isinstance(a, float) and a > 0 for a in below.args)
            roots = [self.numbering.nodes[k].op for k in self.numbering.uses(divisor)]
            return self.level(divisor) == PAIR and not (bounded and roots == ["sqrt"])
        if node.op == "call":
            return node.what[0] not in (shape_f, shape_w, power)
        return node.op in FUNCTIONS and node.op != "sqrt"

    def mirror(self, number: int) -> int:
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

    def needs_places(self, roots: dict[str, tuple[Any, ...]]) -> bool:
        """Whether a pass looks at where particles are."""
        under = self.numbering.under(n for v in roots.values() for n in v if isinstance(n, int))
        nodes = (self.numbering.nodes[number] for number in under)
        return any(n.op == "symbol" and n.what[0] in ("pair", "apart") for n in nodes)

    def is_offset(self, number: int) -> bool:
        """Whether a value is a component of x_ij."""
        node = self.numbering.nodes[number]
        return node.op == "symbol" and node.what[0] == "pair"

    def is_finite(self, number: int) -> bool:
        """Whether a value is made of fields that are finite: zero times infinity is no number."""
        nodes = (self.numbering.nodes[k] for k in self.numbering.under([number]))
        whats = (node.what for node in nodes if node.op == "symbol")
        return all(kind != "field" or name in FINITE for kind, name, *_ in whats)

    def risky(self, roots: list[Any], columns: list[int]) -> set[int]:
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
