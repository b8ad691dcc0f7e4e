"""The sweeps of the flow schemes: which laws they sum, over whom, and what these may read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from particell.boundaries.wall_friction import FREE, slowed
from particell.compute.expressions import Vector, call, symbol
from particell.compute.sweep import Sweep
from particell.fields import RATE
from particell.kernels import power, shape_w
from particell.laws.continuity import Continuity, DensityDiffusion, HeadOfRest
from particell.laws.fluctuations import ThermalNoise
from particell.laws.hydrostatics import AT_REST, Weight
from particell.laws.law import Law
from particell.laws.pressure import PressureForce
from particell.laws.shifting import Crowding
from particell.laws.species_flux import PairShifts
from particell.laws.sums import DensityFilter, KernelSum, SummedDensity
from particell.laws.transport_velocity import (
    ConsistentContinuity,
    MomentumFlux,
    TransportContinuity,
)
from particell.laws.viscosity import Viscosity
from particell.laws.wall_pressure import WallPressure
from particell.sources.images import Plane, at_planes
from particell.sources.mobile import ALL, MOBILE, Particles
from particell.sources.source import Names, Side
from particell.sources.walls import Walls

#: Properties that sweeps read of fluids alone, never of walls.
OF_FLUIDS = ("transverse", "radial", "thermal", "diffusion", "equation", "fluid")


def tables_of(values: Mapping[str, np.ndarray], fluids: np.ndarray) -> dict[str, Any]:
    """Properties by group as numbers where they are the same for all that have them.

    Parameters
    ----------
    values
        Arrays (G,) by name.
    fluids
        Which groups are fluids (G,).
    """
    found: dict[str, Any] = {}
    for name, array in values.items():
        shown = array[fluids] if name in OF_FLUIDS and np.any(fluids) else array
        found[name] = float(shown[0]) if np.all(shown == shown[0]) else np.asarray(array, float)
    return found


def _ahead(held: int) -> Callable[[Side], Vector]:
    """v at the end of the half step that is yet to come, by the last acceleration."""

    def velocity(p: Side) -> Vector:
        half_step, lead = symbol("number", "half_step"), symbol("number", "lead")
        a = p.a.parts(p.dim)
        if held != FREE:
            a = (*a, *(0.0,) * (3 - p.dim))
            friction = symbol("array", "wall_friction")
            a = call(slowed, (p.index, friction, half_step, *a, p.dim, held), 3)[: p.dim]
        step = lead * half_step
        v = p.v.parts(p.dim)
        return Vector.of("v_ahead", (q + step * b for q, b in zip(v, a, strict=True)))

    return velocity


def _at_whole_step(name: str) -> Callable[[Side], Any]:
    """A field of the user's when its rate is taken: half a step on, by the last rate."""

    def value(p: Side) -> Any:
        ahead = symbol("number", "field_lead") * symbol("number", "half_step")
        return p.field(name) + ahead * p.field(name + RATE)

    return value


def _half_way(p: Side) -> Vector:
    """v in the middle of the step, by the last flux of momentum."""
    half_step = symbol("number", "half_step")
    parts = zip(p.field("v").parts(p.dim), p.flux.parts(p.dim), strict=True)
    return Vector.of("v", (v + half_step * f for v, f in parts))


def _shift_velocity(p: Side) -> Vector:
    """δv, what the transport velocity has besides v."""
    parts = zip(p.transport.parts(p.dim), p.v.parts(p.dim), strict=True)
    return Vector.of("shift_velocity", (t - v for t, v in parts))


def _pressure_over_square(p: Side) -> Any:
    """P'/(s ρ²): of what a fluid at rest does not have."""
    return p.pressure_term - p.rest_pressure / (p.density * p.density * p.density_sum)


@dataclass(frozen=True)
class FlowSweeps:
    """Descriptions of a flow scheme's sweeps.

    Attributes
    ----------
    names
        What laws may read, of the fields themselves.
    kernel, uniform
        The kernel's code; whether all supports are equal.
    walls, unknown, held, moving
        Whether there are walls, whether some have no known surface, how their friction is held
        (:mod:`particell.boundaries.wall_friction`), whether they may move.
    viscosity
        The law of friction.
    pressure
        The law of its force.
    noise, gaussian
        Whether there is thermal noise; whether its numbers are normal.
    lead
        Whether friction takes velocities ahead.
    shift
        Whether particles are shifted.
    diffusion
        The law of the density's diffusion, if any.
    head
        Of a fluid at rest.
    buoyancy
        Whether there is a body force that depends on species.
    several, parted
        Whether there is more than one group of fluid, and with other equations of state.
    contrast
        Whether reference densities differ.
    more, fields
        Laws of the user's, and names of their fields.
    mirrors, reach
        Planes in which particles are seen, and the largest support in m.
    """

    names: Names
    kernel: int
    uniform: bool
    walls: bool
    unknown: bool
    held: int
    moving: bool
    viscosity: Viscosity
    pressure: PressureForce
    noise: bool
    gaussian: bool
    lead: bool
    shift: bool
    diffusion: DensityDiffusion | None
    head: HeadOfRest | None
    buoyancy: bool
    several: bool
    parted: bool
    contrast: bool
    more: tuple[Law, ...] = ()
    fields: tuple[str, ...] = ()
    mirrors: tuple[Plane, ...] = ()
    reach: float = 0.0

    def _derived(self, **more: Callable[[Side], Any]) -> Names:
        return replace(self.names, derived={**self.names.derived, **more})

    def _own_kernel(self, p: Side) -> Any:
        """W at distance zero, in 1/m^D."""
        scale = symbol("number", "alpha") / call(power, (p.support, p.dim))
        return scale * call(shape_w, (0.0, self.kernel))

    def _sweep(
        self, name: str, laws: list[Law], sources: list[Any], seen: bool = True, **options: Any
    ) -> Sweep:
        """A sweep, where particles are ``seen`` in mirrors over their images too."""
        names = options.pop("names", self.names)
        known = {**AT_REST, "own_kernel": self._own_kernel, **names.derived}
        options["names"] = replace(names, derived=known)
        if seen:  # walls are too far from mirrors to have images
            sources = [*sources, *at_planes(self.mirrors, self.reach, of=sources[0])]
        return Sweep(
            name,
            tuple(laws),
            tuple(sources),
            kernel=self.kernel,
            uniform=self.uniform,
            **options,
        )

    def _density_laws(self) -> list[Law]:
        return [Continuity(), *([self.diffusion] if self.diffusion else [])]

    def _force_laws(self) -> list[Law]:
        laws: list[Law] = [self.pressure, self.viscosity]
        if self.noise:
            laws.append(ThermalNoise(self.viscosity, self.gaussian))
        if self.shift:
            laws.append(Crowding())
        return [*laws, *self.more, Weight(self.buoyancy)]

    def density_rates(self) -> Sweep:
        """The density's rate half-way through a step."""
        names = self._derived(density=lambda p: p.density_half)
        walls = [Walls(self.unknown)] if self.walls else []
        return self._sweep(
            "density_rates",
            self._density_laws(),
            [MOBILE, *walls],
            names=names,
            zeroed=("density_rate",),
        )

    def _written(self, density: bool) -> tuple[str, ...]:
        """What laws of the user's may add to, and the scheme's own."""
        own = [f + RATE for f in self.fields]
        known = {"density_rate": density, "shift": self.shift, "wall_friction": self.walls}
        return ("a", *(name for name, there in known.items() if there), *own)

    def forces(self, density: bool = False) -> Sweep:
        """Accelerations, and with ``density`` the density's rate."""
        derived: dict[str, Callable[[Side], Any]] = {
            "specific_volume": lambda p: p.volume / p.mass,
            "pressure_over_square": _pressure_over_square,
            **{name: _at_whole_step(name) for name in self.fields},
        }
        velocity = "v"
        if self.lead:
            derived["v_ahead"] = _ahead(self.held)
            velocity = "v_ahead"
        walls = [Walls(self.unknown, its=velocity)] if self.walls else []
        return self._sweep(
            "rates" if density else "forces",
            [*(self._density_laws() if density else []), *self._force_laws()],
            [Particles(velocity=velocity), *walls],
            names=self._derived(**derived),
            zeroed=("a", *(("density_rate",) if density else ())),
            addable=self._written(density),
        )

    def summed_density(self) -> Sweep:
        """Density from the arrangement."""
        return self._sweep("summed_density", [SummedDensity(self.contrast)], [ALL])

    def kernel_sums(self) -> Sweep:
        """The kernel's second moment, of walls too."""
        return self._sweep("kernel_sums", [KernelSum()], [ALL], targets="all")

    def wall_pressure(self) -> Sweep:
        """Pressure of walls."""
        return self._sweep(
            "wall_pressure",
            [WallPressure(self.moving, self.buoyancy)],
            [MOBILE],
            targets="walls",
            seen=False,
        )

    def flux_rates(self, consistent: bool, form: str) -> Sweep:
        """Density's rate and flux of momentum where particles move with v + δv."""
        names = self._derived(
            specific_volume=lambda p: p.volume / p.mass,
            density=lambda p: p.density_half,
            shift_velocity=_shift_velocity,
            v=_half_way,
        )
        first = ConsistentContinuity() if consistent else TransportContinuity()
        laws: list[Law] = [first, *([self.diffusion] if self.diffusion else [])]
        laws.append(MomentumFlux(form))
        walls = [Walls(self.unknown)] if self.walls else []
        return self._sweep(
            "flux_rates",
            laws,
            [Particles(jumps=self.parted), *walls],
            names=names,
            zeroed=("density_rate", "flux"),
        )

    def pair_shifts(self) -> Sweep:
        """What the shift carries between pairs, which is kept for all species."""
        names = self._derived(shift_velocity=_shift_velocity, v=_half_way)
        stored = ("own_shift", "its_shift")
        return self._sweep(
            "pair_shifts", [PairShifts()], [MOBILE], seen=False, names=names, stored=stored
        )

    def density_filter(self) -> Sweep:
        """The density, filtered, as ``density_half``."""
        return self._sweep("filtered_density", [DensityFilter(self.several, self.head)], [MOBILE])
