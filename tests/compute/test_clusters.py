"""Clusters and their lists: whole, no longer than needed, the same for any number of threads."""

from __future__ import annotations

import numpy as np
import pytest
from test_neighbours import images, system

from particell.compute.bins import LANES, SLOT_BITS
from particell.compute.device import Device
from particell.compute.threads import Shared
from particell.errors import InputError
from systems import channel, periodic_lattice, unit_fluid

BOX = (8.0, 7.0, 9.0)


def lists(neighbours):
    """Of each cluster its particles, the neighbours with their images' shifts, and the walls'."""
    f = neighbours.fields
    member, shifts = f["member"], f["shifts"].reshape(27, -1)
    for c, size in enumerate(f["cluster_size"]):
        first, split, last = (f[f"cluster_{name}"][c] for name in ("start", "split", "stop"))
        entries = f["cluster_entries"][first:last]
        neighbour = member[entries & np.uint32((1 << SLOT_BITS) - 1)]
        own = member[c * LANES :][: int(size)]
        yield own, neighbour, shifts[entries >> np.uint32(SLOT_BITS)], split - first


def check(x, lengths, periodic, support, walls):
    """Against all distances: nobody is missed, nobody listed twice or for no one."""
    particles, neighbours, domain = system(x, lengths, periodic, support, walls)
    x, h, is_wall = (particles.host(name) for name in ("x", "support", "is_wall"))
    seen = []
    for own, neighbour, shift, split in lists(neighbours):
        seen += own.tolist()
        assert len({int(is_wall[i]) for i in own}) == 1
        assert not is_wall[neighbour[:split]].any()
        assert is_wall[neighbour[split:]].all()
        apart = x[own][:, None] - x[neighbour] - shift
        reach = 0.5 * (h[own][:, None] + h[neighbour]) + neighbours.skin
        near = np.linalg.norm(apart, axis=2) < reach
        assert near.any(axis=0).all()
        for lane, i in enumerate(own):
            distance = np.linalg.norm(images(domain, x[i] - x), axis=1)
            within = np.flatnonzero(distance < 0.5 * (h[i] + h) + neighbours.skin)
            assert sorted(neighbour[near[lane]]) == within.tolist()
    assert sorted(seen) == list(range(len(x)))


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("arrangement", ["scattered", "on faces", "few", "outside"])
def test_all_pairs_are_listed_once(dim, arrangement):
    """With supports 4 to 1 and walls, in boxes barely two reaches wide along one axis."""
    random = np.random.default_rng(dim)
    lengths, number = BOX[:dim], {1: 61, 2: 203, 3: 411}[dim]
    x = random.uniform(0, lengths, (number, dim))
    if arrangement == "on faces":
        x = np.floor(x)
    if arrangement == "few":
        x = x[:5]
    support = np.where(x[:, -1] > 0.4 * lengths[-1], 0.6, 2.4)
    walls = x[:, 0] < 1.5
    periodic = "" if arrangement == "outside" else "xyz"[:dim]
    if arrangement == "outside":
        x = 1.5 * x - 2.0
    check(x, lengths, periodic, support, walls)
    check(x, lengths, periodic[:1], np.full(len(x), 2.4), walls)


def test_clusters_are_compact():
    """On a lattice they are cubes: no list is longer than that of a cube by the odd ones' share."""
    simulation = periodic_lattice(12, 3)
    simulation.start()
    sizes = [len(neighbour) for _, neighbour, *_ in lists(simulation.neighbours)]
    offsets = np.stack(np.meshgrid(*[np.arange(-5, 6)] * 3), -1).reshape(-1, 3)
    cube = np.stack(np.meshgrid(*[np.arange(2)] * 3), -1).reshape(-1, 3)
    apart = np.linalg.norm(offsets[:, None] - cube, axis=2)
    reach = simulation.neighbours.support + simulation.neighbours.skin
    assert np.median(sizes) == np.count_nonzero((apart < reach).any(axis=1))
    assert np.mean(sizes) < 1.1 * np.median(sizes)


def shared_by(threads, monkeypatch):
    """Loops run on so many threads whatever they take."""
    monkeypatch.setattr(Shared, "worth", lambda self, n: max(1, min(threads, n)))


def test_same_bits_for_any_number_of_threads(monkeypatch):
    found = []
    for threads in (1, 2, 3):
        shared_by(threads, monkeypatch)
        monkeypatch.setattr("particell.compute.batches.available_threads", lambda: 3)
        simulation = channel((8, 6), gravity=(0.5, 0.0), device=Device(form="lanes"))
        simulation.advance(5)
        assert set(simulation.solver.forms().values()) == {"lanes"}
        found.append(b"".join(simulation.particles.by_id(name).tobytes() for name in ("x", "a")))
    assert found[0] == found[1] == found[2]


def test_the_form_can_be_named_and_stays(tmp_path):
    with pytest.raises(InputError, match="form"):
        Device(form="rows")
    one, two = (periodic_lattice(9, 2, device=Device(form=form)) for form in (None, "gather"))
    one.advance(2)
    assert set(one.settings["forms"].values()) == {"lanes"}
    assert set(two.settings["forms"].values()) == {"gather"}
    with pytest.raises(InputError, match="forms"):
        two.restore(one.state())


def test_rows_are_made_when_they_are_asked_for():
    """From the positions at the last build, whenever that is."""
    one, two = (periodic_lattice(9, 2, jitter=0.2) for _ in range(2))
    two.neighbours.want("rows")
    for simulation in (one, two):
        simulation.advance(3)
    with pytest.raises(KeyError, match="want"):
        one.neighbours.fields["neighbours"]
    one.neighbours.want("rows")
    for name in ("start", "stop", "neighbours"):
        assert one.neighbours.fields[name].tolist() == two.neighbours.fields[name].tolist()


def test_dear_laws_gather():
    hot = unit_fluid(temperature=1e20)
    simulation = periodic_lattice(8, 3, hot, fluctuations=True)
    assert simulation.solver.forms()["forces"] == "gather"
    assert simulation.solver.forms()["density_rates"] == "lanes"
