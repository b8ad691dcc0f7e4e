"""Mirrors: half of a symmetric flow is the whole, and fluid sticks to planes without slip."""

from __future__ import annotations

import copy
import itertools
from dataclasses import replace

import numpy as np
import pytest

import particell as pc
from particell.health import beyond
from particell.health.spacing import Spacing
from systems import same_bits, unit_fluid

WATER = unit_fluid(viscosity=0.5)
SCHEMES = {
    "SDPD": pc.SDPD(),
    # volumes are put right when lists are built: of the whole also where images have come too near
    "SDPD, shifted": pc.SDPD(shifting=0.5, support=2.6, skin=0.5),
    "SDPD, summed": pc.SDPD(density="summation"),
    "SDPD, trapezoidal": pc.SDPD(integrator="trapezoidal"),
    "TransportVelocity": pc.TransportVelocity(filter_every=3, density_diffusion=0.1),
    "TransportVelocity, normalised": pc.TransportVelocity(
        normalise_viscosity=True, momentum_flux="conserving", pressure_force="difference"
    ),
}


def plane(dim, axis, at, side, **options):
    """A mirror across an axis, with the fluid on one side of it."""
    point, normal = np.zeros(dim), np.zeros(dim)
    point[axis], normal[axis] = at, side
    return pc.Mirror(pc.HalfSpace(point, normal), **options)


def jittered(domain, by=0.2, seed=4):
    """A lattice of particles, displaced."""
    x = pc.lattice(domain, 1.0)
    return x + np.random.default_rng(seed).uniform(-by, by, x.shape)


def same_fields(part, whole, number, tolerance=1e-11):
    """Fields of the part, and of the first ``number`` particles of the whole."""
    for name in ("x", "v", "density", "pressure"):
        one, all_ = (s.particles.by_id(name) for s in (part, whole))
        scale = max(np.abs(all_).max(), 1.0)
        assert np.abs(one[:number] - all_[:number]).max() <= tolerance * scale, name


# --- the part is the whole --------------------------------------------------------------------
def in_a_corner(dim, whole, scheme, dt=0.01, **options):
    """Particles in front of one plane (in 2D two), with ends that are free, or the whole."""
    side, mirrors = {1: 12, 2: 6, 3: 4}[dim], {1: 1, 2: 2, 3: 1}[dim]
    x = jittered(pc.Domain((0,) * dim, (side,) * dim, depth=1.0))
    x[:, mirrors:] %= side
    v = np.random.default_rng(2).normal(0, 0.3, x.shape)
    if whole:
        signs = [(*s, *(1,) * (dim - mirrors)) for s in itertools.product((1, -1), repeat=mirrors)]
        x, v = (np.vstack([a * np.array(s) for s in signs]) for a in (x, v))
    end = 2 * side
    lower = [-end if whole and d < mirrors else 0 for d in range(dim)]
    upper = [end if d < mirrors else side for d in range(dim)]
    box = pc.Domain(lower, upper, periodic="xyz"[mirrors:dim], depth=1.0)
    phase = pc.Phase("fluid", WATER, x, 1.0, velocity=lambda _: v)
    planes = [] if whole else [plane(dim, d, 0.0, 1.0) for d in range(mirrors)]
    return pc.Simulation(box, phase, scheme, boundaries=planes, dt=dt, **options)


@pytest.mark.parametrize("name", SCHEMES)
def test_a_quarter_is_the_whole(name):
    """Uneven particles that move, in front of two planes."""
    part, whole = (in_a_corner(2, full, SCHEMES[name]) for full in (False, True))
    for simulation in (part, whole):
        simulation.advance(30)
    same_fields(part, whole, part.particles.n)
    assert part.particles.host("v").any(axis=1).all()
    ours, theirs = (Spacing(s).measure() for s in (part, whole))
    for one, all_ in zip(ours, theirs, strict=True):  # what health looks at
        order = [np.argsort(s.particles.host("id")) for s in (part, whole)]
        assert one[order[0]] == pytest.approx(all_[order[1]][: part.particles.n], abs=1e-9)


@pytest.mark.parametrize("dim", [1, 3])
def test_in_one_and_in_three_dimensions(dim):
    scheme = pc.TransportVelocity(support=1.7)
    part, whole = (in_a_corner(dim, full, scheme) for full in (False, True))
    for simulation in (part, whole):
        simulation.advance(12)
    same_fields(part, whole, part.particles.n)


def half_channel(whole, scheme):
    """Uneven particles between a plate and the middle of a channel, or two plates."""
    x = jittered(pc.Domain((0, 0), (8, 4), depth=1.0))
    if whole:
        x = np.vstack([x, np.array([0, 8]) + x * (1, -1)])
    box = pc.Domain((0, 0), (8, 8 if whole else 4), periodic="x", depth=1.0)
    walls = pc.channel_walls(pc.Domain((0, 0), (8, 8), "x", 1.0), WATER, 1.0, axis=1)
    phases = [pc.Phase("fluid", WATER, x, 1.0), *(walls if whole else walls[:1])]
    boundaries = [] if whole else [plane(2, 1, 4.0, -1.0)]
    return pc.Simulation(box, phases, scheme, boundaries=boundaries, dt=0.01)


@pytest.mark.parametrize("name", ["SDPD", "TransportVelocity"])
def test_half_a_channel_is_the_channel(name):
    """Also what is kept of volumes, and the sound speed's rule."""
    scheme = replace(SCHEMES[name], gravity=(0.5, 0.0))
    part, whole = (half_channel(full, scheme) for full in (False, True))
    for simulation in (part, whole):
        simulation.advance(60)
    same_fields(part, whole, 32)
    counts = [s.conservation() for s in (part, whole)]
    assert counts[0].keys() == counts[1].keys()
    kept = [c.get("volume put right", 0.0) for c in counts]
    assert kept[0] == pytest.approx(kept[1], abs=1e-12)
    found = [[f.name for f in beyond(s.health())] for s in (part, whole)]
    assert found[0] == found[1]


def test_the_profile_of_half_a_channel():
    """Exact on lattices for the normalised viscosity beside walls."""
    box = pc.Domain((0, 0), (6, 5), periodic="x", depth=1.0)
    walls = pc.channel_walls(box, WATER, 1.0, axis=1)[:1]
    scheme = pc.TransportVelocity(normalise_viscosity=True, gravity=(0.01, 0.0))

    def profile(x):
        return np.stack([0.01 * x[:, 1] * (10 - x[:, 1]) / (2 * 0.5), 0 * x[:, 1]], axis=1)

    inside = pc.fluid(box, WATER, 1.0, velocity=profile)
    mirror = plane(2, 1, 5.0, -1.0)
    simulation = pc.Simulation(box, [inside, *walls], scheme, boundaries=[mirror], dt=0.02)
    simulation.advance(500)
    fluid = simulation.particles.host("is_wall") == 0
    x, v = (simulation.particles.host(name)[fluid] for name in ("x", "v"))
    assert np.abs(v - profile(x)).max() < 1e-3 * v.max()


# --- without slip -----------------------------------------------------------------------------
def couette(speed=1.0, height=6, scheme=None, velocity=None, **options):
    """A plane that rests and one that moves, without a particle of either."""
    box = pc.Domain((0, 0), (8, height), periodic="x", depth=1.0)
    planes = [
        plane(2, 1, 0.0, 1.0, slip=False),
        plane(2, 1, height, -1.0, slip=False, velocity=(speed, 0.0)),
    ]
    inside = pc.fluid(box, WATER, 1.0, velocity=velocity)
    scheme = scheme or pc.TransportVelocity(normalise_viscosity=True)
    return pc.Simulation(box, inside, scheme, boundaries=planes, **options)


@pytest.mark.parametrize("name", ["SDPD", "TransportVelocity, normalised"])
def test_plane_couette_flow_is_exact(name):
    """Shear is exact on a lattice, to round-off, and stays while the lattice is sheared."""
    line = lambda x: np.stack([x[:, 1] / 6, 0 * x[:, 1]], axis=1)  # noqa: E731
    simulation = couette(scheme=SCHEMES[name], velocity=line, dt=0.01)
    simulation.start()
    assert np.abs(simulation.particles.host("a")).max() < 1e-12
    simulation.advance(50)
    x, v = (simulation.particles.host(k) for k in ("x", "v"))
    assert np.abs(v - line(x)).max() < 1e-3


@pytest.mark.parametrize("height", [8, 16])
def test_couette_flow_that_starts(height):
    """The series of the plate that is set in motion, to second order in the spacing."""
    nu = 0.5
    simulation = couette(height=height, dt=0.02)
    for time in (0.07 * height**2 / nu, 0.14 * height**2 / nu):
        simulation.advance(round((time - simulation.time) / 0.02))
        x, v = (simulation.particles.host(k) for k in ("x", "v"))
        y, k = x[:, 1] / height, np.arange(1, 60)[:, None]
        decay = np.exp(-nu * (k * np.pi / height) ** 2 * simulation.time)
        exact = y + (2 / np.pi * (-1.0) ** k / k * np.sin(k * np.pi * y) * decay).sum(axis=0)
        assert np.abs(v[:, 0] - exact).max() < 1.2 / height**2
    assert np.abs(v[:, 1]).max() < 1e-3


def test_the_speed_of_planes_counts():
    """For the sound speed and for the step, as that of walls."""
    soft = pc.Fluid(density=1.0, viscosity=0.5)
    box = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
    lid = plane(2, 1, 8.0, -1.0, slip=False, velocity=(3.0, 0.0))
    made = pc.Simulation(box, pc.fluid(box, soft, 1.0), pc.SDPD(), boundaries=[lid])
    assert made.materials[0].sound_speed >= 30.0


# --- what else there is -----------------------------------------------------------------------
def test_concentrations_beside_a_mirror_stay_on_their_side():
    """A mirror is a closed end: those of the whole, within the second order of closed ends."""
    n = 16
    decay = []
    for whole in (False, True):
        box = pc.Domain((-n if whole else 0, 0), (n, 7), periodic="xy" if whole else "y", depth=1.0)
        ends = [] if whole else [plane(2, 0, 0.0, 1.0), plane(2, 0, n, -1.0)]
        species = [pc.Species("A", 1.0), pc.Species("M", 1.0, molecules=True)]
        inside = pc.fluid(box, WATER, 1.0)
        made = pc.Simulation(box, inside, pc.SDPD(), species, boundaries=ends, dt=0.02)
        made.chemistry.set_concentration("A", lambda x: 2 + np.cos(np.pi * x[:, 0] / n))
        made.chemistry.set_count("M", 30)
        made.advance(1000)
        drift = made.conservation()
        assert abs(drift["amount A"]) < 1e-12 and drift["amount M"] == 0
        x, c = made.particles.host("x"), made.chemistry.concentration("A")
        decay.append(c[x[:, 0] > 0] - 2)
        exact = np.cos(np.pi * x[:, 0] / n) * np.exp(-((np.pi / n) ** 2) * made.time)
        assert np.abs(c - 2 - exact).max() < 3e-3
    assert np.sort(decay[0]) == pytest.approx(np.sort(decay[1]), abs=3e-3)


def test_what_crosses_is_put_back_and_counted():
    box = pc.Domain((0, 0), (8, 4), periodic="x", depth=1.0)
    phase = pc.Phase("fluid", WATER, np.array([[1.0, 0.1], [4.0, 3.5]]), 1.0,
                     velocity=lambda x: np.where(x[:, 1:] < 1, [[0.0, -9.0]], 0.0))  # fmt: skip
    floor = plane(2, 1, 0.0, 1.0)
    simulation = pc.Simulation(box, phase, pc.SDPD(), boundaries=[floor], dt=0.02)
    simulation.advance(3)
    assert simulation.conservation()["reflections"] == 1
    assert simulation.particles.by_id("x")[0, 1] > 0


def test_momentum_that_a_mirror_takes_up_is_no_drift():
    simulation = in_a_corner(2, False, pc.SDPD())
    before = simulation.monitor.momentum()
    simulation.advance(20)
    assert np.abs(simulation.monitor.momentum() - before).max() > 1e-3
    assert simulation.conservation()["momentum"] < 1e-12


def test_averages_at_a_mirror():
    """Fits of linear functions, there as at any end: exact, but for the shear of the lattice."""
    line = lambda x: np.stack([x[:, 1] / 6, 0 * x[:, 1]], axis=1)  # noqa: E731
    simulation = couette(scheme=SCHEMES["SDPD"], velocity=line, dt=0.01)
    at = np.array([[3.0, 0.0], [3.0, 2.0], [3.0, 6.0]])
    run = simulation.run(0.1, every=0.1, progress=False, averages=pc.TimeAverage(at, ["velocity"]))
    assert run.average("velocity")[:, 0] == pytest.approx(at[:, 1] / 6, abs=1e-7)


@pytest.mark.parametrize("name", ["SDPD", "TransportVelocity"])
def test_forms_and_restarts(name):
    """Lanes have images as rows have, and a run goes on bit for bit."""
    one = in_a_corner(2, False, SCHEMES[name])
    assert set(one.solver.forms().values()) == {"lanes"}
    rows = in_a_corner(2, False, SCHEMES[name], device=pc.Device(form="gather"))
    assert set(rows.solver.forms().values()) == {"gather"}
    one.advance(10)
    rows.advance(10)
    same_fields(one, rows, one.particles.n, 1e-12)
    state = copy.deepcopy(one.state())
    one.advance(10)
    resumed = in_a_corner(2, False, SCHEMES[name])
    resumed.restore(state)
    resumed.advance(10)
    assert same_bits(one, resumed) == []


def test_a_checkpoint_of_other_mirrors_is_refused():
    state = couette(speed=1.0, dt=0.01).state()
    with pytest.raises(pc.InputError, match="boundaries of the checkpoint"):
        couette(speed=2.0, dt=0.01).restore(state)


HOT = unit_fluid(temperature=1e20)
BOX = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
FLOOR, SIDE = plane(2, 1, 0.0, 1.0), plane(2, 0, 0.0, 1.0)


def made(scheme=None, boundaries=(FLOOR,), box=BOX, fluid=WATER, walls=False, **options):
    phases = [pc.fluid(box, fluid, 1.0)]
    phases += pc.channel_walls(box, fluid, 1.0, axis=1) if walls else []
    return pc.Simulation(box, phases, scheme or pc.SDPD(), boundaries=list(boundaries), **options)


@pytest.mark.parametrize(
    ("match", "build"),
    [
        ("scheme", lambda: made(pc.Static())),
        ("fluctuations", lambda: made(pc.SDPD(fluctuations=True), fluid=HOT)),
        ("species_flux", lambda: made(pc.TransportVelocity(species_flux=True))),
        ("gravity", lambda: made(pc.SDPD(gravity=(0.0, -1.0)))),
        ("gravity", lambda: made(forces=[pc.Buoyancy("A", 1.0, (0.0, 1.0))],
                                 species=[pc.Species("A")])),
        ("periodic axis", lambda: made(boundaries=[SIDE])),
        ("2 dimensions", lambda: made(boundaries=[plane(3, 1, 0.0, 1.0)])),
        ("further than the support", lambda: made(walls=True)),
        ("in front of the Mirror", lambda: made(boundaries=[plane(2, 1, 4.0, 1.0)])),
        ("in front of the Mirror", lambda: made(boundaries=[plane(2, 1, 0.5, 1.0)])),
        ("parallel", lambda: made(boundaries=[FLOOR, plane(2, 1, 2.9, -1.0)],
                                  box=pc.Domain((0, 0), (8, 2), periodic="x", depth=1.0))),
        ("right angles", lambda: made(box=pc.Domain((0, 0), (8, 8), depth=1.0), boundaries=[
            pc.Mirror(pc.HalfSpace((0, 0), (1, 0))), pc.Mirror(pc.HalfSpace((0, 0), (1, 1)))])),
        ("velocity", lambda: plane(2, 1, 0.0, 1.0, velocity=(1.0, 0.0))),
        ("along the plane", lambda: plane(2, 1, 0.0, 1.0, slip=False, velocity=(1.0, 0.1))),
        ("2 numbers", lambda: plane(2, 1, 0.0, 1.0, slip=False, velocity=(1.0,))),
    ],
)  # fmt: skip
def test_refused(match, build):
    with pytest.raises(pc.InputError, match=match):
        build()


def test_walls_that_come_near_are_refused():
    box = pc.Domain((0, 0), (20, 30), periodic="x", depth=1.0)
    ball = pc.Circle((10, 12), 3.0)
    phases = [pc.fluid(box, WATER, 1.0, ~ball)]
    points, areas = pc.rings(ball, 0.0, 3.0, 1.0)
    phases.append(pc.Phase("cell", WATER, points, areas, kind="wall", spacing=1.0, surface=ball))

    def build(**motion):
        motions = [FLOOR, pc.WallMotion("cell", **motion)]
        return pc.Simulation(box, phases, pc.SDPD(reference_speed=1.0), boundaries=motions)

    build(angular_velocity=1.0, centre=(10.0, 12.0))
    build(velocity=(1.0, 0.0))
    for motion in (
        {"velocity": (0.0, -1.0)},
        {"angular_velocity": 1.0, "centre": (10.0, 6.0)},
        {"displacement": lambda t: np.array([0.0, np.sin(t)])},
    ):
        with pytest.raises(pc.InputError, match="WallMotion of 'cell'"):
            build(**motion)
