"""Tables of properties by group, which laws and loops read, and what groups have in common."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particell.errors import InputError
from particell.laws.shifting import FRICTION, SOUND
from particell.materials import BOLTZMANN, Fluid
from particell.schemes.friction_limit import stiffest
from particell.schemes.summation import discrete_fluids
from particell.state import State


def friction_time(material: Fluid) -> float:
    """τ/h² of :mod:`particell.laws.shifting` in s/m² where friction limits it."""
    largest = max(material.viscosity, material.bulk_viscosity)
    return FRICTION * material.density / largest if largest else math.inf


class Properties:
    """Properties of the groups of a state under a scheme.

    Attributes
    ----------
    given
        What particles of each group are given so that their fluid is the one asked for
        (:mod:`particell.schemes.summation`): it limits the step.
    tables
        Arrays (G,) by name.
    fluids
        Which groups are fluids (G,).
    contrast, parted, radial
        Whether reference densities differ, equations of state do, and friction has a radial part.
    stiffness
        λ_max of :mod:`particell.schemes.friction_limit` in 1/s, of the fluid held most.
    """

    def __init__(self, state: State, scheme: Any):
        materials, groups = state.group_materials, state.particles.groups
        found = discrete_fluids(scheme, state.particles, materials, state.depth_factor)
        self.given = [d.material for d in found]
        friction = [scheme.friction(m, state.dim) for m in self.given]
        equations = [
            (m.density, m.sound_speed, m.exponent, m.background_pressure) for m in materials
        ]
        self.fluids = np.array([g.kind == "fluid" for g in groups])
        self.contrast = len({m.density for m in materials}) > 1
        self.parted = len(set(equations)) > 1
        self.radial = any(f[1] != 0 for f in friction)
        densities = np.array([m.density for m in materials])
        sound_speeds = np.array([m.sound_speed for m in self.given], dtype=float)
        full = [m.density * (m.sound_speed or 0.0) ** 2 for m in materials]
        self.tables = {
            "transverse": np.array([f[0] for f in friction]),
            "radial": np.array([f[1] for f in friction]),
            "diffusion": 2 * scheme.delta * sound_speeds,
            "equation": np.array([equations.index(e) for e in equations], dtype=float),
            "fluid": np.arange(len(materials), dtype=float),
            "thermal": _thermal(scheme, materials, state.depth_factor),
            "reference": densities,
            "sound_speed": sound_speeds,
            "exponent": np.array([m.exponent for m in materials]),
            "shift_pressure": scheme.shifting * np.array(full),
            "shift_sound": SOUND / sound_speeds,
            "shift_friction": np.array([friction_time(m) for m in materials]),
            "background": np.array([m.background_pressure for m in materials]),
            "density_sum": np.array([d.density_sum for d in found]),
            "confinement": np.array([d.confinement for d in found]),
        }
        h = float(state.particles.host("support").min())
        how = (scheme.kernel, scheme.support, state.dim, scheme.normalise_viscosity)
        self.stiffness = max(
            stiffest(f, friction, *how) / (m.density * h**2)
            for m, f in zip(materials, friction, strict=True)
        )


def _thermal(scheme: Any, materials: list[Fluid], depth_factor: float) -> np.ndarray:
    """k_B T of every group, divided by what masses are per, in J per m^(3−D)."""
    if not scheme.fluctuations:
        return np.zeros(len(materials))
    if any(m.temperature is None for m in materials):
        raise InputError("temperature", None, "given for every material, with noise")
    return np.array([BOLTZMANN * (m.temperature or 0.0) / depth_factor for m in materials])
