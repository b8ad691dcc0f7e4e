"""Friction with walls: implicit, so that neither stability nor equipartition depends on it."""

from __future__ import annotations

import numpy as np
import pytest

from particell.boundaries.wall_friction import draw_spread, friction_width, slowed
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.geometry.shapes import Box
from particell.materials import Fluid
from particell.phases import Phase, box_walls, channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.stages import DrawSpread, Forces, Kick, TakeSpread
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import (
    UNIT_TEMPERATURE,
    channel,
    fluid_rows,
    forces,
    same_bits,
    standard_errors,
    unit_fluid,
)

#: So viscous that friction alone limits the step.
VISCOUS = {"viscosity": 20.0}


def points_beside_walls(dim, side, jitter, corner=0.3):
    """A jittered lattice whose first particle is ``corner`` from all walls that meet there."""
    domain = Domain((0,) * dim, (side,) * dim, depth=1.0)
    points = lattice(domain, 1.0)
    points += np.random.default_rng(3).uniform(-jitter, jitter, points.shape)
    points[np.argmin(points.sum(axis=1))] = corner
    return domain, points


def box(dim, side, scheme, jitter=0.0, corner=0.3, material=None, **options):
    domain, points = points_beside_walls(dim, side, jitter, corner)
    material = material or unit_fluid(**VISCOUS)
    inside = Phase("fluid", material, points, 1.0)
    walls = box_walls(domain, material, 1.0, layers=3)
    return Simulation(domain, [inside, *walls], scheme, **options)


def two_fluids():
    """A thin light fluid above a viscous heavy one: ν is the same, the friction between is not."""
    domain, points = points_beside_walls(2, 6, 0.2)
    light, heavy = unit_fluid(**VISCOUS), unit_fluid(viscosity=2000.0, density=100.0)
    low = (np.arange(len(points)) % 3) > 0  # each light one among heavy ones
    phases = [Phase("light", light, points[~low], 1.0), Phase("heavy", heavy, points[low], 1.0)]
    return Simulation(domain, [*phases, *box_walls(domain, light, 1.0)], SDPD())


def two_supports():
    domain, material = Domain((0, 0), (8, 8), depth=1.0), unit_fluid(**VISCOUS)
    low = Box((0, 0), (8, 4))
    phases = [
        fluid(domain, material, 1.0, low, name="fine"),
        fluid(domain, material, 2.0, ~low, name="coarse"),
    ]
    return Simulation(domain, [*phases, *box_walls(domain, material, 1.0, layers=6)], SDPD())


SYSTEMS = {
    "2D corner": lambda: box(2, 6, SDPD(), corner=0.3),
    "2D corner, on the surface": lambda: box(2, 6, SDPD(), corner=0.01),
    "2D, jittered": lambda: box(2, 7, SDPD(), jitter=0.3),
    "2D, trapezoidal": lambda: box(2, 6, SDPD(integrator="trapezoidal")),
    "2D, transport velocity": lambda: box(2, 6, TransportVelocity(), jitter=0.2),
    "2D, normalised": lambda: box(2, 6, TransportVelocity(normalise_viscosity=True), jitter=0.2),
    "3D corner": lambda: box(3, 4, SDPD(), corner=0.3),
    "3D, jittered": lambda: box(3, 4, SDPD(), jitter=0.3),
    "3D, transport velocity": lambda: box(3, 4, TransportVelocity(), jitter=0.3),
    "3D, quintic spline": lambda: box(3, 4, SDPD(kernel="quintic-spline"), jitter=0.2),
    "two fluids": two_fluids,
    "two supports": two_supports,
}
#: Those in which explicit friction would be unstable at the automatic step.
CORNERS = ("2D corner, on the surface", "3D corner")


def accelerations(simulation, v):
    """Of the fluid, (n, D), for velocities of the fluid."""
    p, inside = simulation.particles, fluid_rows(simulation)
    every = np.zeros(p.host("v").shape)
    every[inside] = v
    p.set("v", every)
    forces(simulation, 0, 1.0)
    return p.host("a")[inside].astype(float)


def friction_matrix(simulation):
    """−∂a/∂v of the fluid, (nD, nD), column by column from the sweep."""
    n, dim = int(fluid_rows(simulation).sum()), simulation.domain.dim
    rest = accelerations(simulation, np.zeros((n, dim)))
    columns = np.eye(n * dim).reshape(-1, n, dim)
    return np.array([(rest - accelerations(simulation, v)).ravel() for v in columns]).T


def wall_matrices(simulation):
    """Γ of the fluid particles, (n, D, D)."""
    dim = simulation.domain.dim
    numbers = simulation.particles.host("wall_friction")[fluid_rows(simulation)]
    found = np.zeros((len(numbers), dim, dim))
    if numbers.shape[1] == 1:
        return found + numbers[:, :, None] * np.eye(dim)
    upper = np.triu_indices(dim)
    found[:, upper[0], upper[1]] = found[:, upper[1], upper[0]] = numbers
    return found


@pytest.mark.parametrize("name", ["2D, jittered", "3D, jittered", "2D, normalised", "two fluids"])
def test_gamma_is_what_holds_a_uniform_velocity(name):
    """Fluid particles of one velocity exert no friction on each other: −Γv is all there is."""
    simulation = SYSTEMS[name]()
    simulation.start()
    n, dim = int(fluid_rows(simulation).sum()), simulation.domain.dim
    rest = accelerations(simulation, np.zeros((n, dim)))
    for along in np.eye(dim):
        held = rest - accelerations(simulation, np.tile(along, (n, 1)))
        expected = wall_matrices(simulation) @ along
        assert np.abs(expected).max() > 10.0
        np.testing.assert_allclose(held, expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_automatic_step_is_stable_beside_walls_and_not_too_cautious(name):
    """dt λ_max of the friction as it is taken is below 2, at most 2.7 times so."""
    simulation = SYSTEMS[name]()
    simulation.start()
    matrix, dt = friction_matrix(simulation), simulation.largest_step()
    gamma = wall_matrices(simulation)
    n, dim = gamma.shape[:2]
    slow = np.linalg.inv(np.eye(dim) + 0.5 * dt * gamma)
    taken = np.einsum("nij,njm->nim", slow, matrix.reshape(n, dim, -1)).reshape(n * dim, -1)
    largest = np.linalg.eigvals(taken).real.max()
    assert 2 / 2.7 < dt * largest < 2.0
    if name in CORNERS:
        assert dt * np.linalg.eigvals(matrix).real.max() > 2.0


def test_slowed_solves_its_equations():
    random = np.random.default_rng(1)
    for dim in (1, 2, 3):
        for held in (1, 2):
            root = random.normal(size=(dim, dim))
            gamma = root @ root.T if held == 2 else 2.5 * np.eye(dim)
            numbers = gamma[np.triu_indices(dim)] if held == 2 else np.array([2.5])
            assert len(numbers) == friction_width(held, dim)
            a = np.zeros(3)
            a[:dim] = random.normal(size=dim)
            found = slowed.py_func(0, numbers[None], 0.7, *a, dim, held)
            expected = np.linalg.solve(np.eye(dim) + 0.7 * gamma, a[:dim])
            np.testing.assert_allclose(found[:dim], expected, rtol=1e-12)


def decay_error(dt, time=0.02):
    """Error of the velocity of one particle that stands still among walls, after a time in s."""
    domain, material = Domain((0, 0, 0), (1, 1, 1), depth=1.0), unit_fluid(**VISCOUS)
    inside = Phase("fluid", material, np.array([[0.3, 0.4, 0.45]]), 1.0)
    walls = box_walls(domain, material, 1.0)
    simulation = Simulation(domain, [inside, *walls], SDPD(), dt=dt)
    simulation.start()
    solver, rows = simulation.solver, fluid_rows(simulation)
    forces(simulation, 0, dt)
    p = simulation.particles
    rest = p.host("a")[rows][0].copy()  # of pressure, where the particle is
    gamma = wall_matrices(simulation)[0]
    values, vectors = np.linalg.eigh(gamma)
    steady = np.linalg.solve(gamma, rest)
    decay = vectors @ np.diag(np.exp(-values * time)) @ vectors.T
    start = steady + np.array([1.0, -0.5, 0.7])
    p.set("v", np.where(rows[:, None], start, 0.0))
    forces(simulation, 0, dt)
    kick, push = solver.bound([Kick(), Forces(0)])
    for _ in range(round(time / dt)):
        kick()
        push()
        kick()
    found = p.host("v")[rows][0]
    return np.linalg.norm(found - steady - decay @ (start - steady))


def test_friction_with_walls_is_of_second_order():
    errors = [decay_error(0.02 / n) for n in (20, 40, 80)]
    assert errors[0] > 1e-5
    assert 3.5 < errors[0] / errors[1] < 4.6
    assert 3.7 < errors[1] / errors[2] < 4.3


def final_state(steps):
    simulation = channel(
        (8, 5),
        unit_fluid(viscosity=0.5, sound_speed=3.0),
        jitter=0.1,
        velocity=lambda x: 0.1 * np.sin(np.pi / 4 * (x[:, ::-1] + 0.3 * x)),
        integrator="trapezoidal",
    )
    simulation.dt, simulation.timing.automatic = 1.0 / steps, False
    simulation.advance(steps)
    p = simulation.particles
    return np.concatenate([p.by_id("x").ravel(), p.by_id("v").ravel()])


def test_the_trapezoidal_rule_is_second_order_beside_walls():
    coarse, middle, fine = (final_state(n) for n in (20, 40, 80))
    assert np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine)) > 1.8


@pytest.mark.parametrize(("dim", "steps"), [(2, 12000), (3, 2500)])
def test_equipartition_is_exact_beside_walls_whatever_the_step(dim, steps):
    """At fixed places in a corner, where dt Γ is above 2: each component of the first particle, and
    all. The false-alarm rate is 1e-6 a run; what walls damp within a step is a half."""
    hot = unit_fluid(**VISCOUS, temperature=UNIT_TEMPERATURE)
    scheme = SDPD(density="summation", fluctuations=True)
    simulation = box(dim, 3, scheme, material=hot, corner=0.05)
    simulation.start()
    solver, p, dt = simulation.solver, simulation.particles, simulation.dt
    rows, n = fluid_rows(simulation), len(p)
    forces(simulation, 0, dt)
    assert dt * np.linalg.eigvalsh(wall_matrices(simulation)).max() > 2.2
    gamma = wall_matrices(simulation)
    first = int(np.argmax(np.trace(gamma, axis1=1, axis2=2)))
    p.set("v", np.zeros((n, dim)))
    samples = np.empty((steps, int(rows.sum()), dim))
    take, kick, push, draw = solver.bound([TakeSpread(), Kick(), Forces(0), DrawSpread()])
    for step in range(steps):
        simulation.step = step
        if step:
            take()
        kick()
        push()
        kick()
        draw()
        samples[step] = p.host("v")[rows]
    samples = samples[steps // 10 :]
    samples -= samples.mean(axis=0)  # pressure pushes
    mass = p.host("mass")[rows][:, None]
    blocks = np.array([(mass * part**2).mean(axis=0) for part in np.array_split(samples, 30)])
    mean, error = blocks.mean(axis=0), blocks.std(axis=0) / np.sqrt(29)
    off = standard_errors(dim + 1, 30)
    assert np.all(error < 0.05)
    assert np.all(np.abs(mean[first] - 1.0) < off * error[first] + 1e-3)
    every = blocks.mean(axis=(1, 2))
    assert abs(every.mean() - 1.0) < off * every.std() / np.sqrt(29)


def hot_box(seed=2):
    material = Fluid(density=1000.0, viscosity=1e-3, temperature=300.0)
    domain = Domain((0, 0), (8e-8, 8e-8), periodic="x", depth=1e-8)
    walls = channel_walls(domain, material, 1e-8, axis=1)
    scheme = SDPD(density="summation", fluctuations=True)
    return Simulation(domain, [fluid(domain, material, 1e-8), *walls], scheme, seed=seed)


def test_a_restart_beside_walls_with_noise_has_the_same_bits():
    whole, first, second = hot_box(), hot_box(), hot_box()
    whole.advance(30)
    first.advance(17)
    second.restore(first.state())
    second.advance(13)
    assert np.abs(whole.particles.host("velocity_spread")).max() > 0
    assert same_bits(whole, second) == []


@pytest.mark.parametrize("by_id", [False, True])
def test_velocities_set_between_steps_are_those_that_go_on(by_id):
    """What a step would take away beside walls belongs to the velocities that were there before."""
    simulation = hot_box()
    simulation.advance(20)
    p = simulation.particles
    thermal = np.abs(p.host("velocity_spread")).max()
    assert thermal > 0
    given = p.by_id("v") if by_id else p.host("v")
    p.set("v", given, by_id)
    np.testing.assert_array_equal(p.by_id("v") if by_id else p.host("v"), given)
    rows, before = fluid_rows(simulation), p.host("v")
    simulation.dt, simulation.timing.automatic = 1e-30, False  # nothing acts in it
    simulation.advance(1)
    np.testing.assert_allclose(p.host("v")[rows], before[rows], atol=1e-6 * thermal)


def test_walls_at_rest_stay_and_others_drag():
    """Sliding walls take the fluid along, by the velocity that they have."""
    simulation = channel((8, 3), unit_fluid(**VISCOUS), wall_velocity=((1.0, 0.0), (1.0, 0.0)))
    simulation.advance(600)
    inside = fluid_rows(simulation)
    np.testing.assert_allclose(simulation.particles.host("v")[inside][:, 0], 1.0, atol=1e-6)


@pytest.mark.parametrize("scheme", [SDPD(), TransportVelocity()])
def test_a_cavity_with_all_defaults_does_not_heat_up(scheme):
    """3D, jittered, its step limited by viscosity: nothing becomes faster than the lid."""
    domain, points = points_beside_walls(3, 6, 0.2)
    material = unit_fluid(**VISCOUS)
    walls = box_walls(domain, material, 1.0, sliding={"z-upper": (0.1, 0.0, 0.0)})
    simulation = Simulation(domain, [Phase("fluid", material, points, 1.0), *walls], scheme)
    simulation.advance(50)  # the jittered start expands
    fastest = []
    for _ in range(8):
        simulation.advance(50)
        v = simulation.particles.host("v")[fluid_rows(simulation)]
        fastest.append(np.linalg.norm(v, axis=1).max())
    assert max(fastest) < 0.1


def test_a_given_step_beyond_stability_is_refused():
    domain, points = points_beside_walls(2, 6, 0.0)
    inside = Phase("fluid", unit_fluid(**VISCOUS), points, 1.0)
    with pytest.raises(InputError, match="viscosity makes the step unstable"):
        Simulation(domain, inside, SDPD(), dt=0.11 * 9 / 20)
    assert Simulation(domain, inside, SDPD(), dt=0.09 * 9 / 20).dt == pytest.approx(0.09 * 9 / 20)


def test_particles_without_walls_have_no_spread():
    v, spread = np.ones((1, 2)), np.ones((1, 2))
    draw_spread.specialise(DIM=2, HELD=1)(
        1,
        np.zeros(1, np.int64),
        np.zeros(1, np.uint8),
        np.zeros(1, np.int32),
        np.ones(1),
        np.ones(1),
        np.zeros((1, 1)),
        v,
        spread,
        0,
        0.1,
        np.uint64(1),
        np.uint64(2),
    )
    assert (v == 1).all() and (spread == 0).all()
