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
from particell.compute.batches import batch_size
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.compute.philox import PAIR_NOISE, VELOCITY_SPREAD, stream_key
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.kernels import kernel_code, normalisation
from particell.laws.diffusion import pair_slopes, slope_fields
from particell.laws.shifting import FRICTION, SOUND
from particell.laws.viscosity import friction_coefficients
from particell.materials import BOLTZMANN, Fluid
from particell.particles import Particles
from particell.schemes import updates
from particell.schemes.friction_limit import stiffest
from particell.schemes.hydrostatics import RestPressure
from particell.schemes.kept_volume import KeptVolume
from particell.schemes.rates import MATTER, RECORD, batch_fields, pack, rates
from particell.schemes.summation import discrete_fluids
from particell.schemes.sweeps import summed_density, wall_pressure
from particell.schemes.timestep import EXPLICIT

if TYPE_CHECKING:
    from particell.schemes.sdpd import SDPD
    from particell.schemes.transport_velocity import TransportVelocity


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
        self.constants = {
            "alpha": normalisation(code, dim),
            "transverse": array(np.array([f[0] for f in friction])),
            "radial": array(np.array([f[1] for f in friction])),
            "diffusion": array(2 * scheme.delta * sound_speeds),
            "equation": array(np.array([equations.index(e) for e in equations])),
            "thermal": array(self.thermal),
            "gravity": array(gravity),
            "holds_head": array(np.where(domain.periodic, 0.0, 1.0)),
            "key0": key[0],
            "key1": key[1],
            "reference": array(densities),
            "sound_speed": array(sound_speeds),
            "exponent": array(np.array([m.exponent for m in by_group])),
            "shift_pressure": array(
                np.array(
                    [scheme.shifting * m.density * (m.sound_speed or 0.0) ** 2 for m in by_group]
                )
            ),
            "shift_sound": array(SOUND / sound_speeds),
            "shift_friction": array(np.array([friction_time(m) for m in by_group])),
            "background": array(np.array([m.background_pressure for m in by_group])),
            "density_sum": array(np.array([d.density_sum for d in discrete])),
            "confinement": array(np.array([d.confinement for d in discrete])),
        }
        kinds = zip(friction, self.thermal.tolist(), particles.groups, strict=True)
        pairings = {(f, thermal) for f, thermal, g in kinds if g.kind == "fluid"}
        self.options: dict[str, Any] = {
            "DIM": dim,
            "KERNEL": code,
            "UNIFORM": bool(neighbours.constants["UNIFORM"]),
            "MIXED": len(pairings) > 1,
            "RADIAL": any(f[1] != 0 for f in friction),
            "DELTA": scheme.delta > 0,
            "HEAD": 1
            if np.any(gravity[~np.array(domain.periodic)])
            else 0,  # 2 with forces besides
            "PARTED": len(set(equations)) > 1,
            "CONTRAST": contrast,
            "LEAD": not (scheme.fluctuations or self.trapezoidal),
            "NOISE": scheme.fluctuations,
            "GAUSSIAN": scheme.noise == "gaussian",
            "WALLS": bool(neighbours.constants["WALLS"]),
            "SHIFT": self.shifting,
            "SWITCH": 0,
            "NORMAL": scheme.normalise_viscosity,
            "UNKNOWN": "wall_distance" in particles,
            "PARABOLIC": bool(neighbours.constants["WALLS"]) and not scheme.fluctuations,
            "BATCH": batch_size(device),
            "RECORD": RECORD[dim],
            "MATTER": MATTER[dim],
        }
        o = self.options
        self.held = FREE
        if o["WALLS"]:
            self.held = TENSOR if o["RADIAL"] else ISOTROPIC
            particles.add("wall_friction", friction_width(self.held, dim))
        else:
            self.constants["wall_friction"] = device.zeros((1, 1))
        self.spreads = self.held != FREE and scheme.fluctuations and not self.trapezoidal
        if self.spreads:
            particles.add("velocity_spread", dim, part_of="v")
            self._spread_key = stream_key(seed, VELOCITY_SPREAD)
        self.constants |= self.rest.fields
        self.constants |= batch_fields(
            device, self.n, dim, o["UNIFORM"], o["WALLS"], o["MIXED"], o["NOISE"], o["NORMAL"]
        )
        if o["NORMAL"]:
            self.constants |= slope_fields(device, self.n, o["UNIFORM"])
        for name, shape in (
            ("wall_direction", (1, dim)),
            ("wall_distance", 1),
            ("wall_acceleration", (1, dim)),
            ("buoyancy", (1, dim)),
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
        bind = self.device.bind
        dim, o = {"DIM": self.dim}, self.options
        if "buoyancy" in self.particles:
            o["HEAD"] = 2
        record = {k: o[k] for k in ("DIM", "RECORD", "MATTER")}
        small = {k: o[k] for k in ("DIM", "KERNEL", "UNIFORM")}
        continuity = not self.summation
        if self.leapfrog:
            half = {**fields, "density": fields["density_half"]}
            quiet = {**o, "NOISE": False, "SHIFT": False, "MIXED": False, "RADIAL": False}
            quiet |= {"SWITCH": 0, "NORMAL": False, "LEAD": False, "PARABOLIC": False}
            self._density_rates = bind(rates, half, **quiet, DENSITY=True, FORCE=False)
            self._pack_half = bind(pack, half, **record, LEAD=False, HELD=FREE)
            self.predict_density = bind(updates.predict_density, fields)
        self._pack = bind(pack, fields, **record, LEAD=o["LEAD"], HELD=self.held)
        self._forces = bind(rates, fields, **o, DENSITY=False, FORCE=True)
        self._all_rates = bind(rates, fields, **o, DENSITY=continuity, FORCE=True)
        contrast = {"CONTRAST": o["CONTRAST"]}
        self.sum_density = bind(summed_density, fields, **small, **contrast)
        moving = "wall_acceleration" in self.particles
        self.wall_pressure = bind(wall_pressure, fields, **dim, KERNEL=o["KERNEL"], MOVING=moving)
        if o["NORMAL"]:
            fields["exchange"] = self.constants["kernel_sum"]  # which is not kept
            sums = {"BATCH": o["BATCH"], "SUM": True, "KEEP": False}
            self._kernel_sums = bind(pair_slopes, fields, **small, **sums)
        held = {"HELD": self.held}
        self.kick = bind(updates.kick, fields, **dim, **held)
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
        if not self.options["NOISE"]:
            self.rest.tabulate()
        self.accelerate(step, dt)
        if self.options["HEAD"] == 2 and not self.options["NOISE"]:
            self.rest.tabulate()  # buoyancy is known now
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
        self.rates(step, dt)
        self.remember(n)
        self.predict(n, dt)
        self.move_walls(1.0)
        self._thermodynamics(0.0)
        self.rates(step, dt)
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

    def after_forces(self) -> None:
        """Called when accelerations are known (forces that depend on species)."""

    def after_wall_pressure(self) -> None:
        """Called when walls have the fluid's pressure (heads of forces that depend on species)."""

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
        if self.options["WALLS"]:
            self.wall_pressure(self.n)
            self.after_wall_pressure()

    def density_rates(self, step: int, dt: float) -> None:
        """Density rate at the half step (velocity-Verlet)."""
        self.before_pairs()
        self._pack_half(self.n, 0.0, 0.0)
        self._density_rates(self.n, step, 0.0)

    def accelerate(self, step: int, dt: float) -> None:
        """Acceleration; ``dt`` scales the noise."""
        self._before_forces(dt)
        self._forces(self.n, step, 1.0 / dt)
        self.after_forces()

    def _before_forces(self, dt: float) -> None:
        self.before_pairs()
        if self.options["NORMAL"]:
            self._kernel_sums(self.n)
        self._pack(self.n, 0.5 * dt, self._lead(dt))

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

    def rates(self, step: int, dt: float) -> None:
        """Density rate (unless it is summed) and acceleration in one sweep."""
        self._before_forces(dt)
        self._all_rates(self.n, step, 1.0 / dt)
        self.after_forces()
