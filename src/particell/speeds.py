"""The speeds that a simulation's description implies: of the flow, of heat, of sound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from particell.boundaries.moving import WallMotion
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.materials import BOLTZMANN, Fluid
from particell.phases import Phase
from particell.schemes.friction_limit import stiffest
from particell.schemes.sdpd import SDPD
from particell.schemes.static import Static
from particell.schemes.timestep import UNSTABLE, StepLimits, sound_speed_by_rule, step_limits
from particell.schemes.transport_velocity import TransportVelocity

#: What a simulation can be moved by.
Scheme = SDPD | TransportVelocity | Static


def flow_speed(phases: Sequence[Phase], scheme: Scheme, boundaries: Sequence[Any] = ()) -> float:
    """Largest initial or expected speed in m/s, without that of noise.

    Of walls that move the constant part counts; give others as ``reference_speed``.
    """
    fastest = max(
        (float(np.linalg.norm(p.velocities(), axis=1).max(initial=0.0)) for p in phases),
        default=0.0,
    )
    for motion in boundaries:
        if isinstance(motion, WallMotion):
            points = [p.points for p in phases if p.name == motion.group]
            fastest = max([fastest, *(motion.constant_speed(x) for x in points)])
    return fastest if isinstance(scheme, Static) else max(fastest, scheme.reference_speed)


def initial_speed(
    phases: Sequence[Phase], scheme: Scheme, depth_factor: float, boundaries: Sequence[Any] = ()
) -> float:
    """:func:`flow_speed`, with noise and that of a particle's thermal motion, in m/s."""
    fastest = flow_speed(phases, scheme, boundaries)
    if not isinstance(scheme, Static) and scheme.fluctuations:
        fastest += thermal_speed(phases, depth_factor)
    return fastest


def flow_limits(
    support: float, materials: Sequence[Fluid], scheme: Scheme, speed: float, dim: int
) -> list[StepLimits]:
    """The limits of the time step for each material, at the smallest support in m."""
    assert not isinstance(scheme, Static)
    gravity = float(np.linalg.norm(scheme.gravity or 0.0))
    return [
        step_limits(
            support,
            m.sound_speed or 1.0,
            speed,
            max(m.viscosity, m.bulk_viscosity) / m.density,
            gravity,
            scheme.viscous_factor,
            friction,
        )
        for m, friction in zip(
            materials, largest_frictions(support, materials, scheme, dim), strict=True
        )
    ]


def largest_frictions(
    support: float, materials: Sequence[Fluid], scheme: Scheme, dim: int
) -> list[float]:
    """λ_max of :mod:`particell.schemes.friction_limit` in 1/s for each material among all."""
    assert not isinstance(scheme, Static)
    kinds = [scheme.friction(m, dim) for m in materials]
    how = (scheme.kernel, scheme.support, dim, scheme.normalise_viscosity)
    return [
        stiffest(kind, kinds, *how) / (m.density * support**2)
        for m, kind in zip(materials, kinds, strict=True)
    ]


def check_given_step(
    dt: float, support: float, materials: Sequence[Fluid], scheme: Scheme, dim: int
) -> None:
    """Refuse a time step in s at which the friction between fluid particles is unstable.

    Raises
    ------
    InputError
        Naming ``dt``, the limit of stability and the step that the rules choose.
    """
    if isinstance(scheme, Static):
        return
    viscosity = min(found.viscosity for found in flow_limits(support, materials, scheme, 0.0, dim))
    fastest = max(largest_frictions(support, materials, scheme, dim))
    if dt * fastest > UNSTABLE:
        allowed = (
            f"below {UNSTABLE / fastest:.3g} s, where viscosity makes the step unstable "
            f"('auto' takes at most {viscosity:.3g} s)"
        )
        raise InputError("dt", dt, allowed)


def thermal_speed(phases: Sequence[Phase], depth_factor: float) -> float:
    """Three standard deviations of a velocity component of the lightest fluid particle, in m/s."""
    speeds = [
        3 * math.sqrt(BOLTZMANN * (p.material.temperature or 0.0) / _smallest_mass(p, depth_factor))
        for p in phases
        if p.kind == "fluid" and len(p.points)
    ]
    return max(speeds, default=0.0)


def _smallest_mass(phase: Phase, depth_factor: float) -> float:
    return phase.material.density * float(np.min(phase.volume)) * depth_factor


def default_sound_speed(
    domain: Domain,
    phases: Sequence[Phase],
    scheme: Scheme,
    depth_factor: float,
    boundaries: Sequence[Any] = (),
) -> float | None:
    """The sound speed by rule in m/s; None where every material has one of its own.

    Friction is that of the flow alone: nothing drives thermal motion against its own.

    Raises
    ------
    InputError
        Where nothing drives a flow by which to choose it.
    """
    if all(p.material.sound_speed is not None for p in phases):
        return None
    if isinstance(scheme, Static):
        return 1.0
    gravity = np.abs(scheme.gravity or np.zeros(domain.dim))
    if gravity.shape != (domain.dim,):
        raise InputError("gravity", scheme.gravity, f"{domain.dim} numbers")
    density = min(p.material.density for p in phases)
    head = float(np.max(gravity * domain.lengths))
    speed = initial_speed(phases, scheme, depth_factor, boundaries)
    viscosity = max(p.material.viscosity / p.material.density for p in phases)
    support = scheme.support * min(p.particle_spacing for p in phases)
    friction = viscosity * flow_speed(phases, scheme, boundaries) / support
    return sound_speed_by_rule(speed, scheme.pressure_drop, density, head, friction)
