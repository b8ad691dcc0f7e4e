from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from particell.compute.cells import counting_sort
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.errors import InputError
from particell.fields import Field
from particell.geometry.domain import Domain
from particell.particles import Group, Particles

SKIN = 0.3


def system(x, lengths, periodic, support, walls=None, general=True):
    """A built list; ``general`` compiles for variable support and walls whether used or not."""
    device, (n, dim) = Device(), x.shape
    domain = Domain((0,) * dim, lengths, periodic=periodic)
    groups = [Group("fluid", "fluid", 0), Group("wall", "wall", 0)]
    particles = Particles(device, n, dim, groups)
    particles.set("x", x)
    particles.set("support", support)
    if walls is not None:
        particles.set("is_wall", walls.astype(np.uint8))
    h = float(np.max(support))
    wall_free = domain.periodic
    lower = np.where(wall_free, domain.lower, np.minimum(domain.lower, x.min(axis=0)))
    upper = np.where(wall_free, domain.upper, np.maximum(domain.upper, x.max(axis=0)))
    neighbours = NeighbourList(
        device, domain, particles, h, SKIN * h, lower, upper, uniform=not general, walls=general
    )
    neighbours.want("rows")
    neighbours.build(particles)
    return particles, neighbours, domain


def rows(neighbours):
    """For each particle its mobile and its wall neighbours, as sets of rows."""
    f = neighbours.fields
    everything = f["neighbours"]
    return [
        (everything[a:b].tolist(), everything[b:c].tolist())
        for a, b, c in zip(f["start"], f["split"], f["stop"], strict=True)
    ]


def images(domain, difference):
    return difference - domain.lengths * np.rint(difference * domain.inverse_periods)


def expected(particles, domain, reach_of):
    """Neighbours by a k-d tree of all periodic images."""
    x, support = particles.host("x"), particles.host("support")
    n, dim = x.shape
    shifts = [(-1, 0, 1) if p else (0,) for p in domain.periodic]
    grid = np.stack(np.meshgrid(*shifts, indexing="ij"), -1).reshape(-1, dim) * domain.lengths
    copies = (x[None] + grid[:, None]).reshape(-1, dim)
    tree = cKDTree(copies)
    found = []
    for i in range(n):
        near = np.array(tree.query_ball_point(x[i], reach_of(support.max(), support.max())), int)
        distance = np.linalg.norm(copies[near] - x[i], axis=1)
        j = near % n
        keep = (j != i) & (distance < reach_of(support[i], support[j]))
        found.append(set(j[keep].tolist()))
    return found


def random_points(seed, n, lengths):
    return np.random.default_rng(seed).uniform(0, 1, (n, len(lengths))) * lengths


CASES = [
    # lengths in units of the support; cells of 1.3 supports, so 1, 2, 3 and more cells an axis
    ((12.0,), "x"),
    ((2.7,), "x"),
    ((1.0,), ""),
    ((5.3, 2.7), "xy"),
    ((4.0, 7.9), "y"),
    ((1.2, 3.0), ""),
    ((2.7, 3.95), "xy"),
    ((2.7, 3.95, 5.3), "xyz"),
    ((1.2, 2.7, 4.0), "yz"),
    ((2.7, 2.7, 2.7), "xyz"),
]


@pytest.mark.parametrize(("lengths", "periodic"), CASES)
def test_same_neighbours_as_a_tree(lengths, periodic):
    x = random_points(1, 150, lengths)
    particles, neighbours, domain = system(x, lengths, periodic, 1.0, general=False)
    found = rows(neighbours)
    assert [set(a) for a, _ in found] == expected(particles, domain, lambda a, b: 1.0 + SKIN)
    assert all(len(a) == len(set(a)) and not b for a, b in found)
    assert neighbours.builds == 1


@pytest.mark.parametrize(("lengths", "periodic"), [CASES[0], CASES[4], CASES[6], CASES[7]])
def test_variable_support_and_walls(lengths, periodic):
    random = np.random.default_rng(2)
    x = random_points(3, 150, lengths)
    support, walls = random.uniform(0.4, 1.0, 150), random.uniform(size=150) < 0.3
    particles, neighbours, domain = system(x, lengths, periodic, support, walls)
    skin = SKIN * support.max()
    wanted = expected(particles, domain, lambda a, b: 0.5 * (a + b) + skin)
    is_wall = particles.host("is_wall") != 0
    for (mobile, wall), everyone in zip(rows(neighbours), wanted, strict=True):
        assert set(mobile) == {j for j in everyone if not is_wall[j]}
        assert set(wall) == {j for j in everyone if is_wall[j]}
        assert len(mobile) + len(wall) == len(everyone)


def test_particles_outside_are_wrapped_or_kept():
    lengths = (4.0, 4.0)
    x = random_points(4, 120, lengths) + np.array([9.0, 0.0])  # beyond the periodic axis
    x[:10, 1] -= 3.0  # below an open one
    particles, neighbours, domain = system(x, lengths, "x", 1.0, general=False)
    wrapped = particles.host("x")
    assert ((wrapped[:, 0] >= 0) & (wrapped[:, 0] <= 4)).all()
    turns = particles.host("image")
    assert wrapped + turns * domain.lengths == pytest.approx(x[particles.host("id")], abs=1e-12)
    assert [set(a) for a, _ in rows(neighbours)] == expected(
        particles, domain, lambda a, b: 1.0 + SKIN
    )


def test_rows_grow_when_particles_crowd():
    x = 0.4 * random_points(5, 150, (1.0, 1.0))
    _, neighbours, _ = system(x, (8.0, 8.0), "xy", 1.0, general=False)
    assert neighbours.capacity >= 150
    assert all(len(a) == 149 for a, _ in rows(neighbours))


def test_empty_space_does_not_make_countless_cells():
    x = random_points(6, 150, (1.0, 1.0)) + 5000
    particles, neighbours, domain = system(x, (10000.0, 10000.0), "", 0.5, general=False)
    assert neighbours.number_of_cells <= 4 * 150 + 64
    assert [set(a) for a, _ in rows(neighbours)] == expected(
        particles, domain, lambda a, b: 0.5 * (1.0 + SKIN)
    )


def missing_pairs(x, neighbours, domain, support):
    """Pairs within the mean support that the loops over the list would not see."""
    crosses = neighbours.fields["crosses"] != 0
    seen = np.zeros((len(x), len(x)), bool)
    for i, (mobile, wall) in enumerate(rows(neighbours)):
        listed = np.array([*mobile, *wall], int)
        difference = x[i] - x[listed]
        if crosses[i]:
            difference = images(domain, difference)
        seen[i, listed[np.linalg.norm(difference, axis=1) < support[i]]] = True
    difference = images(domain, x[:, None] - x[None])
    near = np.linalg.norm(difference, axis=-1) < 0.5 * (support[:, None] + support[None])
    np.fill_diagonal(near, False)
    return np.argwhere(near & ~seen)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    case=st.sampled_from([CASES[0], CASES[3], CASES[4], CASES[6], CASES[7], CASES[8]]),
    seed=st.integers(0, 2**31),
    shear=st.floats(-2, 2),
    drift=st.floats(-2, 2),
    heat=st.floats(0, 0.5),
    dt=st.floats(0.005, 0.3),
)
def test_a_list_that_is_kept_misses_nothing(case, seed, shear, drift, heat, dt):
    """Moves that needs_build lets pass bring no pair within the support that is not listed."""
    lengths, periodic = case
    dim = len(lengths)
    particles, neighbours, domain = system(
        random_points(seed, 80, lengths), lengths, periodic, 1.0, general=False
    )
    x, support = particles.host("x"), particles.host("support")
    v = particles.host("v")
    v[:] = heat * np.random.default_rng(seed).normal(size=x.shape) + drift
    if dim > 1:
        period = 2 * np.pi / lengths[1]
        v[:, 0] += shear * np.sin(period * x[:, 1])  # smooth across periodic faces
    for _ in range(30):
        if neighbours.needs_build(x, v, dt):
            break
        x += dt * v
        assert len(missing_pairs(x, neighbours, domain, support)) == 0


def test_particles_that_flow_together_keep_their_list():
    particles, neighbours, _ = system(
        random_points(7, 150, (5.3, 5.3)), (5.3, 5.3), "xy", 1.0, general=False
    )
    x, v = particles.host("x"), particles.host("v")
    v[:, 0] = 1.0
    assert not neighbours.needs_build(x, v, 0.7)
    assert neighbours.needs_build(x, v, 3.0)
    v[0, 0] = -1.0
    assert neighbours.needs_build(x, v, 0.7)


def test_streams_with_a_cell_between_them_may_slide_but_not_approach():
    """Sliding counts between cells side by side, approach across a cell too."""
    width = 1.0 + SKIN
    x = random_points(9, 400, (10.0, 3 * width))
    particles, neighbours, domain = system(
        x, (10.0, 3 * width), "", 1.0, walls=np.zeros(400, bool), general=False
    )
    x, v = particles.host("x"), particles.host("v")
    support = particles.host("support")
    layer = np.minimum(x[:, 1] // width, 2) - 1
    v[:, 0] = layer  # −1, 0 and 1
    assert not neighbours.needs_build(x, v, 0.85 * SKIN)
    assert neighbours.needs_build(x, v, 0.95 * SKIN)
    x += 0.85 * SKIN * v
    assert len(missing_pairs(x, neighbours, domain, support)) == 0
    x -= 0.85 * SKIN * v
    v[:, 0], v[:, 1] = 0.0, -layer
    assert not neighbours.needs_build(x, v, 0.4 * SKIN)
    assert neighbours.needs_build(x, v, 0.5 * SKIN)


def test_a_position_that_is_not_a_number_asks_for_a_build():
    particles, neighbours, _ = system(
        random_points(8, 50, (4.0, 4.0)), (4.0, 4.0), "xy", 1.0, general=False
    )
    v = particles.host("v")
    v[:] = np.inf
    assert neighbours.needs_build(particles.host("x"), v, 1.0)


def test_boxes_in_which_images_would_meet_are_refused():
    """A particle and its image would both be neighbours, and rows hold both."""
    lengths = (4.0, 9.0)
    x = random_points(9, 40, lengths)
    system(x, lengths, "xy", 1.999, general=False)
    with pytest.raises(InputError, match="half of the shortest periodic edge"):
        system(x, lengths, "xy", 2.001, general=False)
    system(x, lengths, "y", 2.001, general=False)


def test_sorted_into_cells_with_ids_kept():
    lengths = (5.3, 5.3)
    x = random_points(9, 200, lengths)
    particles, neighbours, _ = system(x, lengths, "xy", 1.0, general=False)
    cell, ids = neighbours.fields["cell"], particles.host("id")
    assert (np.diff(cell) >= 0).all()
    assert sorted(ids) == list(range(200))
    assert particles.host("x").tobytes() == x[ids].tobytes()
    assert particles.by_id("x").tobytes() == x.tobytes()
    starts = neighbours.fields["cell_start"]
    assert starts[0] == 0
    assert np.diff(starts).tolist() == np.bincount(cell, minlength=len(starts) - 1).tolist()


@pytest.mark.parametrize("cells", [1, 7, 400])
def test_counting_sort_orders_by_cell_and_id(cells):
    """Also of many particles in a cell, and whatever their order was."""
    random = np.random.default_rng(1)
    cell, ids = random.integers(0, cells, 900).astype(np.int32), random.permutation(2000)[:900]
    start, order = np.zeros(cells + 2, np.int64), np.zeros(900, np.int64)
    counting_sort(cell, ids, start, order)
    assert order.tolist() == np.lexsort((ids, cell)).tolist()
    assert start.tolist() == np.searchsorted(np.sort(cell), np.arange(cells + 2)).tolist()


@pytest.mark.parametrize(("lengths", "periodic"), [CASES[0], CASES[4], CASES[6], CASES[7]])
def test_rows_depend_on_positions_and_ids_alone(lengths, periodic):
    """Not on the order in memory before, nor on lists of other positions; also in a restart."""
    random = np.random.default_rng(11)
    x, walls = random_points(10, 150, lengths), random.uniform(size=150) < 0.3
    support = random.uniform(0.4, 1.0, 150)
    support[0] = 1.0  # the largest, whoever else is
    made = [system(x, lengths, periodic, support, walls)[:2] for _ in range(3)]
    (first, one), (second, two), (third, three) = made
    second.permute(random.permutation(150))
    two.build(second)
    moved = third.by_id("x")
    third.set("x", random_points(12, 150, lengths), by_id=True)
    three.build(third)  # which mixes them
    third.set("x", moved, by_id=True)
    three.build(third)
    for particles, neighbours in (made[1], made[2]):
        assert particles.host("id").tolist() == first.host("id").tolist()
        assert rows(neighbours) == rows(one)
    state = one.saved()
    one._reserve(400)  # a capacity that is of no account
    first.set("x", first.host("x") + 0.01)
    one.restore(state, first)
    assert rows(one) == rows(two)
    assert one.builds == 1
    is_wall, slot = first.host("is_wall"), np.zeros(150, np.int64)
    slot[one.fields["member"][::-1]] = np.arange(len(one.fields["member"]))[::-1]
    crosses = one.fields["crosses"] != 0
    for i, parts in enumerate(rows(one)):
        assert not is_wall[parts[0]].any()
        assert is_wall[parts[1]].all()
        assert crosses[i] or all((np.diff(slot[part]) > 0).all() for part in parts)  # one order


def test_permute_moves_every_field():
    particles = Particles(Device(), 6, 2, [Group("fluid", "fluid", 0)])
    particles.add(Field("tensor", components=4), np.arange(24.0).reshape(6, 4))
    particles.set("mass", np.arange(6.0))
    order = np.array([3, 1, 5, 0, 4, 2])
    particles.permute(order)
    assert particles.host("mass").tolist() == order.tolist()
    assert particles.host("id").tolist() == order.tolist()
    assert particles.host("tensor")[:, 0].tolist() == (4.0 * order).tolist()
    assert particles.by_id("mass").tolist() == list(range(6))
