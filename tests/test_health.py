"""Each check of a run's health fires on what was made wrong, and not on the right one."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

import particell as pc
from particell.cli import call
from particell.errors import HealthWarning
from particell.health import beyond, foresee
from particell.health.finding import Finding
from systems import UNIT_TEMPERATURE, unit_fluid

WATER = unit_fluid(viscosity=0.1)


def channel(scheme=None, layers=3, wall_spacing=1.0, velocity=(0.1, 0.0), material=WATER):
    box = pc.Domain((0, 0), (10, 12), periodic="x", depth=1.0)
    walls = pc.channel_walls(box, material, wall_spacing, axis=1, layers=layers)
    filled = pc.fluid(box, material, 1.0, velocity=velocity)
    return pc.Simulation(box, [filled, *walls], scheme or pc.SDPD())


def names(findings) -> list[str]:
    return [f.name.split()[0] + " " + f.name.split()[1] for f in beyond(findings)]


def test_a_finding():
    most = Finding("it", 2.0, 1.0, "too much")
    assert not most.passed and "it 2, above 1: too much" in most.line
    assert Finding("it", 2.0, 1.0, "", least=True).passed
    assert not Finding("it", np.nan, 1.0, "").passed
    assert "sentence" in most.as_dict() and "sentence" not in Finding("it", 0.0, 1.0, "x").as_dict()


@pytest.mark.parametrize("scheme", [pc.SDPD(), pc.TransportVelocity(), pc.SDPD(shifting=0.5)])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_right_channel_is_healthy(scheme, dim):
    side = (8, 10, 8)[:dim]
    box = pc.Domain((0,) * dim, side, periodic="xz"[: dim - 1], depth=1.0)

    def parabola(x):
        u = np.zeros_like(x)
        u[:, 0] = 0.4 * x[:, 1] * (10 - x[:, 1]) / 100
        return u

    phases = [pc.fluid(box, WATER, 1.0, velocity=parabola)]
    phases += pc.channel_walls(box, WATER, 1.0, axis=1)
    simulation = pc.Simulation(box, phases, scheme)
    simulation.advance(20)
    found = simulation.health()
    assert names(found) == []
    assert len(found) == 10


def test_thin_walls_and_those_of_another_spacing():
    thin = channel(layers=2)
    assert names(foresee(thin)) == ["wall layers:"]
    assert "at least 3 layers" in beyond(foresee(thin))[0].line
    assert names(foresee(channel(pc.SDPD(support=2.0), layers=2))) == []
    assert names(foresee(channel(pc.SDPD(kernel="wendland-c2", support=4.0)))) == ["wall layers:"]
    coarse = foresee(channel(pc.SDPD(support=4.0), layers=4, wall_spacing=0.5))
    assert "wall spacing" in names(coarse)


@pytest.mark.parametrize(
    ("scheme", "sound_speed", "said"),
    [
        ({}, 30.0, None),
        ({"support": 2.4, "kernel": "wendland-c2"}, 30.0, None),
        ({"support": 2.0, "kernel": "wendland-c2"}, 30.0, "larger support, 2.5 to 3"),
        ({"support": 2.0, "kernel": "quintic-spline"}, 30.0, "larger support, 2.5 to 3"),
        ({"support": 4.5}, 30.0, "from 2 to 4 spacings in 2D, not for 4.5"),
        ({}, 300.0, "from 0.0001 to 0.004 in 2D"),
        ({}, 8.0, "give another sound_speed"),
        ({"density": "continuity"}, 300.0, None),
        ({"fluctuations": False}, 300.0, None),
    ],
)
def test_noise_that_was_not_measured_or_makes_a_soft_fluid(scheme, sound_speed, said):
    hot = unit_fluid(viscosity=20.0, sound_speed=sound_speed, temperature=UNIT_TEMPERATURE)
    box = pc.Domain((0, 0), (14, 14), periodic="xy", depth=1.0)
    given = pc.SDPD(**{"fluctuations": True, "density": "summation", **scheme})
    found = beyond(foresee(pc.Simulation(box, pc.fluid(box, hot, 1.0), given)))
    assert [said in f.line for f in found] == ([True] if said else [])


def test_a_plate_between_two_fluids_is_seen_through():
    box = pc.Domain((0, 0), (12, 24), periodic="xy", depth=1.0)
    for thickness, thin in ((2, True), (3, False)):
        plate = pc.Box([-np.inf, 12 - thickness], [np.inf, 12])
        wall = pc.fluid(box, WATER, 1.0, plate)
        wall = pc.Phase("plate", WATER, wall.points, 1.0, kind="wall", surface=plate)
        both = pc.Simulation(box, [pc.fluid(box, WATER, 1.0, ~plate), wall], pc.SDPD())
        assert bool(beyond(foresee(both))) is thin


def test_bodies_and_boxes_have_walls_that_are_thick_enough():
    box, ball = pc.Domain((0, 0), (20, 20), depth=1.0), pc.Circle((10, 10), 3.0)
    points, areas = pc.rings(ball, 0.0, 3.0, 1.0)
    body = pc.Phase("body", WATER, points, areas, kind="wall", spacing=1.0, surface=ball)
    phases = [pc.fluid(box, WATER, 1.0, ~ball), body, *pc.box_walls(box, WATER, 1.0)]
    assert names(foresee(pc.Simulation(box, phases, pc.SDPD()))) == []
    cube = pc.Domain((0, 0, 0), (6, 6, 6))
    phases = [pc.fluid(cube, WATER, 1.0), *pc.box_walls(cube, WATER, 1.0)]
    assert names(foresee(pc.Simulation(cube, phases, pc.SDPD()))) == []


def test_a_flow_as_fast_as_sound():
    assert "Mach number" in names(channel(velocity=(4.0, 0.0)).health())
    box = pc.Domain((0, 0), (10, 10), periodic="xy", depth=1.0)  # a stream has no speed of its own
    stream = pc.Simulation(box, pc.fluid(box, WATER, 1.0, velocity=(9.0, 0.0)), pc.SDPD())
    assert names(stream.health()) == []


def test_density_voids_clumps_and_what_is_outside():
    simulation = channel()
    simulation.start()
    simulation.watch.look()
    particles = simulation.particles
    mobile = np.flatnonzero(particles.host("is_wall") == 0)
    density = particles.host("density").copy()
    density[mobile[:10]] *= 1.1
    particles.set("density", density)
    x = particles.host("x").copy()
    inner = mobile[np.argsort(np.linalg.norm(x[mobile] - [5, 6], axis=1))]
    x[inner[:8]] = x[inner[60:68]] + 0.1  # leaves a void, makes eight pairs
    x[inner[-1], 1] = -0.4
    particles.set("x", x)
    simulation.solver.build_list()
    found = names(simulation.health())
    assert {"change of", "space filled", "part of"} <= set(found)
    assert found.count("part of") == 2


def test_the_worst_of_all_frames_counts_and_is_kept(tmp_path):
    thick = unit_fluid(viscosity=5.0)
    simulation = channel(velocity=(4.0, 0.0), material=thick)
    with pytest.warns(HealthWarning) as caught:
        run = simulation.run(20.0, every=2.0, out=tmp_path, progress=False)
    assert any("Mach number" in str(w.message) for w in caught)
    assert all("\n" not in str(w.message) for w in caught)
    assert "Mach number" in names(run.health)
    assert simulation.monitor.largest_speed() < 0.25 * 10  # friction has slowed it down
    again = channel(velocity=(4.0, 0.0), material=thick)
    again.restore(simulation.state())
    assert [f.value for f in again.health()] == [f.value for f in simulation.health()]


def test_slip_and_scatter():
    """Random velocities; and plug flow, which has slip but no scatter."""
    plug = channel(velocity=(0.2, 0.0)).health()
    assert names(plug) == ["slip at"]
    value = next(f.value for f in plug if f.name.startswith("slip"))
    assert value == pytest.approx(1.0, abs=1e-6)
    random = np.random.default_rng(1).normal(0, 0.1, (120, 2))
    assert "scatter of" in names(channel(velocity=random).health())


def test_noise_is_allowed_for():
    """Thermal motion is no scatter and no clump, and has a part in Mach number and density."""
    box = pc.Domain((0, 0), (16, 16), periodic="xy", depth=1.0)
    warm = pc.Fluid(1.0, 5.0, temperature=1 / 1.380649e-23, sound_speed=10.0)
    scheme = pc.SDPD(fluctuations=True, density="summation")
    simulation = pc.Simulation(box, pc.fluid(box, warm, 1.0), scheme, seed=1)
    run = simulation.run(simulation.dt * 400, progress=False)
    assert names(run.health) == []
    assert len(run.health) == 7


def test_a_particle_that_has_lost_all_others():
    box = pc.Domain((0, 0), (20, 20), depth=1.0)
    points = np.concatenate([pc.lattice(pc.Domain((0, 0), (8, 8)), 1.0), [[15.0, 15.0]]])
    lone = pc.Phase("fluid", WATER, points, 1.0)
    assert names(pc.Simulation(box, lone, pc.SDPD()).health()) == ["neighbours of"]
    assert names(pc.Simulation(box, lone, pc.Static()).health()) == []


def waves(number, diffusivity=1e-3, **options):
    box = pc.Domain((0, 0), (24, 24), periodic="xy", depth=1.0)
    made = pc.Simulation(
        box, pc.fluid(box, WATER, 1.0), pc.Static(), [pc.Species("C", diffusivity, **options)]
    )
    made.chemistry.set_concentration(
        "C", lambda x: 1 + np.round(1e6 * np.sin(2 * np.pi * number * x[:, 0] / 24)) / 1e6
    )
    return made


@pytest.mark.parametrize(("number", "resolved"), [(1, True), (2, True), (4, False), (8, False)])
def test_waves_of_a_concentration(number, resolved):
    found = waves(number).health()
    assert (names(found) == []) is resolved
    value = next(f.value for f in found if f.name.startswith("particles per wave"))
    expected = 2 * np.pi / np.sqrt(2 * (1 - np.cos(2 * np.pi * number / 24)))
    assert value == pytest.approx(expected, rel=0.01)
    assert names(waves(number, diffusivity=0.0).health()) == []  # what rides has no waves


def test_concentrations_of_few_molecules():
    simulation = waves(1)
    simulation.chemistry.set_concentration("C", 50 / 6.02214076e23 / 576)
    assert names(simulation.health()) == ["molecules of"]
    simulation.chemistry.set_concentration("C", 500 / 6.02214076e23 / 576)
    assert names(simulation.health()) == []


THIN = """
[domain]
lower = [0, 0]
upper = ["10 um", "10 um"]
periodic = "x"
[materials.water]
density = 1000
viscosity = 1e-3
[[phases]]
type = "fluid"
material = "water"
spacing = "1 um"
[[phases]]
type = "channel_walls"
material = "water"
spacing = "1 um"
axis = 1
layers = LAYERS
[scheme]
type = "SDPD"
reference_speed = "1 mm/s"
[run]
until = "1 us"
"""


def test_the_command_line_says_so(tmp_path, capsys):
    for layers, status in ((2, 1), (3, 0)):
        file, out = tmp_path / f"{layers}.toml", tmp_path / f"out{layers}"
        file.write_text(THIN.replace("LAYERS", str(layers)))
        assert call(["check", str(file), "--no-timing"]) == status
        assert ("health:    wall layers" in capsys.readouterr().out) is bool(status)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert call(["run", str(file), "--out", str(out), "--no-progress"]) == status
        assert ("health: FAILED: wall layers" in capsys.readouterr().out) is bool(status)
        summary = json.loads((out / "summary.json").read_text())["health"]
        wrong = [name for name, found in summary.items() if not found["passed"]]
        assert [name[:11] for name in wrong] == ["wall layers"] * status
        assert [f.name for f in beyond(pc.Run(out).health)] == wrong
