"""Density diffusion: what it leaves alone, what it conserves, and with whose support it acts."""

from __future__ import annotations

import numpy as np
import pytest

from particell.geometry.domain import Domain
from particell.kernels import LUCY, normalisation, shape_f
from particell.phases import Phase, box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import density_rates, unit_fluid, vortices

SCHEMES = pytest.mark.parametrize("scheme", [SDPD, TransportVelocity])


def diffusion(simulation):
    """The rate of density of particles that all rest: what diffuses, in memory order."""
    p = simulation.particles
    for name in ("v", "transport"):
        if name in p:
            p.set(name, np.zeros(p.host("v").shape))
    density_rates(simulation)
    return p.host("density_rate").copy()


def enthalpy_density(potential, exponent, sound):
    """ρ of a fluid of ρ₀ = 1 at rest where the body force's work from ρ₀ on is ``potential``."""
    if exponent == 1.0:
        return np.exp(potential / sound**2)
    return (1 + (exponent - 1) * potential / sound**2) ** (1 / (exponent - 1))


@SCHEMES
@pytest.mark.parametrize(("exponent", "dim"), [(1.0, 2), (2.0, 2), (4.5, 2), (7.0, 2), (7.0, 3)])
def test_a_fluid_at_rest_does_not_diffuse(scheme, exponent, dim):
    """Scattered particles beside walls, density varying by 4 % across the box; exact is zero."""
    force, sound = np.array([0.4, -0.6, -0.5])[:dim], 12.0
    domain = Domain((0,) * dim, (8,) * dim, depth=1.0)
    material = unit_fluid(sound_speed=sound, exponent=exponent)
    x = fluid(domain, material, 1.0).points
    x = x + np.random.default_rng(3).uniform(-0.2, 0.2, x.shape)
    phases = [Phase("fluid", material, x, 1.0), *box_walls(domain, material, 1.0)]
    options = {"gravity": tuple(force), "density_diffusion": 0.1}
    simulation = Simulation(domain, phases, scheme(**options), dt=0.01)
    simulation.start()
    p = simulation.particles
    p.set("density", enthalpy_density((p.host("x") - 4.0) @ force, exponent, sound))
    rate = diffusion(simulation)
    simulation.solver.flow.constants["gravity"][...] = 0.0
    assert np.abs(rate).max() < 1e-3 * np.abs(diffusion(simulation)).max()


def two_sizes(scheme, ratio, second=None):
    """Fine particles beside coarse ones, ``ratio`` times as far apart, in a periodic box."""
    domain = Domain((0, 0), (24, 12), periodic="xy", depth=1.0)
    f = 1 / ratio
    left, right = Domain((0, 0), (12, 12)), Domain((12, 0), (24, 12))
    material = unit_fluid(viscosity=0.05)
    fine = fluid(left, material, f).points
    coarse = fluid(right, material, 1.0).points
    noise = np.random.default_rng(1)
    fine = np.mod(fine + 0.1 * f * noise.uniform(-1, 1, fine.shape), [24, 12])
    phases = [
        Phase("fine", material, fine, f * f, velocity=vortices(12.0)),
        Phase("coarse", second or material, coarse, 1.0, velocity=vortices(12.0)),
    ]
    return Simulation(domain, phases, scheme(density_diffusion=0.1))


@SCHEMES
def test_small_and_large_particles_exchange_with_the_pair_s_support(scheme):
    """The sum of the law with h_ij; Σ V dρ/dt is zero to round-off."""
    simulation = two_sizes(scheme, 4)
    simulation.start()
    p = simulation.particles
    p.set("density", np.random.default_rng(4).uniform(0.99, 1.01, len(p)))
    rate = diffusion(simulation)
    x, rho, h = p.host("x"), p.host("density"), p.host("support")
    volume = p.host("mass") / rho
    assert abs(volume @ rate) < 1e-12 * np.abs(volume * rate).sum()
    for i in np.flatnonzero(np.abs(x[:, 0] - 12) < 1.0)[::7]:
        offset = x[i] - x
        offset -= np.array([24, 12]) * np.rint(offset / [24, 12])
        r, pair = np.linalg.norm(offset, axis=1), 0.5 * (h[i] + h)
        near = np.flatnonzero((r < pair) & (r > 0))
        q = r[near] / pair[near]
        f = normalisation(LUCY, 2) * np.array([shape_f(s, LUCY) for s in q]) / pair[near] ** 4
        sound = simulation.materials[0].sound_speed
        expected = 0.2 * sound * np.sum(pair[near] * volume[near] * f * (rho[near] - rho[i]))
        assert rate[i] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@SCHEMES
@pytest.mark.parametrize("ratio", [2, 4])
def test_a_flow_through_two_sizes_of_particles_stays_calm(scheme, ratio):
    """With the support of the largest for all, densities were infinite after 100 steps at 4."""
    simulation = two_sizes(scheme, ratio)
    simulation.advance(200)
    density = simulation.particles.host("density")
    assert np.abs(density - 1).max() < 0.02


@SCHEMES
def test_between_two_fluids_density_jumps(scheme):
    """Fluids of ρ₀ = 1 and 2 side by side, each with its own: nothing diffuses between them.

    Nor does the transport velocity carry any of it across, where δv is not zero.
    """
    heavy = unit_fluid(viscosity=0.05, density=2.0)
    simulation = two_sizes(scheme, 1, heavy)
    simulation.start()
    assert np.abs(diffusion(simulation)).max() < 1e-14
    if scheme is TransportVelocity:
        p = simulation.particles
        p.set("transport", np.random.default_rng(2).normal(size=p.host("v").shape))
        density_rates(simulation)
        assert np.abs(p.host("density_rate")).max() < 1e-13
