"""The compiled form of the transport-velocity scheme: what it does otherwise than SDPD."""

from __future__ import annotations

from typing import TYPE_CHECKING

from particell.boundaries.wall_friction import FREE
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.compute.sweep import Sweep
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.particles import Particles
from particell.schemes import updates
from particell.schemes.sdpd_solver import SDPDSolver

if TYPE_CHECKING:
    from particell.schemes.transport_velocity import TransportVelocity


class TransportVelocitySolver(SDPDSolver):
    """Steps a set of particles by the transport-velocity scheme.

    Forces, list and walls are those of :class:`.SDPDSolver` without noise, with the viscosity of
    Morris, Fox & Zhu (J. Comput. Phys. 136 (1997) 214): 2η F/(d_i d_j) v_ij.
    Parameters as there.
    """

    scheme: TransportVelocity  # type: ignore[assignment]

    def __init__(
        self,
        scheme: TransportVelocity,
        device: Device,
        domain: Domain,
        particles: Particles,
        neighbours: NeighbourList,
        materials: list[Fluid],
        seed: int,
        depth_factor: float,
    ):
        super().__init__(
            scheme, device, domain, particles, neighbours, materials, seed, depth_factor
        )
        particles.add("flux", self.dim)

    @property
    def pressure_form(self) -> str:  # type: ignore[override]
        """See :class:`.PressureForce`."""
        return "switched" if self.scheme.pressure_switch else self.scheme.pressure_force

    @staticmethod
    def _keeps_volume(scheme: TransportVelocity) -> bool | None:
        return scheme.fixed_volume

    @staticmethod
    def friction(material: Fluid, dim: int) -> tuple[float, float]:
        """The transverse factor 2η of F/(d_i d_j); there is no radial friction."""
        if material.bulk_viscosity:
            raise InputError(
                "bulk_viscosity", material.bulk_viscosity, "zero with TransportVelocity"
            )
        return 2.0 * material.viscosity, 0.0

    def _bind_loops(self) -> None:
        super()._bind_loops()
        fields = {**self.constants, **self.neighbours.fields, **self.particles.fields}
        self._add_flux = self.device.bind(
            updates.kick, {**fields, "a": fields["flux"]}, DIM=self.dim, HELD=FREE
        )

    def descriptions(self) -> list[Sweep]:
        """See :meth:`.SDPDSolver.descriptions`; fluxes half-way, and the filter."""
        made, scheme = self.sweeps(), self.scheme
        found = [s for s in super().descriptions() if s.name != "density_rates"]
        flux = made.flux_rates(scheme.renormalise, scheme.momentum_flux)
        return [flux, made.density_filter(), *found]

    def step(self, step: int, dt: float) -> None:
        """Kick, drift, kick with two sweeps: fluxes half-way, forces at the end of the drift.

        δv is known with the forces, where the step begins; what it is in the middle of the step
        holds for all of it. Mass and momentum cross between particles with the very δv that moves
        these, at x and v of the half step, to which the last flux has brought v.
        """
        n = self.n
        self.kick(n, 0.5 * dt)
        self.transport_velocity(n, dt)
        self._renew_list(dt)
        self.drift(n, 0.5 * dt)
        self.move_walls(0.5)
        self.predict_density(n, 0.5 * dt)
        self.density_rates(step, dt)
        self.carry_species(step, dt)
        self.drift(n, 0.5 * dt)
        self.move_walls(1.0)
        self.after_drift()
        self._add_flux(n, dt)
        self._thermodynamics(dt)
        every = self.scheme.filter_every
        if every and (step + 1) % every == 0:
            self.filter_density()
        self.time += dt
        self.accelerate(step + 1, dt)
        self.kick(n, 0.5 * dt)

    def density_rates(self, step: int, dt: float) -> None:
        """Density rate and flux of momentum at the half step."""
        self.before_pairs()
        self._run["flux_rates"](self.n, half_step=0.5 * dt)

    def carry_species(self, step: int, dt: float) -> None:
        """Called at the half step (what the shift carries of species)."""

    def filter_density(self) -> None:
        """Smooth the fluid's density; pressure, volume and walls follow."""
        p = self.particles
        self.device.copy(p["density"], p["density_half"])  # walls keep theirs
        self._run["filtered_density"](self.n)
        self.device.copy(p["density_half"], p["density"])
        self._thermodynamics(0.0)
