r"""Materials and their equations of state.

Barotropic pressure with reference density :math:`\rho_0`, sound speed :math:`c_0`, exponent
:math:`\gamma` and background pressure :math:`P_b`:

.. math:: P = \frac{\rho_0 c_0^2}{\gamma}\left[(\rho/\rho_0)^\gamma - 1\right] + P_b

:math:`\gamma = 7` is Tait's equation for water, :math:`\gamma = 1` the linear one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from numba import njit

from particell.checks import checked, not_negative, positive

BOLTZMANN = 1.380649e-23  # J/K, exact (SI 2019)
AVOGADRO = 6.02214076e23  # 1/mol, exact


@checked
@dataclass(frozen=True)
class Fluid:
    """A weakly compressible Newtonian fluid.

    Parameters
    ----------
    density
        Reference density in kg/m³.
    viscosity
        Shear viscosity η in Pa s.
    bulk_viscosity
        Bulk viscosity ζ in Pa s. In D dimensions 2η ≥ ζ + η(1 − 2/D) is needed.
    temperature
        Temperature in K, needed for thermal fluctuations.
    sound_speed
        Artificial sound speed in m/s; None lets the simulation choose it by the rule
        c₀² ≥ 100 max(U², Δp/ρ, |g|L), which keeps density changes below about 1 %.
    exponent
        γ of the equation of state.
    background_pressure
        P_b in Pa, or None for zero.

    Raises
    ------
    InputError
        Where a number is outside its range.
    """

    density: float
    viscosity: float
    bulk_viscosity: float = 0.0
    temperature: float | None = None
    sound_speed: float | None = None
    exponent: float = 7.0
    background_pressure: float = 0.0

    def __post_init__(self) -> None:
        for name in ("density", "exponent"):
            positive(name, getattr(self, name))
        for name in ("viscosity", "bulk_viscosity"):
            not_negative(name, getattr(self, name))
        for name in ("temperature", "sound_speed"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name))

    def with_sound_speed(self, sound_speed: float) -> Fluid:
        """The same fluid with its sound speed given."""
        return replace(self, sound_speed=sound_speed)


@njit
def pressure_of(density, reference, sound_speed, exponent, background):
    """P(ρ) of the equation of state above, in Pa."""
    stiffness = reference * sound_speed * sound_speed / exponent
    ratio = density / reference
    if exponent == 1.0:
        return stiffness * (ratio - 1.0) + background
    if exponent == 7.0:
        square = ratio * ratio
        return stiffness * (square * square * square * ratio - 1.0) + background
    return stiffness * (ratio**exponent - 1.0) + background


@njit
def compressibility(density, reference, sound_speed, exponent):
    """(1/ρ) dρ/dP of the equation of state above, in 1/Pa."""
    ratio = density / reference
    if exponent == 1.0:
        power = 1.0
    elif exponent == 7.0:
        power = ratio * ratio * ratio
        power *= power
    else:
        power = ratio ** (exponent - 1.0)
    return 1.0 / (density * sound_speed * sound_speed * power)


@njit
def density_of(pressure, reference, sound_speed, exponent, background):
    """ρ(P), the inverse of :func:`pressure_of`, in kg/m³ (at least a tenth of the reference)."""
    stiffness = reference * sound_speed * sound_speed / exponent
    ratio = max((pressure - background) / stiffness + 1.0, 1e-3)
    if exponent == 1.0:
        return reference * max(ratio, 0.1)
    return reference * max(ratio ** (1.0 / exponent), 0.1)
