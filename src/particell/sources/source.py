r"""How a neighbour is seen: whose neighbours a sweep sums over, and what laws see of them.

A source names the neighbours of a row and may show laws other values than those stored: a wall's
velocity extrapolated through its surface, an image's mirrored one, the properties of the fluid that
meets it. Laws do not know the difference.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from particell.compute.expressions import Node, Number, Vector, call, early, sqrt, symbol
from particell.errors import InputError, unknown_name
from particell.kernels import power, shape_f, shape_w
from particell.laws.fluctuations import pair_numbers

#: Its inverse squared is a number.
TINY = 1e-150


@dataclass(frozen=True)
class Names:
    """What laws may read of a particle, and where it is found.

    Attributes
    ----------
    dim
        The number of dimensions.
    fields
        Fields with their number of components, 0 for a number a particle; of a field that has a
        column for each of several things the name of the number that says which.
    tables
        Properties by group; those that are the same for all groups have a number (False), those
        with columns, as for fields, a name.
    groups
        How many there are, where that is known.
    numbers, vectors
        What is the same for all particles: numbers, and arrays of one number an axis.
    derived
        Values made of others, by a function of the particle.
    """

    dim: int
    fields: Mapping[str, int | str]
    tables: Mapping[str, bool | str] = field(default_factory=dict)
    numbers: frozenset[str] = frozenset()
    vectors: frozenset[str] = frozenset()
    derived: Mapping[str, Callable[[Side], Any]] = field(default_factory=dict)
    groups: int = 0

    def _all(self) -> set[str]:
        return {*self.fields, *self.tables, *self.numbers, *self.vectors, *self.derived}

    def __contains__(self, name: str) -> bool:
        return name in self._all()

    def look(self, name: str, side: Side, derived: bool = True) -> Any:
        """A value of a particle, as symbols."""
        if derived and name in self.derived:
            return self.derived[name](side)
        if name in self.fields:
            components = self.fields[name]
            if isinstance(components, str):
                return symbol("field", name, side.side, components)
            if components == 0:
                return symbol("field", name, side.side)
            parts = [symbol("field", name, side.side, d) for d in range(components)]
            return Vector.of(f"{side.side}.{name}", parts)
        if name in self.tables:
            kind = self.tables[name]
            if kind is False:
                return symbol("number", name)
            return symbol("table", name, side.side, kind if isinstance(kind, str) else None)
        if name in self.numbers:
            return symbol("number", name)
        if name in self.vectors:
            return Vector.of(name, [symbol("array", name, "", d) for d in range(self.dim)])
        raise unknown_name("what a law reads", name, self._all())


class Side:
    """What laws see of particle i or j."""

    def __init__(self, names: Names, side: str, values: Mapping[str, Any] | None = None):
        self.names, self.side = names, side
        self._values = dict(values or {})

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name not in self._values:
            self._values[name] = self._look(name)
        return self._values[name]

    def _look(self, name: str, derived: bool = True) -> Any:
        return self.names.look(name, self, derived)

    @property
    def dim(self) -> int:
        """The number of dimensions."""
        return self.names.dim

    def field(self, name: str) -> Any:
        """A field itself, whatever else goes by its name."""
        return self._look(name, derived=False)

    @property
    def index(self) -> Node:
        """The particle's place, for functions that take it."""
        return symbol("index", "", self.side)

    def replace(self, **values: Any) -> Side:
        """The same particle, seen with other values."""
        other = copy.copy(self)
        other._values = {**self._values, **values}
        return other


class Source:
    """Whom a sweep sums over; derive from it.

    Attributes
    ----------
    first, last
        The list's arrays between whose values the neighbours stand in a row.
    """

    first: str
    last: str

    def see(self, i: Side, j: Side, kernel: int, uniform: bool) -> tuple[Side, Side, Pair]:
        """i, j and the pair as laws see them."""
        raise NotImplementedError

    def numbers(self) -> dict[str, float]:
        """Numbers of its own that loops are given, by name."""
        return {}


def difference(name: str, a: Vector, b: Vector) -> Vector:
    """a − b as a base vector of its own."""
    dim = max(a.dim, b.dim)
    return Vector.of(name, (p - q for p, q in zip(a.parts(dim), b.parts(dim), strict=True)))


class Pair:
    """What a pair of particles has: x_ij, r, e, v_ij, the kernel and its gradient.

    Attributes
    ----------
    x, r, e
        x_i − x_j of the nearest images in m, its length, the unit vector along it.
    v
        v_i − v_j in m/s; of walls extrapolated through the surface.
    support
        The kernel's, the mean of both, in m.
    F, W
        −W'/r in 1/m^(D+2) and the kernel in 1/m^D.
    weight
        V_j F in 1/m².
    wall
        Whether j is a particle of a wall.
    offset
        x as it follows from the places of i and j, where j is seen elsewhere
        (:attr:`.Pass.offset`).
    weighed
        The array along the list that has the pair's weight (see :class:`.Pass`), if any.
    itself, only
        Whether i is its own neighbour too, and a condition on i for there to be any (see
        :class:`.Pass`).
    """

    offset: Vector | None = None
    weighed: str = ""
    itself: bool = False
    only: Node | None = None

    def __init__(
        self,
        i: Side,
        j: Side,
        kernel: int,
        uniform: bool,
        velocity: Any = "v",
        wall: bool = False,
        extrapolation: Number = 1.0,
    ):
        self.i, self.j, self.dim = i, j, i.names.dim
        self.kernel, self.uniform, self.wall = kernel, uniform, wall
        self.extrapolation = extrapolation
        self._velocity = velocity
        self.x = Vector.of("x", [symbol("pair", f"dx{d}", "pair") for d in range(self.dim)])

    @cached_property
    def v(self) -> Vector:
        """See the class."""
        return difference("v", getattr(self.i, self._velocity), getattr(self.j, self._velocity))

    @cached_property
    def square(self) -> Number:
        """r² in m²."""
        return self.x.dot(self.x)

    @cached_property
    def r(self) -> Number:
        """See the class."""
        return sqrt(self.square)

    @cached_property
    def inverse_r(self) -> Number:
        """1/r; finite at r = 0."""
        return 1.0 / (self.r + TINY)

    @cached_property
    def e(self) -> Vector:
        """See the class."""
        return self.inverse_r * self.x

    @cached_property
    def support(self) -> Number:
        """See the class."""
        return self.i.support if self.uniform else early(0.5 * (self.i.support + self.j.support))

    @cached_property
    def _inverse(self) -> Number:
        return 1.0 / self.support

    @cached_property
    def _scale(self) -> Number:
        return symbol("number", "alpha") * call(power, (self._inverse, self.dim))

    @cached_property
    def F(self) -> Number:  # noqa: N802 - the field's symbol
        """See the class."""
        shape = call(shape_f, (self.r * self._inverse, self.kernel))
        return (self._scale * self._inverse * self._inverse) * shape

    @cached_property
    def W(self) -> Number:  # noqa: N802
        """See the class."""
        return self._scale * call(shape_w, (self.r * self._inverse, self.kernel))

    @cached_property
    def weight(self) -> Number:
        """See the class."""
        return self.j.volume * self.F

    def kept(self, name: str) -> Node:
        """What an array along the list has of the pair."""
        return symbol("stored", name, "pair")

    def of_groups(self, name: str, column: str | None = None) -> Node:
        """The entry of a table (G, G), or (G, G, columns), of the groups of i and j."""
        return symbol("groups", name, "" if self.i.names.groups == 1 else "pair", column)

    def noise(self, gaussian: bool) -> Vector:
        """D numbers of zero mean and unit variance, ξ_ij = −ξ_ji, by ids and step."""
        if self.offset is not None:
            raise InputError("noise", "of images", "off: no law says yet how it is mirrored")
        numbers = [symbol("number", name) for name in ("step", "key0", "key1")]
        args = (self.i.id, self.j.id, *numbers, gaussian, self.dim)
        return Vector.of("noise", call(pair_numbers, args, 3)[: self.dim])
