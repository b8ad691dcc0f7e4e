r"""What a fluid of fluctuating particles is, and what its equations are given so that it is right.

With noise particles are disordered, and their densities are sums over such neighbours as there are.
What they make together is not what each is given: the sum of the kernel over neighbours is larger
than on a lattice; under tension particles clump, and the fluid is as soft as a foam; a disordered
fluid gives way where a lattice does not, and has a smaller compression modulus than each of its
particles; its friction is that of its arrangement, and collisions add to it. So the equations are

.. math::

   \rho_i = \frac1s \sum_j m_j W_{ij},\qquad
   m_i a_i = \sum_j \frac{m_i m_j}{s}
   \left(\frac{P_i + P_c}{\rho_i^2} + \frac{P_j + P_c}{\rho_j^2}\right) F_{ij} x_{ij} + \dots

with the energy :math:`\sum_i m_i e(\rho_i) - P_c V_i`, whose equilibrium at the temperature T is
known as ever. In it

- the confinement :math:`P_c = \sqrt{\rho c_p^2\,k_BT/V}`, but at most 100 :math:`k_BT/V` (where
  particles would freeze), is what the pressure in a particle's volume fluctuates by: it keeps
  particles from tension. It is the same everywhere, and only differences of pressure act: that of
  the particles is given without it;
- s is the kernel sum of the disordered fluid, such that its pressure (virial and
  :math:`k_BT/V`) is that of the equation of state, plus P_c, at the reference density;
- the particles' sound speed is :math:`c_p = c_0/\sqrt K`, with the isothermal compression modulus
  :math:`K = (\partial P/\partial\rho)_T/c_p^2`: that of the fluid is :math:`c_0`;
- their viscosity :math:`\eta_p` is such that the fluid's is :math:`\eta = f \eta_p + g \rho c_p h`,
  where f is the sum of friction over neighbours, and g what the collisions carry.

s, K, f and g depend on the kernel, its support in spacings, the dimension and
:math:`\theta = k_BT/(m c_p^2)` alone. They were measured (``docs/fluctuating_table.py``), once and
for all fluids, in periodic boxes with γ = 7, for every kernel, supports from 2 to 4 spacings (3 in
3D) and θ from 10⁻⁴ to 4·10⁻³ (10⁻³ in 3D). Between they are interpolated, linearly in the support
and in the logarithm of θ; outside, the nearest hold, and the run's health says so
(:mod:`particell.health.noise`). In one dimension s is the lattice's.

Without noise particles stay where a lattice or a packing has put them: there s is the sum of the
kernel over the square (cubic) lattice, and nothing else is changed.
"""

from __future__ import annotations

import csv
import functools
import math
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.kernels import kernel_code, normalisation, power, shape_w
from particell.materials import BOLTZMANN, Fluid
from particell.particles import Particles

#: Largest P_c in units of k_BT/V: what repels then is still far from freezing.
MOST_CONFINED = 100.0
#: At most this part of a viscosity is taken to be the collisions'.
MOST_COLLISIONS = 0.2
#: γ of the fluids in the table, and the variance of their ρ/ρ₀ over θ.
REFERENCE_EXPONENT, VARIANCE = 7.0, 0.45


@dataclass(frozen=True)
class Disorder:
    """Properties of a disordered fluid of particles, without dimension.

    Attributes
    ----------
    density_sum
        s, the sum of the kernel over neighbours.
    stiffness
        K, the compression modulus over that of a particle.
    friction, collisions
        f and g of the viscosity.
    """

    density_sum: float
    stiffness: float
    friction: float
    collisions: float


@dataclass(frozen=True)
class DiscreteFluid:
    """What the particles of a fluid are given.

    Attributes
    ----------
    material
        The fluid with the particles' sound speed and viscosities.
    density_sum
        What sums of the density are divided by.
    confinement
        P_c in Pa.
    """

    material: Fluid
    density_sum: float = 1.0
    confinement: float = 0.0


def discrete_fluids(
    scheme: Any,
    particles: Particles,
    materials: list[Fluid],
    depth_factor: float,
) -> list[DiscreteFluid]:
    """What the particles of each group are given, for the groups' ``materials``."""
    if scheme.density != "summation":
        return [DiscreteFluid(m) for m in materials]
    total = lattice_sum(scheme.kernel, scheme.support, particles.dim)
    if not scheme.fluctuations or particles.dim == 1:
        return [DiscreteFluid(m, total) for m in materials]
    group, groups = particles.host("group"), len(materials)
    masses = _means(particles.host("mass"), group, groups)
    lengths = _means(particles.host("support"), group, groups)
    kernel = (scheme.kernel, scheme.support, particles.dim)
    return [
        fluctuating_fluid(*kernel, material, depth_factor * mass, length)
        for material, mass, length in zip(materials, masses, lengths, strict=True)
    ]


def _means(values: np.ndarray, group: np.ndarray, groups: int) -> list[float]:
    """The mean of each group; of all where a group is empty."""
    number = np.bincount(group, minlength=groups)
    total = np.bincount(group, values, groups)
    return np.where(number > 0, total / np.maximum(number, 1), values.mean()).tolist()


def fluctuating_fluid(
    kernel: str, support: float, dim: int, material: Fluid, mass: float, length: float
) -> DiscreteFluid:
    """What particles of a mass in kg are given to be a fluid with noise.

    Parameters
    ----------
    kernel, support, dim
        The kernel, its support in spacings, and the dimension.
    material
        The fluid that is asked for, with temperature and sound speed.
    mass
        Of a particle in three dimensions, in kg.
    length
        The support in m.
    """
    assert material.sound_speed is not None
    found, theta = disorder_of(kernel, support, dim, material, mass)
    sound_speed = material.sound_speed / math.sqrt(found.stiffness)
    carried = found.collisions * material.density * sound_speed * length
    carried = min(carried, MOST_COLLISIONS * material.viscosity)
    friction = (1.0 - carried / material.viscosity if material.viscosity else 1.0) / found.friction
    # by which another γ changes the mean pressure, (γ - 7)/2 ρ c² times the variance of ρ/ρ₀
    shift = 0.5 * (material.exponent - REFERENCE_EXPONENT) * VARIANCE * theta
    given = replace(
        material,
        sound_speed=sound_speed,
        viscosity=material.viscosity * friction,
        bulk_viscosity=material.bulk_viscosity * friction,
    )
    confinement = confinement_of(theta) * material.density * sound_speed**2
    return DiscreteFluid(given, found.density_sum * (1.0 + shift), confinement)


def disorder_of(
    kernel: str, support: float, dim: int, material: Fluid, mass: float
) -> tuple[Disorder, float]:
    """The table's entry for a fluid of particles of a mass in kg, and their θ."""
    if material.temperature is None:
        raise InputError("temperature", None, "given for every material, with noise")
    assert material.sound_speed is not None
    theta = asked = BOLTZMANN * material.temperature / (mass * material.sound_speed**2)
    for _ in range(20):  # θ is that of the particles: a contraction, K hardly depends on it
        found = disorder(kernel, support, dim, theta)
        theta = asked * found.stiffness
    return found, theta


def confinement_of(theta: float) -> float:
    """P_c/(ρ c_p²) at θ = k_BT/(m c_p²)."""
    return min(math.sqrt(theta), MOST_CONFINED * theta)


def disorder(kernel: str, support: float, dim: int, theta: float) -> Disorder:
    """The table's entry for a kernel, its support in spacings, D = 2 or 3, and θ, interpolated."""
    table = _table()[kernel, dim]
    supports = sorted(table)
    # first along ln θ at every support, then between supports
    values = [
        [np.interp(math.log(theta), np.log(table[h][:, 0]), table[h][:, k]) for k in range(1, 5)]
        for h in supports
    ]
    found = [float(np.interp(support, supports, column)) for column in np.transpose(values)]
    return Disorder(*found)


def measured_range(kernel: str, dim: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and largest support in spacings, and θ, of a kernel's rows in the table."""
    table = _table()[kernel, dim]
    theta = np.concatenate([rows[:, 0] for rows in table.values()])
    return (min(table), max(table)), (float(theta.min()), float(theta.max()))


@functools.cache
def _table() -> dict[tuple[str, int], dict[float, np.ndarray]]:
    """Rows (θ, s, K, f, g) with rising θ, by (kernel, D) and support."""
    rows: dict[tuple[str, int], dict[float, list[list[float]]]] = {}
    text = (files("particell.schemes") / "disorder.csv").read_text(encoding="utf-8")
    for row in csv.DictReader(line for line in text.splitlines() if line[:1] != "#"):
        by_support = rows.setdefault((row["kernel"], int(row["D"])), {})
        entry = [float(row[name]) for name in ("theta", "s", "K", "f", "g")]
        by_support.setdefault(float(row["support"]), []).append(entry)
    return {
        key: {h: np.array(sorted(entries)) for h, entries in by_support.items()}
        for key, by_support in rows.items()
    }


def lattice_sum(kernel: str, support: float, dim: int) -> float:
    """Σ_j V W_ij on the infinite square (cubic) lattice, the particle itself included."""
    code = kernel_code(kernel)
    reach = int(np.ceil(support))
    cube = Domain([-reach - 0.5] * dim, [reach + 0.5] * dim)
    r = np.linalg.norm(lattice(cube, 1.0), axis=1)
    w = np.array([shape_w.py_func(q, code) for q in r / support])
    return float(w.sum() * normalisation(code, dim) / power.py_func(support, dim))
