"""Images: sums beside mirrors are those of the whole that is symmetric about them."""

from __future__ import annotations

import itertools
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

import particell as pc
from particell.errors import InputError
from particell.laws.continuity import Continuity, DensityDiffusion
from particell.laws.diffusion import pair_slopes
from particell.laws.pressure import PressureForce
from particell.laws.shifting import Crowding
from particell.laws.sums import DensityFilter, KernelSum, SummedDensity
from particell.laws.transport_velocity import (
    ConsistentContinuity,
    MomentumFlux,
    TransportContinuity,
)
from particell.laws.viscosity import Viscosity
from particell.schemes.flow_sweeps import tables_of
from particell.sources.images import Plane, at_planes
from systems import UNIT_TEMPERATURE, periodic_lattice, unit_fluid

HOT = unit_fluid(temperature=UNIT_TEMPERATURE)

SIDE = {1: 14, 2: 8, 3: 6}
#: What a particle has besides its place, and how far it varies.
SCALARS = {"density": 0.1, "density_half": 0.1, "pressure": 5.0, "pressure_term": 5.0,
           "kernel_sum": 0.2, "volume": 0.1}  # fmt: skip
VECTORS = ("v", "transport", "a", "flux")


def jittered(dim, two_supports, seed=3):
    """Points of a box with one corner at 0, phases of one and, with another support, of two."""
    random = np.random.default_rng(seed)
    side = SIDE[dim]
    points = np.array(list(itertools.product(np.arange(side) + 0.5, repeat=dim)))
    points = points + random.uniform(-0.4, 0.4, points.shape)
    return (points[::2], points[1::2]) if two_supports else (points,)


def system(dim, groups, mirrors, whole, scheme):
    """The box, or with its images about ``mirrors`` axes the whole, periodic along the others."""
    lower = [-SIDE[dim] if whole and d < mirrors else 0 for d in range(dim)]
    box = pc.Domain(lower, (SIDE[dim],) * dim, periodic="xyz"[mirrors:dim], depth=1.0)
    phases = []
    for number, points in enumerate(groups):
        if whole:
            signs = itertools.product((1, -1), repeat=mirrors)
            points = np.vstack([points * (*s, *(1,) * (dim - mirrors)) for s in signs])
        kind = unit_fluid(viscosity=(0.3, 0.8)[number])
        spacing = (1.0, 0.25)[number]
        phases.append(pc.Phase("ab"[number], kind, points, spacing**dim, spacing=spacing))
    with patch("particell.setup.check_filling"):  # fine and coarse particles in one place
        simulation = pc.Simulation(box, phases, scheme, dt=0.01)
    simulation.start()
    # the scheme has no radial friction
    tables = simulation.solver.flow.properties.tables
    tables["radial"] = 0.5 * tables["transverse"]
    return simulation


def disturb(simulation, number, slip, moves):
    """Values that are those of the first ``number`` particles of a phase, mirrored."""
    p = simulation.particles
    dim, place, group = p.dim, p.by_id("x"), p.by_id("group")
    own = np.zeros(len(p), int)
    for g in range(len(p.groups)):
        own[group == g] = 1000 * g + np.arange((group == g).sum()) % number[g]
    signs = np.where(place < 0, -1.0, 1.0)
    order = p.host("id")
    random = np.random.default_rng(7)
    for name, range_ in SCALARS.items():
        table = random.uniform(-range_, range_, 2000)
        if name in p:
            p.set(name, (1.0 + table[own] if name != "pressure" else table[own])[order])
    for name in VECTORS:
        if name not in p:
            continue
        values = random.normal(0, 1, (2000, dim))[own]
        if slip:
            values = values * signs
        else:
            wall = moves if name in ("v", "transport") else 0.0
            odd = signs.prod(axis=1)[:, None]
            values = np.where(odd < 0, 2 * wall - values, values)
        p.set(name, values[order])


def every_law(simulation):
    """All laws of flows in one sweep."""
    laws = [Continuity(), DensityDiffusion(), ConsistentContinuity(), TransportContinuity(),
            PressureForce("switched"), Viscosity(radial=True, normalised=True), Crowding(),
            KernelSum(), SummedDensity(), DensityFilter(True), MomentumFlux("conserving"),
            MomentumFlux("uniform")]  # fmt: skip
    return sweep_of(simulation, laws)


def sums(simulation):
    """A sum of the kernel and one of vectors."""
    return sweep_of(simulation, [SummedDensity(), Crowding()])


def friction(simulation):
    return sweep_of(simulation, [Viscosity(radial=True)])


def sweep_of(simulation, laws):
    """What laws add together, with all that any of them reads."""
    made = simulation.solver.flow.sweeps()
    sweep = made.flux_rates(True, "uniform")
    derived = {**made.forces().names.derived, **sweep.names.derived}
    names = replace(sweep.names, derived=derived)
    return replace(sweep, name="trial", laws=tuple(laws), names=names, zeroed=())


def results(simulation, sweep, numbers, form="gather"):
    """What a sweep writes, in the order of ids; fields are as before."""
    solver, p = simulation.solver, simulation.particles
    simulation.neighbours.want("rows")
    fields = {**solver.flow.constants, **simulation.neighbours.fields, **p.fields}
    fields.setdefault("transport", fields["v"])
    fields |= tables_of(solver.flow.properties.tables, solver.flow.properties.fluids)
    before = {name: p.host(name).copy() for name in sweep.plan().results}
    sweep.bind(simulation.device, fields, {}, form)(len(p), **numbers)
    found = {name: p.by_id(name).copy() for name in before}
    for name, values in before.items():
        p.fields[name][...] = values
    return found


def compare(dim, mirrors, slip=True, moves=0.0, two_supports=True, forms=("gather",), of=every_law):
    """A part of a box beside mirrors against the whole of it."""
    scheme = pc.TransportVelocity(normalise_viscosity=True)
    groups = jittered(dim, two_supports)
    number = [len(points) for points in groups]
    half, whole = (system(dim, groups, mirrors, full, scheme) for full in (False, True))
    for simulation in (half, whole):
        disturb(simulation, number, slip, moves)
    normals = np.eye(dim)[:mirrors]
    planes = [
        Plane(f"mirror_{k}", (0.0,) * dim, tuple(n), slip, (moves,) * dim)
        for k, n in enumerate(normals)
    ]
    reach = float(half.particles.host("support").max())
    one, all_ = half.particles.by_id("group"), whole.particles.by_id("group")
    rows = np.concatenate([np.flatnonzero(all_ == g)[: number[g]] for g in range(len(number))])
    assert (whole.particles.by_id("x")[rows] == half.particles.by_id("x")).all()
    assert (all_[rows] == one).all()
    numbers = half.solver.flow.numbers(3)
    sweep = of(half)
    images = at_planes(planes, reach, of=sweep.sources[0])
    assert len(images) == 2**mirrors - 1
    beside = replace(sweep, sources=(*sweep.sources, *images))
    expected, without = results(whole, of(whole), numbers), results(half, sweep, numbers)
    near = half.particles.by_id("x")[:, :mirrors].min(axis=1) < reach
    assert not near.all()
    for form in forms:
        found = results(half, beside, numbers, form)
        for name, values in expected.items():
            scale = np.abs(values).max()
            assert scale > 0.0
            assert np.abs(found[name] - values[rows]).max() <= 1e-12 * scale, (name, form)
            assert np.abs(found[name] - without[name]).max() > 1e-8 * scale, (name, form)
            far = np.abs(found[name] - without[name])[~near]
            assert far.max() <= 1e-14 * scale


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_a_mirror(dim):
    """Every law, particles of two supports (4 to 1); in the form of GPUs too."""
    compare(dim, 1, forms=("gather", "cuda") if dim == 2 else ("gather",))


def test_a_mirror_where_supports_are_equal():
    compare(2, 1, two_supports=False, of=sums)


def test_corners():
    """Images of images: the point reflection at edges, the inversion at corners."""
    compare(3, 3, of=sums)


def test_no_slip():
    """Velocities are odd about the plane's, at an edge about those of both."""
    compare(2, 2, slip=False, moves=0.7, of=friction)


def test_friction_takes_velocities_ahead_of_images_too():
    compare(2, 1, of=lambda simulation: simulation.solver.flow.sweeps().forces())


def test_planes_at_other_angles_are_refused():
    floor = Plane("floor", (0.0, 0.0), (0.0, 1.0))
    lid = Plane("lid", (0.0, 4.0), (0.0, -1.0))
    slope = Plane("slope", (0.0, 0.0), (0.6, 0.8))
    side = Plane("side", (0.0, 0.0), (1.0, 0.0))
    assert [len(images.planes) for images in at_planes((floor, lid, side), 1.0)] == [1, 1, 1, 2, 2]
    with pytest.raises(InputError, match="right angles"):
        at_planes((floor, slope), 1.0)
    with pytest.raises(InputError, match="at least 5 m"):
        at_planes((floor, lid), 5.0)


def test_noise_and_what_is_kept_of_pairs_have_no_images():
    simulation = periodic_lattice(8, 2, HOT, fluctuations=True)
    images = at_planes([Plane("floor", (0.0, 0.0), (0.0, 1.0))], 3.0)
    with pytest.raises(InputError, match="noise"):
        replace(simulation.solver.flow.sweeps().forces(), sources=images).plan()
    with pytest.raises(InputError, match="exchange"):
        replace(pair_slopes(2, 0, True), sources=images).plan()
