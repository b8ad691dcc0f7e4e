"""A flow: what a scheme's loops are bound to on a state, besides fields."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from particell.boundaries.wall_friction import FREE, ISOTROPIC, TENSOR
from particell.compute.forms import LISTS
from particell.compute.philox import PAIR_NOISE, stream_key
from particell.compute.sweep import Sweep
from particell.errors import InputError
from particell.fields import Field
from particell.kernels import kernel_code, normalisation
from particell.laws.continuity import DensityDiffusion, HeadOfRest
from particell.laws.hydrostatics import AT_REST
from particell.laws.law import Law, check_law
from particell.laws.pressure import PressureForce
from particell.laws.viscosity import Viscosity
from particell.operations.kept_volume import KeptVolume
from particell.operations.operation import Operation
from particell.operations.rest_pressure import RestPressure
from particell.schemes.flow_sweeps import FlowSweeps, tables_of
from particell.schemes.properties import Properties
from particell.schemes.timestep import EXPLICIT
from particell.sources.source import Names
from particell.state import State

#: Names that laws, loops and frames use for something else, also where there is no such thing.
RESERVED = {"time", "step", "inverse_dt", "half_step", "lead", "position", "velocity", "index"}
RESERVED |= {
    "field_lead",
    "member",
    "lanes",
    "octets",
    "shifts",
    "start",
    "split",
    "stop",
    "neighbours",
}
RESERVED |= {"dim", "side", "names", "replace", "field", "record", "columns", "whole_columns"}
RESERVED |= {"specific_volume", "pressure_over_square", "v_ahead", "own_kernel", "transport"}
RESERVED |= {"flux", "buoyancy", "count", "amount", "shift", "shift_before", "density_half"}
RESERVED |= {"kernel_sum", "velocity_spread", "wall_normal", "wall_depth", "wall_curvature"}
RESERVED |= {"wall_friction", "image_reach", "box", "species", "speed", *AT_REST}
#: What loops are given at every call.
RESERVED |= {"dt", "dt_over_time", "tau", "part", "fraction", "target", "stream", "expected"}


class Flow:
    """Properties, constants and sweeps of a scheme in which particles move.

    Parameters
    ----------
    state, scheme
        What it acts on; its description.
    forces
        Laws of body forces.

    Attributes
    ----------
    laws
        Those that act besides the scheme's.
    properties
        The :class:`.Properties` by group.
    constants
        Numbers and arrays that loops read besides fields and the neighbour list.
    rest, kept_volume
        Operations that belong to every flow.
    walls, held
        Whether there are walls, and how friction with them is held
        (:mod:`particell.boundaries.wall_friction`).
    leads
        Whether friction takes velocities ahead (:meth:`lead`).
    law_limit
        Of the step, by laws of the user's, in s.
    """

    def __init__(self, state: State, scheme: Any, forces: Sequence[Law] = ()):
        self.state, self.scheme = state, scheme
        self.forces = tuple(forces)
        self.laws = (*scheme.more, *forces)
        for law in self.laws:
            check_law(law)
        dim, device, array = state.dim, state.device, state.device.array
        self.properties = properties = Properties(state, scheme)
        gravity = np.zeros(dim) if scheme.gravity is None else np.array(scheme.gravity, dtype=float)
        if gravity.shape != (dim,):
            raise InputError("gravity", scheme.gravity, f"{dim} numbers")
        self.rest = RestPressure(state, gravity, properties.contrast)
        self.kept_volume = KeptVolume(state, scheme.keeps_volume)
        self.walls = bool(state.neighbours.constants["WALLS"])
        self.held = FREE
        if self.walls:
            self.held = TENSOR if properties.radial else ISOTROPIC
        self.law_limit = math.inf
        self.leads = not (scheme.fluctuations or scheme.integrator == "trapezoidal")
        code, key = kernel_code(scheme.kernel), stream_key(state.seed, PAIR_NOISE)
        self.constants: dict[str, Any] = {
            "alpha": normalisation(code, dim),
            "gravity": array(gravity),
            "key0": key[0],
            "key1": key[1],
            **{name: array(values) for name, values in properties.tables.items()},
            **self.rest.tables,
        }
        for name, shape in (("wall_direction", (1, dim)), ("wall_distance", 1)):
            self.constants[name] = device.zeros(shape)  # of walls with a known surface
        if not self.walls:
            self.constants["wall_friction"] = device.zeros((1, 1))
        self._scratch: dict[str, Any] = {}

    def operations(self) -> list[Operation]:
        """What happens in every flow of the scheme besides its loops."""
        return [self.kept_volume, *([] if self.scheme.fluctuations else [self.rest])]

    def fields(self, more: dict[str, Any] | None = None) -> dict[str, Any]:
        """Arrays and numbers by name, for loops; fields come before what stands in for them."""
        s = self.state
        found = {**self.constants, **s.neighbours.fields, **s.particles.fields, **(more or {})}
        found.setdefault("transport", found["v"])
        return found

    def bound(self, sweep: Sweep, **more: Any) -> Any:
        """A sweep over the particles and the list that there are now, and ``more`` arrays."""
        tables = tables_of(self.properties.tables, self.properties.fluids)
        form = sweep.form_on(self.state.device)
        self.state.neighbours.want(LISTS[form])
        given = {**self.fields(more), **tables}
        return sweep.bind(self.state.device, given, self._scratch, form)

    def sweeps(self) -> FlowSweeps:
        """The descriptions of the sweeps, of the fields that there are now."""
        scheme, p, found = self.scheme, self.state.particles, self.properties
        buoyancy = "buoyancy" in p
        walled = tuple(not periodic for periodic in self.state.domain.periodic)
        acts = buoyancy or np.any(self.rest.gravity[list(walled)])
        head = HeadOfRest(walled, buoyancy) if acts else None
        exact = self.walls and not scheme.fluctuations
        tables = tables_of(found.tables, found.fluids)
        return FlowSweeps(
            names=Names(
                self.state.dim,
                {name: field.components for name, field in p.declared.items()},
                {k: isinstance(v, np.ndarray) for k, v in tables.items()},
                numbers=frozenset({"time", "inverse_dt", "half_step", "lead", "field_lead"}),
                vectors=frozenset({"gravity"}),
            ),
            kernel=kernel_code(scheme.kernel),
            uniform=bool(self.state.neighbours.constants["UNIFORM"]),
            walls=self.walls,
            unknown="wall_distance" in p,
            held=self.held,
            moving="wall_acceleration" in p,
            viscosity=Viscosity(found.radial, scheme.normalise_viscosity, exact, self.walls),
            pressure=PressureForce(scheme.pressure_form, contrast=found.contrast),
            contrast=found.contrast,
            noise=scheme.fluctuations,
            gaussian=scheme.noise == "gaussian",
            lead=self.leads,
            shift=scheme.shifting > 0,
            diffusion=DensityDiffusion(head, found.parted) if scheme.delta > 0 else None,
            head=head,
            buoyancy=buoyancy,
            several=int(found.fluids.sum()) > 1,
            parted=found.parted,
            more=self.laws,
            fields=tuple(f.name for f in scheme.fields),
            mirrors=self.state.mirrors,
            reach=float(self.state.neighbours.support),
        )

    def lead(self, dt: float) -> float:
        """How far ahead the friction between fluid particles takes their velocities: 1 is exact.

        In a step friction acts once, with the velocities at its end. These are v at the half step
        and half a step of the acceleration before, which makes the step one of second order and
        stable for λ dt < 1 (Adams and Bashforth's rule), λ being the largest eigenvalue of the
        friction; with v alone it is of first order and stable for λ dt < 2. Of the acceleration as
        much is taken as leaves λ dt (1 + lead) at what the automatic step allows.
        """
        stiffness = self.properties.stiffness
        if stiffness == 0.0:
            return 1.0
        return min(1.0, max(0.0, EXPLICIT / (dt * stiffness) - 1.0))

    def field_lead(self, dt: float) -> float:
        """How far ahead fields of the user's are taken, as :meth:`lead`: by what laws allow."""
        return min(1.0, max(0.0, EXPLICIT * self.law_limit / dt - 1.0))

    def numbers(self, step: int) -> dict[str, float]:
        """What sums depend on besides fields; ``step`` is the number that noise has."""
        clock = self.state.clock
        return {
            "step": step,
            "time": clock.now,
            "inverse_dt": 1.0 / clock.dt,
            "half_step": 0.5 * clock.dt,
            "lead": self.lead(clock.dt),
            "field_lead": self.field_lead(clock.dt),
        }

    def check_names(self, fields: Iterable[Field]) -> None:
        """Refuse fields of the user's whose names mean something else.

        Raises
        ------
        InputError
            Naming the field.
        """
        taken = {*RESERVED, *self.constants, *self.state.neighbours.fields}
        taken |= {name for plane in self.state.mirrors for name in plane.numbers()}
        for field in fields:
            if not isinstance(field, Field):
                raise InputError("fields", field, "particell.Field(name)")
            both = {field.name, field.rate.name}
            if both & taken or any(name in self.state.particles for name in both):
                allowed = "one that the program does not use itself"
                raise InputError("name of Field", field.name, allowed)
