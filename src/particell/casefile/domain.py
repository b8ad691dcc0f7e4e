"""Tables of the domain and of materials."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from particell.casefile.table import Position, Table, describes
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.units import Density, Length, Number, Pressure, Temperature, Velocity, Viscosity


@describes(Domain)
class DomainTable(Table):
    """The box that is simulated."""

    lower: Position
    upper: Position
    periodic: str
    depth: Annotated[Length, Field(gt=0)] | None

    def build(self) -> Domain:
        """The domain."""
        return Domain(**self.given())


@describes(Fluid)
class FluidTable(Table):
    """A weakly compressible Newtonian fluid; walls carry the density of the fluid they bound."""

    type: Literal["Fluid"] = "Fluid"
    """What it is."""
    density: Annotated[Density, Field(gt=0)]
    viscosity: Annotated[Viscosity, Field(ge=0)]
    bulk_viscosity: Annotated[Viscosity, Field(ge=0)]
    temperature: Annotated[Temperature, Field(gt=0)] | None
    sound_speed: Annotated[Velocity, Field(gt=0)] | None
    exponent: Annotated[Number, Field(gt=0)]
    background_pressure: Pressure

    def build(self) -> Fluid:
        """The material."""
        return Fluid(**self.given())
