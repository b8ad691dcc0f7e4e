"""Tables of arrangements: where the particles of a phase are, and how large they are."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from particell.casefile.scope import Scope
from particell.casefile.table import Name, Position, Table, describes
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import (
    around,
    arranged,
    fitting_spacing,
    jittered,
    lattice,
    packed,
    rings,
    shells,
    wrapped,
)
from particell.geometry.shapes import Ball
from particell.units import Length, Number

#: Points and the volume of each.
Filled = tuple[np.ndarray, float | np.ndarray]
_Spacing = Annotated[Length, Field(gt=0)]
_Seed = Annotated[int, Field(ge=0, lt=2**56)]
#: Nobody waits for more.
MOST_ITERATIONS = 10_000


def sites(domain: Domain, spacing: float) -> float:
    """How many particles fill a domain, about."""
    return math.prod(domain.lengths / spacing)


def ball_of(scope: Scope, key: str, name: str) -> Ball:
    """A ball by name."""
    shape = scope.shape(name)
    if not isinstance(shape, Ball):
        raise InputError(key, name, "the name of a ball, circle or sphere")
    return shape


class _FillTable(Table):
    def needs(self) -> Iterable[str]:
        """The phases that have to be there before."""
        return getattr(self, "fixed", ())


@describes(lattice)
class LatticeFill(_FillTable):
    """Points of a lattice that fits the domain."""

    type: Literal["lattice"]
    """What it is."""
    spacing: _Spacing
    shape: Name | None
    kind: Literal["square", "hexagonal"]

    def estimate(self, scope: Scope) -> float:
        """About how many particles, at most."""
        return sites(scope.domain, self.spacing)

    def build(self, scope: Scope) -> Filled:
        """Points and volume."""
        shape = scope.shape(self.shape) if self.shape else None
        total = len(lattice(scope.domain, self.spacing, None, self.kind))
        points = lattice(scope.domain, self.spacing, shape, self.kind)
        return points, scope.domain.volume / total


@describes(arranged, lattice)
class ArrangedFill(_FillTable):
    """The whole domain, with points displaced at random, and relaxed if packed."""

    type: Literal["arranged"]
    """What it is."""
    spacing: _Spacing
    kind: Literal["square", "hexagonal", "jittered", "packed"]
    """A lattice, one that is displaced at random by 0.1 spacings, or a relaxed arrangement."""
    seed: _Seed = 1
    fixed: tuple[Name, ...] = ()
    """Names of phases whose points "packed" keeps its distance from."""

    def estimate(self, scope: Scope) -> float:
        """About how many particles."""
        return sites(scope.domain, self.spacing)

    def build(self, scope: Scope) -> Filled:
        """Points and volume."""
        points = arranged(
            scope.domain, self.spacing, self.kind, self.seed, points_of(scope, self.fixed)
        )
        return points, scope.domain.volume / len(points)


@describes(around, lattice)
class AroundFill(_FillTable):
    """The domain around a ball: as many particles as fit beside it, those near it relaxed."""

    type: Literal["around"]
    """What it is."""
    spacing: _Spacing
    ball: Name
    """Name of a ball, circle or sphere."""
    fixed: tuple[Name, ...] = ()
    """Names of phases whose points push but do not move: walls, what fills the ball."""
    reach: Annotated[Number, Field(ge=0)]

    def estimate(self, scope: Scope) -> float:
        """About how many particles."""
        return sites(scope.domain, self.spacing)

    def build(self, scope: Scope) -> Filled:
        """Points and volume."""
        ball = ball_of(scope, "ball", self.ball)
        fixed = points_of(scope, self.fixed)
        points = around(scope.domain, self.spacing, ball, fixed, self.reach)
        volume = float(np.prod(fitting_spacing(scope.domain, self.spacing)))
        return points, volume


@describes(rings)
class RingsFill(_FillTable):
    """Concentric circles that fill a ring, or with ``inner = 0`` a circle; in 2D."""

    type: Literal["rings"]
    """What it is."""
    ball: Name
    """Name of a circle: its centre is used."""
    inner: Annotated[Length, Field(ge=0)]
    outer: Annotated[Length, Field(gt=0)]
    spacing: _Spacing

    def estimate(self, scope: Scope) -> float:
        """About how many particles."""
        return math.pi * max(0.0, self.outer**2 - self.inner**2) / self.spacing**2

    def build(self, scope: Scope) -> Filled:
        """Points and volumes."""
        if scope.dim != 2:
            raise InputError("type", self.type, "'shells' in 3 dimensions: rings are for 2")
        return rings(ball_of(scope, "ball", self.ball), self.inner, self.outer, self.spacing)


@describes(shells)
class ShellsFill(_FillTable):
    """Concentric spheres that fill a shell, or with ``inner = 0`` a ball; in 3D."""

    type: Literal["shells"]
    """What it is."""
    ball: Name
    """Name of a sphere: its centre is used."""
    inner: Annotated[Length, Field(ge=0)]
    outer: Annotated[Length, Field(gt=0)]
    spacing: _Spacing

    def estimate(self, scope: Scope) -> float:
        """About how many particles."""
        return 4 / 3 * math.pi * max(0.0, self.outer**3 - self.inner**3) / self.spacing**3

    def build(self, scope: Scope) -> Filled:
        """Points and volumes."""
        if scope.dim != 3:
            raise InputError("type", self.type, "'rings' in 2 dimensions: shells are for 3")
        return shells(ball_of(scope, "ball", self.ball), self.inner, self.outer, self.spacing)


class PointsFill(_FillTable):
    """Points that are given one by one."""

    type: Literal["points"]
    """What it is."""
    points: Annotated[list[Position], Field(min_length=1)]
    """Positions."""
    spacing: _Spacing
    """Distance of neighbours, to the power of the dimension the volume of a particle."""

    def estimate(self, scope: Scope) -> float:
        """How many particles."""
        return len(self.points)

    def build(self, scope: Scope) -> Filled:
        """Points and volume."""
        points = np.array([scope.vector("points", point) for point in self.points])
        return points, self.spacing**scope.dim


#: Arrangements that others are made from.
ArrangedTable = Annotated[
    LatticeFill | RingsFill | ShellsFill | PointsFill, Field(discriminator="type")
]


class _MadeOf(_FillTable):
    of: Any

    def needs(self) -> Iterable[str]:
        """See the base class."""
        return (*self.of.needs(), *super().needs())

    def estimate(self, scope: Scope) -> float:
        """As many as those that are moved."""
        return self.of.estimate(scope)


@describes(jittered)
class JitteredFill(_MadeOf):
    """Another arrangement, displaced at random; across periodic edges points come in again."""

    type: Literal["jittered"]
    """What it is."""
    of: ArrangedTable
    """The arrangement: a lattice, rings or points."""
    amplitude: Annotated[Length, Field(ge=0)]
    """Standard deviation of the displacements along each axis."""
    seed: _Seed = 1
    """Of the random displacements."""

    def build(self, scope: Scope) -> Filled:
        """Points and volume."""
        points, volume = self.of.build(scope)
        return wrapped(scope.domain, jittered(points, self.amplitude, self.seed)), volume


@describes(packed)
class PackedFill(_MadeOf):
    """Another arrangement, relaxed until its points are evenly spread."""

    type: Literal["packed"]
    """What it is."""
    of: Annotated[
        LatticeFill | RingsFill | ShellsFill | PointsFill | JitteredFill,
        Field(discriminator="type"),
    ]
    """The arrangement: a lattice, rings or points, which may be jittered."""
    spacing: _Spacing
    fixed: tuple[Name, ...] = ()
    """Names of phases whose points push but do not move: walls, bodies."""
    keep_inside: Name | None
    """Name of a shape; points that leave it are put back on the near side of its surface."""
    tolerance: Annotated[Number, Field(ge=0)]
    iterations: Annotated[int, Field(gt=0, le=MOST_ITERATIONS)]

    def build(self, scope: Scope) -> Filled:
        """Points and volume."""
        points, volume = self.of.build(scope)
        fixed = points_of(scope, self.fixed)
        inside = scope.shape(self.keep_inside) if self.keep_inside else None
        moved = packed(
            points, scope.domain, self.spacing, fixed, inside, self.tolerance, self.iterations
        )
        return moved, volume


def points_of(scope: Scope, names: Iterable[str]) -> np.ndarray | None:
    """The points of phases that are there already, one after another."""
    found = [scope.phases[name].points for name in names]
    return np.concatenate(found) if found else None


def wall_sites(scope: Scope, spacing: float, layers: int, axis: int | None) -> float:
    """Particles of the walls across one axis, or on all sides."""
    numbers = scope.domain.lengths / fitting_spacing(scope.domain, spacing)
    if axis is not None:
        return 2 * layers * math.prod(np.delete(numbers, axis))
    # the walls across an axis go on beyond the domain along those before it
    beyond = [np.append(numbers[:d] + 2 * layers, numbers[d + 1 :]) for d in range(scope.dim)]
    return sum(2 * layers * math.prod(others) for others in beyond)


FillTable = Annotated[
    LatticeFill
    | ArrangedFill
    | AroundFill
    | RingsFill
    | ShellsFill
    | PointsFill
    | JitteredFill
    | PackedFill,
    Field(discriminator="type"),
]
