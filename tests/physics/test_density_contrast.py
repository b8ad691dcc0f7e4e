"""Fluids of very different densities beside and among each other."""

from __future__ import annotations

import numpy as np
import pytest

from particell.geometry.domain import Domain
from particell.phases import Phase, box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import UNIT_TEMPERATURE, standard_errors, unit_fluid

SUMMATION = {"density": "summation"}
#: Kinetic energy per particle and degree of freedom, where there is noise.
HEAT = 0.1


def mixture(scheme, ratio, dim=2, walls=False, warm=False, **options):
    """Half of all particles heavy, at random; off the lattice, in a periodic or a closed box."""
    side = 12 if dim == 2 else 7
    domain = Domain((0,) * dim, (side,) * dim, periodic="" if walls else "xyz"[:dim], depth=1.0)
    random = np.random.default_rng(2)
    heat = {"temperature": HEAT * UNIT_TEMPERATURE} if warm else {}
    background = {} if warm else {"background_pressure": 3.0}
    light, heavy = (
        unit_fluid(
            viscosity=5.0 if warm else 0.5 * m, density=m, sound_speed=10.0, **background, **heat
        )
        for m in (1.0, ratio)
    )
    x = fluid(domain, light, 1.0).points
    x = x + random.uniform(-0.2, 0.2, x.shape)
    chosen = random.random(len(x)) < 0.5
    phases = [Phase("light", light, x[~chosen], 1.0), Phase("heavy", heavy, x[chosen], 1.0)]
    if walls:
        phases += box_walls(domain, light, 1.0)
    return Simulation(domain, phases, scheme(reference_speed=1.0, **options), seed=3)


@pytest.mark.parametrize(
    ("scheme", "dim", "walls"), [(SDPD, 3, True), (TransportVelocity, 2, False)]
)
def test_the_force_of_a_uniform_pressure_does_not_know_densities(scheme, dim, walls):
    """It is that of the arrangement: not larger where a light particle is among heavy ones."""
    found = {}
    for ratio in (1.0, 100.0):
        simulation = mixture(scheme, ratio, dim, walls)
        simulation.start()
        p = simulation.particles
        found[ratio] = p.by_id("mass")[:, None] * p.by_id("a")
    force = found[1.0]
    assert np.abs(force).max() > 0.01
    np.testing.assert_allclose(found[100.0], force, atol=1e-10 * np.abs(force).max())


def test_summed_densities_do_not_know_of_each_other():
    """Each particle has its own fluid's density; forces still cancel."""
    relative = {}
    for ratio in (1.0, 100.0):
        simulation = mixture(SDPD, ratio, **SUMMATION)
        simulation.start()
        p = simulation.particles
        relative[ratio] = p.by_id("density") / p.by_id("mass")
    np.testing.assert_allclose(relative[100.0], relative[1.0], rtol=1e-12)
    force = p.by_id("mass")[:, None] * p.by_id("a")
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-10 * np.abs(force).max())


@pytest.mark.parametrize(
    ("scheme", "options"), [(SDPD, SUMMATION), (TransportVelocity, {})], ids=["SDPD", "transport"]
)
@pytest.mark.parametrize("ratio", [4.0, 100.0])
def test_a_mixture_comes_to_rest(scheme, options, ratio):
    """At its automatic step; with the step of one fluid it broke at 100 within a few steps."""
    simulation = mixture(scheme, ratio, **options)
    c = simulation.materials[0].sound_speed
    h = simulation.scheme.support
    assert simulation.dt <= 0.5 * h / (c * np.sqrt(ratio)) * (1 + 1e-9)
    energy, p = [], simulation.particles
    for _ in range(3):
        simulation.advance(200)
        energy.append(simulation.monitor.kinetic_energy())
    assert energy[2] < energy[0]
    if scheme is SDPD:  # the transport velocity's pressure force has a switch of sign
        momentum = np.abs(simulation.monitor.momentum()).max()
        assert momentum < 1e-12 * c * p.host("mass").sum()
    density = p.host("density") / p.host("mass")
    assert np.abs(density - 1).max() < 0.1


def test_both_fluids_have_their_temperature():
    """Ten times as dense: the false-alarm rate is 1e-6, limits are 5 % at most."""
    options = {"density": "summation", "fluctuations": True, "warm": True}
    simulation = mixture(SDPD, 10.0, **options)
    simulation.advance(1000)
    p, energy = simulation.particles, []
    for _ in range(600):
        simulation.advance(10)
        square = p.host("mass")[:, None] * p.host("v") ** 2 / HEAT
        heavy = p.host("group") == 1
        energy.append([square[~heavy].mean(), square[heavy].mean()])
    blocks = np.reshape(energy, (40, 15, 2)).mean(axis=1)
    limit = standard_errors(2, 40) * blocks.std(axis=0, ddof=1) / np.sqrt(40)
    assert np.all(limit < 0.05)
    assert np.all(np.abs(blocks.mean(axis=0) - 1) < limit)
