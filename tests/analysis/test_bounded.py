"""Fields at walls: the wall's value at the wall, nothing in solids, exact profiles between."""

from __future__ import annotations

import json

import numpy as np
import pytest

import particell as pc
from particell import snapshot
from particell.analysis.fields import grid
from particell.geometry.shapes import Ball
from particell.output.run import Run
from particell.phases import Phase

SPACING = 0.05
WATER = pc.Fluid(density=1.0, viscosity=0.1, sound_speed=10.0)


def recorded(simulation: pc.Simulation, times: tuple[float, ...] = (0.0,)) -> Run:
    """The state with walls where they are at some times; nothing else moves, no loop of the flow is
    compiled."""
    frames, static = [], simulation.static_frame()
    simulation.walls.attach(simulation.system)
    for time in times:
        simulation.system.clock.now = time
        if simulation.walls.motions:
            simulation.walls.move(simulation.system)
        frames.append(simulation.frame())
    roles = snapshot.roles_of(simulation)
    head = (simulation.domain, simulation.group_names, static)
    return Run.from_memory(*head, range(len(times)), times, frames, roles=roles)


def slab(dim: int, molecules: bool = False) -> pc.Simulation:
    """Between plates held at 1 and 3, a linear profile from the start; nothing moves."""
    box = pc.Domain((0.0,) * dim, (1.0, 0.6, 0.5)[:dim], "yz"[: dim - 1], depth=1.0)
    phases = [pc.fluid(box, WATER, SPACING), *pc.channel_walls(box, WATER, SPACING, axis=0)]
    held = {"wall-lower": 1.0, "wall-upper": 3.0}
    boundaries = [pc.FixedValueWall(name, {"C": value}) for name, value in held.items()]
    species = [pc.Species("C", 1e-3, molecules=molecules)]
    simulation = pc.Simulation(box, phases, pc.Static(), species, boundaries=boundaries)
    scale = 1e-17 if molecules else 1.0  # so that there are thousands of molecules a particle
    simulation.chemistry.set_concentration("C", lambda x: scale * (1.0 + 2.0 * x[:, 0]))
    return simulation


def across(dim: int, points: int = 41) -> np.ndarray:
    places = np.full((points, dim), 0.21)
    places[:, 0] = np.linspace(0.0, 1.0, points)
    return places


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_linear_between_plates_and_at_them(dim, tmp_path):
    runs = [recorded(slab(dim))]
    if dim == 2:  # what is needed stands in the file
        runs.append(slab(dim).run(1e-9, out=tmp_path / "run", progress=False))
    for run in runs:
        places = across(dim)
        found = run.on_points("concentration/C", places)
        assert found == pytest.approx(1.0 + 2.0 * places[:, 0], rel=1e-7)
        assert found[[0, -1]] == pytest.approx([1.0, 3.0], rel=1e-11)
        beyond = np.array([places[0], places[-1]])
        beyond[:, 0] += [-0.2 * SPACING, 0.2 * SPACING]
        assert np.isnan(run.on_points("concentration/C", beyond)).all()


@pytest.mark.parametrize("dim", [1, 2])
def test_molecules_at_plates(dim):
    """The wall's value is no random number, however many molecules there are beside it."""
    run = recorded(slab(dim, molecules=True))
    ends = run.on_points("concentration/C", across(dim))[[0, -1]]
    assert ends == pytest.approx([1.0, 3.0], rel=1e-11)
    assert run.source.roles()[1].held == {"C": 1.0}
    assert run.source.roles()[0].species == ("C",)


def test_averages_in_time_are_bounded_too():
    places, simulation = across(2), slab(2)
    outside = np.array([[-0.01, 0.2], [1.01, 0.2]])
    mean = pc.TimeAverage(np.concatenate([places, outside]), ("concentration/C", "velocity"))
    run = simulation.run(2e-9, progress=False, averages=mean)
    found = run.average("concentration/C")
    assert found[:-2] == pytest.approx(1.0 + 2.0 * places[:, 0], rel=1e-7)
    assert found[[0, len(places) - 1]] == pytest.approx([1.0, 3.0], rel=1e-11)
    assert np.isnan(found[-2:]).all()
    assert np.isnan(run.average("velocity")[-2:]).all()


def rings(dim: int, turning: float = 0.0) -> tuple[pc.Simulation, float]:
    """Fluid round a body in a box, which holds 2 at its surface (and turns)."""
    radius, width = 0.3, 1.4
    box = pc.Domain((-0.5 * width,) * dim, (0.5 * width,) * dim, "xyz"[:dim], depth=1.0)
    ball = Ball((0.0,) * dim, radius)
    filled = pc.fluid(box, WATER, SPACING, shape=~ball)
    points = pc.fluid(box, WATER, SPACING, shape=ball).points
    body = Phase("body", WATER, points, SPACING**dim, "wall", spacing=SPACING, surface=ball)
    motion = [pc.WallMotion("body", angular_velocity=turning, centre=(0.0,) * dim)]
    simulation = pc.Simulation(
        box,
        [filled, body],
        pc.SDPD() if turning else pc.Static(),
        [pc.Species("C", 1e-3)],
        boundaries=[pc.FixedValueWall("body", {"C": 2.0}), *(motion if turning else [])],
    )
    return simulation, radius


@pytest.mark.parametrize("dim", [2, 3])
def test_a_curved_wall(dim):
    """The profile round a body, ln r or 1/r: 2 at the surface, and nothing within."""
    simulation, radius = rings(dim)

    def profile(x):
        r = np.linalg.norm(x, axis=1) / radius
        return 2.0 + (np.log(r) if dim == 2 else 1.0 - 1.0 / r)

    simulation.chemistry.set_concentration("C", profile)
    run = recorded(simulation)
    random = np.random.default_rng(5)
    way = random.normal(size=(50, dim))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    assert run.on_points("concentration/C", radius * way) == pytest.approx(2.0, rel=1e-7)
    for away in (0.1, 0.5, 1.0):
        places = (radius + away * SPACING) * way
        error = run.on_points("concentration/C", places) - profile(places)
        # of the linear fit in the bulk too; without the wall's value 0.016 and 0.021 at 0.1
        assert np.abs(error).max() < {2: 1.3e-3, 3: 2.5e-3}[dim]
    within = run.on_points("concentration/C", (radius - 0.1 * SPACING) * way)
    assert np.isnan(within).all()
    alone = run.on_points("concentration/C", (radius - 0.1 * SPACING) * way, groups="body")
    assert (alone == 0.0).all()  # its own particles hold nothing


def test_velocity_at_a_body_that_turns_is_that_of_its_surface():
    """At the start and later, beside fluid at rest."""
    simulation, radius = rings(2, turning=2.0)
    run = recorded(simulation, (0.0, 0.2, 0.4))
    angle = np.linspace(0.0, 2 * np.pi, 37)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    expected = 2.0 * radius * np.stack([-way[:, 1], way[:, 0]], axis=1)
    for frame in range(3):
        found = run.on_points("velocity", radius * way, frame)
        assert found == pytest.approx(expected, abs=1e-6)
        assert np.isnan(run.on_points("velocity", 0.95 * radius * way, frame)).all()
        alone = run.on_points("velocity", radius * way, frame, groups="fluid")
        assert np.abs(alone - expected).max() > 0.05  # what was given before


def test_the_surface_goes_with_a_body():
    """A body that moves and turns: what is masked is where it is."""
    box = pc.Domain((0.0, 0.0), (2.0, 1.0), "xy")
    body = pc.Box((0.3, 0.4), (0.7, 0.6))
    filled = pc.fluid(box, WATER, SPACING, shape=~body)
    points = pc.fluid(box, WATER, SPACING, shape=body).points
    wall = Phase("body", WATER, points, SPACING**2, "wall", spacing=SPACING, surface=body)
    motion = pc.WallMotion("body", velocity=(1.5, 0.0), angular_velocity=np.pi, centre=(0.5, 0.5))
    simulation = pc.Simulation(box, [filled, wall], pc.SDPD(), boundaries=[motion])
    run = recorded(simulation, (0.0, 0.5))
    # a quarter of a turn: now 0.2 wide and 0.4 high about (1.25, 0.5)
    inside = np.array([(1.25, 0.68), (1.25, 0.32), (1.17, 0.5), (1.33, 0.6)])
    outside = np.array([(1.38, 0.5), (1.12, 0.5), (1.25, 0.73), (1.25, 0.27)])
    assert np.isnan(run.on_points("velocity", inside)).all()
    assert np.isfinite(run.on_points("velocity", outside)).all()


def test_species_are_where_they_are_held():
    """Two fluids beside each other, receptors on a membrane: none is smeared over the others."""
    box = pc.Domain((0.0, 0.0), (2.0, 1.0), "xy")
    left = pc.Box((0.0, 0.0), (1.0, 1.0))
    spot = Ball((1.5, 0.5), 0.2)
    phases = [
        pc.fluid(box, WATER, SPACING, shape=left, name="left"),
        pc.fluid(box, WATER, SPACING, shape=~(left | spot), name="right"),
    ]
    points = pc.fluid(box, WATER, SPACING, shape=spot).points
    rim = np.linalg.norm(points - [1.5, 0.5], axis=1) > 0.2 - 1.5 * SPACING
    for name, rows in (("membrane", rim), ("inner", ~rim)):
        extra = {"spacing": SPACING, "surface": spot}
        phases.append(Phase(name, WATER, points[rows], SPACING**2, "wall", **extra))
    species = [
        pc.Species("A", 1e-3, only_in="left"),
        pc.Species("B", 1e-3),
        pc.Species("R", 0.0, only_in="membrane"),
    ]
    simulation = pc.Simulation(box, phases, pc.Static(), species)
    for name, value in (("A", 1.0), ("B", 2.0), ("R", 3.0)):
        simulation.chemistry.set_concentration(name, value)
    run = recorded(simulation)
    places = np.array([(0.5, 0.5), (0.97, 0.5), (1.03, 0.5), (1.5, 0.675), (1.5, 0.5), (1.5, 0.72)])

    def shown(name):
        return run.on_points(f"concentration/{name}", places).round(9).tolist()

    nan = pytest.approx(np.nan, nan_ok=True)
    assert shown("A") == [1.0, 1.0, nan, nan, nan, nan]
    assert shown("B") == [2.0, 2.0, 2.0, nan, nan, 2.0]
    assert shown("R") == [nan, nan, nan, 3.0, nan, nan]
    # by name it is those particles, as far as they reach, but not into solids
    near = run.on_points("concentration/A", places, groups="left")
    assert near[:3] == pytest.approx(1.0)
    assert json.dumps([role.as_dict() for role in run.source.roles()])


def test_the_lid_of_a_cavity():
    box = pc.Domain((0.0, 0.0), (1.0, 1.0))
    walls = pc.box_walls(box, WATER, SPACING, sliding={"y-upper": (1.0, 0.0)})
    scheme = pc.TransportVelocity(reference_speed=1.0)
    simulation = pc.Simulation(box, [pc.fluid(box, WATER, SPACING), *walls], scheme)
    run = recorded(simulation)
    line = run.on_line("velocity", (0.5, 0.0), (0.5, 1.0), points=21)
    assert line[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert line[-1] == pytest.approx([1.0, 0.0], rel=1e-9, abs=1e-9)
    whole = run.on_grid("velocity", (10, 10))
    assert np.isfinite(whole).all()
    assert grid(box, 3).shape == (3, 3, 2)
