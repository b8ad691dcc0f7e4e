"""Tables of boundaries and forces."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from particell.boundaries.mean_velocity import MeanVelocity
from particell.boundaries.mirror import Mirror
from particell.boundaries.moving import WallMotion
from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.casefile.scope import Scope
from particell.casefile.table import Axis, Name, Position, Profile, Table, describes
from particell.chemistry.reservoirs import FixedValueWall, FluxWall, Reservoir
from particell.errors import InputError
from particell.geometry.shapes import Ball, HalfSpace
from particell.laws.body_force import BodyForce
from particell.laws.buoyancy import Buoyancy
from particell.units import Acceleration, Concentration, Length, Number, Quantity, Time, Velocity

_Flux = Annotated[float, Field(ge=0), Quantity("mol/m^2/s")]
_Transfer = Annotated[float, Field(ge=0), Quantity("m/s")]
_Value = Annotated[Concentration, Field(ge=0)]


@describes(Reflection)
class ReflectionTable(Table):
    """Fluid particles that cross the surface of a body are mirrored back."""

    type: Literal["Reflection"]
    """What it is."""
    body: Name
    """Name of a half-space, circle or sphere that must not be entered."""
    inside: bool

    def build(self, scope: Scope) -> Reflection:
        """The boundary."""
        body = scope.shape(self.body)
        if not isinstance(body, HalfSpace | Ball):
            raise InputError("body", self.body, "the name of a HalfSpace, Ball, Circle or Sphere")
        return Reflection(body, self.inside)


@describes(Mirror)
class MirrorTable(Table):
    """A plane of symmetry, or without slip a plane that fluid sticks to."""

    type: Literal["Mirror"]
    """What it is."""
    body: Name
    """Name of the half-space behind the plane, whose normal points into the fluid."""
    slip: bool
    velocity: Annotated[tuple[Velocity, ...], Field(min_length=1, max_length=3)] | None

    def build(self, scope: Scope) -> Mirror:
        """The boundary."""
        body = scope.shape(self.body)
        if not isinstance(body, HalfSpace):
            raise InputError("body", self.body, "the name of a HalfSpace")
        velocity = None if self.velocity is None else scope.vector("velocity", self.velocity)
        return Mirror(body, self.slip, velocity)


@describes(Sponge)
class SpongeTable(Table):
    """A zone in which the fluid is brought to given values."""

    type: Literal["Sponge"]
    """What it is."""
    start: Length
    end: Length
    time: Annotated[Time, Field(gt=0)]
    velocity: (
        Annotated[tuple[Annotated[Any, Profile("m/s")], ...], Field(min_length=1, max_length=3)]
        | None
    )
    """Target velocity, one number or formula of x, y, z for each dimension."""
    species: dict[str, Annotated[Any, Profile("mol/m^3")]] = Field(default_factory=dict)
    """Target concentrations by species, numbers or formulas of x, y, z."""
    axis: Axis
    exponent: Annotated[Number, Field(gt=0)]

    def build(self, scope: Scope) -> Sponge:
        """The boundary."""
        scope.axis("axis", self.axis)
        scope.known_species("Sponge", self.species)
        targets = {n: scope.profile(f"species.{n}", v, "mol/m^3") for n, v in self.species.items()}
        velocity = scope.velocity("velocity", self.velocity, function=True)
        parts = self.given("velocity", "species")
        return Sponge(velocity=velocity, species=targets, **parts)


@describes(WallMotion)
class WallMotionTable(Table):
    """The motion of a wall as a rigid body; at t = 0 it is where its phase says."""

    type: Literal["WallMotion"]
    """What it is."""
    group: Name
    velocity: Annotated[tuple[Velocity, ...], Field(min_length=1, max_length=3)] | None
    angular_velocity: Annotated[float, Quantity("rad/s")]
    centre: Position | None
    axis: tuple[Number, Number, Number]
    displacement: (
        Annotated[tuple[Annotated[Any, Profile("m")], ...], Field(min_length=1, max_length=3)]
        | None
    )
    """Displacement added to that by ``velocity``: a formula of the time t for each dimension."""
    angle: Annotated[Any, Profile("rad")] | None
    """Angle added to that by ``angular_velocity``: a formula of the time t."""

    def build(self, scope: Scope) -> WallMotion:
        """The motion."""
        scope.known_group("WallMotion", self.group)
        for name in ("velocity", "centre"):
            if (given := getattr(self, name)) is not None:
                scope.vector(name, given)
        displacement, angle = None, None
        if self.displacement is not None:
            given = scope.vector("displacement", self.displacement)
            parts = [scope.motion("displacement", v, "m") for v in given]

            def displacement(time: float) -> np.ndarray:
                return np.array([part(time) for part in parts])

        if self.angle is not None:
            angle = scope.motion("angle", self.angle, "rad")
        others = self.given("displacement", "angle")
        return WallMotion(displacement=displacement, angle=angle, **others)


@describes(MeanVelocity)
class MeanVelocityTable(Table):
    """Keeps the mean velocity of the fluid along a periodic axis, by a uniform body force."""

    type: Literal["MeanVelocity"]
    """What it is."""
    velocity: Velocity
    axis: Axis

    def build(self, scope: Scope) -> MeanVelocity:
        """The boundary."""
        return MeanVelocity(**self.given())


class _HeldTable(Table):
    group: Name
    values: Annotated[dict[str, _Value], Field(min_length=1)]

    def _checked(self, scope: Scope) -> dict:
        scope.known_group(type(self).__name__.removesuffix("Table"), self.group)
        scope.known_species("values", self.values)
        return self.given()


@describes(Reservoir)
class ReservoirTable(_HeldTable):
    """Particles in which species are kept at a value."""

    type: Literal["Reservoir"]
    """What it is."""

    def build(self, scope: Scope) -> Reservoir:
        """The boundary."""
        return Reservoir(**self._checked(scope))


@describes(FixedValueWall)
class FixedValueWallTable(_HeldTable):
    """A wall whose surface has fixed concentrations; of first order if its phase has none."""

    type: Literal["FixedValueWall"]
    """What it is."""

    def build(self, scope: Scope) -> FixedValueWall:
        """The boundary."""
        return FixedValueWall(**self._checked(scope))


@describes(FluxWall)
class FluxWallTable(Table):
    """A wall with a given flux, or with a flux in proportion to a difference."""

    type: Literal["FluxWall"]
    """What it is."""
    group: Name
    flux: dict[str, _Flux] = Field(default_factory=dict)
    transfer: dict[str, tuple[_Transfer, _Value]] = Field(default_factory=dict)
    area: Annotated[float, Field(gt=0), Quantity("m^2")] | None

    def build(self, scope: Scope) -> FluxWall:
        """The boundary."""
        scope.known_group("FluxWall", self.group)
        scope.known_species("FluxWall", [*self.flux, *self.transfer])
        return FluxWall(**self.given())


@describes(Buoyancy)
class BuoyancyTable(Table):
    """A body force in proportion to the concentration of a species."""

    type: Literal["Buoyancy"]
    """What it is."""
    species: Name
    expansion: Annotated[float, Quantity("m^3/mol")]
    gravity: Annotated[tuple[Acceleration, ...], Field(min_length=1, max_length=3)]
    reference: Concentration

    def build(self, scope: Scope) -> Buoyancy:
        """The force."""
        scope.known_species("Buoyancy", [self.species])
        scope.vector("gravity", self.gravity)
        return Buoyancy(**self.given())


@describes(BodyForce)
class BodyForceTable(Table):
    """A force per mass that depends on place and time."""

    type: Literal["BodyForce"]
    """What it is."""
    acceleration: Annotated[
        tuple[Annotated[Any, Profile("m/s^2")], ...], Field(min_length=1, max_length=3)
    ]
    """One number or formula of x, y, z and the time t for each dimension, in m/s²."""

    def build(self, scope: Scope) -> BodyForce:
        """The force."""
        parts = scope.vector("acceleration", self.acceleration)
        return BodyForce(scope.place_and_time("acceleration", parts, "m/s^2"))


BoundaryTable = Annotated[
    MirrorTable
    | ReflectionTable
    | WallMotionTable
    | SpongeTable
    | MeanVelocityTable
    | ReservoirTable
    | FixedValueWallTable
    | FluxWallTable,
    Field(discriminator="type"),
]
ForceTable = Annotated[BuoyancyTable | BodyForceTable, Field(discriminator="type")]
