from __future__ import annotations

import numpy as np
import pytest

from particell.boundaries.wall import (
    CLOSEST,
    FLAT,
    LEAST_RADIUS,
    extrapolation,
    layer_profile,
    missed,
    surface_distance,
)
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.phases import box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import channel, fluid_rows, forces, lattice_offsets, unit_fluid


def distance(t, n, curvature):
    t, n = (np.concatenate([a, np.zeros(3 - len(a))]) for a in (t, n))
    return surface_distance(*t, *n, curvature)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_distance_from_a_plane(dim):
    random = np.random.default_rng(1)
    for _ in range(50):
        normal, t = random.normal(size=(2, dim))
        normal /= np.linalg.norm(normal)
        assert distance(t, normal, 0.0) == pytest.approx(t @ normal, abs=1e-14)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("inside", [False, True])
def test_distance_from_a_ball(dim, inside):
    """Exact wherever the fluid particle and the surface point are."""
    random, radius = np.random.default_rng(2), 1.7
    side = -1.0 if inside else 1.0
    for _ in range(100):
        outward, place = random.normal(size=(2, dim))
        outward /= np.linalg.norm(outward)
        place *= random.uniform(0.1, 0.99 if inside else 3) * radius / np.linalg.norm(place)
        t = place - radius * outward
        exact = side * (np.linalg.norm(place) - radius)
        assert distance(t, side * outward, side / radius) == pytest.approx(exact, abs=1e-13)


def test_extrapolation_is_bounded():
    assert extrapolation(1.0, 0.5, 3.0, 0.0, 3) == 1.5
    assert extrapolation(0.0, 0.5, 3.0, 0.0, 2) == 1 + 0.5 / (CLOSEST * 3)
    nearest = extrapolation(0.0, 0.5, 3.0, 0.0, 2)
    assert extrapolation(-1.0, 0.5, 3.0, 0.0, 2) == nearest
    for dim in (2, 3):  # deeper than the middle of a body, and beyond that of a cavity
        deepest = layer_profile(-(1 - LEAST_RADIUS), 1.0, dim)
        assert layer_profile(-1.5, 1.0, dim) == pytest.approx(deepest)
        assert np.isfinite(extrapolation(3.0, 2.0, 3.0, -1.0, dim))


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("curvature", [0.0, 0.3, -0.2, 1e-5])
def test_the_layers_profile_is_harmonic(dim, curvature):
    """r^(D−1) s' is 1 on both sides of the surface, where r is 1 + k d; s is 0 on it."""
    assert layer_profile(0.0, curvature, dim) == 0.0
    step = 1e-4
    for d in (-2.0, -0.5, 0.01, 1.0, 3.0):
        slope = layer_profile(d + step, curvature, dim) - layer_profile(d - step, curvature, dim)
        flux = slope / (2 * step) * (1 + curvature * d) ** (dim - 1)
        assert flux == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_layers_profile_has_no_step_where_it_is_taken_for_a_plane(dim):
    for sign in (-1, 1):
        planar = layer_profile(0.999 * sign * FLAT, 1.0, dim)
        curved = layer_profile(1.001 * sign * FLAT, 1.0, dim)
        assert curved / planar == pytest.approx(1.001 / 0.999, rel=2 * FLAT)


def test_what_is_missed_is_exact_for_parabolas():
    """u = α d + L d²/2 at d = −d_j, less what the straight line through u(d_i) gives."""
    alpha, bend, above, depth = 0.7, -0.3, 0.9, 1.4
    profile = lambda d: alpha * d + 0.5 * bend * d**2  # noqa: E731
    grow = extrapolation(above, depth, 3.0, 0.0, 2)
    extrapolated = profile(above) * (1 - grow)
    gap = profile(-depth) - extrapolated
    assert gap == pytest.approx(bend * missed(above, depth, 3.0, grow), rel=1e-14)


def residual(ny, velocity, gravity, wall_velocity=(None, None), extrapolated=True):
    """Root mean square of the acceleration that should vanish, with viscosity 1."""
    simulation = channel(
        (8, ny),
        unit_fluid(viscosity=1.0, sound_speed=1.0),
        velocity=velocity,
        wall_velocity=wall_velocity,
        gravity=gravity,
    )
    if not extrapolated:
        simulation.particles.set("wall_depth", 0.0)
    simulation.start()
    a = simulation.particles.host("a")[fluid_rows(simulation)]
    return float(np.sqrt((a**2).mean(axis=0).sum()))


def steady_profile(ny, extrapolated=True):
    """Heights and steady velocity under a uniform force along the channel, f H²/(8 ν) = 1.

    The viscous force on a resting lattice is a linear function of the rows' velocities: its matrix,
    column by column, from the sweep itself.
    """
    simulation = channel((8, ny), unit_fluid(viscosity=1.0, sound_speed=1.0))
    if not extrapolated:
        simulation.particles.set("wall_depth", 0.0)
    simulation.start()
    p = simulation.particles
    inside = fluid_rows(simulation)
    row = np.floor(p.host("x")[:, 1]).astype(int)
    first = [np.flatnonzero(inside & (row == k))[0] for k in range(ny)]
    matrix = np.empty((ny, ny))
    for k in range(ny):
        p.set("v", ((row == k) & inside)[:, None] * np.array([1.0, 0.0]))
        forces(simulation, 0, 1.0)
        matrix[:, k] = p.host("a")[first, 0]
    return p.host("x")[first, 1] / ny, np.linalg.solve(matrix, np.full(ny, -8 / ny**2))


def test_poiseuille_profile_is_exact_but_for_the_kernel_sum():
    """With layers of constant velocity it is of first order."""
    offsets, f = lattice_offsets(2, 3.0)
    kernel_sum = 0.5 * (f * (offsets**2).sum(axis=1)).sum()
    bad = []
    for ny in (6, 10, 20, 40):
        s, u = steady_profile(ny)
        assert u * kernel_sum == pytest.approx(4 * s * (1 - s), abs=1e-11)
        s, u = steady_profile(ny, extrapolated=False)
        bad.append(float(np.sqrt(((u - 4 * s * (1 - s)) ** 2).mean())))
    assert np.log2(bad[-2] / bad[-1]) < 1.2


SCHEMES = {
    "sdpd": lambda g: SDPD(density_diffusion=0.0, gravity=g),
    "transport": lambda g: TransportVelocity(gravity=g),
    "normalised": lambda g: TransportVelocity(normalise_viscosity=True, gravity=g),
}


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("dim", [2, 3])
def test_friction_beside_a_plane_is_exact_for_a_parabola(dim, scheme):
    """The force on u = α d + L d²/2 is ρν L times the bulk's own factor in every row, 3D too.

    That of the bulk is the kernel's sum for shear, with the radial friction in 3D a sum of fourth
    moments: whatever it is, rows beside the walls have the same to within 2 % (3D with radial
    friction, where C is a mean over directions) or to round-off.
    """
    side = (9, 12) if dim == 2 else (9, 12, 9)
    domain = Domain((0,) * dim, side, periodic="xz"[: dim - 1], depth=1.0)
    material = unit_fluid(viscosity=1.0, sound_speed=1.0)

    def velocity(x):
        u = np.zeros_like(x)
        u[:, 0] = x[:, 1] * (12 - x[:, 1])
        return u

    inside = fluid(domain, material, 1.0, velocity=velocity)
    walls = box_walls(domain, material, 1.0)
    simulation = Simulation(domain, [inside, *walls], SCHEMES[scheme]((0.0,) * dim))
    simulation.start()
    rows = fluid_rows(simulation)
    a, y = simulation.particles.host("a")[rows], simulation.particles.host("x")[rows, 1]
    bulk = a[np.abs(y - 6) < 1, 0].mean()
    assert bulk == pytest.approx(-2.0, rel=1e-12 if scheme == "normalised" else 0.04)
    radial = dim == 3 and scheme == "sdpd"
    assert a[:, 0] == pytest.approx(bulk, rel=2e-2 if radial else 1e-11)


def test_couette_profile_is_exact_between_walls():
    """A linear profile is continued exactly through both walls: no acceleration at all."""
    moving = (None, (1.0, 0.0))
    velocity = lambda x: np.stack([x[:, 1] / 20, 0 * x[:, 1]], axis=-1)  # noqa: E731
    scale = residual(20, velocity, None, moving, extrapolated=False)
    assert residual(20, velocity, None, moving) < 1e-11 * scale


def test_wall_pressure_continues_the_hydrostatic_one():
    simulation = channel((8, 12), unit_fluid(exponent=1.0), gravity=(0.0, -1e-3))
    p = simulation.particles
    height = p.host("x")[:, 1]
    p.set("density", np.where(p.host("is_wall"), 1.0, 1 + 1e-5 * (6 - height)))
    simulation.start()
    height, pressure = p.host("x")[:, 1], p.host("pressure")
    near = (p.host("is_wall") != 0) & (height > -2) & (height < 14)
    # densities differ from 1 by up to 6e-5, and heads of up to 3 spacings with them
    assert pressure[near] == pytest.approx(1e-3 * (6 - height[near]), abs=6e-5 * 3e-3)


@pytest.mark.parametrize("slides", [None, "x-lower", "y-upper"])
@pytest.mark.parametrize("dim", [2, 3])
def test_walls_of_a_closed_box_continue_the_lattice(dim, slides):
    """Layers all around, corners included, each place once; normals into the box."""
    sides = (4, 5, 6)[:dim]
    sliding = {slides: (1.0,) * dim} if slides else None
    walls = box_walls(Domain((0,) * dim, sides), unit_fluid(), 1.0, layers=2, sliding=sliding)
    assert len(walls) == 2 * dim
    points = np.concatenate([w.points for w in walls])
    outside = np.prod([s + 4 for s in sides]) - np.prod(sides)
    assert len(points) == outside == len(np.unique(points, axis=0))
    assert np.all((points > -2) & (points < np.array(sides) + 2))
    for wall in walls:
        centre = np.full((1, dim), 2.0)
        assert wall.surface.signed_distance(wall.points).max() < 0
        assert wall.surface.signed_distance(centre)[0] > 0
        assert wall.slides == (wall.name == f"wall-{slides}")
        if wall.slides:  # and does not go on beyond the box
            own = "xyz".index(slides[0])
            along = np.delete(wall.points, own, axis=1)
            assert np.all((along > 0) & (along < np.delete(np.array(sides), own)))
            assert np.all(wall.velocities() == 1.0)


def test_a_box_has_no_walls_across_periodic_axes():
    """A duct: four walls, corners included, each place once."""
    domain = Domain((0, 0, 0), (4, 5, 6), periodic="x")
    walls = box_walls(domain, unit_fluid(), 1.0, layers=2)
    assert [w.name for w in walls] == [f"wall-{a}-{s}" for a in "yz" for s in ("lower", "upper")]
    points = np.concatenate([w.points for w in walls])
    assert len(points) == 4 * (9 * 10 - 5 * 6) == len(np.unique(points, axis=0))
    assert np.all((points[:, 0] > 0) & (points[:, 0] < 4))
    with pytest.raises(InputError, match="not periodic"):
        box_walls(Domain((0, 0), (4, 4), periodic="xy"), unit_fluid(), 1.0)


def test_a_side_that_is_not_there_does_not_slide():
    with pytest.raises(InputError, match="x-lower, x-upper, y-lower, y-upper"):
        box_walls(Domain((0, 0), (4, 4)), unit_fluid(), 1.0, sliding={"z-upper": (1.0, 0.0)})
