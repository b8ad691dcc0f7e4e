"""A case file as a case: all its tables, the simulation they describe, general results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from particell.averages import TimeAverage, check_averages
from particell.casefile import results
from particell.casefile.boundaries import BoundaryTable, ForceTable
from particell.casefile.checks import check_sound, check_steps
from particell.casefile.chemistry import InitialTable, ReactionTable, SpeciesTable
from particell.casefile.constants import Constants
from particell.casefile.domain import DomainTable, FluidTable
from particell.casefile.fills import ArrangedTable, FillTable
from particell.casefile.messages import input_error
from particell.casefile.networks import SBMLTable
from particell.casefile.ordered import resolve_all
from particell.casefile.phases import PhaseTable
from particell.casefile.running import AverageTable, RunTable, SimulationTable, StopTable
from particell.casefile.schemes import SchemeTable
from particell.casefile.scope import Scope, known
from particell.casefile.shapes import ShapeTable
from particell.casefile.table import Name, place_of, within
from particell.casefile.typed import as_typed
from particell.cases.base import Case, Context, Metric
from particell.errors import InputError, unknown_name
from particell.geometry.domain import Domain
from particell.output.run import Run
from particell.phases import Phase
from particell.setup import TOO_NEAR, check_overlap
from particell.simulation import Simulation

#: The tables of several kinds, by the key that they are at.
UNIONS = {
    "shapes": ShapeTable,
    "phases": PhaseTable,
    "fill": FillTable,
    "of": ArrangedTable,
    "scheme": SchemeTable,
    "boundaries": BoundaryTable,
}


class _Typed(dict[str, Any]):
    """What a file says, for messages: cases are equal that say the same in other words."""

    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Typed)


class FileCase(Case):
    """A simulation that a file describes, table by table.

    Parameters
    ----------
    **parameters
        The tables, as they stand in the file.

    Raises
    ------
    InputError
        Naming the first key that is wrong, where it is, and what is allowed.
    """

    model_config = ConfigDict(validate_assignment=False, title="Particell case file")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][\w.-]*$", max_length=100)] = "case"  # type: ignore[misc]
    """What it is called; without it, as the file is."""
    title: Annotated[str, Field(max_length=200)] = ""  # type: ignore[misc]
    """What it is, in one line."""
    constants: dict[str, int | float | str] = Field(default_factory=dict)
    """Numbers, quantities and formulas by name, for formulas ("= 2 * height") everywhere else."""
    domain: DomainTable
    """The box that is simulated."""
    materials: Annotated[dict[Name, FluidTable], Field(min_length=1)]
    """Materials by name."""
    shapes: dict[Name, ShapeTable] = Field(default_factory=dict)
    """Shapes by name."""
    phases: Annotated[list[PhaseTable], Field(min_length=1)]
    """The particles: fluids, walls, bodies."""
    scheme: SchemeTable
    """How they move."""
    species: list[SpeciesTable] = Field(default_factory=list)
    """What they carry."""
    reactions: list[ReactionTable] = Field(default_factory=list)
    """How that reacts."""
    sbml: list[SBMLTable] = Field(default_factory=list)
    """Species and reactions from SBML files; others may be added to them."""
    initial: list[InitialTable] = Field(default_factory=list)
    """How much of it there is at the beginning; later ones overwrite earlier ones."""
    boundaries: list[BoundaryTable] = Field(default_factory=list)
    """Reflecting surfaces, sponges, mean velocities, reservoirs, walls with values or fluxes."""
    forces: list[ForceTable] = Field(default_factory=list)
    """Body forces that depend on what the particles carry."""
    simulation: SimulationTable = SimulationTable.model_construct()
    """How the simulation is stepped."""
    run: RunTable
    """How long it runs, and what it writes."""
    stop: StopTable | None = None
    """When it stops early."""
    averages: list[AverageTable] = Field(default_factory=list)
    """Fields averaged in time."""

    reference: ClassVar[str] = ""
    _typed: _Typed = PrivateAttr(default_factory=lambda: _Typed())

    def __init__(self, **parameters: Any):
        try:
            BaseModel.__init__(self, **parameters)
        except ValidationError as error:
            raise as_typed(input_error(error, parameters, UNIONS), parameters) from None
        except RecursionError:
            raise InputError("case file", "this one", "nested less deeply") from None
        self._typed = _Typed(parameters)

    @model_validator(mode="before")
    @classmethod
    def _without_formulas(cls, data: Any) -> Any:
        """Unknown keys refused, constants put in."""
        for key in data:
            if key not in cls.model_fields:
                raise unknown_name("key", str(key), cls.model_fields)
        given = data.get("constants", {})
        if not isinstance(given, Mapping):
            raise InputError("constants", given, "a table")
        constants = Constants(given)
        return {k: v if k == "constants" else constants.replace(v, k) for k, v in data.items()}

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.run.until

    @property
    def every(self) -> float:
        """Time between frames in s."""
        assert self.run.every is not None
        return self.run.every

    def run_options(self) -> dict[str, Any]:
        """See :class:`~particell.cases.base.Case`."""
        stop = {"stop": self.stop.build()} if self.stop else {}
        averages = self._averages(self.domain.build())
        return {"checkpoint_every": self.run.checkpoint_every, "averages": averages, **stop}

    def _averages(self, domain: Domain) -> list[TimeAverage]:
        made = []
        for k, table in enumerate(self.averages):
            with within(place_of("averages", k)):
                made.append(table.build(domain))
        return made

    def scope(self) -> Scope:
        """Constants, domain, materials and shapes, to which everything else refers."""
        with np.errstate(all="ignore"):
            return self._scope()

    def _scope(self) -> Scope:
        with within("domain"):
            scope = Scope(Constants(self.constants), self.domain.build())
        for name, material in self.materials.items():
            with within(f"materials.{name}"):
                scope.materials[name] = material.build()
        needs = {name: list(table.needs()) for name, table in self.shapes.items()}
        for name, others in needs.items():
            for other in others:
                known(f"shape in shapes.{name}", other, self.shapes)
        for name in resolve_all("shapes", needs):
            with within(f"shapes.{name}"):
                scope.shapes[name] = self.shapes[name].build(scope)
        for k, table in enumerate(self.sbml):
            with within(place_of("sbml", k)):
                scope.networks.append(table.build())
        scope.species = tuple(s.name for m in scope.networks for s in m.species)
        scope.species += tuple(s.name for s in self.species)
        return scope

    def estimates(self, scope: Scope) -> dict[str, float]:
        """About how many particles there will be, by phase.

        Raises
        ------
        InputError
            Where this machine has no memory for them.
        """
        found: dict[str, float] = {}
        for k, table in enumerate(self.phases):
            with within(place_of("phases", k, table.name)), np.errstate(all="ignore"):
                found[table.name] = found.get(table.name, 0.0) + table.estimate(scope)
        scope.admit(sum(found.values()))
        return found

    def build(self, context: Context) -> Simulation:
        """See :class:`~particell.cases.base.Case`."""
        try:
            with np.errstate(all="ignore"):
                return self._build(context)
        except InputError as error:
            raise as_typed(error, self._typed) from None
        except ArithmeticError as error:
            allowed = f"one of numbers that can be computed with ({error})"
            raise InputError("case file", self.name, allowed) from None

    def _build(self, context: Context) -> Simulation:
        scope = self.scope()
        self.estimates(scope)
        phases = self._phases(scope)
        with within("scheme"):
            scheme = self.scheme.build(scope)
        species = [s for network in scope.networks for s in network.species]
        reactions = [r for network in scope.networks for r in network.reactions]
        for k, n in enumerate(self.sbml):
            with within(place_of("sbml", k)):
                n.check_groups(scope)
        for s in self.species:
            with within(place_of("species", 0, s.name)):
                species.append(s.build(scope))
        for name in scope.species:
            if scope.species.count(name) > 1:
                raise InputError("species", name, "a name used once")
        by_name = {s.name: s for s in species}
        for r in self.reactions:
            with within(place_of("reactions", 0, r.equation)):
                reactions.append(r.build(scope, by_name))
        boundaries, forces = [], []
        for k, b in enumerate(self.boundaries):
            with within(place_of("boundaries", k)):
                boundaries.append(b.build(scope))
        for k, f in enumerate(self.forces):
            with within(place_of("forces", k)):
                forces.append(f.build(scope))
        check_sound(scope.domain, phases, scheme, boundaries)
        simulation = Simulation(
            scope.domain,
            phases,
            scheme,
            species,
            reactions,
            boundaries,
            forces,
            seed=context.seed,
            device=context.device,
            **self.simulation.given(),
        )
        for network in scope.networks:
            if simulation.chemistry is not None:
                network.set_initial(simulation.chemistry)
        for k, initial in enumerate(self.initial):
            with within(place_of("initial", k)):
                initial.apply(scope, simulation)
        check_steps(simulation, self.until, self.every)
        if self.stop is not None:
            known("observable in stop", self.stop.observable, simulation.observables())
        check_averages(simulation, self._averages(scope.domain))
        return simulation

    def _phases(self, scope: Scope) -> list[Phase]:
        """All phases, made in the order in which they need each other."""
        owner: dict[str, int] = {}
        for k, table in enumerate(self.phases):
            for name in table.names(scope.dim):
                if name in owner:
                    raise InputError("phase", name, "a name used once")
                owner[name] = k
        needs: dict[str, list[str]] = {}
        for k, table in enumerate(self.phases):
            for name in table.needs():
                known(f"phase in fixed in phases '{table.name}'", name, owner)
            needs[str(k)] = [str(owner[name]) for name in table.needs()]
        made: dict[int, list[Phase]] = {}
        for k in map(int, resolve_all("phases", needs)):
            with within(place_of("phases", k, self.phases[k].name)):
                made[k] = self.phases[k].build(scope)
                if not all(len(phase.points) for phase in made[k]):
                    raise InputError("number of particles", 0, "at least one particle")
                scope.phases |= {phase.name: phase for phase in made[k]}
        phases = [phase for k in range(len(self.phases)) for phase in made[k]]
        check_overlap(scope.domain, phases, within_phase=TOO_NEAR)
        return phases

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """What is conserved; see :mod:`particell.casefile.results`."""
        return results.metrics(simulation)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """The fields of the last frame; see :mod:`particell.casefile.results`."""
        return results.figures(run, directory)
