"""Tables of shapes, which other tables refer to by name."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import Field, PlainSerializer

from particell.casefile.scope import Scope
from particell.casefile.table import Name, Position, Table, describes
from particell.errors import InputError
from particell.geometry.shapes import Ball, Box, HalfSpace, Shape
from particell.units import Number, Quantity

_Corner = Annotated[
    float,
    Field(allow_inf_nan=True),
    Quantity("m", infinite=True),
    # JSON has no infinite numbers
    PlainSerializer(lambda x: x if math.isfinite(x) else str(x), when_used="json"),
]


class _ShapeTable(Table):
    def needs(self) -> Iterable[str]:
        """The shapes that it is made of."""
        return ()


@describes(Box)
class BoxTable(_ShapeTable):
    """A box with edges along the axes; infinite corners (inf, -inf) make slabs."""

    type: Literal["Box"]
    """What it is."""
    lower: Annotated[tuple[_Corner, ...], Field(min_length=1, max_length=3)]
    """Lower corner."""
    upper: Annotated[tuple[_Corner, ...], Field(min_length=1, max_length=3)]
    """Upper corner."""

    def build(self, scope: Scope) -> Shape:
        """The shape."""
        return Box(scope.vector("lower", self.lower), scope.vector("upper", self.upper))


@describes(Ball)
class BallTable(_ShapeTable):
    """An interval in 1D, a circle in 2D, a sphere in 3D."""

    type: Literal["Ball", "Circle", "Sphere"]
    """What it is."""
    center: Position
    radius: Annotated[float, Field(gt=0), Quantity("m")]

    def build(self, scope: Scope) -> Shape:
        """The shape."""
        needed = {"Circle": 2, "Sphere": 3}.get(self.type, scope.dim)
        if needed != scope.dim:
            raise InputError("type", self.type, f"'Ball' in {scope.dim} dimensions")
        return Ball(scope.vector("center", self.center), self.radius)


@describes(HalfSpace)
class HalfSpaceTable(_ShapeTable):
    """All points on one side of a plane."""

    type: Literal["HalfSpace"]
    """What it is."""
    point: Position
    normal: Annotated[tuple[Number, ...], Field(min_length=1, max_length=3)]

    def build(self, scope: Scope) -> Shape:
        """The shape."""
        return HalfSpace(scope.vector("point", self.point), scope.vector("normal", self.normal))


class CombinedTable(_ShapeTable):
    """Other shapes put together."""

    type: Literal["union", "intersection", "difference"]
    """Everything in one of them, what is in all of them, or the first without the others."""
    of: Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)]
    """Names of shapes."""

    def needs(self) -> Iterable[str]:
        """See the base class."""
        return self.of

    def build(self, scope: Scope) -> Shape:
        """The shape."""
        rules = {"union": operator.or_, "intersection": operator.and_, "difference": operator.sub}
        return functools.reduce(rules[self.type], [scope.shape(name) for name in self.of])


class ComplementTable(_ShapeTable):
    """Everything outside of another shape."""

    type: Literal["complement"]
    """What it is."""
    of: Name
    """Name of a shape."""

    def needs(self) -> Iterable[str]:
        """See the base class."""
        return (self.of,)

    def build(self, scope: Scope) -> Shape:
        """The shape."""
        return ~scope.shape(self.of)


ShapeTable = Annotated[
    BoxTable | BallTable | HalfSpaceTable | CombinedTable | ComplementTable,
    Field(discriminator="type"),
]
