"""SDPD: smoothed dissipative particle dynamics, isothermal; with noise off, plain SPH.

The description says which laws act, and of which stages a step is made.

References
----------
Español & Revenga, Phys. Rev. E 67 (2003) 026705; Drawert, Jacob, Li, Yi & Petzold, J. Comput. Phys.
378 (2019) 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from particell.checks import checked, not_negative
from particell.errors import InputError
from particell.fields import Field
from particell.laws.law import Law
from particell.laws.viscosity import friction_coefficients
from particell.materials import Fluid
from particell.operations.operation import When
from particell.schemes.checks import check_choice, check_described, check_kernel
from particell.schemes.density_stages import (
    DensityRates,
    EquationOfState,
    PredictDensity,
    SumDensity,
    WallPressure,
)
from particell.schemes.solver import Stage
from particell.schemes.stages import (
    At,
    ChangeFields,
    Correct,
    DrawSpread,
    Drift,
    Forces,
    Kick,
    Predict,
    Rates,
    RenewList,
    ShiftVelocity,
    TakeSpread,
    beginning,
)
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
    species_flux: ClassVar[bool] = False
    pressure_form: ClassVar[str] = "symmetric"
    at_rest: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_described(self)
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
        return friction_coefficients(material.viscosity, material.bulk_viscosity, dim)

    @property
    def keeps_volume(self) -> bool:
        """See :class:`.KeptVolume`; without shifting what keeps particles apart is their pressure.

        It comes from a mean density that has climbed a little: were that taken away, half of the
        fluid would be under tension, and clump.
        """
        return self.shifting > 0

    def first_stages(self) -> list[Stage]:
        """What comes before the first step."""
        return beginning(self._densities(0.0), [Forces(ahead=0)], shift=self.shifting > 0)

    def stages(self) -> list[Stage]:
        """A step."""
        if self.integrator == "trapezoidal":
            return self._trapezoidal()
        return self._velocity_verlet()

    def _densities(self, part: float) -> list[Stage]:
        """Density after a part of the step (or summed), pressure, volume; then that of walls."""
        if self.density == "summation":
            first: list[Stage] = [SumDensity(), EquationOfState(0.0)]
        else:
            first = [EquationOfState(part)]
        return [*first, At(When.FORCES), WallPressure()]

    def _velocity_verlet(self) -> list[Stage]:
        """Kick, drift, kick; one force sweep a step, not iterated; friction as :meth:`.Flow.lead`.

        The continuity equation is integrated by the midpoint rule, with positions and velocities
        at n + 1/2: that is the leapfrog of density and velocity, which neither damps nor feeds
        sound. (Rates taken with the forces, at n + 1, are late by half a step.) The densities and
        volumes in it are extrapolated to n + 1/2 too, else it would be of first order.
        """
        half_way: list[Stage] = [At(When.MOVED, 0.5), PredictDensity(0.5), DensityRates()]
        drift = [Drift(1.0)] if self.density == "summation" else [Drift(), *half_way, Drift()]
        return [
            TakeSpread(),
            Kick(),
            ChangeFields(),
            *([ShiftVelocity()] if self.shifting else []),
            RenewList(),
            *drift,
            At(When.MOVED, 1.0),
            At(When.DRIFTED),
            *self._densities(1.0),
            Forces(),
            Kick(),
            ChangeFields(),
            At(When.END),
            DrawSpread(),
        ]

    def _trapezoidal(self) -> list[Stage]:
        """The papers' explicit two-stage rule; the same noise in both stages."""
        continuity = self.density != "summation"
        return [
            RenewList(),
            Rates(continuity, field_lead=0.0),
            ChangeFields(),
            Predict(),
            At(When.MOVED, 1.0),
            *self._densities(0.0),
            Rates(continuity, field_lead=1.0),
            ChangeFields(),
            Correct(),
            At(When.MOVED, 1.0),
            At(When.DRIFTED),
            *self._densities(0.0),
            At(When.END),
        ]
