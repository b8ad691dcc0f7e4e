"""The boundary volume fraction against the half-space, and particles fired at walls."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.geometry.shapes import HalfSpace
from particell.phases import Phase
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import DATA, unit_fluid


def half_space(dim):
    """d/h, φ and the largest |h² d²φ/dd²| from the table for Lucy's kernel."""
    with open(DATA / "bvf_lucy_halfspace.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    table = np.array([[float(value) for value in row] for row in rows[1:]])
    curvature = np.abs(np.gradient(table[:, dim + 3], table[:, 0])).max()
    return table[:, 0], table[:, dim], curvature


def wall_below(dim, points, velocity, support=2.6, wall_velocity=None, layers=3, dt=1e-3):
    """Particles over a wall whose surface is at 0 on the last axis; spacing 1, no forces."""
    edges = [24.0] * (dim - 1) + [90.0]
    domain = Domain((0,) * dim, edges, periodic="xy"[: dim - 1], depth=1.0)
    slab = Domain([0.0] * (dim - 1) + [-float(layers)], [*edges[:-1], 0.0])
    up = np.eye(dim)[-1]
    material = unit_fluid(viscosity=0.0, sound_speed=1e-9, exponent=1.0)
    phases = [
        Phase("fluid", material, points, 1.0, velocity=velocity),
        Phase(
            "wall",
            material,
            lattice(slab, 1.0),
            1.0,
            kind="wall",
            velocity=wall_velocity,
            surface=HalfSpace((0,) * dim, up),
        ),
    ]
    scheme = TransportVelocity(support=support, filter_every=0)
    return Simulation(domain, phases, scheme, dt=dt)


@pytest.mark.parametrize("dim", [2, 3])
def test_fraction_and_direction_over_a_plane(dim):
    """The table's values, but for the error of a midpoint rule over layers, φ''/24 to lead."""
    support = {2: 9.0, 3: 7.0}[dim]
    distance = np.array([0.05, 0.2, 0.4, 0.6, 0.7, 0.85])
    points = np.full((6, dim), 12.3)
    points[:, -1] = distance * support
    simulation = wall_below(dim, points, None, support, layers=support + 1)
    simulation.advance(1)
    p = simulation.particles
    d, phi, curvature = half_space(dim)
    error = 1.1 * curvature / 24 / support**2
    expected = np.interp(distance, d, phi)
    np.testing.assert_allclose(p.by_id("wall_fraction")[:6], expected, rtol=0, atol=error)
    direction = p.by_id("wall_direction")[:6]
    np.testing.assert_allclose(direction, np.tile(np.eye(dim)[-1], (6, 1)), atol=0.02)


@pytest.mark.parametrize("dim", [2, 3])
def test_fraction_on_the_surface_is_a_half(dim):
    """Also at the default support of 2.6 spacings and wherever between the wall's particles."""
    random = np.random.default_rng(7)
    points = random.uniform(0, 24, (20, dim))
    points[:, -1] = 0.0
    simulation = wall_below(dim, points, None, dt=1e-9)
    simulation.advance(1)
    fraction = simulation.particles.by_id("wall_fraction")[:20]
    assert fraction == pytest.approx(0.5, abs={2: 5e-3, 3: 1e-2}[dim])


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("advance", [0.01, 0.1, 0.25])
@pytest.mark.parametrize("drift", [0.0, 0.7])
def test_a_particle_fired_at_a_wall_comes_out(dim, advance, drift):
    """At angles of 5° to 90°, in steps of up to a quarter of the support (none by rule is longer).

    ``drift``: the wall slides. A particle is never deeper than one step goes, and leaves the way it
    came, as seen from the wall.
    """
    step = advance * 2.6
    angle = np.radians([5.0, 10.0, 30.0, 45.0, 75.0, 90.0])
    points, velocity = np.zeros((6, dim)), np.zeros((6, dim))
    points[:, 0], points[:, -1] = 4.0 * np.arange(6) + 0.37, 2.8
    velocity[:, 0], velocity[:, -1] = np.cos(angle) + drift, -np.sin(angle)
    sliding = np.eye(dim)[0] * drift
    simulation = wall_below(dim, points, velocity, wall_velocity=sliding, dt=step)
    p = simulation.particles
    for _ in range(20):
        simulation.advance(round(2.2 * 2.8 / np.sin(angle[0]) / step / 20) + 1)
        assert np.all(p.by_id("x")[:6, -1] > -step * np.sin(angle) - 1e-3)
    assert np.all(p.by_id("x")[:6, -1] > 0)
    assert np.all(p.by_id("bounces")[:6] == 1)
    assert simulation.conservation()["bounces"] == 6
    assert simulation.conservation()["inside walls"] == 0
    expected = sliding - (velocity - sliding)
    np.testing.assert_allclose(p.by_id("v")[:6], expected, rtol=1e-9, atol=1e-9)
