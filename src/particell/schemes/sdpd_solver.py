"""The compiled form of the SDPD scheme: its loops, and in which order they run in a step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.boundaries.wall_friction import (
    FREE,
    ISOTROPIC,
    TENSOR,
    draw_spread,
    friction_width,
    take_spread,
)
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.compute.philox import PAIR_NOISE, VELOCITY_SPREAD, stream_key
from particell.compute.sweep import Sweep
from particell.errors import InputError
from particell.fields import RATE
from particell.geometry.domain import Domain
from particell.kernels import kernel_code, normalisation
from particell.laws.continuity import DensityDiffusion, HeadOfRest
from particell.laws.hydrostatics import AT_REST
from particell.laws.pressure import PressureForce
from particell.laws.shifting import FRICTION, SOUND
from particell.laws.viscosity import Viscosity, friction_coefficients
from particell.materials import BOLTZMANN, Fluid
from particell.particles import Particles
from particell.schemes import updates
from particell.schemes.flow_sweeps import FlowSweeps, tables_of
from particell.schemes.friction_limit import stiffest
from particell.schemes.hydrostatics import RestPressure
from particell.schemes.kept_volume import KeptVolume
from particell.schemes.summation import discrete_fluids
from particell.schemes.timestep import EXPLICIT
from particell.sources.source import Names

if TYPE_CHECKING:
    from particell.schemes.sdpd import SDPD
    from particell.schemes.transport_velocity import TransportVelocity


#: Names that laws, loops and frames use for something else.
TAKEN = {"time", "step", "inverse_dt", "half_step", "lead", "position", "velocity", "index", "dim"}
TAKEN |= {"field_lead"}
TAKEN |= {"record", "columns", "whole_columns", "specific_volume", "pressure_over_square", "side"}
TAKEN |= {"v_ahead", "own_kernel", "names", "replace", "field", "transport", "flux", "buoyancy"}
TAKEN |= {"count", "amount", "shift", "density_half", "wall_depth", "wall_normal"}
TAKEN |= {"wall_curvature", "wall_friction", "velocity_spread", "kernel_sum", "shift_before"}
TAKEN |= set(AT_REST)


def friction_time(material: Fluid) -> float:
    """τ/h² of :mod:`particell.laws.shifting` in s/m² where friction limits it."""
    largest = max(material.viscosity, material.bulk_viscosity)
    return FRICTION * material.density / largest if largest else math.inf


class SDPDSolver:
    """Steps a set of particles by the SDPD scheme.

    Parameters
    ----------
    scheme
        The description.
    device, domain, particles, neighbours
        Where loops run; the box; the particles; their neighbour list.
    materials
        Materials (with sound speeds), indexed by the groups' ``material``.
    seed
        Of the noise.
    depth_factor
        Extent in m^(3−D) of the missing dimensions; k_B T is divided by it, since masses of 1D
        and 2D particles are per that extent.
    """

    FIELDS = ("pressure_term", "density_rate")

    def __init__(
        self,
        scheme: SDPD | TransportVelocity,
        device: Device,
        domain: Domain,
        particles: Particles,
        neighbours: NeighbourList,
        materials: list[Fluid],
        seed: int,
        depth_factor: float,
    ):
        self.scheme, self.device, self.domain = scheme, device, domain
        self.particles, self.neighbours = particles, neighbours
        self.n, self.dim = len(particles), domain.dim
        dim = self.dim
        by_group = [materials[g.material] for g in particles.groups]
        discrete = discrete_fluids(scheme, particles, by_group, depth_factor)
        #: what particles of each group are given: what limits the step
        self.given = [d.material for d in discrete]
        friction = [self.friction(m, dim) for m in self.given]
        gravity = np.zeros(dim) if scheme.gravity is None else np.array(scheme.gravity, dtype=float)
        if gravity.shape != (dim,):
            raise InputError("gravity", scheme.gravity, f"{dim} numbers")
        contrast = len({m.density for m in by_group}) > 1
        self.rest = RestPressure(device, domain, particles, gravity, contrast)
        self.thermal = np.zeros(len(by_group))
        if scheme.fluctuations:
            for k, material in enumerate(by_group):
                if material.temperature is None:
                    raise InputError("temperature", None, "given for every material, with noise")
                self.thermal[k] = BOLTZMANN * material.temperature / depth_factor
        for name in self.FIELDS:
            particles.add(name)
        for field in scheme.fields:
            if field.name in TAKEN or field.name in particles or field.name + RATE in particles:
                raise InputError("name of Field", field.name, "one that nothing else has")
            particles.add(field.name, values=field.initial)
            particles.add(field.name + RATE)
        for name, components in (("wall_normal", dim), ("wall_depth", 0), ("wall_curvature", 0)):
            if name not in particles:
                particles.add(name, components)
        self.trapezoidal = scheme.integrator == "trapezoidal"
        self.summation = scheme.density == "summation"
        self.leapfrog = not (self.trapezoidal or self.summation)
        if self.leapfrog:
            particles.add("density_half")
        if self.trapezoidal:
            for name, components in (
                ("x0", dim),
                ("v0", dim),
                ("a0", dim),
                ("density0", 0),
                ("density_rate0", 0),
            ):
                particles.add(name, components)
        self.shifting = scheme.shifting > 0
        particles.add("shift", dim if self.shifting else 1)
        if self.shifting:
            particles.add("transport", dim)
            particles.add("shift_before", dim)
        densities = np.array([m.density for m in by_group])
        self.kept_volume = KeptVolume(
            device, domain, particles, densities, self._keeps_volume(scheme)
        )
        code = kernel_code(scheme.kernel)
        array = device.array
        key = stream_key(seed, PAIR_NOISE)
        equations = [
            (m.density, m.sound_speed, m.exponent, m.background_pressure) for m in by_group
        ]
        sound_speeds = np.array([m.sound_speed for m in self.given], dtype=float)
        self.contrast = contrast
        self.tables = {
            "transverse": np.array([f[0] for f in friction]),
            "radial": np.array([f[1] for f in friction]),
            "diffusion": 2 * scheme.delta * sound_speeds,
            "equation": np.array([equations.index(e) for e in equations], dtype=float),
            "fluid": np.arange(len(by_group), dtype=float),
            "thermal": self.thermal,
            "reference": densities,
            "sound_speed": sound_speeds,
            "exponent": np.array([m.exponent for m in by_group]),
            "shift_pressure": np.array(
                [scheme.shifting * m.density * (m.sound_speed or 0.0) ** 2 for m in by_group]
            ),
            "shift_sound": SOUND / sound_speeds,
            "shift_friction": np.array([friction_time(m) for m in by_group]),
            "background": np.array([m.background_pressure for m in by_group]),
            "density_sum": np.array([d.density_sum for d in discrete]),
            "confinement": np.array([d.confinement for d in discrete]),
        }
        self.fluids = np.array([g.kind == "fluid" for g in particles.groups])
        self.parted = len(set(equations)) > 1
        self.radial = any(f[1] != 0 for f in friction)
        self.walls = bool(neighbours.constants["WALLS"])
        self.constants = {
            "alpha": normalisation(code, dim),
            "gravity": array(gravity),
            "key0": key[0],
            "key1": key[1],
            **{name: array(values) for name, values in self.tables.items()},
        }
        self._scratch: dict[str, Any] = {}
        for field in scheme.fields:
            if field.name in self.constants or field.name in neighbours.fields:
                raise InputError("name of Field", field.name, "one that nothing else has")
        self.time = 0.0  # at which forces act, in s
        self.law_limit = math.inf  # of the step, by laws of the user's, in s
        self.held = FREE
        if self.walls:
            self.held = TENSOR if self.radial else ISOTROPIC
            particles.add("wall_friction", friction_width(self.held, dim))
        else:
            self.constants["wall_friction"] = device.zeros((1, 1))
        self.spreads = self.held != FREE and scheme.fluctuations and not self.trapezoidal
        if self.spreads:
            particles.add("velocity_spread", dim, part_of="v")
            self._spread_key = stream_key(seed, VELOCITY_SPREAD)
        self.constants |= self.rest.fields
        if scheme.normalise_viscosity:
            particles.add("kernel_sum")
        for name, shape in (
            ("wall_direction", (1, dim)),
            ("wall_distance", 1),
        ):
            if name not in particles:
                self.constants[name] = device.zeros(shape)
        self._stiffness = self._largest_friction(by_group, friction)
        self._bound: object = None

    def _largest_friction(
        self, materials: list[Fluid], friction: list[tuple[float, float]]
    ) -> float:
        """λ_max of :mod:`particell.schemes.friction_limit` in 1/s, of the fluid held most."""
        scheme, h = self.scheme, float(self.particles.host("support").min())
        how = (scheme.kernel, scheme.support, self.dim, scheme.normalise_viscosity)
        pairs = zip(materials, friction, strict=True)
        return max(stiffest(f, friction, *how) / (m.density * h**2) for m, f in pairs)

    @staticmethod
    def friction(material: Fluid, dim: int) -> tuple[float, float]:
        """Transverse and radial factor of F/(d_i d_j) in the friction of a material."""
        return friction_coefficients(material.viscosity, material.bulk_viscosity, dim)

    def _bind(self) -> None:
        """Look up arrays again where those of the neighbour list are new (grown, restored)."""
        listed = self.neighbours.fields["neighbours"]
        if self._bound is listed:
            return
        self._bound = listed
        self._bind_loops()

    #: The form of the pressure's force.
    pressure_form = "symmetric"

    def sweeps(self) -> FlowSweeps:
        """The descriptions of the sweeps, of the fields that there are now."""
        scheme, p = self.scheme, self.particles
        buoyancy = "buoyancy" in p
        walled = tuple(not periodic for periodic in self.domain.periodic)
        acts = buoyancy or np.any(self.device.to_host(self.constants["gravity"])[list(walled)])
        head = HeadOfRest(walled, buoyancy) if acts else None
        exact = self.walls and not scheme.fluctuations
        arrays: dict[str, Any] = p.fields
        shapes = {name: array.shape for name, array in arrays.items()}
        tables = tables_of(self.tables, self.fluids)
        return FlowSweeps(
            names=Names(
                self.dim,
                {k: s[1] if len(s) > 1 else 0 for k, s in shapes.items()},
                {k: isinstance(v, np.ndarray) for k, v in tables.items()},
                numbers=frozenset({"time", "inverse_dt", "half_step", "lead", "field_lead"}),
                vectors=frozenset({"gravity"}),
            ),
            kernel=kernel_code(scheme.kernel),
            uniform=bool(self.neighbours.constants["UNIFORM"]),
            walls=self.walls,
            unknown="wall_distance" in p,
            held=self.held,
            moving="wall_acceleration" in p,
            viscosity=Viscosity(self.radial, scheme.normalise_viscosity, exact, self.walls),
            pressure=PressureForce(self.pressure_form, contrast=self.contrast),
            contrast=self.contrast,
            noise=scheme.fluctuations,
            gaussian=scheme.noise == "gaussian",
            lead=not (scheme.fluctuations or self.trapezoidal),
            shift=self.shifting,
            diffusion=DensityDiffusion(head, self.parted) if scheme.delta > 0 else None,
            head=head,
            buoyancy=buoyancy,
            several=int(self.fluids.sum()) > 1,
            parted=self.parted,
            more=tuple(scheme.more),
            fields=tuple(f.name for f in scheme.fields),
        )

    def descriptions(self) -> list[Sweep]:
        """The sweeps that steps are made of."""
        made = self.sweeps()
        found = [made.density_rates()] if self.leapfrog else []
        if self.trapezoidal:
            found.append(made.forces(density=not self.summation))
        if self.summation:
            found.append(made.summed_density())
        if self.walls:
            found.append(made.wall_pressure())
        if self.scheme.normalise_viscosity:
            found.append(made.kernel_sums())
        return [*found, made.forces()]

    def bound(self, sweep: Sweep, **more: Any) -> Any:
        """A sweep over the particles and the list that there are now, and ``more`` arrays."""
        fields = {**self.constants, **self.neighbours.fields, **self.particles.fields, **more}
        fields.setdefault("transport", fields["v"])
        given = {**fields, **tables_of(self.tables, self.fluids)}
        return sweep.bind(self.device, given, self._scratch)

    def kick(self, n: int, dt: float) -> None:
        """Velocities after dt; and fields of the user's."""
        self._kick(n, dt)
        self.change_fields(dt)

    def change_fields(self, dt: float) -> None:
        """Fields of the user's after dt."""
        for change in self._changes:
            change(self.n, dt)

    def sum_density(self, n: int) -> None:
        """Density from the arrangement."""
        self._run["summed_density"](n)

    def wall_pressure(self, n: int) -> None:
        """Pressure of walls from the fluid's."""
        self._run["wall_pressure"](n)

    @staticmethod
    def _keeps_volume(scheme: Any) -> bool | None:
        """See :class:`.KeptVolume`; without shifting what keeps particles apart is their pressure.

        It comes from a mean density that has climbed a little: were that taken away, half of the
        fluid would be under tension, and clump.
        """
        return bool(scheme.shifting > 0)

    def _bind_loops(self) -> None:
        fields = {**self.constants, **self.neighbours.fields, **self.particles.fields}
        fields.setdefault("transport", fields["v"])
        bind, dim = self.device.bind, {"DIM": self.dim}
        self._run = {sweep.name: self.bound(sweep) for sweep in self.descriptions()}
        if self.leapfrog:
            self.predict_density = bind(updates.predict_density, fields)
        held = {"HELD": self.held}
        self._kick = bind(updates.kick, fields, **dim, **held)
        self._changes = [
            bind(
                updates.change,
                {**fields, "value": fields[f.name], "rate": fields[f.name + RATE]},
            )
            for f in self.scheme.fields
        ]
        if self.spreads:
            key0, key1 = self._spread_key
            spread = {**fields, "key0": key0, "key1": key1}
            self._draw_spread = bind(draw_spread, spread, **dim, **held)
            self._take_spread = bind(take_spread, fields, **dim)
        self.drift = bind(updates.drift, fields, **dim)
        self.equation_of_state = bind(updates.equation_of_state, fields)
        self.kept_volume.bind(fields)
        if self.shifting:
            carries = {"FLUX": "flux" in self.particles}
            fields.setdefault("flux", fields["v"])
            self.transport_velocity = bind(updates.transport_velocity, fields, **dim, **carries)
        if self.trapezoidal:
            self.remember = bind(updates.remember, fields, **dim)
            self.predict = bind(updates.predict, fields, **dim, **held)
            self.correct = bind(updates.correct, fields, **dim, **held)

    def build_list(self) -> None:
        """Build the neighbour list at the present positions."""
        self.neighbours.build(self.particles)
        self._bind()
        self.kept_volume.keep()

    def initialise(self, step: int, dt: float) -> None:
        """Density (if summed), pressure and acceleration of the initial state."""
        self.build_list()
        self.kept_volume.start()
        self._thermodynamics(0.0)
        if not self.scheme.fluctuations:
            self.rest.tabulate()
        self.accelerate(step, dt)
        if self.shifting:
            self.device.copy(self.particles["shift"], self.particles["shift_before"])

    def restore(self) -> None:
        """Go on from fields and a neighbour list that were put back."""
        self._bind()

    def step(self, step: int, dt: float) -> None:
        """Advance by dt; ``step`` numbers the step (the noise depends on it)."""
        if self.trapezoidal:
            self._trapezoidal(step, dt)
        else:
            self._velocity_verlet(step, dt)

    def _velocity_verlet(self, step: int, dt: float) -> None:
        """Kick, drift, kick; one force sweep a step, not iterated; friction as :meth:`_lead` says.

        The continuity equation is integrated by the midpoint rule, with positions and velocities
        at n + 1/2: that is the leapfrog of density and velocity, which neither damps nor feeds
        sound. (Rates taken with the forces, at n + 1, are late by half a step.) The densities and
        volumes in it are extrapolated to n + 1/2 too, else it would be of first order.
        """
        n = self.n
        if self.spreads:
            self._take_spread(n)
        self.kick(n, 0.5 * dt)
        if self.shifting:
            self.transport_velocity(n, dt)
        self._renew_list(dt)
        if self.summation:
            self.drift(n, dt)
            self.move_walls(1.0)
            self.after_drift()
            self._thermodynamics(0.0)
        else:
            self.drift(n, 0.5 * dt)
            self.move_walls(0.5)
            self.predict_density(n, 0.5 * dt)
            self.density_rates(step, dt)
            self.drift(n, 0.5 * dt)
            self.move_walls(1.0)
            self.after_drift()
            self._thermodynamics(dt)
        self.time += dt
        self.accelerate(step + 1, dt)
        self.kick(n, 0.5 * dt)

    def finish(self, step: int, dt: float) -> None:
        """Give v its spread at whole steps, when everything has acted on it.

        See :mod:`particell.boundaries.wall_friction`.
        """
        if self.spreads:
            self._draw_spread(self.n, step, 0.5 * dt)

    def _trapezoidal(self, step: int, dt: float) -> None:
        """The papers' explicit two-stage rule; the same noise in both stages."""
        n = self.n
        self._renew_list(dt)
        self.rates(step, dt, 0.0)
        self.change_fields(0.5 * dt)
        self.remember(n)
        self.predict(n, dt)
        self.move_walls(1.0)
        self._thermodynamics(0.0)
        self.time += dt
        self.rates(step, dt, 1.0)
        self.change_fields(0.5 * dt)
        self.correct(n, dt)
        self.move_walls(1.0)
        self.after_drift()
        self._thermodynamics(0.0)

    def move_walls(self, part: float) -> None:
        """Called when positions have reached this part of the step (walls that move)."""

    def before_pairs(self) -> None:
        """Called before sums over neighbours (distances from walls without a known surface)."""

    def after_drift(self) -> None:
        """Called when positions have reached the end of the step (reflecting surfaces)."""

    def body_forces(self) -> None:
        """Called when volumes are known, before pressures act (forces that depend on species)."""

    def _renew_list(self, dt: float) -> None:
        p = self.particles
        if self.neighbours.needs_build(p["x"], p["transport" if self.shifting else "v"], dt):
            self.build_list()
            self.rest.follow()

    def _thermodynamics(self, dt: float) -> None:
        """Density after dt (or summed), pressure and volume; then the pressure of walls."""
        if self.summation:
            self.sum_density(self.n)
            dt = 0.0
        self.equation_of_state(self.n, dt)
        self.body_forces()
        if self.walls:
            self.wall_pressure(self.n)

    def density_rates(self, step: int, dt: float) -> None:
        """Density rate at the half step (velocity-Verlet)."""
        self.before_pairs()
        self._run["density_rates"](self.n)

    def accelerate(self, step: int, dt: float) -> None:
        """Acceleration; ``dt`` scales the noise."""
        self._before_forces()
        self._run["forces"](self.n, **self.numbers(step, dt))

    def _before_forces(self) -> None:
        self.before_pairs()
        if self.scheme.normalise_viscosity:
            self._run["kernel_sums"](self.n)

    def numbers(self, step: int, dt: float) -> dict[str, float]:
        """What forces depend on besides fields."""
        lead = {"half_step": 0.5 * dt, "lead": self._lead(dt), "field_lead": self._field_lead(dt)}
        return {"step": step, "time": self.time, "inverse_dt": 1.0 / dt, **lead}

    def _lead(self, dt: float) -> float:
        """How far ahead the friction between fluid particles takes their velocities: 1 is exact.

        In a step friction acts once, with the velocities at its end. These are v at the half step
        and half a step of the acceleration before, which makes the step one of second order and
        stable for λ dt < 1 (Adams and Bashforth's rule), λ being the largest eigenvalue of the
        friction; with v alone it is of first order and stable for λ dt < 2. Of the acceleration as
        much is taken as leaves λ dt (1 + lead) at what the automatic step allows.
        """
        if self._stiffness == 0.0:
            return 1.0
        return min(1.0, max(0.0, EXPLICIT / (dt * self._stiffness) - 1.0))

    def _field_lead(self, dt: float) -> float:
        """How far ahead fields of the user's are taken, as :meth:`_lead`: by what laws allow."""
        return min(1.0, max(0.0, EXPLICIT * self.law_limit / dt - 1.0))

    def rates(self, step: int, dt: float, field_lead: float) -> None:
        """Density rate (unless it is summed) and acceleration in one sweep."""
        self._before_forces()
        self._run["rates"](self.n, **{**self.numbers(step, dt), "field_lead": field_lead})
