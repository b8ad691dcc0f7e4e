"""The region of space that is simulated: a box, periodic on the axes one chooses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from particell.checks import checked
from particell.errors import InputError

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

AXES = "xyz"


@checked
class Domain:
    """A box in 1, 2 or 3 dimensions.

    Parameters
    ----------
    lower, upper
        Corners, in m, one number per dimension.
    periodic
        The periodic axes as letters, for example ``"x"`` or ``"xy"``; none by default.
    depth
        Extent in m of the missing dimensions of a 1D or 2D domain (of the plane's thickness, or of
        the line's cross-section per dimension missing). Masses, molecule numbers and k_B T/m need
        it. Default: chosen by the simulation as one particle spacing.

    Raises
    ------
    InputError
        Where the corners do not make a box, or an axis does not exist.
    """

    def __init__(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        periodic: str = "",
        depth: float | None = None,
    ):
        self.lower = np.array(lower, dtype=float)
        self.upper = np.array(upper, dtype=float)
        if self.lower.ndim != 1 or self.lower.shape != self.upper.shape:
            raise InputError("upper", upper, "as many numbers as 'lower'")
        if not 1 <= len(self.lower) <= 3:
            raise InputError("lower", lower, "1, 2 or 3 numbers")
        if not (np.all(np.isfinite(self.lower)) and np.all(np.isfinite(self.upper))):
            raise InputError("lower, upper", (lower, upper), "finite")
        if np.any(self.upper <= self.lower):
            raise InputError("upper", upper, f"greater than 'lower' = {self.lower.tolist()}")
        axes = AXES[: self.dim]
        if any(axis not in axes for axis in periodic):
            raise InputError("periodic", periodic, f"some of the letters '{axes}'")
        if depth is not None and not depth > 0:
            raise InputError("depth", depth, "positive")
        self.periodic = np.array([axis in periodic for axis in axes])
        self.depth = depth

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return len(self.lower)

    @property
    def lengths(self) -> np.ndarray:
        """Edge lengths in m, shape (dim,)."""
        return self.upper - self.lower

    @property
    def inverse_periods(self) -> np.ndarray:
        """1/length on periodic axes and 0 elsewhere: the factor of the minimum-image rule."""
        return np.where(self.periodic, 1.0 / self.lengths, 0.0)

    @property
    def volume(self) -> float:
        """Product of the edge lengths, in m^dim."""
        return float(np.prod(self.lengths))

    def wrapped(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, dim) in the box, and how many edges each was away from it.

        On periodic axes a point is brought to ``lower <= x < upper``; on others it stays.

        Returns
        -------
        points, turns
            (n, dim) in m, of the precision given, and whole numbers (n, dim):
            ``points + turns * lengths`` is what was given, to round-off.
        """
        given = np.asarray(points)
        kind = given.dtype if given.dtype.kind == "f" else np.dtype(float)
        turns = np.floor((given - self.lower) * self.inverse_periods)
        x = (given - turns * self.lengths).astype(kind)
        first = self.lower.astype(kind)
        first = np.where(first < self.lower, np.nextafter(first, kind.type(np.inf)), first)
        # what lies below an edge by less than round-off would come out at the other one
        over = self.periodic & (x >= self.upper)
        return np.where(over | (self.periodic & (x < first)), first, x), turns + over

    def wrapped_from_zero(self, points: np.ndarray) -> np.ndarray:
        """Points (n, dim) as seen from the lower corner, on periodic axes in 0 <= x < length."""
        x = np.array(points, float) - self.lower
        for a in np.flatnonzero(self.periodic):
            length = self.lengths[a]
            x[:, a] %= length
            x[x[:, a] >= length, a] = 0.0  # the remainder of a tiny negative number rounds up
        return x

    def tree(self, points: np.ndarray) -> cKDTree:
        """For looking up which of the points (n, dim) are near; by the nearest periodic images.

        It knows them, and takes others, as :meth:`wrapped_from_zero` has them.
        """
        from scipy.spatial import cKDTree

        periods = np.where(self.periodic, self.lengths, 0.0)  # 0: not periodic
        return cKDTree(self.wrapped_from_zero(points), boxsize=periods)

    def shortest(self, offsets: np.ndarray) -> np.ndarray:
        """Differences (n, dim) of places by the nearest periodic images."""
        return offsets - self.lengths * np.rint(offsets * self.inverse_periods)

    def __repr__(self) -> str:
        axes = "".join(a for a, p in zip(AXES, self.periodic, strict=False) if p)
        return (
            f"Domain(lower={self.lower.tolist()}, upper={self.upper.tolist()}, periodic={axes!r})"
        )
