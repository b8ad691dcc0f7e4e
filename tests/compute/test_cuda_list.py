"""Neighbour lists made on a GPU are those of the CPU.

As a script (``PYTHONPATH=tests python tests/compute/test_cuda_list.py [CHECK...]``) it runs on the
GPU at hand; as a test on Numba's CUDA simulator, in a process of its own.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

from particell.compute.cells import counting_sort
from particell.compute.device import Device
from particell.compute.neighbours import NeighbourList
from particell.compute.simulator import simulating
from particell.geometry.domain import Domain
from particell.particles import Group, Particles
from simulated_gpu import lines_on_simulator

CPU = Device(form="gather")


def running_sums(gpu):
    """Of less than a tile, of two levels, on a GPU of three."""
    from particell.compute.cuda_scan import EACH, TILE, RunningSum

    for n in (1, EACH + 1, TILE + 1, 4 * TILE if simulating() else TILE * TILE + 7):
        values = np.random.default_rng(n).integers(0, 2**40, n)
        array = gpu.array(values)
        RunningSum(gpu, n)(array)
        assert gpu.to_host(array).tolist() == [0, *np.cumsum(values)[:-1].tolist()], n


def sorting(gpu):
    """Also of many particles in a cell, of empty cells, and whatever their order was."""
    from particell.compute.cuda_list import DeviceSort

    random = np.random.default_rng(1)
    for cells in (1, 7, 400):
        cell, ids = random.integers(0, cells, 120).astype(np.int32), random.permutation(999)[:120]
        start, order = np.zeros(cells + 1, np.int64), np.zeros(120, np.int64)
        counting_sort(cell, ids, start, order)
        mine = gpu.zeros(cells + 1, np.int64), gpu.zeros(120, np.int64)
        sort = DeviceSort(gpu, 120, cells)
        for _ in range(2):  # nothing is left of the first time
            sort(gpu.array(cell), gpu.array(ids), *mine)
            assert gpu.to_host(mine[0]).tolist() == start.tolist()
            assert gpu.to_host(mine[1]).tolist() == order.tolist()


def lists(device, x, lengths, periodic, support, walls, uniform):
    """Particles and their list, built twice at other positions."""
    domain, (n, dim) = Domain((0,) * dim_of(x), lengths, periodic=periodic), x.shape
    particles = Particles(device, n, dim, [Group("fluid", "fluid", 0), Group("wall", "wall", 0)])
    particles.set("x", x)
    particles.set("support", support)
    particles.set("is_wall", walls.astype(np.uint8))
    h = float(np.max(support))
    lower = np.where(domain.periodic, domain.lower, np.minimum(domain.lower, x.min(axis=0)))
    upper = np.where(domain.periodic, domain.upper, np.maximum(domain.upper, x.max(axis=0)))
    made = NeighbourList(
        device, domain, particles, h, 0.3 * h, lower, upper, uniform, bool(walls.any())
    )
    made.want("rows")
    for _ in range(2):
        made.build(particles)
        random = np.random.default_rng(5)
        particles.set("x", particles.by_id("x") + random.uniform(0, 0.4, x.shape), by_id=True)
    return particles, made


def dim_of(x):
    return x.shape[1]


def rows_of_the_cpu(gpu):
    """The same rows in the same order, after builds at other places; rows outgrow their room."""
    cases = [
        ((9.0,), "x", 40, 0.0, True),
        ((7.0, 5.0), "x", 70, 0.3, False),
        ((4.0, 4.0, 4.0), "xz", 80, 0.3, True),
    ]
    for lengths, periodic, n, part, uniform in cases:
        random = np.random.default_rng(n)
        x = random.uniform(0.05, 0.95, (n, len(lengths))) * np.array(lengths)
        walls = random.uniform(size=n) < part
        support = np.full(n, 1.5) if uniform else random.uniform(0.6, 1.5, n)
        given = (x, lengths, periodic, support, walls, uniform)
        (here, mine), (there, its) = lists(CPU, *given), lists(gpu, *given)
        assert its.capacity == mine.capacity
        for name in here:
            assert here.host(name).tobytes() == there.host(name).tobytes(), (lengths, name)
        for name in ("cell", "cell_start", "x_built", "start", "split", "stop", "found", "crosses"):
            assert np.array_equal(mine.fields[name], gpu.to_host(its.fields[name])), (lengths, name)
        rows, others = mine.fields["neighbours"], gpu.to_host(its.fields["neighbours"])
        for a, b in zip(mine.fields["start"], mine.fields["stop"], strict=True):
            assert rows[a:b].tolist() == others[a:b].tolist(), lengths


def decisions_of_the_cpu(gpu):
    """Whether to build: at rest, after small and large moves, a shear, and what is no number."""
    from particell.compute.neighbours import SAFETY

    random = np.random.default_rng(3)
    for lengths, n in (((9.0, 8.0), 60), ((5.0, 8.0, 5.0), 90)):
        x = random.uniform(0.0, 1.0, (n, len(lengths))) * np.array(lengths)
        given = (x, lengths, "xy", np.ones(n), np.zeros(n, bool), True)
        (here, mine), (there, its) = lists(CPU, *given), lists(gpu, *given)
        for particles, made in ((here, mine), (there, its)):
            particles.set("x", made.device.to_host(made.x_built))
        limit, start = 0.5 * SAFETY * mine.skin, here.by_id("x")
        sign = np.where(start[:, :1] < 0.5 * lengths[0], 1.0, -1.0) * np.eye(len(lengths))[:1]
        shear = np.zeros_like(start)
        shear[:, 0] = start[:, 1] / lengths[1]
        moves = [0.0 * sign, 0.99 * limit * sign, 1.01 * limit * sign, 5 * limit * (1 + 0 * sign)]
        moves += [k * limit * shear for k in (1.5, 4.0, 9.0, 1e3)] + [1e30 * (1 + 0 * sign)]
        moves[-1][3, 0] = np.inf
        found = []
        for move in moves:
            for particles in (here, there):
                particles.set("v", move, by_id=True)
            asked = [
                made.needs_build(p["x"], p["v"], 1.0) for p, made in ((here, mine), (there, its))
            ]
            assert asked[0] == asked[1], (lengths, asked, found)
            found.append(asked[0])
        assert found[:3] == [False, False, True]
        assert set(found[4:8]) == {True, False}


CHECKS = (
    running_sums,
    sorting,
    rows_of_the_cpu,
    decisions_of_the_cpu,
)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_lists_of_a_gpu(check):
    pytest.importorskip("numba.cuda", reason="numba.cuda is missing")
    assert lines_on_simulator(__file__, check.__name__) == [check.__name__]


if __name__ == "__main__":
    for check in CHECKS:
        if check.__name__ in (sys.argv[1:] or [check.__name__]):
            check(Device("cuda"))
            print(check.__name__, flush=True)
