"""Particle shifting against its formula, and what it must not do."""

import numpy as np
import pytest

import particell as pc
from particell.kernels import normalisation, shape_f
from systems import vortices


def lattice(shifting: float, displaced: float) -> pc.Simulation:
    domain = pc.Domain((0, 0), (1, 1), periodic="xy")
    points = pc.lattice(domain, 0.1)
    points[45, 0] += displaced
    fluid = pc.Fluid(density=1.0, viscosity=0.0, sound_speed=1.0)
    phase = pc.Phase("fluid", fluid, points, 0.01)
    return pc.Simulation(domain, phase, pc.SDPD(support=2.4, shifting=shifting), dt=0.01)


def test_a_perfect_lattice_is_not_shifted():
    sim = lattice(1.0, 0.0)
    sim.advance(3)
    np.testing.assert_allclose(sim.particles.by_id("shift"), 0.0, atol=1e-12)
    np.testing.assert_allclose(sim.particles.by_id("v"), 0.0, atol=1e-12)


def test_the_sum_is_that_of_the_law_and_pushes_back():
    sim = lattice(1.0, 0.02)
    sim.start()
    x, shift = sim.particles.by_id("x"), sim.particles.by_id("shift")
    offset = x[45] - np.delete(x, 45, axis=0)
    offset -= np.rint(offset)
    r = np.linalg.norm(offset, axis=1)
    f = normalisation(0, 2) / 0.24**4 * np.array([shape_f(q, 0) for q in r / 0.24])
    expected = (2 * 0.01**2 * f[:, None] * offset).sum(axis=0)
    np.testing.assert_allclose(shift[45], expected, rtol=1e-9, atol=1e-12)
    assert shift[45, 0] < 0
    np.testing.assert_allclose(shift.sum(axis=0), 0.0, atol=1e-12)


def test_each_of_a_pair_counts_with_its_own_volume():
    """At scattered densities: Σ (V_i² + V_j²) F x_ij, V = m/ρ."""
    sim = lattice(1.0, 0.02)
    density = np.random.default_rng(4).uniform(0.7, 1.3, 100)
    sim.particles.set("density", density)
    sim.start()
    x, volume = sim.particles.by_id("x"), 0.01 / sim.particles.by_id("density")
    assert np.ptp(volume) > 0.005
    offset = x[45] - np.delete(x, 45, axis=0)
    offset -= np.rint(offset)
    r = np.linalg.norm(offset, axis=1)
    f = normalisation(0, 2) / 0.24**4 * np.array([shape_f(q, 0) for q in r / 0.24])
    both = volume[45] ** 2 + np.delete(volume, 45) ** 2
    expected = ((both * f)[:, None] * offset).sum(axis=0)
    np.testing.assert_allclose(sim.particles.by_id("shift")[45], expected, rtol=1e-9)


def test_momentum_is_conserved_and_the_displaced_particle_goes_half_way_back():
    sim = lattice(1.0, 0.02)
    sim.advance(400)
    assert sim.conservation()["momentum"] < 1e-10
    x = sim.particles.by_id("x") + sim.particles.by_id("image")
    site = pc.lattice(sim.domain, 0.1)
    drift = (x - site).mean(axis=0)
    assert np.abs(x[45] - site[45] - drift).max() < 0.01


def test_it_is_refused_with_noise():
    with pytest.raises(pc.InputError, match="shifting"):
        pc.SDPD(shifting=0.5, fluctuations=True)


def test_volumes_stay_those_of_the_particles():
    """Where the flow draws particles apart Σ V stays the domain's, by scaling the densities.

    Vortices of speed 1 for 1.5 L/U; without the scaling volumes are 2.7 % too small by then.
    """
    domain = pc.Domain((0, 0), (1, 1), periodic="xy")
    fluid = pc.Fluid(density=1.0, viscosity=0.01, sound_speed=10.0)
    phase = pc.Phase("fluid", fluid, pc.lattice(domain, 0.05), 0.0025, velocity=vortices(1.0))
    sim = pc.Simulation(domain, phase, pc.SDPD(shifting=0.5))
    sim.advance(round(1.5 / sim.dt))
    volume = (sim.particles.by_id("mass") / sim.particles.by_id("density")).sum()
    assert volume == pytest.approx(1.0, abs=2e-3)
