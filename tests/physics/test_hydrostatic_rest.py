"""A fluid between walls under its own weight comes to rest and stays there, with both schemes.

In units of the column: ρ = 1 and gH = 1, the speed of sound 12.
"""

from __future__ import annotations

import numpy as np
import pytest

from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.laws.buoyancy import Buoyancy
from particell.phases import Phase, box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import same_bits, unit_fluid

SCHEMES = pytest.mark.parametrize("scheme", [SDPD, TransportVelocity])
SOUND, VISCOSITY = 12.0, 2.0


def column(
    scheme, sides, gravity, jitter=0.0, exponent=7.0, concentration=None, layers=False, **options
):
    """A box full of fluid, its spacing 1; with a concentration its weight is that of buoyancy."""
    domain = Domain((0,) * len(sides), sides, depth=1.0)
    light = unit_fluid(viscosity=VISCOSITY, sound_speed=SOUND, exponent=exponent)
    heavy = unit_fluid(viscosity=2 * VISCOSITY, sound_speed=SOUND, exponent=exponent, density=2.0)
    inside = fluid(domain, light, 1.0).points
    inside = inside + np.random.default_rng(2).uniform(-jitter, jitter, inside.shape)
    phases = [Phase("fluid", light, inside, 1.0)]
    if layers:
        low = inside[:, -1] < sides[-1] / 2
        phases = [Phase("up", light, inside[~low], 1.0), Phase("low", heavy, inside[low], 1.0)]
    species = {}
    if concentration is not None:
        species = {
            "species": [Species("C", 0.0)],
            "forces": [Buoyancy("C", 1.0, tuple(-s for s in gravity))],
        }
        options |= {"reference_speed": 1.0}
    else:
        options |= {"gravity": gravity}
    walls = box_walls(domain, heavy if layers else light, 1.0)
    simulation = Simulation(domain, [*phases, *walls], scheme(**options), **species)
    if concentration is not None:
        simulation.chemistry.set_concentration("C", concentration)
    return simulation


def rests(simulation, weight, crossings=200.0, creep=0.05, mean=0.01):
    """Whether pressure is the head ``weight(x)`` and nothing moves; figures are in units of gH.

    Slope within 0.5 %, mean pressure within ``mean`` of its start, which is zero, and particles
    creep by less than ``creep`` spacings in 30 crossings, over the second half of the time.
    """
    rows = simulation.particles.by_id("is_wall") == 0
    crossing = simulation.domain.lengths[-1] / SOUND
    x = None
    for _ in range(2):
        before = x
        simulation.advance(round(0.5 * crossings * crossing / simulation.dt))
        x = simulation.particles.by_id("x")[rows]
    p = simulation.particles.by_id("pressure")[rows]
    slope = np.polyfit(weight(x), p, 1)[0]
    moved = np.linalg.norm(x - before, axis=1).max() * 30 / (0.5 * crossings)
    assert slope == pytest.approx(1, abs=5e-3)
    assert abs(p.mean()) < mean
    assert moved < creep


@SCHEMES
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_a_closed_column_rests(scheme, jitter):
    """With the diffusion of all of the density SDPD's mean pressure was 0.47, its slope 0.970."""
    rests(column(scheme, (8, 16), (0.0, -1 / 16), jitter), lambda x: -x[:, 1] / 16)


@pytest.mark.parametrize("kernel", ["wendland-c2", "quintic-spline"])
def test_with_summed_density(kernel):
    """Where the kernel sum is far from 1 (1.02 to 1.05): it divides pressures too."""
    options = {"density": "summation", "kernel": kernel, "support": 2.0}
    simulation = column(SDPD, (8, 16), (0.0, -1 / 16), **options)
    rests(simulation, lambda x: -x[:, 1] / 16, 100.0)


@SCHEMES
@pytest.mark.parametrize("exponent", [1.0, 2.5])
def test_with_other_equations_of_state(scheme, exponent):
    start = column(scheme, (8, 16), (0.0, -1 / 16), 0.2, exponent)
    rests(start, lambda x: -x[:, 1] / 16, 60.0)


@SCHEMES
def test_where_gravity_is_oblique_to_the_walls(scheme):
    rests(column(scheme, (12, 12), (-0.03, -0.06), 0.2), lambda x: x @ np.array([-0.03, -0.06]))


@SCHEMES
def test_in_three_dimensions(scheme):
    start = column(scheme, (6, 6, 10), (0.0, 0.0, -0.1), 0.2)
    rests(start, lambda x: -0.1 * x[:, 2], 40.0)


@SCHEMES
def test_where_a_dissolved_species_is_what_weighs(scheme):
    """Concentrated below: its weight is linear in height, the pressure quadratic."""
    start = column(scheme, (8, 16), (0.0, -1 / 16), concentration=lambda x: 2 - x[:, 1] / 8)
    rests(start, lambda x: -(2 * x[:, 1] / 16 - (x[:, 1] / 16) ** 2))


def test_a_light_fluid_above_a_heavy_one():
    """The jump of the density between them does not diffuse."""
    start = column(SDPD, (8, 16), (0.0, -1 / 16), 0.1, layers=True)
    rests(start, lambda x: np.where(x[:, 1] > 8, 8 - x[:, 1], 2 * (8 - x[:, 1])) / 16, 100.0)


@SCHEMES
def test_a_free_surface_keeps_the_whole_pressure(scheme):
    """Two drops in free fall: nothing but gravity acts on them."""
    domain = Domain((0, 0), (12, 40))
    points = fluid(domain, unit_fluid(), 1.0).points
    drop = points[np.hypot(points[:, 0] - 6, points[:, 1] - 30) < 4]
    simulation = Simulation(
        domain, Phase("drop", unit_fluid(), drop, 1.0), scheme(gravity=(0.0, -0.1))
    )
    simulation.start()
    a = simulation.particles.host("a")
    assert a == pytest.approx(np.array([[0.0, -0.1]] * len(drop)), abs=1e-14)


@SCHEMES
def test_a_restart_under_gravity_gives_the_same_bits(scheme):
    """What is taken out of the pressure is that of the run's start, not of its restart."""

    def start():
        return column(scheme, (8, 8), (0.0, -1 / 8), 0.2, concentration=lambda x: 2 - x[:, 1] / 4)

    one, two, three = start(), start(), start()
    one.advance(30)
    two.advance(17)
    three.restore(two.state())
    three.advance(13)
    assert same_bits(one, three) == []
