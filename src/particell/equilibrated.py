"""Particles of a fluid with noise in thermal equilibrium, to start from.

A fluid that starts on a lattice forgets it slowly: particles that hardly diffuse take thousands of
h²ρ/η. Until then its pressure is up to a per cent of ρc² too low, and its waves are a little
stiffer. Equilibrium does not depend on viscosity; with little of it particles mix in a thousand
steps.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from particell.checks import checked
from particell.errors import InputError
from particell.phases import fluid
from particell.simulation import Simulation

if TYPE_CHECKING:
    from particell.compute.device import Device
    from particell.geometry.domain import Domain
    from particell.materials import Fluid
    from particell.schemes.sdpd import SDPD

#: Reynolds number ρ c h/η of the fluid that mixes, and how many h²ρ/η it takes.
MIXING, TIMES = 25.0, 10.0


@checked
def equilibrated(
    domain: Domain,
    material: Fluid,
    spacing: float,
    scheme: SDPD,
    seed: int = 1,
    device: Device | None = None,
) -> np.ndarray:
    """Positions (n, D) in m of a fluid at rest, with noise, that fills a periodic box.

    Parameters
    ----------
    domain
        The box, periodic along every axis.
    material
        The fluid, with a temperature.
    spacing
        Distance of the particles in m.
    scheme
        With fluctuations and summed densities: what the points are to be used with.
    seed, device
        As for the simulation.

    Raises
    ------
    InputError
        Where there is no such equilibrium: without noise, or with a box that is not periodic.
    """
    if not (scheme.fluctuations and scheme.density == "summation"):
        raise InputError("scheme", scheme, 'one with fluctuations=True and density="summation"')
    if not np.all(domain.periodic):
        raise InputError("domain", domain, "periodic along every axis")
    phase = fluid(domain, material, spacing)
    given = Simulation(domain, phase, scheme, seed=seed, device=device)
    sound_speed = given.materials[0].sound_speed
    assert sound_speed is not None
    length = scheme.support * spacing
    thin = replace(
        material,
        sound_speed=sound_speed,
        viscosity=material.density * sound_speed * length / MIXING,
        bulk_viscosity=0.0,
    )
    mixing = Simulation(domain, replace(phase, material=thin), scheme, seed=seed, device=device)
    mixing.advance(round(TIMES * MIXING * length / sound_speed / mixing.dt))
    points = mixing.particles.by_id("x")
    return np.asarray(domain.lower) + np.mod(points - domain.lower, domain.lengths)
