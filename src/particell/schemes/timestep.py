r"""Time step and sound speed by rule.

.. math::

   dt \le \min\left(\frac{0.25\,h}{c_0+|v|_{max}},\ \frac{0.05\,h^2\rho}{\eta},\
   \frac{1.3}{\lambda_{max}},\ \frac{0.05\,h^2}{\kappa_{max}},\ 0.25\sqrt{h/|g|}\right)

with h the support and λ_max the largest eigenvalue of the friction between fluid particles on a
lattice (:mod:`particell.schemes.friction_limit`), which is taken explicitly and stable below
2/λ_max: 0.10 h²/ν with Lucy's kernel (0.077 with the radial friction in 3D). With noise c_0 and η
are those that particles are given (:mod:`particell.schemes.summation`). Where fluids of several
densities meet, the pressure of the stiffest, ρ_k c_k², acts on the particles of the lightest:
:math:`dt \le 0.5\,h\,\sqrt{\rho/\rho_k}/c_k`. Friction with walls is
implicit (:mod:`particell.boundaries.wall_friction`) and limits nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from particell.errors import InputError

#: The limits of :class:`StepLimits`.
RULES = ("sound", "viscosity", "acceleration")
#: More steps than anybody waits for.
MOST_STEPS = 1e12
COURANT = 0.25
#: Where fluids of several densities meet: of h/√(max(ρc²)/ρ), unstable from 1.2 or more.
STIFF = 0.5
VISCOUS = 0.05
#: Largest dt λ_max of the friction between fluid particles on a lattice, and where it is unstable.
#: Particles displaced at random by 0.3 spacings raise λ_max to 1.25 times that, by 0.5 to 1.5.
EXPLICIT, UNSTABLE = 1.3, 2.0
#: The trapezoidal rule with noise is 3 % cold at 0.02 h²ρ/η: equipartition asks for less.
VISCOUS_TRAPEZOIDAL_NOISE = 0.005


@dataclass(frozen=True)
class StepLimits:
    """Largest time steps in s by reason; the smallest one holds.

    Attributes
    ----------
    sound, viscosity, acceleration
        The limits of the flow.
    """

    sound: float
    viscosity: float
    acceleration: float

    @property
    def smallest(self) -> float:
        """The time step to use, in s."""
        return min(self.sound, self.viscosity, self.acceleration)

    @property
    def reason(self) -> str:
        """Which limit is the smallest."""
        return min(RULES, key=lambda name: getattr(self, name))


def check_number_of_steps(dt: float, span: float) -> None:
    """Refuse more steps of dt in a span of time (both in s) than anybody waits for.

    Raises
    ------
    InputError
        Naming ``dt`` and what it has to be.
    """
    if not (0 < dt < math.inf and span <= MOST_STEPS * dt):
        raise InputError("dt", dt, f"at least {span / MOST_STEPS:.3g} s, for {span:g} s to be run")


def step_limits(
    support: float,
    sound_speed: float,
    speed: float,
    kinematic_viscosity: float,
    gravity: float,
    viscous: float = VISCOUS,
    friction: float = 0.0,
    stiff: float = 0.0,
) -> StepLimits:
    """The limits above for one material; all in SI units.

    ``viscous`` is the factor of h²ρ/η, ``friction`` is λ_max in 1/s: where one is smaller, so is
    what the other one allows. ``stiff`` is √(ρ_k c_k²/ρ) in m/s, with the stiffest fluid k there
    is: what a particle of this one does among that one's.
    """
    infinite = math.inf
    slow = viscous * support**2 / kinematic_viscosity if kinematic_viscosity else infinite
    explicit = viscous / VISCOUS * EXPLICIT / friction if friction else infinite
    return StepLimits(
        sound=support / max((sound_speed + speed) / COURANT, stiff / STIFF),
        viscosity=min(slow, explicit),
        acceleration=COURANT * math.sqrt(support / gravity) if gravity else infinite,
    )


def sound_speed_by_rule(
    speed: float, driving_pressure: float, density: float, head: float, friction: float = 0.0
) -> float:
    """c₀ with c₀² = 100 max(U², Δp/ρ, |g|L, νU/h): density changes by about 1 %.

    The last is the largest viscous stress that particles can carry, that over one support: in
    corners and beside bodies pressure and shear become as large as that. It counts where Uh/ν < 1,
    and below 1/4 makes no step shorter, since there viscosity limits it.

    Parameters
    ----------
    speed
        Largest expected speed U in m/s.
    driving_pressure
        Pressure drop Δp in Pa that drives the flow; at low Reynolds number it is what counts.
    density
        ρ in kg/m³.
    head
        |g|L in m²/s².
    friction
        νU/h in m²/s², with h the support.

    Raises
    ------
    InputError
        Where all are zero.
    """
    square = 100 * max(speed**2, driving_pressure / density, head, friction)
    if not (square > 0 and np.isfinite(square)):
        raise InputError(
            "sound_speed",
            None,
            "given, or a reference_speed, a pressure_drop or gravity to choose it by",
        )
    return math.sqrt(square)
