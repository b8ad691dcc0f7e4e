"""Tables of schemes: how the particles move."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import Field

from particell.casefile.scope import Scope
from particell.casefile.table import Table, describes
from particell.kernels import CODES
from particell.laws.transport_velocity import FORMS
from particell.schemes.sdpd import DENSITIES, INTEGRATORS, NOISES, SDPD
from particell.schemes.static import Static
from particell.schemes.transport_velocity import PRESSURE_FORCES, TransportVelocity
from particell.units import Acceleration, Number, Pressure, Velocity

_Kernel = Annotated[str, Field(json_schema_extra={"enum": list(CODES)})]
_Gravity = Annotated[tuple[Acceleration, ...], Field(min_length=1, max_length=3)]


def _choice(names: Iterable[str]) -> Any:  # the constructors refuse others, by name
    return Field(json_schema_extra={"enum": list(names)})


class _MovingTable(Table):
    kernel: _Kernel
    support: Number
    gravity: _Gravity | None
    reference_speed: Annotated[Velocity, Field(ge=0)]
    pressure_drop: Annotated[Pressure, Field(ge=0)]

    def _values(self, scope: Scope) -> dict[str, Any]:
        values = self.given()
        if self.gravity is not None:
            values["gravity"] = scope.vector("gravity", self.gravity)
        return values


@describes(SDPD)
class SDPDTable(_MovingTable):
    """Isothermal SDPD; without fluctuations, weakly compressible SPH."""

    type: Literal["SDPD"]
    """What it is."""
    density: Annotated[str, _choice(DENSITIES)]
    integrator: Annotated[str, _choice(INTEGRATORS)]
    fluctuations: bool
    noise: Annotated[str, _choice(NOISES)]
    density_diffusion: Number | None
    shifting: Number
    impenetrable: bool
    skin: Number | None

    def build(self, scope: Scope) -> SDPD:
        """The scheme."""
        return SDPD(**self._values(scope))


@describes(TransportVelocity, SDPD)
class TransportVelocityTable(_MovingTable):
    """SPH with a transport velocity: particles stay evenly spread."""

    type: Literal["TransportVelocity"]
    """What it is."""
    background: Number
    momentum_flux: Annotated[str, _choice(FORMS)]
    pressure_force: Annotated[str, _choice(PRESSURE_FORCES)]
    fixed_volume: bool | None
    renormalise: bool
    pressure_switch: bool
    filter_every: Annotated[int, Field(ge=0)]
    density_diffusion: Number
    impenetrable: bool
    normalise_viscosity: bool
    species_flux: bool
    skin: Number

    def build(self, scope: Scope) -> TransportVelocity:
        """The scheme."""
        return TransportVelocity(**self._values(scope))


@describes(Static, SDPD)
class StaticTable(Table):
    """No flow: particles keep their places, and species react and diffuse on them."""

    type: Literal["Static"]
    """What it is."""
    kernel: _Kernel
    support: Number

    def build(self, scope: Scope) -> Static:
        """The scheme."""
        return Static(**self.given())


SchemeTable = Annotated[
    SDPDTable | TransportVelocityTable | StaticTable, Field(discriminator="type")
]
