"""Fluids of very different densities beside and among each other."""

from __future__ import annotations

import numpy as np
import pytest

from particell.geometry.domain import Domain
from particell.phases import Phase, box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import UNIT_TEMPERATURE, same_bits, standard_errors, unit_fluid

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


def layers(scheme, heavy_above, amplitude=0.0, sides=(12, 16)):
    """Two layers in a box, 2 to 1, their border bent; gH = 1, the speed of sound 12."""
    domain = Domain((0, 0), sides, depth=1.0)
    light, heavy = (unit_fluid(viscosity=0.04 * m, density=m, sound_speed=12.0) for m in (1.0, 2.0))
    x = fluid(domain, light, 1.0).points
    x = x + np.random.default_rng(2).uniform(-0.1, 0.1, x.shape)
    up = x[:, 1] > sides[1] / 2 + amplitude * np.cos(np.pi * x[:, 0] / sides[0])
    chosen = up if heavy_above else ~up
    phases = [Phase("light", light, x[~chosen], 1.0), Phase("heavy", heavy, x[chosen], 1.0)]
    gravity = (0.0, -1.0 / sides[1])
    driven = scheme(gravity=gravity, reference_speed=1.0)
    return Simulation(domain, [*phases, *box_walls(domain, light, 1.0)], driven)


def height_of_the_heavy(simulation):
    p = simulation.particles
    return p.host("x")[p.host("group") == 1, 1].mean() / simulation.domain.lengths[1]


@pytest.mark.parametrize("scheme", [SDPD, TransportVelocity])
def test_a_heavy_fluid_above_a_light_one_falls_and_comes_to_rest(scheme):
    """Energy never increases by more than 1 % of what the fall has to give, from frame to frame.

    With masses in the pressure's force SDPD tore it apart within ten passages of sound.
    """
    simulation = layers(scheme, heavy_above=True, amplitude=2.0)
    simulation.start()
    p, monitor = simulation.particles, simulation.monitor

    def energy():
        mobile = p.host("is_wall") == 0
        weight = p.host("mass")[mobile] / 16
        return weight @ p.host("x")[mobile, 1] + monitor.kinetic_energy()

    free = 96 * (0.75 - 0.25)  # (ρ₂ - ρ₁) V g times the way of half of the fluid
    before, moving = energy(), []
    for _ in range(8):
        simulation.advance(round(2 * 16 / simulation.dt))
        now = energy()
        assert now < before + 0.01 * free
        before = now
        moving.append(monitor.kinetic_energy())
    assert height_of_the_heavy(simulation) == pytest.approx(0.25, abs=0.05)
    assert max(moving) > 0.1 * free
    assert moving[-1] < 0.05 * max(moving)


def test_the_pressure_at_rest_follows_the_layers():
    """Turned upside down, they have the table of layers that started like this."""
    turned, other = (layers(SDPD, above) for above in (True, False))
    turned.start()
    other.start()
    p = turned.particles
    first = turned.solver.flow.rest.saved()["rest_weight"]
    x = p.host("x")
    x[:, 1] = np.where(p.host("is_wall") == 0, 16 - x[:, 1], x[:, 1])
    p.set("x", x)
    turned.solver.build_list()
    turned.solver.flow.rest.follow()
    found, wanted = (s.solver.flow.rest.saved()["rest_weight"] for s in (turned, other))
    assert abs(found - wanted).max() < 0.1 * abs(first - wanted).max()


def test_a_restart_of_layers_that_move_has_the_same_bits():
    one, two, three = (layers(SDPD, True, 2.0) for _ in range(3))
    one.advance(400)
    two.advance(170)
    three.restore(two.state())
    three.advance(230)
    tables = [s.solver.flow.rest.saved()["rest_weight"] for s in (one, two, three)]
    assert np.any(tables[0] != tables[1])
    np.testing.assert_array_equal(tables[0], tables[2])
    assert same_bits(one, three) == []
