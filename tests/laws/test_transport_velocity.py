"""The laws of the transport velocity, pair by pair and as the sweeps evaluate them.

What is exact: linear fields on a lattice, uniform fields on any arrangement, antisymmetry.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from particell.compute.expressions import Vector
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.kernels import LUCY, normalisation
from particell.laws.law import Values, pair_of
from particell.laws.pressure import PressureForce
from particell.laws.transport_velocity import (
    MomentumFlux,
    TransportContinuity,
    consistent_trace,
)
from particell.phases import Phase, box_walls, fluid
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import densities, density_rates, forces, lattice_offsets, unit_fluid

SUPPORT = 2.6


def system(dim, side, disorder=0.3, periodic=True, velocity=None, **scheme):
    """Particles of volume 1 near the sites of a unit lattice, at scattered densities."""
    random = np.random.default_rng(3)
    axes = "xyz"[:dim] if periodic else ""
    domain = Domain((0,) * dim, (side,) * dim, periodic=axes, depth=1.0)
    points = lattice(domain, 1.0)
    if disorder:
        points = (points + random.uniform(-disorder, disorder, points.shape)) % side
    phase = Phase("fluid", unit_fluid(), points, 1.0, velocity=velocity)
    simulation = Simulation(domain, phase, TransportVelocity(filter_every=0, **scheme), dt=0.01)
    if disorder:
        simulation.particles.set("density", random.uniform(0.9, 1.1, len(points)))
    simulation.start()
    return simulation


def fluxes(simulation, shift):
    """Density rate and flux of momentum with δv = ``shift`` (in memory order)."""
    p = simulation.particles
    p.set("transport", p.host("v") + shift)
    density_rates(simulation)
    return p.host("density_rate").copy(), p.host("flux").copy()


def random_shift(simulation):
    return np.random.default_rng(4).normal(size=simulation.particles.host("v").shape)


def two_particles(**more):
    """i and j in one dimension with what the laws below read; ``more`` are tuples for both."""
    both = {
        "x": (0.7, 0.1),
        "v": (0.7, -0.3),
        "shift_velocity": (0.2, -0.4),
        "volume": (2.0, 3.0),
        "density": (1.1, 0.9),
        "support": (1.0, 1.0),
        **more,
    }
    found = []
    for k in range(2):
        values = {n: v[k] for n, v in both.items()}
        for name in ("x", "v", "shift_velocity"):
            values[name] = Vector.of(name, [values[name]])
        values["mass"] = values["volume"] * values["density"]
        values["specific_volume"] = 1.0 / values["density"]
        found.append(Values(dim=1, **values))
    return found


def both_ways(law, i, j, name, F=0.5):
    """What i and j get by a law, times their volumes."""
    one = law.pair(i, j, pair_of(i, j, F))[name]
    two = law.pair(j, i, pair_of(j, i, F))[name]
    one, two = (v.parts(1)[0] if isinstance(v, Vector) else v for v in (one, two))
    return i.volume * one, j.volume * two


def test_mass_that_leaves_one_particle_enters_the_other():
    """What δv carries cancels; in the other part velocities and δv are equal."""
    i, j = two_particles(v=(0.0, 0.0))
    into_i, into_j = both_ways(TransportContinuity(), i, j, "density_rate")
    x, f = 0.6, 0.5
    carried = -2.0 * 3.0 * f * (1.1 * 0.2 - 0.9 * 0.4) * x
    moved = 2.0 * 3.0 * f * 0.6 * x
    assert into_i == pytest.approx(carried - 1.1 * moved, rel=1e-14)
    assert into_j == pytest.approx(-carried - 0.9 * moved, rel=1e-14)


def test_conserving_flux_is_antisymmetric():
    i, j = two_particles()
    on_i, on_j = both_ways(MomentumFlux("conserving"), i, j, "flux")
    assert i.density * on_i + j.density * on_j == pytest.approx(0.0, abs=1e-15)


def test_uniform_flux_of_a_pair():
    """V_j (ρ_j/ρ_i) (v_j − v_i) δv_j·∇W, with ∇W = −F x_ij."""
    i, j = two_particles()
    on_i, _ = both_ways(MomentumFlux("uniform"), i, j, "flux")
    expected = 3.0 * (0.9 / 1.1) * (-0.3 - 0.7) * (-0.4 * -0.5 * 0.6)
    assert on_i / i.volume == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("term_i", "term_j", "expected"), [(1, 2, 3), (1, -0.5, 0.5), (-3, 1, 4), (1, -3, -4)]
)
def test_pressure_switch(term_i, term_j, expected):
    """P_j/ρ_j² − P_i/ρ_i² where the sum is negative; what attracts through i repels."""
    i, j = two_particles(pressure_over_square=(term_i, term_j))
    push = PressureForce("switched").pair(i, j, pair_of(i, j, 0.5))["a"].parts(1)[0]
    assert push == pytest.approx(j.mass * expected * 0.5 * 0.6)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_switch_acts_in_the_sweep(dim):
    """Under tension everywhere the terms of a pair cancel but for their difference."""
    off, on = (system(dim, 8, pressure_switch=s) for s in (False, True))
    for simulation in (off, on):
        p = simulation.particles
        p.set("density", np.full(len(p), 0.9))
        p.set("a", 0.0)  # friction acts at the velocity that it leads to
        densities(simulation)
        forces(simulation, 0, 1.0)
    assert np.abs(off.particles.host("a")).max() > 1.0
    assert np.abs(on.particles.host("a")).max() < 1e-12


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("form", ["uniform", "conserving"])
def test_linear_fields_on_a_lattice(dim, form):
    """The density follows the divergence of v, whatever δv; the momentum feels δv·∇v.

    Exact up to the lattice sum T = Σ V F x xᵀ, here to round-off: the rate of density is −ρ tr(A T)
    and the flux (δv T)·∇v for the velocity A x and uniform δv.
    """
    random = np.random.default_rng(1)
    gradient, spread = random.normal(size=(dim, dim)), random.normal(size=(dim, dim))
    simulation = system(
        dim,
        7,
        0.0,
        periodic=False,
        velocity=lambda x: x @ gradient.T,
        momentum_flux=form,
        renormalise=False,
    )
    x = simulation.particles.host("x")
    centre = np.linalg.norm(x - 3.5, axis=1) < 0.1
    offsets, weight = lattice_offsets(dim, SUPPORT)
    tensor = np.einsum("n,na,nb->ab", weight, offsets, offsets)
    rate, _ = fluxes(simulation, x @ spread.T + 1.0)
    assert rate[centre][0] == pytest.approx(-np.sum(gradient * tensor), rel=1e-11)
    uniform = random.normal(size=dim)
    _, flux = fluxes(simulation, np.tile(uniform, (len(x), 1)))
    np.testing.assert_allclose(flux[centre][0], gradient @ tensor @ uniform, rtol=1e-11)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_rate_of_density_of_linear_fields_on_any_arrangement(dim):
    """−ρ tr A + δv·∇ρ to round-off with the consistent gradient, whatever δv is."""
    random = np.random.default_rng(1)
    gradient, slope = random.normal(size=(dim, dim)), 0.01 * random.normal(size=dim)
    simulation = system(dim, 9, periodic=False, velocity=lambda x: x @ gradient.T)
    p = simulation.particles
    density = 1.0 + p.host("x") @ slope
    p.set("density", density)
    shift = random_shift(simulation)
    rate, _ = fluxes(simulation, shift)
    inside = np.linalg.norm(p.host("x") - 4.5, axis=1) < 1.5
    assert inside.sum() >= 2
    expected = -density * np.trace(gradient) + shift @ slope
    np.testing.assert_allclose(rate[inside], expected[inside], rtol=1e-11, atol=1e-13)


def diffusion_rate(system_of, density):
    """What density diffusion adds to the rate of density, with δ = 0.1."""
    rates = []
    for delta in (0.0, 0.1):
        simulation = system_of(density_diffusion=delta)
        p = simulation.particles
        p.set("density", density(p.host("x")))
        rates.append(fluxes(simulation, np.zeros(p.host("v").shape))[0])
    return simulation, rates[1] - rates[0]


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("renormalise", [True, False])
def test_density_diffuses_by_its_laplacian(dim, renormalise):
    """δ h c₀ ∇²ρ of a small quadratic density, up to the lattice sum T = Σ V F x xᵀ."""
    curvature, slope = 1e-7 * np.arange(1.0, dim + 1), 1e-7 * np.arange(2.0, dim + 2)

    def of(**options):
        return system(dim, 7, 0.0, periodic=False, renormalise=renormalise, **options)

    def quadratic(x):
        return 1.0 + (x - 3.5) @ slope + 0.5 * (x - 3.5) ** 2 @ curvature

    simulation, rate = diffusion_rate(of, quadratic)
    centre = np.linalg.norm(simulation.particles.host("x") - 3.5, axis=1) < 0.1
    offsets, weight = lattice_offsets(dim, SUPPORT)
    tensor = np.einsum("n,na,nb->ab", weight, offsets, offsets)
    coefficient = 0.1 * SUPPORT * simulation.materials[0].sound_speed
    expected = coefficient * np.sum(curvature * np.diag(tensor))
    # δ's part is the small difference of two sums, and V_j is not quite uniform
    assert rate[centre][0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_density_diffusion_exchanges_and_spreads(dim):
    """Σ V dρ/dt is 0 to round-off on any arrangement, and Σ V ρ dρ/dt falls."""
    random = np.random.default_rng(5)
    density = random.uniform(0.9, 1.1, 8**dim)
    simulation, rate = diffusion_rate(lambda **o: system(dim, 8, **o), lambda x: density)
    volume = simulation.particles.host("mass") / density
    assert abs(np.sum(volume * rate)) < 1e-12 * np.sum(volume * np.abs(rate))
    assert np.sum(volume * density * rate) < -1e-3 * np.sum(volume * np.abs(rate))


def test_walls_take_no_part_in_density_diffusion():
    """Fluid of a uniform density next to walls of another one does not change."""
    domain = Domain((0, 0), (8, 8), depth=1.0)
    walls = box_walls(domain, unit_fluid(), 1.0, layers=3)
    phases = [fluid(domain, unit_fluid(), 1.0), *walls]
    scheme = TransportVelocity(density_diffusion=0.1)
    simulation = Simulation(domain, phases, scheme, dt=0.01)
    simulation.start()
    p = simulation.particles
    p.set("density", np.where(p.host("is_wall"), 2.0, 1.0))
    rate, _ = fluxes(simulation, np.zeros(p.host("v").shape))
    assert np.abs(rate).max() < 1e-13


def test_a_particle_with_too_few_neighbours_keeps_the_plain_sum():
    t, g = [0.04, 1.0, 1.0, 0.0, 0.0, 0.0], [0.3, 0.1, 0.0, 0.0, 0.0, 0.0]
    assert consistent_trace(*t, *g) == pytest.approx(0.4)
    t[0] = 0.5
    assert consistent_trace(*t, *g) == pytest.approx(0.7)


@pytest.mark.parametrize("dim", [2, 3])
def test_uniform_velocity_stays_uniform_with_the_uniform_form(dim):
    simulation = system(dim, 8, velocity=(0.7,) * dim, momentum_flux="uniform")
    _, flux = fluxes(simulation, random_shift(simulation))
    assert np.abs(flux).max() < 1e-14
    other = system(dim, 8, velocity=(0.7,) * dim, momentum_flux="conserving")
    assert np.abs(fluxes(other, random_shift(other))[1]).max() > 1e-3


@pytest.mark.parametrize("dim", [2, 3])
def test_what_is_exchanged_is_conserved(dim):
    """Mass as Σ V times the flux, without T; momentum with the conserving form."""
    simulation = system(
        dim,
        8,
        velocity=lambda x: np.sin(x + x[:, ::-1]),
        momentum_flux="conserving",
        renormalise=False,
    )
    p = simulation.particles
    shift = random_shift(simulation)
    rate, flux = fluxes(simulation, shift)
    force = p.host("mass")[:, None] * flux
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).sum()
    # with v = −δv nothing is advected: what is left of the density's rate is the flux of mass
    p.set("v", -shift)
    gain = p.host("volume") * fluxes(simulation, shift)[0]
    assert abs(gain.sum()) < 1e-13 * np.abs(gain).sum() and np.abs(gain).max() > 1e-3
    assert np.abs(rate).max() > 1e-3


def mode_matrix(dim, support, wave, basis=None):
    """K of δs = K u for displacements u exp(ik·x) of a lattice: negative restores.

    ``basis``: rows that span it, a unit volume each; the unit lattice by default.
    """
    reach = range(-int(support) - 2, int(support) + 3)
    x = np.array([o for o in itertools.product(reach, repeat=dim) if any(o)], float)
    x = x if basis is None else x @ basis
    r = np.linalg.norm(x, axis=1)
    x, r = x[r < support], r[r < support]
    q = r / support
    scale = 2 * normalisation(LUCY, dim) / support ** (dim + 2)
    f, slope = 12 * (1 - q) ** 2, -24 * (1 - q) / (support * r)
    pairs = f[:, None, None] * np.eye(dim) + slope[:, None, None] * x[:, :, None] * x[:, None, :]
    return scale * np.einsum("n,nab->ab", 1 - np.cos(x @ wave), pairs)


def growth(dim, side, support):
    """Largest eigenvalue of K over all modes of a periodic lattice of ``side`` spacings."""
    waves = itertools.product(range(side // 2 + 1), repeat=dim)
    return max(
        np.linalg.eigvalsh(mode_matrix(dim, support, 2 * np.pi * np.array(w) / side)).max()
        for w in waves
        if any(w)
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_the_shift_returns_every_mode_of_a_lattice(dim):
    """At the default support; at 3 spacings some mode grows. Shear modes of long wave are slow."""
    assert growth(dim, 16, SUPPORT) < -1e-4
    assert growth(dim, 16, 3.0) > 0.1
    assert TransportVelocity().support == SUPPORT


def test_the_shift_returns_every_mode_of_a_hexagonal_lattice():
    edge = np.sqrt(2 / np.sqrt(3))
    basis = edge * np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    reciprocal = 2 * np.pi * np.linalg.inv(basis).T
    waves = [np.array(k) / 16 @ reciprocal for k in itertools.product(range(16), repeat=2)]
    largest = {
        h: max(np.linalg.eigvalsh(mode_matrix(2, h, w, basis)).max() for w in waves[1:])
        for h in (SUPPORT, 3.0)
    }
    assert largest[SUPPORT] < -1e-4 and largest[3.0] > 0.01


@pytest.mark.parametrize("dim", [2, 3])
def test_the_sweep_has_these_modes(dim):
    """Every mode of an 8-spacing lattice, displaced by 1e-6: the shift is K u, and points back."""
    simulation = system(dim, 8, 0.0)
    p = simulation.particles
    sites = p.host("x").copy()
    random = np.random.default_rng(2)
    for mode in itertools.product(range(5), repeat=dim):
        if not any(mode) or (dim == 3 and random.random() < 0.7):
            continue
        wave = 2 * np.pi * np.array(mode) / 8
        phase = np.cos(sites @ wave - 0.4)
        values, vectors = np.linalg.eigh(mode_matrix(dim, SUPPORT, wave))
        for value, along in zip(values, vectors.T, strict=True):
            displaced = 1e-6 * phase[:, None] * along
            p.set("x", sites + displaced)
            forces(simulation, 0, 1.0)
            shift = p.host("shift")
            np.testing.assert_allclose(shift, value * displaced, atol=2e-10)
            assert (shift * displaced).sum() < 0


@pytest.mark.parametrize("dim", [2, 3])
def test_pressure_differences_exert_no_force_under_a_uniform_pressure(dim):
    """On scattered particles, where the symmetric form shoves them about."""
    accelerations = []
    for form in ("difference", "symmetric"):
        simulation = system(dim, 8, pressure_force=form)
        p = simulation.particles
        p.set("density", np.full(len(p), 1.05))
        p.set("a", 0.0)  # friction acts at the velocity that it leads to
        densities(simulation)
        forces(simulation, 0, 0.01)
        accelerations.append(np.abs(p.host("a")).max())
    assert accelerations[0] < 1e-12 < 1e-2 < accelerations[1]


def test_pressure_differences_on_a_lattice_are_the_gradient():
    """P = c₀²(ρ − ρ₀) linear in x, far from the seam where it jumps: a = −c₀² ∇ρ/ρ · Σ V F x²."""
    simulation = system(2, 16, disorder=0.0, pressure_force="difference")
    p = simulation.particles
    x = p.host("x")[:, 0]
    p.set("density", 1.0 + 1e-6 * (x - 8.0))
    densities(simulation)
    forces(simulation, 0, 0.01)
    offsets, f = lattice_offsets(2, SUPPORT)
    slope = simulation.materials[0].sound_speed ** 2 * 1e-6 * (f * offsets[:, 0] ** 2).sum()
    middle = np.abs(x - 8.0) < 4
    assert p.host("a")[middle, 0] == pytest.approx(-slope, rel=1e-4)
    assert p.host("a")[middle, 1] == pytest.approx(0.0, abs=1e-5 * slope)


def test_fixed_volume_keeps_the_volume_of_the_fluid():
    simulation = system(2, 10, fixed_volume=True)
    p = simulation.particles
    assert (p.host("mass") / p.host("density")).sum() == pytest.approx(100.0, rel=1e-12)
    with pytest.raises(InputError, match="pressure_force"):
        TransportVelocity(pressure_force="both")
    with pytest.raises(InputError, match="pressure_switch"):
        TransportVelocity(pressure_force="difference", pressure_switch=True)
