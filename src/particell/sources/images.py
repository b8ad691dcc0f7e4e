r"""Images: particles mirrored at planes, which are stored nowhere.

Near a plane with the unit normal *n* (into the fluid) through the point *p* each particle j is seen
once more, at

.. math:: x_{j'} = x_j - 2\, s_j\, n, \qquad s_j = n\cdot(x_j - p),

with the scalars of j, its vectors mirrored, :math:`a' = a - 2 (n\cdot a)\,n`, and the velocity

.. math:: v_{j'} = v_j - 2\, n\cdot(v_j - v_w)\, n \quad\text{(free slip)}, \qquad
          v_{j'} = 2 v_w - v_j \quad\text{(no slip)},

with :math:`v_w` of the plane. Sums over particles and images are those of the whole that is
symmetric about the plane, to round-off: density, pressure and velocity have no jump there.

**Who is seen.** For i and j on the fluid's side

.. math:: |x_i - x_{j'}|^2 = |x_i - x_j|^2 + 4\, s_i s_j \ge |x_i - x_j|^2 ,

since the parts along the plane are equal and :math:`(s_i + s_j)^2 - (s_i - s_j)^2 = 4 s_i s_j`. So
whoever has an image within the support of i is itself within it: the row of i in the neighbour list
holds all candidates but one, the image of i itself, which is seen too. And as
:math:`|x_i - x_{j'}| \ge s_i`, nobody is seen from further away than the largest support.

**Several planes.** A chain of mirrors is an image of images: what the first makes of j, the next
mirrors. At planes at right angles to each other each part of the offset keeps its own
:math:`4 s_i s_j`, all said above holds, and the images are the mirrors and all their products: the
point reflection at edges, the inversion at corners (:func:`at_planes`). Between planes that face
each other chains are further away than the planes are. Other angles would need a rule by which
an image belongs to one of them alone.

Not for thermal noise, whose numbers would have to be mirrored as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.compute.expressions import Node, Number, Vector, symbol
from particell.errors import InputError
from particell.sources.mobile import MOBILE
from particell.sources.source import Names, Pair, Side, Source

#: Sines and cosines of angles below this are zero.
ANGLE = 1e-12


@dataclass(frozen=True)
class Plane:
    """A plane that mirrors.

    Attributes
    ----------
    name
        Of its own, a word.
    point, direction
        A point of it in m, and the unit normal into the fluid.
    slip
        Whether the fluid slips along it, or moves with it.
    velocity
        Of the plane, in m/s; zero if empty.
    """

    name: str
    point: tuple[float, ...]
    direction: tuple[float, ...]
    slip: bool = True
    velocity: tuple[float, ...] = ()

    @property
    def place(self) -> float:
        """n·p in m."""
        return sum(n * p for n, p in zip(self.direction, self.point, strict=True))

    def numbers(self) -> dict[str, float]:
        """n·p, n and v_w, by the names that loops know them by."""
        velocity = self.velocity or (0.0,) * len(self.direction)
        found = {f"{self.name}_place": self.place}
        for d, (n, v) in enumerate(zip(self.direction, velocity, strict=True)):
            found |= {f"{self.name}_normal_{d}": n, f"{self.name}_velocity_{d}": v}
        return found

    def normal(self, dim: int) -> Vector:
        """n, as symbols."""
        parts = [symbol("number", f"{self.name}_normal_{d}") for d in range(dim)]
        return Vector.of(f"{self.name}_normal", parts)

    def moving(self, dim: int) -> Vector:
        """v_w, as symbols."""
        parts = [symbol("number", f"{self.name}_velocity_{d}") for d in range(dim)]
        return Vector.of(f"{self.name}_velocity", parts)

    @property
    def place_symbol(self) -> Node:
        """n·p, as loops know it."""
        return symbol("number", f"{self.name}_place")

    def distance(self, p: Side) -> Number:
        """s of a particle in m."""
        return self.normal(p.dim).dot(p.x) - self.place_symbol

    def mirrored(self, a: Vector, dim: int) -> Vector:
        """a − 2 (n·a) n."""
        n = self.normal(dim)
        return a - (2.0 * n.dot(a)) * n

    def seen_velocity(self, v: Vector, rate: bool) -> Vector:
        """What a velocity becomes, or (``rate``) what it changes by."""
        dim = v.dim
        wall = Vector({}) if rate else self.moving(dim)
        return self.mirrored(v - wall, dim) + wall if self.slip else wall + wall - v


class Image(Side):
    """A particle as it is seen in a chain of mirrors."""

    def __init__(self, names: Names, side: str, source: Images):
        super().__init__(names, side)
        self._source = source

    def _look(self, name: str, derived: bool = True) -> Any:
        found = self.names.look(name, self, derived)
        if derived and name in self.names.derived:
            if name not in self._source.velocities:  # made of what is mirrored already
                return found
            found = self.names.look(name, Side(self.names, self.side))
            return self._seen(name, found)
        if self.names.fields.get(name) != self.dim or not isinstance(found, Vector):
            return found
        return self._seen(name, found)

    def _seen(self, name: str, found: Vector) -> Vector:
        """A vector as mirrors show it."""
        for plane in self._source.planes:
            if name in self._source.velocities:
                found = plane.seen_velocity(found, rate=False)
            elif name in self._source.rates:
                found = plane.seen_velocity(found, rate=True)
            else:
                found = plane.mirrored(found, self.dim)
            if name == "x":
                found = found + (2.0 * plane.place_symbol) * plane.normal(self.dim)
        return Vector.of(f"image.{name}", found.parts(self.dim))


@dataclass(frozen=True)
class Images(Source):
    """Neighbours, and the particle itself, as they are seen in a chain of mirrors.

    Attributes
    ----------
    planes
        The mirrors, one after the other.
    reach
        The largest support of any particle in m.
    of
        Whose images they are.
    velocities, rates
        Fields that are velocities, and what changes velocities: all that no slip turns round.
        Other vectors are mirrored.
    """

    planes: tuple[Plane, ...]
    reach: float
    of: Source = MOBILE
    velocities: tuple[str, ...] = ("v", "transport", "v_ahead")
    rates: tuple[str, ...] = ("a", "flux")

    @property
    def first(self) -> str:  # type: ignore[override]
        """See :class:`.Source`."""
        return self.of.first

    @property
    def last(self) -> str:  # type: ignore[override]
        """See :class:`.Source`."""
        return self.of.last

    def numbers(self) -> dict[str, float]:
        """See :class:`.Source`."""
        found = {"image_reach": self.reach, **self.of.numbers()}
        for plane in self.planes:
            found |= plane.numbers()
        return found

    def see(self, i: Side, j: Side, kernel: int, uniform: bool) -> tuple[Side, Side, Pair]:
        """i, the image of j, and the pair as laws see them."""
        i, j, pair = self.of.see(i, Image(j.names, j.side, self), kernel, uniform)
        dim = i.dim
        apart = [symbol("apart", f"dx{d}", "pair") for d in range(dim)]
        offset, near = Vector.of("apart", apart), None
        for plane in self.planes:
            n, own = plane.normal(dim), plane.distance(i)
            # y the image so far: x_i − y', as n·(y − p) = s_i − n·(x_i − y)
            offset = Vector.of("image", (offset + (2.0 * (own - n.dot(offset))) * n).parts(dim))
            close: Node = own < symbol("number", "image_reach")
            near = close if near is None else near & close
        pair.offset, pair.itself, pair.only = offset, True, near
        return i, j, pair


def chains(planes: Sequence[Plane], reach: float) -> list[tuple[Plane, ...]]:
    """All sets of planes in which particles are seen, the planes themselves first.

    Parameters
    ----------
    planes
        The mirrors, at right angles, or parallel and a support apart.
    reach
        The largest support in m.

    Raises
    ------
    InputError
        For planes at other angles, or too near to each other.
    """
    crossing = {}
    for a, b in itertools.combinations(planes, 2):
        cosine = sum(p * q for p, q in zip(a.direction, b.direction, strict=True))
        if abs(cosine) > ANGLE and abs(abs(cosine) - 1.0) > ANGLE:
            angle = f"at {math.degrees(math.acos(cosine)):.3g}° to each other"
            raise InputError("planes", angle, "at right angles, or parallel")
        crossing[a.name, b.name] = abs(cosine) <= ANGLE
        gap = abs(a.place - math.copysign(1.0, cosine) * b.place)
        if not crossing[a.name, b.name] and gap < reach:
            raise InputError("planes", f"{gap:g} m apart", f"parallel ones at least {reach:g} m")
    return [
        chain
        for number in range(1, len(planes) + 1)
        for chain in itertools.combinations(planes, number)
        if all(crossing[a.name, b.name] for a, b in itertools.combinations(chain, 2))
    ]


def at_planes(planes: Sequence[Plane], reach: float, **options: Any) -> tuple[Images, ...]:
    """All images in ``planes``, as :func:`chains` has them; ``options`` are of :class:`Images`."""
    return tuple(Images(chain, reach, **options) for chain in chains(planes, reach))


def points_with_images(
    planes: Sequence[Plane], x: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, D) and, after them, their images within ``reach`` of the planes; of whom they are.

    Returns
    -------
    points, rows
        Shapes (m, D) and (m,).
    """
    points, rows = [x], [np.arange(len(x))]
    for chain in chains(planes, reach):
        image, near = x, np.ones(len(x), bool)
        for plane in chain:
            away = image @ np.array(plane.direction) - plane.place
            near &= np.abs(away) < reach
            image = image - 2.0 * away[:, None] * np.array(plane.direction)
        points.append(image[near])
        rows.append(np.flatnonzero(near))
    return np.concatenate(points), np.concatenate(rows)
