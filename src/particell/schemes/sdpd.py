"""SDPD: smoothed dissipative particle dynamics, isothermal; with noise off, plain SPH.

The description says which laws act and with which integrator; the solver that it makes
(:class:`.SDPDSolver`) owns the compiled loops and steps the particles.

References
----------
Español & Revenga, Phys. Rev. E 67 (2003) 026705; Drawert, Jacob, Li, Yi & Petzold, J. Comput. Phys.
378 (2019) 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from particell.checks import checked, not_negative
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.errors import InputError
from particell.fields import Field
from particell.geometry.domain import Domain
from particell.laws.law import Law
from particell.materials import Fluid
from particell.particles import Particles
from particell.schemes.checks import check_choice, check_kernel
from particell.schemes.sdpd_solver import SDPDSolver
from particell.schemes.timestep import VISCOUS, VISCOUS_TRAPEZOIDAL_NOISE

INTEGRATORS = ("velocity-verlet", "trapezoidal")
DENSITIES = ("continuity", "summation")
NOISES = ("bounded", "gaussian")


@checked
@dataclass(frozen=True)
class SDPD:
    """Isothermal SDPD; what it is made of.

    Parameters
    ----------
    kernel
        ``"lucy"``, ``"wendland-c2"``, ``"cubic-spline"`` or ``"quintic-spline"``.
    support
        Support of the kernel in particle spacings.
    density
        ``"continuity"``: integrated; ``"summation"``: Σ m W, the one to use with noise.
    integrator
        ``"velocity-verlet"`` (default): one force sweep a step, of second order in the step (of
        first in the friction where that limits the step, and with noise); or ``"trapezoidal"``:
        two force sweeps, of second order.
    fluctuations
        Thermal noise that balances the viscosity; the fluid needs a temperature.
    noise
        ``"bounded"`` (sums of uniform numbers, weakly exact) or ``"gaussian"``.
    density_diffusion
        δ of the continuity equation; None means 0.1 without noise and 0 with it.
    shifting
        P_s of :mod:`particell.laws.shifting` in units of ρ₀c₀²; 0 switches it off. For flows
        around bodies, where particles on streamlines would leave voids; without noise only.
    gravity
        Body force per mass in m/s², one number per dimension; None for zero.
    reference_speed
        Largest expected speed in m/s, for the sound speed by rule.
    pressure_drop
        Pressure difference in Pa that drives the flow, for the sound speed by rule.
    skin
        What the neighbour list adds to the support, as a part of it; None means 0.1 without
        noise and 0.3 with it. Changes speed only.
    impenetrable
        Bounce particles back that have crossed a wall's surface, as
        :class:`~particell.schemes.transport_velocity.TransportVelocity` does.

    more
        Laws of one's own (:class:`particell.laws.law.Law`) that act besides the scheme's.
    fields
        Fields of one's own, whose rates such laws give.

    Raises
    ------
    InputError
        Where a value is not allowed, or density diffusion is combined with noise.
    """

    kernel: str = "lucy"
    support: float = 3.0
    density: str = "continuity"
    integrator: str = "velocity-verlet"
    fluctuations: bool = False
    noise: str = "bounded"
    density_diffusion: float | None = None
    shifting: float = 0.0
    gravity: tuple[float, ...] | None = None
    reference_speed: float = 0.0
    pressure_drop: float = 0.0
    skin: float | None = None
    impenetrable: bool = False
    more: tuple[Law, ...] = ()
    fields: tuple[Field, ...] = ()

    normalise_viscosity: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.skin is None:
            # thermal motion separates neighbours that a flow keeps together
            object.__setattr__(self, "skin", 0.3 if self.fluctuations else 0.1)
        check_kernel(self.kernel, self.support)
        check_choice("integrator", self.integrator, INTEGRATORS)
        check_choice("density", self.density, DENSITIES)
        check_choice("noise", self.noise, NOISES)
        assert self.skin is not None
        if not 0 < self.skin <= 1:
            raise InputError("skin", self.skin, "between 0 and 1 supports")
        if self.density_diffusion is not None:
            not_negative("density_diffusion", self.density_diffusion)
        not_negative("reference_speed", self.reference_speed)
        not_negative("pressure_drop", self.pressure_drop)
        if not 0 <= self.shifting <= 2:
            raise InputError("shifting", self.shifting, "between 0 and 2")
        if self.shifting and (self.fluctuations or self.integrator == "trapezoidal"):
            raise InputError(
                "shifting", self.shifting, "zero with fluctuations or the trapezoidal integrator"
            )
        if self.density_diffusion and self.fluctuations:
            raise InputError(
                "density_diffusion",
                self.density_diffusion,
                "zero with fluctuations: it is dissipation that has no fluctuation",
            )

    @property
    def delta(self) -> float:
        """The coefficient δ in use."""
        if self.density == "summation" or self.fluctuations:
            return 0.0
        return 0.1 if self.density_diffusion is None else self.density_diffusion

    @property
    def viscous_factor(self) -> float:
        """The factor of h²ρ/η in the automatic time step."""
        if self.fluctuations and self.integrator == "trapezoidal":
            return VISCOUS_TRAPEZOIDAL_NOISE
        return VISCOUS

    @staticmethod
    def friction(material: Fluid, dim: int) -> tuple[float, float]:
        """Transverse and radial factor of F/(d_i d_j) in the friction of a material, in Pa s."""
        return SDPDSolver.friction(material, dim)

    def solver(
        self,
        device: Device,
        domain: Domain,
        particles: Particles,
        neighbours: NeighbourList,
        materials: list[Fluid],
        seed: int,
        depth_factor: float,
    ) -> SDPDSolver:
        """The compiled form of this scheme for a set of particles."""
        return SDPDSolver(
            self, device, domain, particles, neighbours, materials, seed, depth_factor
        )
