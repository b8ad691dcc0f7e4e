"""Species that only some particles carry: membranes of a few layers, channels, open edges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import jvp, yvp

from particell.chemistry.engine import Chemistry
from particell.chemistry.reservoirs import FixedValueWall, Reservoir
from particell.chemistry.species import Species
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.errors import RunError
from particell.geometry.domain import Domain
from particell.particles import Group, Particles

KAPPA = 1e-10
SPACING = 1e-6
OTHER = Group("other", "wall", 0)


def grid(*numbers):
    """Points of a lattice of spacing 1, (n, dim)."""
    lines = [np.arange(k) + 0.5 for k in numbers]
    return np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, len(numbers))


def system(points, volumes, support, period, species=None, boundaries=(), group=None, **options):
    """Chemistry of particles at points (in spacings); ``period`` has 0 for what is not periodic."""
    points = np.asarray(points, float)
    n, dim = points.shape
    lower = np.where(np.array(period) > 0, 0.0, points.min(axis=0) - 2 * support) * SPACING
    upper = np.where(np.array(period) > 0, period, points.max(axis=0) + 2 * support) * SPACING
    axes = "".join(a for a, p in zip("xyz", period, strict=False) if p)
    device = Device()
    domain = Domain(tuple(lower), tuple(upper), periodic=axes)
    groups = [Group("layer", "fluid", 0), OTHER]
    particles = Particles(device, n, dim, groups)
    particles.set("x", points * SPACING)
    particles.set("support", support * SPACING)
    particles.set("density", 1000.0)
    particles.set("mass", 1000.0 * np.broadcast_to(volumes, n) * SPACING**dim)
    if group is not None:
        particles.set("group", group.astype(np.int32))
        particles.set("is_wall", (group == 1).astype(np.uint8))
    reach = support * SPACING
    neighbours = NeighbourList(
        device, domain, particles, reach, 0.1 * reach, lower, upper, True, group is not None
    )
    species = species or [Species("A", KAPPA, only_in="layer")]
    Chemistry.add_fields(particles, species)
    neighbours.build(particles)
    options.setdefault("kernel", "lucy")
    return Chemistry(
        device,
        particles,
        neighbours,
        species,
        (),
        boundaries,
        depth=SPACING ** (3 - dim),
        **options,
    )


def rates(chem):
    """Weights of the engine over κ, spacings as units of length: (n, n), and volumes (n,)."""
    if not chem._diffusion.measured:
        chem.step(0, 1e-9)
    p, rows = chem.particles, chem.neighbours.fields
    weights = np.zeros((p.n, p.n))
    exchange = chem._diffusion.exchanges[0].fields["exchange"]
    for i in range(p.n):
        row = slice(rows["start"][i], rows["stop"][i])
        np.add.at(weights[i], rows["neighbours"][row], exchange[row])
    volume = p.host("mass") / p.host("density")
    return weights * SPACING ** (2 - p.dim), volume / SPACING**p.dim


def slowest(chem, number=1):
    """Decay rates over κ of the carriers' modes, the constant one left out; in 1/spacing²."""
    weights, volume = rates(chem)
    carry = chem.particles.select("layer")
    assert not weights[~carry].any()
    weights, volume = weights[np.ix_(carry, carry)], volume[carry]
    assert np.array_equal(weights, weights.T)  # amounts are conserved, molecules in balance
    assert weights.min() >= 0
    root = 1 / np.sqrt(volume)
    matrix = (np.diag(weights.sum(axis=1)) - weights) * root[:, None] * root[None, :]
    found = np.linalg.eigvalsh(matrix)
    bound = chem._diffusion.exchanges[0].rate * SPACING**2 / KAPPA
    assert found[-1] <= bound * (1 + 1e-9)  # what explicit steps follow
    return found[1 : number + 1]


@pytest.mark.parametrize("support", [1.2, 2.0, 2.4, 3.0])
@pytest.mark.parametrize("layers", [1, 2, 4, 8])
def test_along_flat_layers(layers, support):
    """The mode cos(2πx/L) of a strip; without normalising 1 layer has 0.42 at a support of 3."""
    length = 48
    chem = system(grid(length, layers), 1.0, support, (length, 0))
    assert slowest(chem)[0] / (2 * np.pi / length) ** 2 == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("layers", [1, 2, 4, 8])
def test_along_jittered_layers(layers):
    """By 0.1 spacings, at the support of 3 that disorder needs; one layer along itself only."""
    length, noise = 64, np.random.default_rng(3)
    points = grid(length, layers)
    points += 0.1 * noise.standard_normal(points.shape) * ([1, 0] if layers == 1 else 1)
    chem = system(points, 1.0, 3.0, (length, 0))
    assert slowest(chem)[0] / (2 * np.pi / length) ** 2 == pytest.approx(1, abs=2e-2)


def rings_of(outer, layers):
    points, volumes = [], []
    for m in range(layers):
        radius = outer - m - 0.5
        number = round(2 * np.pi * radius)
        angle = 2 * np.pi * np.arange(number) / number + 0.3 * m
        points.append(radius * np.stack([np.cos(angle), np.sin(angle)], 1))
        volumes += [2 * np.pi * radius / number] * number
    return np.concatenate(points), np.array(volumes)


def annulus(inner, outer):
    """Decay rate over κ of the slowest mode of a ring with impermeable edges."""

    def edges(k):
        return jvp(1, k * inner) * yvp(1, k * outer) - jvp(1, k * outer) * yvp(1, k * inner)

    return brentq(edges, 0.5 * 2 / (inner + outer), 1.5 * 2 / (inner + outer)) ** 2


@pytest.mark.parametrize(("support", "off"), [(2.0, 8e-3), (2.4, 8e-3), (3.0, 1.2e-2)])
@pytest.mark.parametrize("layers", [1, 2, 3, 6])
def test_along_rings(layers, support, off):
    """Twelve spacings of radius; a single layer needs its tangent, and arcs instead of chords."""
    chem = system(*rings_of(12, layers), support, (0, 0))
    exact = 1 / 11.5**2 if layers == 1 else annulus(12 - layers, 12)
    assert slowest(chem)[0] / exact == pytest.approx(1, abs=off)


@pytest.mark.parametrize("support", [2.0, 2.4])
@pytest.mark.parametrize("layers", [1, 2, 4])
def test_along_sheets(layers, support):
    length = 24
    chem = system(grid(length, 6, layers), 1.0, support, (length, 6, 0))
    assert slowest(chem)[0] / (2 * np.pi / length) ** 2 == pytest.approx(1, abs=1e-2)


def test_along_a_thread():
    chem = system(grid(48, 1, 1), 1.0, 2.4, (48, 0, 0))
    assert slowest(chem)[0] / (2 * np.pi / 48) ** 2 == pytest.approx(1, abs=5e-3)


def sphere(radius):
    """Points of a spiral, evenly on a sphere, each with its share of the area."""
    number = round(4 * np.pi * radius**2)
    k = np.arange(number) + 0.5
    polar, around = np.arccos(1 - 2 * k / number), np.pi * (1 + np.sqrt(5)) * k
    ring = np.stack([np.cos(around), np.sin(around)], 1) * np.sin(polar)[:, None]
    points = radius * np.concatenate([ring, np.cos(polar)[:, None]], 1)
    return points, np.full(number, 4 * np.pi * radius**2 / number)


@pytest.mark.parametrize("layers", [1, 2])
def test_along_shells(layers):
    """The three modes of degree 1: 2/r²; of a thin shell 2 ΔR/∫r² dr, variational."""
    radii = [7.5, 6.5][:layers]
    points, volumes = (np.concatenate(c) for c in zip(*map(sphere, radii), strict=True))
    chem = system(points, volumes, 2.4, (0, 0, 0))
    exact = 2 / 7.5**2 if layers == 1 else 2 * 2 * 3 / (8**3 - 6**3)
    np.testing.assert_allclose(slowest(chem, 3) / exact, 1, atol=1e-2)


@pytest.mark.parametrize("across", [6, 12])
def test_channel_beside_walls(across):
    """Walls that carry nothing: along the channel, and cos(πy/L) across, of second order.

    With nearest neighbours it is the finite volumes' 4 sin²(π/2N).
    """
    length, layers = 48, 3
    points = grid(length, across + 2 * layers)
    inside = np.abs(points[:, 1] - layers - across / 2) < across / 2
    along = slowest(system(points, 1.0, 3.0, (length, 0), group=1 * ~inside))[0]
    assert along / (2 * np.pi / length) ** 2 == pytest.approx(1, abs=1e-2)
    exact = (np.pi / across) ** 2
    short = slowest(system(grid(5, across), 1.0, 2.0, (5, 0)))[0]
    assert short == pytest.approx(4 * np.sin(np.pi / (2 * across)) ** 2, rel=1e-3)
    wide = slowest(system(grid(8, across), 1.0, 3.0, (8, 0)))[0]  # two supports at least
    assert wide / exact == pytest.approx(1, abs=2 / across**2)


@pytest.mark.parametrize(
    ("dim", "support", "off"), [(1, 1.2, 1e-9), (2, 2.0, 2e-3), (2, 2.4, 5e-3)]
)
def test_slab_between_reservoirs(dim, support, off):
    """One layer held at each end: a linear profile, and the flux κ/L, in the last links too."""
    length = 20
    points = grid(length + 1, *[6] * (dim - 1))
    held = [Group("low", "fluid", 0), Group("high", "fluid", 0)]
    species = [Species("A", KAPPA)]
    chem = slab(points, support, (0, 6)[:dim], held, species)
    chem.set_concentration("A", lambda x: (x[:, 0] / SPACING - 0.5) / length)
    for step in range(2000):
        chem.step(step, 8e-4)
    x = chem.particles.host("x")[:, 0] / SPACING - 0.5
    if off < 1e-6:
        np.testing.assert_allclose(chem.concentration("A"), x / length, atol=1e-9)
    before = chem.particles.host("amount_booked")[:, 0].copy()
    chem.step(2000, 8e-4)
    flow = (chem.particles.host("amount_booked")[:, 0] - before)[x > length / 2]
    area = (6 * SPACING) ** (dim - 1)
    flux = flow.sum() / (area * 8e-4)
    assert flux / (KAPPA / (length * SPACING)) == pytest.approx(1, abs=off)


def slab(points, support, period, held, species):
    """A slab whose first and last layer are reservoirs of 0 and 1 mol/m³."""
    n, dim = points.shape
    device = Device()
    lower = np.where(np.array(period) > 0, 0.0, -support) * SPACING
    upper = np.where(np.array(period) > 0, period, points.max(axis=0) + support) * SPACING
    axes = "".join(a for a, p in zip("xyz", period, strict=False) if p)
    particles = Particles(device, n, dim, [Group("fluid", "fluid", 0), *held])
    first, last = points[:, 0] < 1, points[:, 0] > points[:, 0].max() - 0.5
    for name, values in {
        "x": points * SPACING,
        "support": support * SPACING,
        "density": 1000.0,
        "mass": 1000.0 * SPACING**dim,
        "group": (1 * first + 2 * last).astype(np.int32),
    }.items():
        particles.set(name, values)
    reach = support * SPACING
    domain = Domain(tuple(lower), tuple(upper), periodic=axes)
    neighbours = NeighbourList(
        device, domain, particles, reach, 0.1 * reach, lower, upper, True, True
    )
    boundaries = [Reservoir("low", {"A": 0.0}), Reservoir("high", {"A": 1.0})]
    Chemistry.add_fields(particles, species)
    neighbours.build(particles)
    return Chemistry(device, particles, neighbours, species, (), boundaries, "lucy", at_rest=True)


def test_values_at_walls_stay_exact(wall_lattice):
    """A wall that holds a value is a carrier: a linear profile between two does not change."""
    boundaries = [FixedValueWall("left", {"A": 1.0}), FixedValueWall("right", {"A": 3.0})]
    chem = wall_lattice().chemistry([Species("A", KAPPA)], (), boundaries, normalise=True)

    def line(x):
        return 1.0 + 2.0 * (x[:, 0] / 1e-5 - 6 / 16) / (10 / 16)

    chem.set_concentration("A", line)
    fluid = chem.particles.select("fluid")
    for step in range(50):
        chem.step(step, 0.4 * chem.limits()["diffusion of concentrations"])
    expected = line(chem.particles.host("x"))
    np.testing.assert_allclose(chem.concentration("A")[fluid], expected[fluid], rtol=1e-12)


def test_molecules_walk_along_a_membrane():
    """exp(τK) with the very weights; the ring is inside of particles that carry nothing."""
    ring, volumes = rings_of(4, 1)
    around = grid(10, 10) - 5.0
    radius = np.hypot(*around.T)
    around = around[(radius < 2.6) | (radius > 4.6)]
    points = np.concatenate([ring, around])
    group = np.repeat([0, 1], [len(ring), len(around)])
    volumes = np.append(volumes, np.ones(len(around)))
    species = [Species("M", KAPPA, molecules=True, only_in="layer")]
    chem = system(points, volumes, 2.4, (0, 0), species, group=group)
    weights, volume = rates(chem)
    jumps = KAPPA / SPACING**2 * weights / volume[:, None]
    layer = chem.particles.select("layer")
    assert not jumps[~layer].any()
    assert not jumps[:, ~layer].any()
    tau = 3 / jumps.sum(axis=1).max()
    first = np.flatnonzero(layer)[7]
    chem.set_count("M", 200_000 * (np.flatnonzero(layer) == first))
    chem.step(1, tau)
    got = chem.particles.host("count")[:, 0]
    expected = 200_000 * expm(tau * (jumps - np.diag(jumps.sum(axis=1))))[first]
    assert got.sum() == 200_000
    likely = expected > 10
    assert (
        stats.chisquare(  # false-alarm rate 1e-7
            np.append(got[likely], got[~likely].sum() + 10),
            np.append(expected[likely], expected[~likely].sum() + 10),
        ).pvalue
        > 1e-7
    )


def test_steps_follow_the_rows():
    """Two jittered layers have twice the rows of the bulk: a step is divided, and stays stable."""
    noise = np.random.default_rng(5)
    points = grid(40, 2)
    points += 0.12 * noise.standard_normal(points.shape)
    chem = system(points, 1.0, 3.0, (40, 0))
    chem.set_concentration("A", noise.uniform(0, 1, len(points)))
    before = chem.totals()["A"][0]
    for step in range(200):
        chem.step(step, 4 * chem.limits()["diffusion of concentrations"])
    assert chem.divisions > 4
    assert chem.totals()["A"][0] == pytest.approx(before, rel=1e-12)
    found = chem.concentration("A")
    assert found.min() > 0
    assert found.max() < 1


def test_negative_factors_are_clipped_and_counted():
    noise = np.random.default_rng(1)
    points = grid(60, 2)
    points += 0.2 * noise.standard_normal(points.shape)
    chem = system(points, 1.0, 1.8, (60, 0))
    slowest(chem)
    pairs = (rates(chem)[0] > 0).sum()
    assert 0 < chem.negative_factors < 0.05 * pairs
    even = system(grid(60, 2), 1.0, 1.8, (60, 0))
    even.step(0, 1e-6)
    assert even.negative_factors == 0


def test_volumes_that_are_not_finite_are_named():
    chem = system(grid(6, 6), 1.0, 2.0, (6, 6))
    density = chem.particles.host("density").copy()
    density[7] = np.nan
    chem.particles.set("density", density)
    with pytest.raises(RunError, match="exchange by diffusion is not finite"):
        chem.step(0, 1e-6)
