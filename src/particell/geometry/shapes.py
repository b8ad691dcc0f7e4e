"""Shapes: regions of space known by their signed distance.

Distances are negative inside. Shapes combine: ``a | b`` (union), ``a & b`` (intersection),
``a - b`` (difference) and ``~a`` (everything else).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from particell.checks import checked, finite, positive
from particell.errors import InputError

Points = Sequence[float] | np.ndarray


def vector(key: str, values: Points) -> np.ndarray:
    """1, 2 or 3 finite coordinates as an array."""
    array = finite(key, values)
    if array.ndim != 1 or not 1 <= len(array) <= 3:
        raise InputError(key, values, "1, 2 or 3 numbers")
    return array


class Shape(ABC):
    """A region of space; subclasses give its signed distance."""

    @abstractmethod
    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance in m of points (n, D) from the surface, negative inside; shape (n,)."""

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Boolean mask (n,) of the points inside."""
        return self.signed_distance(points) < 0

    def normal(self, points: np.ndarray, step: float) -> np.ndarray:
        """Outward unit normals (n, D): the distance's gradient by central differences."""
        dim = points.shape[1]
        gradient = np.empty_like(points, dtype=float)
        for d in range(dim):
            shift = np.zeros(dim)
            shift[d] = step
            gradient[:, d] = self.signed_distance(points + shift) - self.signed_distance(
                points - shift
            )
        length = np.linalg.norm(gradient, axis=1, keepdims=True)
        fallback = np.zeros(dim)
        fallback[0] = 1.0
        return np.where(length > 0, gradient / np.where(length > 0, length, 1.0), fallback)

    def curvature(self, points: np.ndarray, step: float) -> np.ndarray:
        """Mean of the principal curvatures (n,) in 1/m at surface points, positive if convex."""
        dim = points.shape[1]
        if dim == 1:
            return np.zeros(len(points))
        total = np.zeros(len(points))
        for d in range(dim):
            shift = np.zeros(dim)
            shift[d] = step
            forward = self.normal(points + shift, 0.1 * step)[:, d]
            backward = self.normal(points - shift, 0.1 * step)[:, d]
            total += (forward - backward) / (2 * step)
        return total / (dim - 1)

    def __or__(self, other: Shape) -> Shape:
        return _Combined(self, other, np.minimum, "|")

    def __and__(self, other: Shape) -> Shape:
        return _Combined(self, other, np.maximum, "&")

    def __sub__(self, other: Shape) -> Shape:
        return self & ~other

    def __invert__(self) -> Shape:
        return _Complement(self)


class _Combined(Shape):
    def __init__(self, first: Shape, second: Shape, rule: np.ufunc, symbol: str):
        self.first, self.second, self.rule, self.symbol = first, second, rule, symbol

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        return self.rule(self.first.signed_distance(points), self.second.signed_distance(points))

    def __repr__(self) -> str:
        return f"({self.first!r} {self.symbol} {self.second!r})"


class _Complement(Shape):
    def __init__(self, shape: Shape):
        self.shape = shape

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        return -self.shape.signed_distance(points)

    def __repr__(self) -> str:
        return f"~{self.shape!r}"


@checked
class Ball(Shape):
    """An interval in 1D, a circle in 2D, a sphere in 3D.

    Parameters
    ----------
    center
        Coordinates in m.
    radius
        In m, positive.
    """

    def __init__(self, center: Points, radius: float):
        positive("radius", radius)
        self.center, self.radius = vector("center", center), float(radius)

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points - self.center, axis=1) - self.radius

    def volume(self, dim: int) -> float:
        """Its length, area or volume, in m^dim."""
        return {1: 2, 2: math.pi, 3: 4 / 3 * math.pi}[dim] * self.radius**dim

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.center.tolist()}, {self.radius:g})"


class Circle(Ball):
    """A circle in the plane; see :class:`Ball`."""


class Sphere(Ball):
    """A sphere in space; see :class:`Ball`."""


@checked
class HalfSpace(Shape):
    """All points on one side of a plane.

    Parameters
    ----------
    point
        A point of the plane, in m.
    normal
        Points out of the half-space; need not have unit length.
    """

    def __init__(self, point: Points, normal: Points):
        self.point, direction = vector("point", point), vector("normal", normal)
        if direction.shape != self.point.shape:
            raise InputError("normal", normal, "as many numbers as 'point'")
        length = np.linalg.norm(direction)
        if not 0 < length < math.inf:
            raise InputError("normal", normal, "different from zero")
        self.direction = direction / length

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        return (points - self.point) @ self.direction

    def __repr__(self) -> str:
        return f"HalfSpace({self.point.tolist()}, {self.direction.tolist()})"


@checked
class Box(Shape):
    """A box with edges along the axes.

    Parameters
    ----------
    lower, upper
        Corners in m. Infinite numbers make slabs: ``Box((-inf, 0), (inf, H))``.
    """

    def __init__(self, lower: Points, upper: Points):
        self.lower, self.upper = np.array(lower, dtype=float), np.array(upper, dtype=float)
        if self.lower.ndim != 1 or not 1 <= len(self.lower) <= 3:
            raise InputError("lower", lower, "1, 2 or 3 numbers")
        if self.upper.shape != self.lower.shape:
            raise InputError("upper", upper, "as many numbers as 'lower'")
        if not np.all(self.upper > self.lower):  # false for a NaN
            raise InputError("upper", upper, f"greater than 'lower' = {self.lower.tolist()}")

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        beyond = np.maximum(self.lower - points, points - self.upper)
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return outside + np.minimum(beyond.max(axis=1), 0.0)

    def __repr__(self) -> str:
        return f"Box({self.lower.tolist()}, {self.upper.tolist()})"
