"""Particles as they are: mobile ones, or all."""

from __future__ import annotations

from dataclasses import dataclass

from particell.compute.expressions import where
from particell.sources.source import Pair, Side, Source


@dataclass(frozen=True)
class Particles(Source):
    """Neighbours as they are.

    Attributes
    ----------
    first, last
        The list's arrays between whose values they stand in a row.
    velocity
        The name of the velocity that ij.v is made of.
    jumps
        Whether fluids with another equation of state are seen with the density of i, so that
        nothing is carried across the jump between them.
    weighed
        The array along the list that has the pairs' weights, if they are kept.
    """

    first: str = "start"
    last: str = "split"
    velocity: str = "v"
    jumps: bool = False
    weighed: str = ""

    def see(self, i: Side, j: Side, kernel: int, uniform: bool) -> tuple[Side, Side, Pair]:
        """i, j and the pair as laws see them."""
        if self.jumps:
            same = j.equation == i.equation
            j = j.replace(density=where(same, j.density, i.density))
        pair = Pair(i, j, kernel, uniform, self.velocity)
        pair.weighed = self.weighed
        return i, j, pair


MOBILE = Particles()
#: Walls too, as particles like any other.
ALL = Particles(last="stop")
