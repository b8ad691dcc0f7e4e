r"""Buoyancy in the Boussinesq approximation.

.. math:: a_i \mathrel{+}= -g\,\beta\,(C_i - C_{ref})

with the gravitational acceleration g as a vector: a fluid that a dissolved species (or heat,
carried as one) makes lighter (β > 0) rises against g. The density of the fluid itself is not
changed. C is a concentration, or that of a number of molecules.

In front of a wall the pressure grows by what the fluid there weighs. The pressure of wall particles
is that of the fluid, extrapolated (:mod:`particell.laws.wall_pressure`); it gets the
head of this force as it gets that of gravity,

.. math:: P_w \mathrel{+}= \sum_f \rho_f\, a_f \cdot (x_w - x_f) W_{wf} \Big/ \sum_f W_{wf},

without which a fluid at rest above a wall with C ≠ C_ref would not be at rest (Adami, Hu & Adams,
J. Comput. Phys. 231 (2012) 7057, Eq. 27).
"""

from __future__ import annotations

from dataclasses import dataclass

from particell.checks import checked
from particell.compute.loop import particle_loop


@checked
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


@particle_loop
def measure_buoyancy(
    i, is_wall, content, s, scale, volume, reference, strength, buoyancy, *, DIM, FIRST
):
    """strength (C_i − C_ref), C_i = scale content[i, s]/V_i; ``strength`` is −gβ.

    Of several such forces, of which this may be the ``FIRST``, the sum.
    """
    excess = 0.0 if is_wall[i] else scale * content[i, s] / volume[i] - reference
    for d in range(DIM):
        force = strength[d] * excess
        buoyancy[i, d] = force if FIRST else buoyancy[i, d] + force
