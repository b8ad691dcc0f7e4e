"""Walls that move as rigid bodies: where they are, what they show, and that bits come back."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.errors import InputError
from particell.phases import Phase
from particell.schemes.density_stages import WallPressure
from systems import channel, same_bits, unit_fluid


def disc(motion=None, scheme=None, dt=0.01, dim=2):
    """A disc (ball) of spacing 1 and radius 4 in a resting fluid, with a motion."""
    side = 16.0 if dim == 2 else 12.0
    centre = (0.5 * side,) * dim
    domain = pc.Domain((0,) * dim, (side,) * dim, periodic="xyz"[:dim], depth=1.0)
    ball = pc.Ball(centre, 4.0)
    grid = pc.lattice(domain, 1.0)
    material = unit_fluid()
    phases = [
        Phase("fluid", material, grid[~ball.contains(grid)], 1.0),
        Phase("disc", material, grid[ball.contains(grid)], 1.0, kind="wall", surface=ball),
    ]
    boundaries = [] if motion is None else [motion]
    scheme = scheme or pc.TransportVelocity()
    return (
        pc.Simulation(domain, phases, scheme, boundaries=boundaries, dt=dt),
        grid,
        np.array(centre),
    )


def wall_fields(simulation, *names):
    p = simulation.particles
    wall = p.by_id("is_wall") != 0
    return [p.by_id(name)[wall] for name in names]


@pytest.mark.parametrize(
    "scheme", [pc.TransportVelocity(), pc.SDPD(), pc.SDPD(density="summation")]
)
def test_a_disc_turns_and_moves(scheme):
    """Positions to round-off after 150 steps; v and a are those of the surface points."""
    motion = pc.WallMotion("disc", velocity=(0.5, -0.25), angular_velocity=0.8, centre=(8.0, 8.0))
    simulation, _, centre = disc(motion, scheme)
    start = wall_fields(simulation, "x")[0].copy()
    simulation.advance(150)
    time, turn = simulation.time, 0.8 * simulation.time
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    now = centre + np.array([0.5, -0.25]) * time
    x, image, v, a, normal, depth = wall_fields(
        simulation, "x", "image", "v", "wall_acceleration", "wall_normal", "wall_depth"
    )
    x = x + 16.0 * image
    np.testing.assert_allclose(x, now + (start - centre) @ rotation.T, atol=1e-12)
    foot = x + depth[:, None] * normal - now
    away = np.linalg.norm(start - centre, axis=1) > 1
    np.testing.assert_allclose(np.linalg.norm(foot[away], axis=1), 4.0, rtol=1e-5)
    expected = np.array([0.5, -0.25]) + 0.8 * np.stack([-foot[:, 1], foot[:, 0]], axis=-1)
    np.testing.assert_allclose(v, expected, atol=1e-12)
    np.testing.assert_allclose(a, -(0.8**2) * foot, atol=1e-12)
    assert simulation.conservation().get("inside walls", 0) == 0


def test_a_ball_turns_about_an_axis():
    axis = np.array([1.0, 2.0, -2.0]) / 3
    motion = pc.WallMotion("disc", angular_velocity=-1.5, centre=(6.0,) * 3, axis=(1, 2, -2))
    simulation, _, centre = disc(motion, dim=3)
    start = wall_fields(simulation, "x")[0].copy() - centre
    simulation.advance(20)
    angle = -1.5 * simulation.time
    along = np.outer(start @ axis, axis)
    expected = along + np.cos(angle) * (start - along) + np.sin(angle) * np.cross(axis, start)
    x, v, depth, normal = wall_fields(simulation, "x", "v", "wall_depth", "wall_normal")
    np.testing.assert_allclose(x - centre, expected, atol=1e-12)
    foot = x + depth[:, None] * normal - centre
    np.testing.assert_allclose(v, np.cross(-1.5 * axis, foot), atol=1e-12)


def test_functions_of_time_are_differentiated():
    """Displacement 0.3 sin(2t) and angle 0.2 (1 − cos 3t): velocity and acceleration.

    They count from their values at t = 0, which here are not 0.
    """
    motion = pc.WallMotion(
        "disc",
        centre=(8.0, 8.0),
        displacement=lambda t: np.array([0.4 + 0.3 * np.sin(2 * t), -0.1]),
        angle=lambda t: 0.7 + 0.2 * (1 - np.cos(3 * t)),
    )
    t = 0.37
    state = motion.state(t, 0.01, 2)
    assert state["displacement"] == pytest.approx([0.3 * np.sin(2 * t), 0.0], abs=1e-14)
    angle = 0.2 * (1 - np.cos(3 * t))
    turned = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)]
    assert state["rotation"] == pytest.approx(turned, abs=1e-14)
    assert state["body_velocity"][0] == pytest.approx(0.6 * np.cos(2 * t), rel=1e-5)
    assert state["body_acceleration"][0] == pytest.approx(-1.2 * np.sin(2 * t), rel=1e-5)
    assert state["spin"][2] == pytest.approx(0.6 * np.sin(3 * t), rel=1e-4)
    assert state["spin_rate"][2] == pytest.approx(1.8 * np.cos(3 * t), rel=1e-4)


def test_pressure_of_a_wall_that_accelerates():
    """In its frame the fluid has the weight −a: the pressures are those under gravity."""
    pressures = []
    for gravity, acceleration in ((-1e-3, 0.0), (0.0, 1e-3)):
        simulation = channel(
            (8, 12), unit_fluid(exponent=1.0), gravity=(0.0, gravity), impenetrable=True
        )
        simulation.start()
        p = simulation.particles
        p.set("wall_acceleration", np.array([0.0, acceleration]))
        simulation.solver.do(WallPressure())
        pressures.append(p.by_id("pressure")[p.by_id("is_wall") != 0].copy())
    assert np.abs(pressures[0]).max() > 1e-4
    np.testing.assert_allclose(pressures[0], pressures[1], rtol=1e-12, atol=1e-15)


def test_restart_gives_the_same_bits():
    motion = pc.WallMotion("disc", velocity=(0.5, 0.0), angular_velocity=0.8, centre=(8.0, 8.0))
    one, two, three = (disc(motion)[0] for _ in range(3))
    one.advance(25)
    two.advance(12)
    three.restore(two.state())
    three.advance(13)
    assert same_bits(one, three) == []


def test_its_speed_counts_for_the_time_step():
    motion = pc.WallMotion("disc", velocity=(3.0, 4.0), angular_velocity=2.0, centre=(8.0, 8.0))
    points = np.array([[8.0, 11.0], [8.0, 8.5]])
    assert motion.constant_speed(points) == pytest.approx(5.0 + 6.0)
    assert disc(motion, dt="auto")[0].dt < disc(dt="auto")[0].dt


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"angular_velocity": 1.0}, "centre"),
        ({"angular_velocity": np.inf, "centre": (8.0, 8.0)}, "angular_velocity"),
        ({"velocity": (1.0,)}, "velocity"),
        ({"velocity": (1.0, 0.0), "group": "fluid"}, "group"),
        ({"displacement": lambda t: np.zeros(3)}, "displacement"),
        ({"axis": (0.0, 0.0, 0.0)}, "axis"),
    ],
)
def test_wrong_motions_are_refused(options, what):
    with pytest.raises(InputError, match=what):
        disc(pc.WallMotion(**{"group": "disc", **options}))
