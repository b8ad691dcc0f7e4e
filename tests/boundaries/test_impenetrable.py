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

SIDE, SUPPORT, SOUND = 24.0, 2.6, 1.0
MIDDLE = (0.5 * SIDE, 0.5 * SIDE)
FIRED = 40
#: How far φ = 1/2 lies inside a disc's surface made of particles of a lattice, in spacings.
ROUGH = 0.5


def walls_of(kind):
    """A solid region, the particles' places in it (spacing 1), and its motion, if any."""
    grid = pc.lattice(pc.Domain((0, 0), (SIDE, SIDE)), 1.0)
    circle, block = pc.Circle(MIDDLE, 6.0), pc.Box((7.0, 8.0), (17.0, 16.0))
    region = {
        "slab": pc.Box((-np.inf, 2.0), (np.inf, 6.0)),
        "circle": circle,
        "cavity": ~pc.Circle(MIDDLE, 9.0),
        "block": block,
        "wedge": pc.HalfSpace(MIDDLE, (1.0, 1.0))
        & pc.HalfSpace(MIDDLE, (-1.0, 0.3))
        & pc.Box((2.0, 2.0), (22.0, 22.0)),
        "room": ~pc.Box((4.0, 4.0), (20.0, 19.0)),
        "gear": (circle | pc.Box((11.0, 3.0), (13.0, 21.0))) | pc.Box((3.0, 11.0), (21.0, 13.0)),
    }[kind]
    distance = region.signed_distance(grid)
    return region, grid[(distance < 0) & (distance > -4.0)]


def shoot(kind, speed, angles, scheme, velocity=(0.0, 0.0), spin=0.0, steps=30, known=True):
    """Fire particles that feel no force from places outside the wall, at a step by the rule.

    If the wall's surface is ``known`` nothing is inside after any step; if not, nothing is deeper
    than it went in one step (and an allowance for what φ sees of a curved surface), and nothing
    stays inside.
    """
    region, places = walls_of(kind)
    random = np.random.default_rng(int(1e6 * angles[0]) % 2**32)
    x = random.uniform(3.0, SIDE - 3.0, (4000, 2))
    x = x[region.signed_distance(x) > 0.05][:FIRED]
    turned = np.resize(angles, len(x)) + np.arange(len(x))
    v = speed * SOUND * np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    dense, bare = unit_fluid(sound_speed=1e-9, viscosity=0.0), unit_fluid(sound_speed=1e-9)
    domain = pc.Domain((0, 0), (SIDE, SIDE), periodic="xy", depth=1.0)
    phases = [
        Phase("shot", dense, x, 1e-6, velocity=v, spacing=1.0),
        Phase("wall", bare, places, 1.0, kind="wall", surface=region if known else None),
    ]
    moves = any(velocity) or spin != 0
    motion = pc.WallMotion("wall", velocity=velocity, angular_velocity=spin, centre=MIDDLE)
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
        simulation.solver.shift_pressure = 0.0
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


@pytest.mark.parametrize("scheme", [TransportVelocity, SDPD])
@pytest.mark.parametrize("kind", ["slab", "circle", "cavity", "block", "wedge", "room", "gear"])
def test_nothing_is_ever_inside_walls_at_rest(kind, scheme):
    @examples
    @given(**shot)
    def fire(speed, angles):
        simulation = shoot(kind, speed, angles, scheme)
        v = simulation.particles.by_id("v")[:FIRED]
        np.testing.assert_allclose(np.linalg.norm(v, axis=1), speed * SOUND, rtol=1e-9)
        bounces.append(simulation.conservation()["bounces"])

    bounces = []
    fire()
    assert sum(bounces) > 50


@pytest.mark.parametrize("kind", ["slab", "circle", "block", "room", "gear"])
def test_nothing_is_ever_inside_walls_that_move(kind):
    """Translating walls; what is fired at them gains speed and the step stays as it was."""

    @examples
    @given(**shot, direction=st.floats(0.0, 6.283), fast=st.floats(0.0, 3.0))
    def fire(speed, angles, direction, fast):
        velocity = (fast * SOUND * np.cos(direction), fast * SOUND * np.sin(direction))
        simulation = shoot(kind, speed, angles, TransportVelocity, velocity=velocity)
        bounces.append(simulation.conservation()["bounces"])

    bounces = []
    fire()
    assert sum(bounces) > 30


@pytest.mark.parametrize("kind", ["circle", "cavity", "block", "gear"])
def test_nothing_is_ever_inside_walls_that_turn(kind):
    """Rim speeds of up to three times that of sound, also together with a translation."""

    @examples
    @given(**shot, rim=st.floats(-3.0, 3.0), along=st.floats(0.0, 1.0))
    def fire(speed, angles, rim, along):
        simulation = shoot(
            kind, speed, angles, TransportVelocity, (along * SOUND, 0.0), rim * SOUND / 9.0
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
