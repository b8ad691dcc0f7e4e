"""Planes in which a domain is seen: itself in 1D and 2D, three through its middle in 3D."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from particell.geometry.domain import AXES, Domain
from particell.plots.style import new_figure
from particell.units import length_scale

#: Width in inches of a figure of one plane, and of each of three beside each other.
WIDTH, WIDTH_OF_THREE = 4.6, 3.0
#: Inches that labels and a colour scale take of the width, and labels of the height.
MARGINS = (1.4, 0.8)


@dataclass(frozen=True)
class Plane:
    """A plane, or a slice round it.

    Attributes
    ----------
    first, second
        The axes that are seen; in 1D the second is 1, and nothing lies along it.
    normal
        The axis across, None in 1D and 2D.
    at
        Its coordinate there in m.
    """

    first: int
    second: int
    normal: int | None = None
    at: float = 0.0

    def within(self, position: np.ndarray, thickness: float) -> np.ndarray:
        """Mask (n,) of the positions (n, D) in m in the slice of a thickness round the plane."""
        if self.normal is None:
            return np.ones(len(position), bool)
        # one layer of a lattice that lies evenly to both sides, not two
        offset = position[:, self.normal] - self.at + 1e-9 * thickness
        return (offset >= -0.5 * thickness) & (offset < 0.5 * thickness)

    def seen(self, position: np.ndarray) -> np.ndarray:
        """The coordinates (n, 2) in the plane of positions (n, D)."""
        if position.shape[1] == 1:
            return np.column_stack([position[:, 0], np.zeros(len(position))])
        return position[:, [self.first, self.second]]


def planes_of(domain: Domain) -> list[Plane]:
    """What of a domain a figure shows."""
    if domain.dim < 3:
        return [Plane(0, 1)]
    middle = 0.5 * (domain.lower + domain.upper)
    return [plane_across(domain, axis, float(middle[axis])) for axis in (2, 1, 0)]


def plane_across(domain: Domain, normal: int, at: float) -> Plane:
    """The plane across an axis of a 3D domain."""
    first, second = (a for a in range(3) if a != normal)
    return Plane(first, second, normal, at)


def spacing_of(domain: Domain, count: int) -> float:
    """Distance in m of ``count`` particles that fill a domain."""
    return float((domain.volume / max(count, 1)) ** (1 / domain.dim))


def box_of(domain: Domain, positions: np.ndarray, room: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of what is shown: the domain, and what lies beyond it (walls) with room round it."""
    lower, upper = domain.lower.copy(), domain.upper.copy()
    if len(positions):
        free = ~np.asarray(domain.periodic)
        low, high = positions.min(axis=0) - room, positions.max(axis=0) + room
        beyond = free & (low < lower - room), free & (high > upper + room)
        lower[beyond[0]], upper[beyond[1]] = low[beyond[0]], high[beyond[1]]
    return lower, upper


def panels(
    domain: Domain, planes: list[Plane], box: tuple[np.ndarray, np.ndarray]
) -> tuple[Figure, list[Axes]]:
    """A figure of planes beside each other, with room for a colour scale at its right."""
    factor, unit = length_scale(float(domain.lengths.max()))
    lower, upper = box[0] / factor, box[1] / factor
    sides = np.array([_sides(plane, upper - lower) for plane in planes])
    width = WIDTH if len(planes) == 1 else WIDTH_OF_THREE
    room = width - (MARGINS[0] if len(planes) == 1 else 0.9)
    height = float(np.clip((room * sides[:, 1] / sides[:, 0]).max() + 0.8, 1.6, 7.0))
    total = width * len(planes) + (0.7 if len(planes) > 1 else 0.0)
    figure, grid = new_figure(total, height, columns=len(planes))
    found = list(np.atleast_1d(grid).ravel())
    for axes, plane in zip(found, planes, strict=True):
        axes.set_aspect("equal")
        axes.set_xlim(lower[plane.first], upper[plane.first])
        axes.set_xlabel(f"{AXES[plane.first]} [{unit}]")
        if domain.dim > 1:
            axes.set_ylim(lower[plane.second], upper[plane.second])
            axes.set_ylabel(f"{AXES[plane.second]} [{unit}]")
        else:
            axes.set_yticks([])
        if len(planes) > 1 and plane.normal is not None:
            axes.set_title(f"{AXES[plane.normal]} = {plane.at / factor:.4g} {unit}")
    return figure, found


def marker_area(axes: Axes, spacing: float, domain: Domain) -> float:
    """Area in points² of a disc as wide as a spacing in m."""
    factor, _ = length_scale(float(domain.lengths.max()))
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    figure = axes.figure
    count = len(figure.axes)  # beside each other; before there is a colour scale
    width, height = figure.get_size_inches() - (MARGINS[0] if count == 1 else 0.7, MARGINS[1])  # type: ignore[union-attr]
    scale = (width / count - (0.0 if count == 1 else 0.8)) / (right - left)
    if domain.dim > 1:
        scale = min(scale, height / (high - low))
    full = (72 * spacing / factor * scale) ** 2
    return float(full if domain.dim == 1 else np.clip(1.2 * full, 0.3, 400))


def _sides(plane: Plane, lengths: np.ndarray) -> tuple[float, float]:
    if len(lengths) == 1:
        return float(lengths[0]), 0.2 * float(lengths[0])
    return float(lengths[plane.first]), float(lengths[plane.second])
