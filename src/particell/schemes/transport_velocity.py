"""Weakly compressible SPH with a transport velocity: particles stay evenly spread.

Forces, list and walls are those of :class:`~particell.schemes.sdpd.SDPD` without noise, with the
viscosity of Morris, Fox & Zhu (J. Comput. Phys. 136 (1997) 214): 2η F/(d_i d_j) v_ij. Equations are
in :mod:`particell.laws.transport_velocity` and :mod:`particell.laws.shifting`.

References
----------
Adami, Hu & Adams, J. Comput. Phys. 241 (2013) 292; Jacob, thesis, UCSB 2020, chapter 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from particell.checks import checked, not_negative
from particell.errors import InputError
from particell.fields import Field
from particell.laws.law import Law
from particell.laws.transport_velocity import FORMS
from particell.materials import Fluid
from particell.operations.operation import When
from particell.schemes.checks import check_described, check_kernel
from particell.schemes.density_stages import (
    AddFlux,
    EquationOfState,
    FilterDensity,
    FluxRates,
    PredictDensity,
    WallPressure,
)
from particell.schemes.solver import Stage
from particell.schemes.stages import (
    At,
    ChangeFields,
    Drift,
    EverySteps,
    Forces,
    KernelSums,
    Kick,
    RenewList,
    ShiftVelocity,
    beginning,
)
from particell.schemes.timestep import VISCOUS

#: Largest δ: explicit diffusion at the time step that sound allows is unstable at 0.3.
MOST_DIFFUSION = 0.2

#: Forms of the pressure's force (:class:`.PressureForce`).
PRESSURE_FORCES = ("symmetric", "difference")


@checked
@dataclass(frozen=True)
class TransportVelocity:
    """Isothermal flow by particles that a transport velocity keeps evenly spread.

    Parameters
    ----------
    kernel
        ``"lucy"``, ``"wendland-c2"``, ``"cubic-spline"`` or ``"quintic-spline"``.
    support
        Support of the kernel in particle spacings. At 2.6 with Lucy's kernel the shift returns
        every mode of a square, hexagonal and cubic lattice to its sites; at 3 it does not.
    background
        P_b of the shift in units of ρ₀c₀². It moves particles only and is no pressure.
    momentum_flux
        ``"uniform"``, ``"conserving"`` or ``"none"``: the momentum that crosses between particles
        with the shift, in the form that keeps uniform velocities uniform or in the one that
        conserves momentum.
    renormalise
        Integrate the density with the first-order consistent gradient, exact for linear fields on
        any arrangement. Without it the density follows the arrangement: where a flow strains a
        lattice, pressures of the size of ρU² arise and take its energy.
    pressure_switch
        Let pairs of fluid particles that attract each other repel instead, against cavitation; it
        does not conserve momentum.
    pressure_force
        ``"symmetric"``: P_i + P_j, which conserves momentum, but under a pressure P̄ any order of
        the particles resists being sheared, like a solid with a yield stress of some per cent of
        P̄. ``"difference"``: P_j − P_i, without force where P is uniform, whatever the arrangement,
        and without that resistance, but conserving momentum only to the scheme's order.
    fixed_volume
        Keep Σ m/ρ of the fluid, by scaling all densities every few steps
        (:mod:`particell.operations.kept_volume`): for fluid that fills a closed or periodic space,
        whose mean pressure is arbitrary. Without it the density climbs by half a per cent or more
        in a cavity, which is a pressure of ρU²/2, enough to make slow parts of the flow solid (see
        ``pressure_force``). None: it is kept at that of the start where the fluid has walls, other
        fluid or its own images all round, and no wall moves by a ``WallMotion``; True: at that of
        the reference density, in any case; False: never.
    filter_every
        Steps between two applications of the density filter; 0 switches it off.
    density_diffusion
        δ of the density's diffusion (:mod:`particell.laws.continuity`), at most 0.2, among fluid
        particles. Without it nothing but viscosity and the filter damps sound, and where the flow
        has structures that the particles do not resolve (U Δp/ν well above 10, next to walls), the
        density of single particles may run away; 0.1 bounds it, the filter at every step does more.
    impenetrable
        Bounce particles back that have crossed a wall's surface: at the surface itself where it is
        known (:mod:`particell.boundaries.impenetrable`), else by the boundary volume fraction
        (:mod:`particell.boundaries.volume_fraction`).
    normalise_viscosity
        Divide the friction of each pair by the mean kernel sum (1/D) Σ V F r² of its particles: the
        viscosity is then exact for quadratic profiles on every lattice. Costs a sweep.
    species_flux
        Let the shift carry species between particles (:mod:`particell.laws.species_flux`; molecules
        as in :mod:`particell.chemistry.crossings`); otherwise they ride with them. Not for species
        that switch between molecules and amounts.
    more
        Laws of one's own (:class:`particell.laws.law.Law`) that act besides the scheme's.
    fields
        Fields of one's own, whose rates such laws give.
    gravity, reference_speed, pressure_drop, skin
        As for :class:`~particell.schemes.sdpd.SDPD`.

    Raises
    ------
    InputError
        Where a value is not allowed.
    """

    kernel: str = "lucy"
    support: float = 2.6
    background: float = 1.0
    momentum_flux: str = "uniform"
    renormalise: bool = True
    pressure_switch: bool = False
    pressure_force: str = "symmetric"
    fixed_volume: bool | None = None
    filter_every: int = 20
    density_diffusion: float = 0.0
    impenetrable: bool = True
    normalise_viscosity: bool = False
    species_flux: bool = False
    gravity: tuple[float, ...] | None = None
    reference_speed: float = 0.0
    pressure_drop: float = 0.0
    skin: float = 0.15
    more: tuple[Law, ...] = ()
    fields: tuple[Field, ...] = ()

    # what it has in common with SDPD, whose loops it uses
    density: ClassVar[str] = "continuity"
    integrator: ClassVar[str] = "velocity-verlet"
    noise: ClassVar[str] = "bounded"
    fluctuations: ClassVar[bool] = False
    viscous_factor: ClassVar[float] = VISCOUS
    at_rest: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_described(self)
        check_kernel(self.kernel, self.support)
        if not 0 < self.background <= 2:
            raise InputError("background", self.background, "above 0 and at most 2")
        if self.momentum_flux not in FORMS:
            raise InputError("momentum_flux", self.momentum_flux, f"one of {', '.join(FORMS)}")
        if self.pressure_force not in PRESSURE_FORCES:
            allowed = f"one of {', '.join(PRESSURE_FORCES)}"
            raise InputError("pressure_force", self.pressure_force, allowed)
        if self.pressure_force == "difference" and self.pressure_switch:
            raise InputError("pressure_switch", True, "False with pressure_force 'difference'")
        if not self.filter_every >= 0:
            raise InputError("filter_every", self.filter_every, "a whole number, zero or more")
        if not 0 <= self.density_diffusion <= MOST_DIFFUSION:
            allowed = f"between 0 and {MOST_DIFFUSION}"
            raise InputError("density_diffusion", self.density_diffusion, allowed)
        not_negative("reference_speed", self.reference_speed)
        not_negative("pressure_drop", self.pressure_drop)
        if not 0 < self.skin <= 1:
            raise InputError("skin", self.skin, "between 0 and 1 supports")

    @property
    def delta(self) -> float:
        """δ, by the name that SDPD has for it."""
        return self.density_diffusion

    @property
    def shifting(self) -> float:
        """P_b in units of ρ₀c₀², by the name that SDPD has for it."""
        return self.background

    @staticmethod
    def friction(material: Fluid, dim: int) -> tuple[float, float]:
        """The transverse factor 2η of F/(d_i d_j) in Pa s; there is no radial friction."""
        if material.bulk_viscosity:
            raise InputError(
                "bulk_viscosity", material.bulk_viscosity, "zero with TransportVelocity"
            )
        return 2.0 * material.viscosity, 0.0

    @property
    def pressure_form(self) -> str:
        """See :class:`.PressureForce`."""
        return "switched" if self.pressure_switch else self.pressure_force

    @property
    def keeps_volume(self) -> bool | None:
        """See :class:`.KeptVolume`."""
        return self.fixed_volume

    def _forces(self, ahead: int) -> list[Stage]:
        sums: list[Stage] = [KernelSums()] if self.normalise_viscosity else []
        return [*sums, Forces(ahead)]

    def first_stages(self) -> list[Stage]:
        """What comes before the first step."""
        return beginning(_densities(0.0), self._forces(0), shift=True)

    def stages(self) -> list[Stage]:
        """Kick, drift, kick with two sweeps: fluxes half-way, forces at the end of the drift.

        δv is known with the forces, where the step begins; what it is in the middle of the step
        holds for all of it. Mass and momentum cross between particles with the very δv that moves
        these, at x and v of the half step, to which the last flux has brought v.
        """
        return [
            Kick(),
            ChangeFields(),
            ShiftVelocity(),
            RenewList(),
            Drift(),
            At(When.MOVED, 0.5),
            PredictDensity(),
            FluxRates(self.renormalise, self.momentum_flux),
            At(When.HALF),
            Drift(),
            At(When.MOVED, 1.0),
            At(When.DRIFTED),
            AddFlux(),
            *_densities(1.0),
            EverySteps(self.filter_every, (FilterDensity(), *_densities(0.0))),
            *self._forces(1),
            Kick(),
            ChangeFields(),
            At(When.END),
        ]


def _densities(part: float) -> list[Stage]:
    """Density after a part of the step, pressure, volume; then that of walls."""
    return [EquationOfState(part), At(When.FORCES), WallPressure()]
