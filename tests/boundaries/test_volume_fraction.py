"""The boundary volume fraction against the half-space; walls whose surface is not known."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from particell.boundaries.volume_fraction import fraction_profile, profile_distance
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.phases import Phase
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import DATA, resting_poiseuille_error, unit_fluid

SCHEMES = {"transport velocity": TransportVelocity, "sdpd": SDPD}


def half_space(dim):
    """d/h and φ from the table for Lucy's kernel."""
    with open(DATA / "bvf_lucy_halfspace.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    table = np.array([[float(value) for value in row] for row in rows[1:]])
    return table[:, 0], table[:, dim]


def wall_below(
    dim, points, velocity, support=2.6, wall_velocity=None, layers=3, dt=1e-3, scheme="sdpd"
):
    """Particles over a wall whose surface is at 0 on the last axis; spacing 1, no forces."""
    edges = [24.0] * (dim - 1) + [90.0]
    domain = Domain((0,) * dim, edges, periodic="xy"[: dim - 1], depth=1.0)
    slab = Domain([0.0] * (dim - 1) + [-float(layers)], [*edges[:-1], 0.0])
    material = unit_fluid(viscosity=0.0, sound_speed=1e-9, exponent=1.0)
    phases = [
        Phase("fluid", material, points, 1.0, velocity=velocity),
        Phase("wall", material, lattice(slab, 1.0), 1.0, kind="wall", velocity=wall_velocity),
    ]
    return Simulation(domain, phases, SCHEMES[scheme](support=support, impenetrable=True), dt=dt)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_profile_of_a_half_space(dim):
    """The table's values; layers a spacing apart come near it as the support grows."""
    distance, fraction = half_space(dim)
    found = fraction_profile("lucy", dim, None, len(distance) - 1)
    np.testing.assert_allclose(found, fraction, atol=1e-6)
    error = [
        np.abs(fraction_profile("lucy", dim, h, len(distance) - 1) - fraction).max()
        for h in (3.0, 12.0)
    ]
    assert error[0] < 0.03 and error[1] < error[0] / 10


@pytest.mark.parametrize("kernel", ["lucy", "wendland-c2", "cubic-spline", "quintic-spline"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_profiles_are_inverted(kernel, dim):
    """φ is 1 deep inside, 1/2 on the surface, falls with the distance, and gives that back."""
    profile = fraction_profile(kernel, dim, None)
    assert profile[0] == pytest.approx(1.0, abs=1e-5)
    assert profile[len(profile) // 2] == pytest.approx(0.5, abs=1e-5)
    assert profile[-1] == 0.0 and np.all(np.diff(profile) <= 0)
    for k in range(120, len(profile) - 80):
        assert profile_distance(profile[k], profile) == pytest.approx(k / 200 - 1, abs=1e-9)
    assert profile_distance(1.1, profile) == -1.0 and profile_distance(0.0, profile) == 1.0


@pytest.mark.parametrize("dim", [2, 3])
def test_fraction_distance_and_direction_over_a_plane(dim):
    """At the default support and wherever between the wall's particles; distances in spacings."""
    random = np.random.default_rng(7)
    points = random.uniform(0, 24, (40, dim))
    points[:, -1] = np.linspace(0.0, 1.5, 40)
    above = points + 5.0 * np.eye(dim)[-1]  # so near to a wall none may be set up
    simulation = wall_below(dim, above, None, dt=1e-9)
    x = simulation.particles.host("x")
    x[:40] = points
    simulation.particles.set("x", x)
    simulation.advance(1)
    p = simulation.particles
    assert p.by_id("wall_fraction")[0] == pytest.approx(0.5, abs={2: 5e-3, 3: 1e-2}[dim])
    found = p.by_id("wall_distance")[:40]
    near = points[:, -1] < 1.0
    np.testing.assert_allclose(found[near], points[near, -1], atol={2: 5e-3, 3: 1.5e-2}[dim])
    np.testing.assert_allclose(found, points[:, -1], atol={2: 1e-2, 3: 5e-2}[dim])
    direction = p.by_id("wall_direction")[:40]
    np.testing.assert_allclose(direction[:, -1], 1.0, atol=0.02)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scheme", list(SCHEMES))
@pytest.mark.parametrize("advance", [0.01, 0.1, 0.25, 0.5])
@pytest.mark.parametrize("drift", [0.0, 0.7])
def test_a_particle_fired_at_a_wall_comes_out(dim, scheme, advance, drift):
    """At angles of 5° to 90°, in steps of up to half the support (none by rule is longer).

    ``drift``: the wall slides. A particle is never deeper than one step goes, and leaves the way it
    came, as seen from the wall.
    """
    step = advance * 2.6
    angle = np.radians([5.0, 10.0, 30.0, 45.0, 75.0, 90.0])
    points, velocity = np.zeros((6, dim)), np.zeros((6, dim))
    points[:, 0], points[:, -1] = 4.0 * np.arange(6) + 0.37, 2.8
    velocity[:, 0], velocity[:, -1] = np.cos(angle) + drift, -np.sin(angle)
    sliding = np.eye(dim)[0] * drift
    simulation = wall_below(dim, points, velocity, wall_velocity=sliding, dt=step, scheme=scheme)
    p = simulation.particles
    for _ in range(18):
        simulation.advance(int(2.2 * 2.8 / np.sin(angle[0]) / step / 18) + 1)
        assert np.all(p.by_id("x")[:6, -1] > -step * np.sin(angle) - 1e-2)
    assert np.all(p.by_id("x")[:6, -1] > 0)
    assert np.all(p.by_id("bounces")[:6] == 1)
    assert simulation.conservation()["bounces"] == 6
    expected = sliding - (velocity - sliding)
    np.testing.assert_allclose(p.by_id("v")[:6], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_bounce_back_from_a_wall_that_accelerates(dim):
    """v_w − u + Δt a_w."""
    points = np.full((1, dim), 12.3)
    points[0, -1] = 0.05
    velocity = np.linspace(0.1, -0.5, dim) if dim > 1 else np.array([-0.5])
    simulation = wall_below(dim, points, velocity, dt=0.2)
    acceleration = np.arange(1.0, dim + 1)
    simulation.start()
    p = simulation.particles
    p.set("wall_acceleration", acceleration)
    x = p.host("x").copy()
    x[p.host("is_wall") == 0, -1] = -0.05
    p.set("x", x)
    simulation.walls.measure(simulation.system)
    simulation.walls.bounce_back(simulation.system)
    found = p.by_id("v")[0]
    np.testing.assert_allclose(found, -velocity + 0.2 * acceleration, rtol=1e-9)


@pytest.mark.parametrize("scheme", list(SCHEMES))
def test_poiseuille_profile_without_a_known_surface(scheme):
    """By the distances that follow from φ: the kernel sum's 6e-4, and 1e-3 of a spacing.

    By geometry it is the kernel sum's alone, and with that normalised nothing.
    """
    options = {"density_diffusion": 0.0} if scheme == "sdpd" else {"normalise_viscosity": True}
    kernel_sum = 6.1e-4 if scheme == "sdpd" else 1e-12
    scheme = SCHEMES[scheme](support=3.0, **options)
    for ny in (10, 20, 40):
        assert resting_poiseuille_error(scheme, ny, True) < kernel_sum
        assert resting_poiseuille_error(scheme, ny, False) < kernel_sum + 1.2e-3 / ny
