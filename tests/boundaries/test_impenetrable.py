"""Particles fired at walls of any shape, at rest and moving: none is inside, ever."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase as Stage
from hypothesis import given, settings
from hypothesis import strategies as st

import particell as pc
from particell.phases import Phase
from particell.schemes.sdpd import SDPD
from particell.schemes.timestep import COURANT
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import unit_fluid

SUPPORT, SOUND = 2.6, 1.0
#: Sides of the periodic boxes in 2D and 3D.
SIDE = {2: 24.0, 3: 16.0}
FIRED = 40
#: How far φ = 1/2 lies inside a disc's surface made of particles of a lattice, in spacings.
ROUGH = 0.5


def middle(dim):
    return (0.5 * SIDE[dim],) * dim


def walls_of(kind):
    """A solid region and the particles' places in it (spacing 1)."""
    centre, infinite = middle(2), np.inf
    circle, block = pc.Circle(centre, 6.0), pc.Box((7.0, 8.0), (17.0, 16.0))
    ball, hall = pc.Sphere(middle(3), 4.0), pc.Box((3.0, 3.0, 3.0), (13.0, 12.0, 13.0))
    region, dim = {
        "slab": (pc.Box((-infinite, 2.0), (infinite, 6.0)), 2),
        "circle": (circle, 2),
        "array": (pc.Circle(centre, 10.75), 2),  # 2.5 spacings from its periodic images
        "cavity": (~pc.Circle(centre, 9.0), 2),
        "block": (block, 2),
        "wedge": (
            pc.HalfSpace(centre, (1.0, 1.0))
            & pc.HalfSpace(centre, (-1.0, 0.3))
            & pc.Box((2.0, 2.0), (22.0, 22.0)),
            2,
        ),
        "room": (~pc.Box((4.0, 4.0), (20.0, 19.0)), 2),
        "gear": (
            (circle | pc.Box((11.0, 3.0), (13.0, 21.0))) | pc.Box((3.0, 11.0), (21.0, 13.0)),
            2,
        ),
        "plate": (pc.Box((-infinite, -infinite, 2.0), (infinite, infinite, 6.0)), 3),
        "ball": (ball, 3),
        "cave": (~pc.Sphere(middle(3), 6.0), 3),
        "brick": (pc.Box((5.0, 5.0, 6.0), (11.0, 12.0, 11.0)), 3),
        "hall": (~hall, 3),
        "knob": (ball | pc.Box((7.0, 7.0, 2.0), (9.0, 9.0, 14.0)), 3),
    }[kind]
    grid = pc.lattice(pc.Domain((0,) * dim, (SIDE[dim],) * dim), 1.0)
    distance = region.signed_distance(grid)
    return region, grid[(distance < 0) & (distance > -4.0)]


def directions(angles, dim):
    """Unit vectors, (n, dim), that turn with the angle."""
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    if dim == 2:
        return flat
    height = np.sin(2.4 * angles)[:, None]
    return np.concatenate([flat * np.sqrt(1 - height**2), height], axis=-1)


def shoot(kind, speed, angles, scheme, velocity=None, spin=0.0, steps=30, known=True):
    """Fire particles that feel no force from places outside the wall, at a step by the rule.

    If the wall's surface is ``known`` nothing is inside after any step; if not, nothing is deeper
    than it went in one step (and an allowance for what φ sees of a curved surface), and nothing
    stays inside.
    """
    region, places = walls_of(kind)
    random = np.random.default_rng(int(1e6 * angles[0]) % 2**32)
    dim = places.shape[1]
    velocity = (0.0,) * dim if velocity is None else velocity
    x = random.uniform(3.0, SIDE[dim] - 3.0, (4000, dim))
    x = x[region.signed_distance(x) > 0.05][:FIRED]
    v = speed * SOUND * directions(np.resize(angles, len(x)) + np.arange(len(x)), dim)
    dense, bare = unit_fluid(sound_speed=1e-9, viscosity=0.0), unit_fluid(sound_speed=1e-9)
    depth = 1.0 if dim == 2 else None
    domain = pc.Domain((0,) * dim, (SIDE[dim],) * dim, periodic="xyz"[:dim], depth=depth)
    phases = [
        Phase("shot", dense, x, 1e-6, velocity=v, spacing=1.0),
        Phase("wall", bare, places, 1.0, kind="wall", surface=region if known else None),
    ]
    moves = any(velocity) or spin != 0
    motion = pc.WallMotion(
        "wall", velocity=velocity, angular_velocity=spin, centre=middle(dim), axis=(0.6, 0.0, 0.8)
    )
    fastest = max(
        speed * SOUND + (0 if not moves else 1e-12), motion.constant_speed(places) if moves else 0
    )
    options = (
        {"filter_every": 0, "momentum_flux": "none"}
        if scheme is TransportVelocity
        else {"density_diffusion": 0.0}
    )
    simulation = Simulation(
        domain,
        phases,
        scheme(support=SUPPORT, impenetrable=True, **options),
        boundaries=[motion] if moves else [],
        dt=COURANT * SUPPORT / (SOUND + fastest),
    )
    if scheme is TransportVelocity:
        simulation.solver.flow.constants["shift_pressure"][...] = 0.0
    stay = np.zeros(FIRED, dtype=int)
    for _ in range(steps):
        simulation.advance(1)
        # that of a lone particle near a wall may grow without end
        simulation.particles.set("density", 1.0)
        if known:
            assert simulation.conservation()["inside walls"] == 0
            continue
        walls, x = simulation.walls, simulation.particles.by_id("x")[:FIRED]
        depth = -region.signed_distance(walls._in_body(phases[1], x, simulation.time))
        relative = np.linalg.norm(simulation.particles.by_id("v"), axis=1)
        assert depth.max() < ROUGH + simulation.dt * (relative[:FIRED].max() + relative.max())
        stay = np.where(depth > ROUGH, stay + 1, 0)
        assert stay.max() <= 5
    return simulation


shot = {
    "speed": st.floats(0.3, 10.0),
    "angles": st.lists(st.floats(0.0, 6.283), min_size=4, max_size=4),
}
# no shrinking: each example is a simulation
examples = settings(
    max_examples=8, derandomize=True, deadline=None, database=None, phases=[Stage.generate]
)
few = settings(examples, max_examples=4)


@pytest.mark.parametrize("scheme", [TransportVelocity, SDPD])
@pytest.mark.parametrize(
    "kind", ["slab", "circle", "array", "cavity", "block", "wedge", "room", "gear"]
)
def test_nothing_is_ever_inside_walls_at_rest(kind, scheme):
    at_rest(kind, scheme, examples)


@pytest.mark.parametrize("kind", ["plate", "ball", "cave", "brick", "hall", "knob"])
def test_nothing_is_ever_inside_walls_at_rest_in_space(kind):
    at_rest(kind, TransportVelocity, few)


def at_rest(kind, scheme, chosen):
    @chosen
    @given(**shot)
    def fire(speed, angles):
        simulation = shoot(kind, speed, angles, scheme)
        v = simulation.particles.by_id("v")[:FIRED]
        np.testing.assert_allclose(np.linalg.norm(v, axis=1), speed * SOUND, rtol=1e-9)
        bounces.append(simulation.conservation()["bounces"])

    bounces = []
    fire()
    assert sum(bounces) > (50 if chosen is examples else 10)


@pytest.mark.parametrize("kind", ["slab", "circle", "array", "block", "room", "gear"])
def test_nothing_is_ever_inside_walls_that_move(kind):
    """Translating walls; what is fired at them gains speed and the step stays as it was."""
    moving(kind, 2, examples)


@pytest.mark.parametrize("kind", ["plate", "ball", "brick", "hall", "knob"])
def test_nothing_is_ever_inside_walls_that_move_in_space(kind):
    moving(kind, 3, few)


def moving(kind, dim, chosen):
    @chosen
    @given(**shot, direction=st.floats(0.0, 6.283), fast=st.floats(0.0, 3.0))
    def fire(speed, angles, direction, fast):
        velocity = tuple(fast * SOUND * directions(np.array([direction]), dim)[0])
        simulation = shoot(kind, speed, angles, TransportVelocity, velocity=velocity)
        bounces.append(simulation.conservation()["bounces"])

    bounces = []
    fire()
    assert sum(bounces) > 30


@pytest.mark.parametrize("kind", ["circle", "cavity", "block", "gear"])
def test_nothing_is_ever_inside_walls_that_turn(kind):
    """Rim speeds of up to three times that of sound, also together with a translation."""
    turning(kind, (1.0, 0.0), 9.0, examples)


@pytest.mark.parametrize("kind", ["ball", "cave", "brick", "knob"])
def test_nothing_is_ever_inside_walls_that_turn_in_space(kind):
    """About an axis that is none of the box's."""
    turning(kind, (0.8, 0.0, 0.6), 6.0, few)


def turning(kind, direction, rim_radius, chosen):
    @chosen
    @given(**shot, rim=st.floats(-3.0, 3.0), along=st.floats(0.0, 1.0))
    def fire(speed, angles, rim, along):
        velocity = tuple(along * SOUND * part for part in direction)
        simulation = shoot(
            kind, speed, angles, TransportVelocity, velocity, rim * SOUND / rim_radius
        )
        bounces.append(simulation.conservation()["bounces"])

    bounces = []
    fire()
    assert sum(bounces) > 30


@pytest.mark.parametrize("kind", ["slab", "circle", "cavity"])
@pytest.mark.parametrize("moving", ["at rest", "moving", "turning"])
def test_walls_without_a_known_surface(kind, moving):
    """By the volume fraction: no deeper than one step, and out again."""
    if kind == "slab" and moving == "turning":
        pytest.skip("it would sweep through its periodic images")

    @examples
    @given(**shot, rim=st.floats(-1.0, 1.0))
    def fire(speed, angles, rim):
        velocity = (0.5 * rim * SOUND, rim * SOUND) if moving == "moving" else (0.0, 0.0)
        spin = rim * SOUND / 9.0 if moving == "turning" else 0.0
        simulation = shoot(kind, speed, angles, TransportVelocity, velocity, spin, known=False)
        bounces.append(simulation.conservation()["bounces"])

    bounces = []
    fire()
    assert sum(bounces) > 50
