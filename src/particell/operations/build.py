"""From what a user describes (boundaries, forces, observables) to operations, in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from particell.boundaries.mean_velocity import MeanVelocity
from particell.boundaries.mirror import Mirror
from particell.boundaries.moving import WallMotion
from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.chemistry.engine import Chemistry
from particell.chemistry.reservoirs import FixedValueWall, FluxWall, Reservoir
from particell.errors import InputError
from particell.laws.buoyancy import Buoyancy
from particell.operations.buoyancy import MeasureBuoyancy
from particell.operations.carriage import Carriage
from particell.operations.every import Observables
from particell.operations.mean_velocity import KeepMeans
from particell.operations.operation import Operation
from particell.operations.reflection import Reflect
from particell.operations.species import StepSpecies
from particell.operations.sponge import RelaxInSponges
from particell.operations.walls import Walls
from particell.schemes.flow import Flow
from particell.state import State

#: What may stand among a simulation's boundaries.
Boundary = (
    Mirror
    | Reflection
    | WallMotion
    | Sponge
    | MeanVelocity
    | Reservoir
    | FixedValueWall
    | FluxWall
    | Operation
)
#: Boundaries that belong to species.
OF_SPECIES = (Reservoir, FixedValueWall, FluxWall)


def walls_of(state: State, scheme: Any, boundaries: Sequence[Any]) -> Walls:
    """The walls, with their motions."""
    motions = [b for b in boundaries if isinstance(b, WallMotion)]
    how = (scheme.kernel, scheme.support, bool(scheme.impenetrable), scheme.at_rest)
    return Walls(state, motions, *how)


def operations_of(
    state: State,
    scheme: Any,
    flow: Flow | None,
    walls: Walls,
    chemistry: Chemistry | None,
    boundaries: Sequence[Any],
    forces: Sequence[Buoyancy],
    more: Sequence[Operation],
    observables: Mapping[str, Callable[[State], float]],
) -> list[Operation]:
    """All operations of a simulation.

    At a moment they act in this order: what belongs to the flow, walls, reflecting surfaces,
    sponges, mean velocities, what depends on species, the user's own; the species' step comes
    before sponges.
    """
    for boundary in boundaries:
        if chemistry is None and isinstance(boundary, OF_SPECIES):
            name = next(iter(boundary.values))
            raise InputError(f"species of {type(boundary).__name__}", name, "a species' name")

    def of(kind: type) -> list[Any]:
        return [b for b in boundaries if isinstance(b, kind)]

    dim, found = state.dim, [] if flow is None else flow.operations()
    if walls.active:
        found.append(walls)
    if surfaces := [*of(Reflection), *(mirror.reflection() for mirror in of(Mirror))]:
        found.append(Reflect(surfaces, dim))
    if chemistry is not None:
        found.append(StepSpecies(chemistry))
    if sponges := of(Sponge):
        found.append(RelaxInSponges(sponges, chemistry, dim, scheme.at_rest))
    if means := of(MeanVelocity):
        found.append(KeepMeans(means, state.domain.periodic))
    if forces:
        found.append(MeasureBuoyancy(forces, chemistry, dim))
    if chemistry is not None and flow is not None and scheme.species_flux:
        found.append(Carriage(chemistry, flow))
    found += [*of(Operation), *more]
    if observables:
        found.append(Observables(observables))
    return found
