"""The speeds that a simulation's description implies: of the flow, of heat, of sound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from particell.boundaries.mean_velocity import MeanVelocity
from particell.boundaries.mirror import Mirror
from particell.boundaries.moving import WallMotion
from particell.boundaries.sponge import Sponge
from particell.driving import driven_speed, held_head
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
#: Largest over mean speed of what flows in a pipe; 1.5 between plates, 2.1 in a square duct.
PEAK = 2.0


def flow_speed(
    domain: Domain, phases: Sequence[Phase], scheme: Scheme, boundaries: Sequence[Any] = ()
) -> float:
    """Largest initial or expected speed in m/s, without that of noise.

    Expected is what the scheme's ``reference_speed`` says. Without it also what sponges and mean
    velocities bring about, and, where the sound speed comes by rule, what the body force drives the
    flow to (:mod:`particell.driving`). Of walls that move the constant part counts, and the speed
    of mirrors; give others as ``reference_speed``.

    Raises
    ------
    InputError
        Where a force drives the flow that nothing holds, and nothing says how fast.
    """
    speeds = [float(np.linalg.norm(p.velocities(), axis=1).max(initial=0.0)) for p in phases]
    for motion in boundaries:
        if isinstance(motion, WallMotion):
            points = [p.points for p in phases if p.name == motion.group]
            speeds += [motion.constant_speed(x) for x in points]
    speeds += [boundary.speed for boundary in boundaries if isinstance(boundary, Mirror)]
    fastest = max(speeds, default=0.0)
    if isinstance(scheme, Static):
        return fastest
    if scheme.reference_speed:
        return max(fastest, scheme.reference_speed)
    return _unstated_speed(domain, phases, scheme, boundaries, fastest)


def _unstated_speed(
    domain: Domain,
    phases: Sequence[Phase],
    scheme: SDPD | TransportVelocity,
    boundaries: Sequence[Any],
    initial: float,
) -> float:
    """:func:`flow_speed` without a ``reference_speed``."""
    speeds, driven = [initial], np.ones(domain.dim, bool)
    for boundary in boundaries:
        if isinstance(boundary, MeanVelocity) and boundary.axis < domain.dim:
            speeds.append(PEAK * abs(boundary.velocity))
            driven[boundary.axis] = False
        elif isinstance(boundary, Sponge) and boundary.axis < domain.dim:
            speeds += [_target_speed(domain, p.points, boundary) for p in phases]
    fastest = max(speeds)
    if all(p.material.sound_speed is not None for p in phases):
        return fastest
    gravity = np.where(driven, _gravity(domain, scheme), 0.0)
    found = driven_speed(domain, phases, gravity, _least_viscosity(phases))
    if math.isfinite(found):
        return max(fastest, found)
    if not fastest:
        allowed = (
            "with a reference_speed: along a periodic axis without walls nothing holds it, "
            "and nothing says how fast the flow becomes"
        )
        raise InputError("gravity", scheme.gravity, allowed)
    return fastest


def _target_speed(domain: Domain, points: np.ndarray, sponge: Sponge) -> float:
    """Largest speed in m/s that a sponge brings fluid to; what is no speed is refused elsewhere."""
    if sponge.velocity is None or not len(points):
        return 0.0
    inside = points[sponge.strength_in(domain, domain.wrapped(points)[0]) > 0]
    try:
        speeds = np.linalg.norm(np.asarray(sponge.velocity(inside), float), axis=-1)
    except (TypeError, ValueError):
        return 0.0
    return float(np.max(speeds, initial=0.0, where=np.isfinite(speeds)))


def _gravity(domain: Domain, scheme: Scheme) -> np.ndarray:
    """|g| along each axis in m/s²."""
    gravity = np.zeros(domain.dim)
    if not isinstance(scheme, Static) and scheme.gravity is not None:
        gravity = np.abs(scheme.gravity)
    if gravity.shape != (domain.dim,):
        raise InputError("gravity", getattr(scheme, "gravity", None), f"{domain.dim} numbers")
    return gravity


def _least_viscosity(phases: Sequence[Phase]) -> float:
    """The smallest ν of a fluid, in m²/s."""
    fluids = [p.material for p in phases if p.kind == "fluid"]
    return min((m.viscosity / m.density for m in fluids), default=0.0)


def with_noise(speed: float, phases: Sequence[Phase], scheme: Scheme, depth_factor: float) -> float:
    """A speed of the flow and that of a particle's thermal motion, in m/s."""
    if not isinstance(scheme, Static) and scheme.fluctuations:
        return speed + thermal_speed(phases, depth_factor)
    return speed


def flow_limits(
    support: float, materials: Sequence[Fluid], scheme: Scheme, speed: float, dim: int
) -> list[StepLimits]:
    """The limits of the time step for each material, at the smallest support in m.

    The materials are those that particles are given (:mod:`particell.schemes.summation`).
    """
    assert not isinstance(scheme, Static)
    gravity = float(np.linalg.norm(scheme.gravity or 0.0))
    stiffness = max(m.density * (m.sound_speed or 1.0) ** 2 for m in materials)
    return [
        step_limits(
            support,
            m.sound_speed or 1.0,
            speed,
            max(m.viscosity, m.bulk_viscosity) / m.density,
            gravity,
            scheme.viscous_factor,
            friction,
            math.sqrt(stiffness / m.density),
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
    domain: Domain, phases: Sequence[Phase], scheme: Scheme, depth_factor: float, speed: float
) -> float | None:
    """The sound speed by rule in m/s; None where every material has one of its own.

    ``speed`` is that of the flow (:func:`flow_speed`). Friction is that of the flow alone: nothing
    drives thermal motion against its own.

    Raises
    ------
    InputError
        Where nothing drives a flow by which to choose it.
    """
    if all(p.material.sound_speed is not None for p in phases):
        return None
    if isinstance(scheme, Static):
        return 1.0
    density = min(p.material.density for p in phases)
    head = held_head(domain, phases, _gravity(domain, scheme))
    viscosity = max(p.material.viscosity / p.material.density for p in phases)
    support = scheme.support * min(p.particle_spacing for p in phases)
    fastest = with_noise(speed, phases, scheme, depth_factor)
    pressure = scheme.pressure_drop
    return sound_speed_by_rule(fastest, pressure, density, head, viscosity * speed / support)
