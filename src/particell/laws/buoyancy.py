r"""Buoyancy in the Boussinesq approximation.

.. math:: a_i \mathrel{+}= -g\,\beta\,(C_i - C_{ref})

with the gravitational acceleration g as a vector: a fluid that a dissolved species (or heat,
carried as one) makes lighter (β > 0) rises against g. The density of the fluid itself is not
changed. C is a concentration, or that of a number of molecules.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from particell.compute.loop import particle_loop
from particell.errors import InputError


@dataclass(frozen=True)
class Buoyancy:
    """A body force in proportion to the concentration of a species.

    Parameters
    ----------
    species
        Name of the species.
    expansion
        β in m³/mol: relative decrease of density per concentration.
    gravity
        g in m/s², one number per dimension.
    reference
        C_ref in mol/m³.
    """

    species: str
    expansion: float
    gravity: tuple[float, ...]
    reference: float = 0.0

    def __post_init__(self) -> None:
        for name in ("expansion", "reference"):
            if not np.isfinite(getattr(self, name)):
                raise InputError(name, getattr(self, name), "finite")


@particle_loop
def add_buoyancy(i, is_wall, content, s, scale, volume, reference, strength, a, *, DIM):
    """a_i += strength (C_i − C_ref), C_i = scale content[i, s]/V_i; ``strength`` is −gβ."""
    if is_wall[i]:
        return
    excess = scale * content[i, s] / volume[i] - reference
    for d in range(DIM):
        a[i, d] += strength[d] * excess
