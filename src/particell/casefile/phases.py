"""Tables of phases: particles of one material and one role."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from particell.casefile.fills import FillTable, sites, wall_sites
from particell.casefile.scope import Scope
from particell.casefile.table import Axis, Name, Profile, Table, as_text, describes
from particell.geometry.shapes import Shape
from particell.phases import Phase, box_walls, channel_walls, fluid
from particell.units import Length

_Spacing = Annotated[Length, Field(gt=0)]
_Layers = Annotated[int, Field(ge=1, le=20)]
_Velocity = Annotated[tuple[Annotated[Any, Profile("m/s")], ...], Field(min_length=1, max_length=3)]


class _PhaseTable(Table):
    name: str
    material: Name
    """Name of a material."""

    def names(self, dim: int) -> list[str]:
        """Names of the groups of particles that it makes."""
        return [self.name]

    def needs(self) -> Iterable[str]:
        """The groups that have to be there before."""
        return ()


@describes(fluid, Phase)
class FilledPhase(_PhaseTable):
    """The domain, or a shape in it, filled with fluid on a lattice."""

    type: Literal["fluid"]
    """What it is."""
    spacing: _Spacing
    """Wanted distance of neighbours; the lattice fits the domain evenly."""
    shape: Name | None
    """Name of the shape to fill; without it the whole domain."""
    name: Name
    velocity: _Velocity | None
    """Initial velocity, one number or formula of x, y, z for each dimension; at rest without it."""
    kind: Literal["square", "hexagonal"]
    """The lattice: square (cubic in 3D), or hexagonal in 2D."""

    def estimate(self, scope: Scope) -> float:
        """About how many particles, at most."""
        return sites(scope.domain, self.spacing)

    def build(self, scope: Scope) -> list[Phase]:
        """The phase."""
        parts = self.given("material", "shape", "velocity")
        return [
            fluid(
                scope.domain,
                scope.material(self.material),
                shape=scope.shape(self.shape) if self.shape else None,
                velocity=scope.velocity("velocity", self.velocity),
                **parts,
            )
        ]


@describes(Phase)
class ParticlesPhase(_PhaseTable):
    """Fluid, or fixed particles, in any arrangement."""

    type: Literal["Phase"]
    """What it is."""
    name: Name
    fill: FillTable
    """Where the particles are."""
    volume: Annotated[Any, BeforeValidator(as_text)] = None
    """Volume of a particle, or a list of each one's (m, m^2 or m^3, as the domain has dimensions),
    else that of the fill."""
    kind: Literal["fluid", "wall"]
    velocity: _Velocity | None
    """Initial velocity, one number or formula of x, y, z for each dimension. Walls keep it."""
    spacing: _Spacing | None
    surface: Name | None
    """Name of the solid shape that a wall's particles fill; the fluid begins at its surface."""
    slides: bool

    def needs(self) -> Iterable[str]:
        """See the base class."""
        return self.fill.needs()

    def estimate(self, scope: Scope) -> float:
        """About how many particles."""
        return self.fill.estimate(scope)

    def build(self, scope: Scope) -> list[Phase]:
        """The phase."""
        points, volume = self.fill.build(scope)
        if self.volume is not None:
            volume = self._volume(scope)
        surface: Shape | None = scope.shape(self.surface) if self.surface else None
        return [
            Phase(
                self.name,
                scope.material(self.material),
                points,
                volume,
                self.kind,
                scope.velocity("velocity", self.velocity),
                self.spacing,
                surface,
                self.slides,
            )
        ]

    def _volume(self, scope: Scope) -> Any:
        unit = f"m^{scope.dim}"
        if isinstance(self.volume, list | tuple):
            return np.array([scope.number("volume", one, unit) for one in self.volume])
        return scope.number("volume", self.volume, unit)


@describes(channel_walls)
class ChannelWalls(_PhaseTable):
    """The lower and upper wall across one axis: the groups NAME-lower and NAME-upper."""

    type: Literal["channel_walls"]
    """What it is."""
    spacing: _Spacing
    """That of the fluid, whose lattice the walls continue."""
    axis: Axis
    layers: _Layers
    name: Name
    velocity: tuple[_Velocity | None, _Velocity | None] | None = None
    """Velocities of the two walls; at rest without it."""

    def names(self, dim: int) -> list[str]:
        """See the base class."""
        return [f"{self.name}-{side}" for side in ("lower", "upper")]

    def estimate(self, scope: Scope) -> float:
        """How many particles."""
        return wall_sites(scope, self.spacing, self.layers, scope.axis("axis", self.axis))

    def build(self, scope: Scope) -> list[Phase]:
        """The two phases."""
        lower, upper = (scope.velocity("velocity", v) for v in self.velocity or (None, None))
        parts = self.given("material", "velocity")
        material = scope.material(self.material)
        scope.axis("axis", self.axis)
        return channel_walls(scope.domain, material, velocity=(lower, upper), **parts)


@describes(box_walls, channel_walls)
class BoxWalls(_PhaseTable):
    """The walls on all sides of a closed box: the groups NAME-x-lower, NAME-x-upper, …"""

    type: Literal["box_walls"]
    """What it is."""
    spacing: _Spacing
    """That of the fluid, whose lattice the walls continue."""
    layers: _Layers
    name: Name
    sliding: dict[str, _Velocity] | None = None
    """Velocities of walls whose surface slides along itself: ``{y-upper = ["1 m/s", 0]}``."""

    def names(self, dim: int) -> list[str]:
        """See the base class."""
        return [f"{self.name}-{a}-{side}" for a in "xyz"[:dim] for side in ("lower", "upper")]

    def estimate(self, scope: Scope) -> float:
        """How many particles."""
        return wall_sites(scope, self.spacing, self.layers, None)

    def build(self, scope: Scope) -> list[Phase]:
        """The phases."""
        parts = self.given("material", "sliding")
        sliding = {k: scope.velocity(f"sliding.{k}", v) for k, v in (self.sliding or {}).items()}
        material = scope.material(self.material)
        return box_walls(scope.domain, material, sliding=sliding, **parts)


PhaseTable = Annotated[
    FilledPhase | ParticlesPhase | ChannelWalls | BoxWalls, Field(discriminator="type")
]
