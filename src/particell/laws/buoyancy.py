r"""Buoyancy in the Boussinesq approximation.

.. math:: a_i \mathrel{+}= -g\,\beta\,(C_i - C_{ref})

with the gravitational acceleration g as a vector: a fluid that a dissolved species (or heat,
carried as one) makes lighter (β > 0) rises against g. The density of the fluid itself is not
changed. C is a concentration, or that of a number of molecules.

In front of a wall the pressure grows by what the fluid there weighs. The pressure of wall particles
is that of the fluid, extrapolated (:func:`particell.schemes.sweeps.wall_pressure`); it gets the
head of this force as it gets that of gravity,

.. math:: P_w \mathrel{+}= \sum_f \rho_f\, a_f \cdot (x_w - x_f) W_{wf} \Big/ \sum_f W_{wf},

without which a fluid at rest above a wall with C ≠ C_ref would not be at rest (Adami, Hu & Adams,
J. Comput. Phys. 231 (2012) 7057, Eq. 27).
"""

from __future__ import annotations

from dataclasses import dataclass

from particell.checks import checked
from particell.compute.loop import particle_loop
from particell.laws.pairs import image_offset, wall_weight


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
def add_buoyancy(
    i, is_wall, content, s, scale, volume, reference, strength, a, buoyancy, *, DIM, FIRST
):
    """a_i += strength (C_i − C_ref), C_i = scale content[i, s]/V_i; ``strength`` is −gβ.

    The sum of all such forces, of which this may be the ``FIRST``, is kept in ``buoyancy``.
    """
    if is_wall[i]:
        return
    excess = scale * content[i, s] / volume[i] - reference
    for d in range(DIM):
        force = strength[d] * excess
        a[i, d] += force
        buoyancy[i, d] = force if FIRST else buoyancy[i, d] + force


@particle_loop
def add_wall_head(
    i,
    x,
    is_wall,
    density,
    volume,
    support,
    content,
    s,
    scale,
    reference,
    strength,
    start,
    split,
    neighbours,
    crosses,
    period,
    inverse_period,
    group,
    density_sum,
    pressure,
    pressure_term,
    *,
    DIM,
    KERNEL,
):
    """The head above, added to the pressure of wall particle i."""
    if not is_wall[i]:
        return
    wraps = crosses[i] != 0
    weights, total = 0.0, 0.0
    for k in range(start[i], split[i]):
        j = neighbours[k]
        r2, head = 0.0, 0.0
        for d in range(DIM):
            offset = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += offset * offset
            head += strength[d] * offset
        w = wall_weight(r2, support, i, j, KERNEL)
        weights += w
        total += w * density[j] * head * (scale * content[j, s] / volume[j] - reference)
    if weights > 0.0:
        pressure[i] += total / weights
        pressure_term[i] += total / weights / (density[i] * density[i] * density_sum[group[i]])
