"""Fields between walls: what carries them, what bounds them, and where there are none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from particell.analysis.fields import Held, interpolate
from particell.analysis.surfaces import ON_SURFACE, SIGHT, Seen, Surface, inside, nearest
from particell.geometry.domain import Domain
from particell.roles import Role, carriers, held_at


@dataclass(frozen=True, eq=False)
class Arrangement:
    """Particles at an instant, as fields and surfaces see them.

    Attributes
    ----------
    domain
        The box.
    roles
        Of the groups, by the index in ``group``.
    group, position
        Of the particles, (n,) and (n, D) in m.
    support
        (n,), in m.
    normal, depth, curvature
        What wall particles know of their surfaces (:mod:`particell.analysis.surfaces`), (n, D) and
        (n,), zero elsewhere; None where nothing is known.
    """

    domain: Domain
    roles: Sequence[Role]
    group: np.ndarray
    position: np.ndarray
    support: np.ndarray
    normal: np.ndarray | None = None
    depth: np.ndarray | None = None
    curvature: np.ndarray | None = None

    @cached_property
    def surfaces(self) -> dict[int, Surface]:
        """The known surfaces of walls, by group."""
        if self.normal is None or self.depth is None or self.curvature is None:
            return {}
        found = {}
        for g, role in enumerate(self.roles):
            of = self.group == g
            if role.kind != "wall" or not of.any():
                continue
            surface = Surface(
                self.position[of],
                self.normal[of],
                self.depth[of],
                self.curvature[of],
                self.domain,
            )
            if len(surface):
                found[g] = surface
        return found

    def rows(self, groups: Sequence[int]) -> np.ndarray:
        """The particles of groups."""
        return np.flatnonzero(np.isin(self.group, np.asarray(groups)))

    def seen(self, points: np.ndarray) -> dict[int, Seen]:
        """The surfaces near points (m, D), by group."""
        sight = SIGHT * float(self.support.max())
        return {g: surface.seen(points, sight) for g, surface in self.surfaces.items()}

    def hidden(
        self,
        points: np.ndarray,
        seen: Mapping[int, Seen],
        carrying: Sequence[int],
        everywhere: bool = False,
    ) -> np.ndarray:
        """Mask (m,) of the points at which a field that some groups carry does not exist.

        They are inside the surfaces of other walls, or (unless ``everywhere``) nearer to a particle
        of another group: another fluid, or a wall without a known surface.
        """
        tolerance = ON_SURFACE * float(self.support.max())
        solids = {g: s for g, s in seen.items() if g not in carrying}
        hidden = inside(solids, len(points), tolerance)
        walls = [g for g in carrying if self.roles[g].kind == "wall"]
        if walls and hidden.any():  # a membrane and what it encloses have one surface
            within = np.flatnonzero(hidden)
            own = self._gap(walls, points[within])
            hidden[within] = own > self._gap(list(solids), points[within])
        if everywhere:
            return hidden
        bound = len(walls) == len(carrying)
        others = [
            g
            for g in range(len(self.roles))
            if g not in carrying and (bound or g not in self.surfaces)
        ]
        beside = self._gap(carrying, points) > self._gap(others, points)
        return hidden | beside if others else hidden

    def _gap(self, groups: Sequence[int], points: np.ndarray) -> np.ndarray:
        return nearest(self.position[self.rows(groups)], points, self.domain)[0]

    def held(
        self, name: str, seen: Mapping[int, Seen], points: np.ndarray, values: np.ndarray
    ) -> list[Held]:
        """What walls hold of a field at their surfaces; ``values`` (n, …) are the particles'."""
        found = []
        for g, s in seen.items():
            what = held_at(self.roles[g], name)
            if what is None or not len(s.points):
                continue
            if isinstance(what, float):
                there = np.full((len(s.points), *values.shape[1:]), what)
            else:
                there = self._of_wall(g, points[s.points] + s.offset, values)
            found.append(Held(s.points, s.offset, there))
        return found

    def _of_wall(self, g: int, feet: np.ndarray, values: np.ndarray) -> np.ndarray:
        """A wall's own values at points of its surface: those of its particles, linear between."""
        surface = self.surfaces[g]
        rows = np.flatnonzero(self.group == g)[surface.rows]
        found = interpolate(
            feet,
            surface.feet,
            values[rows],
            volume=np.ones(len(rows)),
            support=float(self.support[rows].max()),
            domain=self.domain,
        )
        lost = np.isnan(found).reshape(len(found), -1).any(axis=1)
        if lost.any():
            found[lost] = values[rows][nearest(surface.feet, feet[lost], self.domain)[1]]
        return found


def at_points(
    arrangement: Arrangement,
    name: str,
    points: np.ndarray,
    values: np.ndarray,
    volume: np.ndarray,
    *,
    groups: Sequence[int] | None,
    order: int,
    kernel: str,
    support: float | None,
) -> np.ndarray:
    """A field at points (m, D), as :meth:`.Run.on_points` says; ``groups`` by index."""
    a = arrangement
    carrying = carriers(a.roles, name) if groups is None else tuple(groups)
    rows = a.rows(carrying)
    flat = np.atleast_2d(np.asarray(points, float))
    fits = flat.ndim == 2 and flat.shape[1] == a.domain.dim  # else refused below
    seen = a.seen(flat) if fits else {}
    found = interpolate(
        points,
        a.position[rows],
        values[rows],
        volume=volume[rows],
        support=a.support[rows] if support is None else support,
        domain=a.domain,
        kernel=kernel,
        order=order,
        held=a.held(name, seen, flat, values) if groups is None else (),
    )
    found[a.hidden(flat, seen, carrying, everywhere=groups is not None)] = np.nan
    return found
