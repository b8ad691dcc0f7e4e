"""The laws as the sweeps over pairs evaluate them, against exact results."""

from __future__ import annotations

import numpy as np
import pytest

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.laws.viscosity import friction_coefficients, harmonic_mean
from particell.phases import Phase
from particell.schemes.sdpd import SDPD
from particell.simulation import Simulation
from systems import (
    UNIT_TEMPERATURE,
    density_rates,
    forces,
    lattice_offsets,
    lattice_viscosity,
    lucy_sums,
    periodic_lattice,
    unit_fluid,
)


def momentum_rate(simulation):
    """Σ m a over Σ m |a|."""
    p = simulation.particles
    force = p.host("mass")[:, None] * p.host("a")
    return np.abs(force.sum(axis=0)).max() / np.linalg.norm(force, axis=1).sum()


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_divergence_of_a_linear_field(dim):
    """It is the exact divergence times the lattice sum Σ V F x xᵀ, here to round-off."""
    gradient = np.random.default_rng(1).normal(size=(dim, dim))
    domain = Domain((0,) * dim, (7,) * dim, depth=1.0)
    phase = Phase(
        "fluid", unit_fluid(), lattice(domain, 1.0), 1.0, velocity=lambda x: x @ gradient.T
    )
    simulation = Simulation(domain, phase, SDPD(density_diffusion=0.0))
    simulation.start()
    density_rates(simulation)
    p = simulation.particles
    centre = np.linalg.norm(p.host("x") - 3.5, axis=1) < 0.1
    offsets, weight = lattice_offsets(dim, 3.0)
    tensor = np.einsum("n,na,nb->ab", weight, offsets, offsets)
    rate = p.host("density_rate")[centre][0]
    assert rate == pytest.approx(-np.sum(gradient * tensor), rel=1e-12)
    total = next(r["kappa"] for r in lucy_sums() if r["D"] == dim and r["h"] == 3)
    assert rate == pytest.approx(-np.trace(gradient) * total, rel=1e-5)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_constant_pressure_on_a_lattice_gives_no_force(dim):
    simulation = periodic_lattice(8, dim, unit_fluid(background_pressure=100.0))
    simulation.start()
    assert simulation.particles.host("pressure") == pytest.approx(100.0)
    assert np.abs(simulation.particles.host("a")).max() < 1e-11 * 100


def scattered(dim, materials=1, supports=1, seed=1, **scheme):
    """Two interleaved phases of uneven particles, fast and compressed, in a periodic box."""
    random = np.random.default_rng(seed)
    domain = Domain((0,) * dim, (8,) * dim, periodic="xyz"[:dim], depth=1.0)
    side = {1: 8, 2: 10, 3: 7}[dim]
    number = 2 * (side**dim // 2)
    grid = np.stack(np.meshgrid(*[np.arange(side) + 0.5] * dim, indexing="ij"), -1)
    places = random.permutation(grid.reshape(-1, dim))[:number]
    places = 8 / side * (places + random.uniform(-0.3, 0.3, places.shape))
    first = unit_fluid(viscosity=0.3, bulk_viscosity=0.2, temperature=UNIT_TEMPERATURE)
    second = first
    if materials == 2:
        second = unit_fluid(
            density=1.5,
            viscosity=0.8,
            bulk_viscosity=0.1,
            temperature=0.5 * UNIT_TEMPERATURE,
            exponent=1.0,
            background_pressure=3.0,
        )
    phases = [
        Phase(
            name,
            material,
            points,
            8**dim / number * random.uniform(0.8, 1.2, number // 2),
            velocity=random.normal(size=(number // 2, dim)),
            spacing=spacing,
        )
        for name, material, spacing, points in (
            ("a", first, 1.0, places[::2]),
            ("b", second, [1.0, 0.8][supports - 1], places[1::2]),
        )
    ]
    simulation = Simulation(domain, phases, SDPD(**scheme), dt=0.01)
    simulation.particles.set("density", random.uniform(0.9, 1.1, number))
    return simulation


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("noise", [False, True])
def test_momentum_is_exchanged(dim, noise):
    simulation = scattered(dim, fluctuations=noise, density_diffusion=0.0)
    simulation.start()
    assert momentum_rate(simulation) < 1e-14


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_momentum_of_two_materials_of_two_resolutions(dim):
    """Viscosities whose ratios of bulk to shear differ, two temperatures, two supports."""
    simulation = scattered(dim, materials=2, supports=2, fluctuations=True)
    sweeps = simulation.solver.flow.sweeps()
    assert sweeps.names.tables["transverse"] and not sweeps.uniform
    simulation.start()
    assert momentum_rate(simulation) < 1e-14


@pytest.mark.parametrize("dim", [2, 3])
def test_pressure_keeps_angular_momentum(dim):
    random = np.random.default_rng(2)
    domain = Domain((0,) * dim, (8,) * dim, depth=1.0)
    points = random.uniform(2, 6, (60, dim))
    phase = Phase("fluid", unit_fluid(viscosity=0.0), points, 4**dim / 60)
    simulation = Simulation(domain, phase, SDPD(density_diffusion=0.0), dt=0.01)
    simulation.particles.set("density", random.uniform(0.9, 1.1, 60))
    simulation.start()
    p = simulation.particles
    x, force = p.host("x") - 4, p.host("mass")[:, None] * p.host("a")
    planes = [(0, 1), (1, 2), (2, 0)] if dim == 3 else [(0, 1)]
    for k, m in planes:
        torque = x[:, k] * force[:, m] - x[:, m] * force[:, k]
        assert abs(torque.sum()) < 1e-13 * np.abs(torque).sum()
    assert np.abs(force).max() > 1


WAVES = [
    # dim, bulk viscosity, direction of the velocity; the wave runs along x
    (1, 0.2, (1.0,)),
    (2, 0.0, (0.0, 1.0)),
    (2, 0.2, (0.0, 1.0)),
    (2, 0.2, (1.0, 0.0)),
    (3, 0.2, (0.0, 0.0, 1.0)),
    (3, 0.2, (1.0, 0.0, 0.0)),
]


@pytest.mark.parametrize(("dim", "bulk", "along"), WAVES)
def test_viscous_force_on_waves(dim, bulk, along):
    """-ν k² v for shear, -(η(2 − 2/D) + ζ)/ρ k² v for compression.

    The sweep is the sum over the lattice to round-off. That sum tends to the viscosity meant for
    long waves on fine lattices; at h = 3 it is off by the lattice's own error.
    """
    shear, direction = 0.3, np.array(along)
    wave = np.zeros(dim)
    side = {1: 24, 2: (24, 8), 3: (24, 8, 8)}[dim]
    wave[0] = 2 * np.pi / 24
    simulation = periodic_lattice(
        side,
        dim,
        unit_fluid(viscosity=shear, bulk_viscosity=bulk),
        velocity=lambda x: np.sin(x @ wave)[:, None] * direction,
    )
    simulation.start()
    p = simulation.particles
    v, a, k2 = p.host("v"), p.host("a"), wave @ wave
    on_lattice = lattice_viscosity(dim, 3.0, shear, bulk, wave, direction)
    assert a == pytest.approx(-on_lattice * k2 * v, abs=1e-13)
    longitudinal = shear * (2 - 2 / dim) + bulk
    nominal = longitudinal if along[0] else shear
    limit = lattice_viscosity(dim, 3.0, shear, bulk, 1e-3 * wave, direction)
    fine = lattice_viscosity(dim, 9.0, shear, bulk, 1e-3 * wave, direction)
    assert fine == pytest.approx(nominal, rel=3e-3)
    assert limit == pytest.approx(nominal, rel=0.025)
    assert on_lattice == pytest.approx(limit, rel=k2 * 9 / 24)
    if bulk == 0:
        row = next(r for r in lucy_sums() if r["D"] == dim and r["h"] == 3)
        assert limit / shear == pytest.approx(row["eta"], abs=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_effective_viscosity_is_the_tabulated_one(dim):
    wave, along = np.zeros(dim), np.zeros(dim)
    wave[0], along[1] = 1e-3, 1.0
    for row in lucy_sums():
        if row["D"] == dim:
            found = lattice_viscosity(dim, row["h"], 1.0, 0.0, wave, along)
            assert found == pytest.approx(row["eta"], abs=1e-5)


def test_viscosities_that_have_no_friction_are_refused():
    assert friction_coefficients(3.0, 0.0, 3) == pytest.approx((5.0, 5.0))
    assert friction_coefficients(1.0, 0.0, 2) == (2.0, 0.0)
    assert friction_coefficients(1.0, 2.0, 2) == (0.0, 8.0)
    for dim, bulk in ((1, 3.1), (2, 2.1), (3, 1.7)):
        with pytest.raises(InputError, match="bulk_viscosity"):
            friction_coefficients(1.0, bulk, dim)
    with pytest.raises(InputError, match="bulk_viscosity"):
        periodic_lattice(8, 2, unit_fluid(viscosity=0.1, bulk_viscosity=0.3))


def test_coefficient_of_a_pair_of_materials():
    assert harmonic_mean(2.0, 2.0) == 2
    assert harmonic_mean(1.0, 3.0) == 1.5
    assert harmonic_mean(0.0, 3.0) == harmonic_mean(0.0, 0.0) == 0


def pair_forces(dim, noise, pairs, draws):
    """Random forces F sqrt(dt) on the first of many distant pairs, and what they should be."""
    shear, bulk, distance, h = 0.5, 0.3, 1.2, 3.0
    axis = np.array([0.6, 0.8, 0.0][:dim]) if dim == 2 else np.array([2.0, -1.0, 2.0]) / 3
    side = int(np.ceil(pairs ** (1 / dim)))
    domain = Domain((0,) * dim, (6.0 * side,) * dim, depth=1.0)
    first = lattice(domain, 6.0)[:pairs] - 0.5 * distance * axis
    points = np.concatenate([first, first + distance * axis])
    material = unit_fluid(viscosity=shear, bulk_viscosity=bulk, temperature=UNIT_TEMPERATURE)
    scheme = SDPD(fluctuations=True, noise=noise)
    dt = 0.01
    simulation = Simulation(domain, Phase("fluid", material, points, 1.0), scheme, dt=dt, seed=11)
    simulation.start()
    p = simulation.particles
    order, sample = np.argsort(p.host("id")), []
    for step in range(draws):
        forces(simulation, step, dt)
        force = p.host("a")[order] * np.sqrt(dt)
        assert np.abs(force[:pairs] + force[pairs:]).max() < 1e-12  # F_ij = -F_ji
        sample.append(force[:pairs].copy())
    transverse, radial = friction_coefficients(shear, bulk, dim)
    alpha = {2: 5 / np.pi, 3: 105 / (16 * np.pi)}[dim]
    f = 12 * alpha / h ** (dim + 2) * (1 - distance / h) ** 2
    exact = 2 * f * (transverse * np.eye(dim) + radial * np.outer(axis, axis))
    return np.concatenate(sample), exact


@pytest.mark.parametrize(("dim", "noise"), [(2, "bounded"), (3, "gaussian")])
def test_fluctuation_dissipation_of_a_pair(dim, noise):
    """Covariance of the pair's force is 2 k_B T (a I + b ee); thresholds at 6 standard errors.

    18 numbers are compared here; P(|z| > 6) = 2e-9, so a false alarm has a probability of 4e-8.
    (The law by itself, with both kinds of numbers in each dimension: test_laws.py.)
    """
    force, exact = pair_forces(dim, noise, 2000, 100)
    n = len(force)
    found = force.T @ force / n
    spread = np.sqrt(np.outer(np.diag(exact), np.diag(exact)) * 2 / n)
    assert np.abs(found - exact).max() > 0  # it is a sample
    assert (np.abs(found - exact) < 6 * spread).all()
    assert (np.abs(force.mean(axis=0)) < 6 * np.sqrt(np.diag(exact) / n)).all()
