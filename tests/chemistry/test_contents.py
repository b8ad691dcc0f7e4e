"""What can be read and set of species: arrays of one's own, in either order."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc


@pytest.fixture(params=[False, True], ids=["lasting", "switching"])
def simulation(request):
    """Species of each kind on particles that have changed places in memory."""
    side = 8
    box = pc.Domain((0, 0), (side, side), periodic="xy", depth=1.0)
    line = np.arange(side) + 0.5
    points = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    points = np.random.default_rng(2).permutation(points)
    limits = {"switch_above": 1e6, "switch_below": 1e5} if request.param else {}
    made = pc.Simulation(
        box,
        pc.Phase("fluid", pc.Fluid(1000, 1e-3), points, 1.0),
        pc.Static(),
        [pc.Species("M", 0.0, molecules=True, **limits), pc.Species("C", 0.0)],
    )
    made.start()
    assert (made.particles.host("id") != np.arange(side**2)).any()
    return made


def test_what_is_returned_is_not_what_is_simulated(simulation):
    chemistry, particles = simulation.chemistry, simulation.particles
    chemistry.set_count("M", 5)
    chemistry.set_concentration("C", 2.0)
    for get in (
        lambda: chemistry.count("M"),
        lambda: chemistry.concentration("C"),
        lambda: particles.host("count"),
        lambda: particles.by_id("x"),
        lambda: particles.host("x"),
    ):
        before = get()
        taken = get()
        taken[...] = 7
        assert np.array_equal(get(), before)
        simulation.advance(1)
    with pytest.raises(ValueError, match="read-only"):
        particles.view("x")[...] = 0


def test_either_order(simulation):
    chemistry, particles = simulation.chemistry, simulation.particles
    number = np.arange(len(particles))
    chemistry.set_count("M", number, by_id=True)
    chemistry.set_concentration("C", 1.0 * number, by_id=True)
    assert np.array_equal(chemistry.count("M", by_id=True), number)
    assert np.array_equal(chemistry.count("M"), particles.host("id"))
    assert chemistry.concentration("C", by_id=True) == pytest.approx(number, rel=1e-15)
    assert np.array_equal(particles.by_id("count")[:, 0], number)
    chemistry.set_count("M", number)
    assert np.array_equal(chemistry.count("M"), number)
    particles.set("v", np.stack([number, -number], axis=1), by_id=True)
    assert np.array_equal(particles.by_id("v")[:, 0], number)
    assert np.array_equal(particles.select("fluid", by_id=True), particles.select("fluid"))


def test_order_of_ids_within_a_group():
    """An array for the particles of one group alone."""
    box = pc.Domain((0,), (12.0,), periodic="x", depth=1.0)
    x = np.random.default_rng(4).permutation(np.arange(12) + 0.5)[:, None]
    phases = [pc.Phase(name, pc.Fluid(1000, 1e-3), x[k::2], 1.0) for k, name in enumerate("ab")]
    made = pc.Simulation(box, phases, pc.Static(), [pc.Species("C", 0.0)])
    made.start()
    made.chemistry.set_concentration("C", np.arange(6.0), group="b", by_id=True)
    found = made.chemistry.concentration("C", by_id=True)
    assert found == pytest.approx(np.r_[np.zeros(6), np.arange(6.0)], rel=1e-15)


def test_what_was_read_beside_walls_can_be_put_back():
    """Arrays of all particles, of which those of walls, which hold nothing, are left aside."""
    box = pc.Domain((0, 0), (8, 4), periodic="x", depth=1.0)
    water = pc.Fluid(1.0, 0.1, sound_speed=10.0)
    phases = [pc.fluid(box, water, 1.0), *pc.channel_walls(box, water, 1.0, axis=1)]
    species = [pc.Species("C", 0.0), pc.Species("M", 0.0, molecules=True)]
    made = pc.Simulation(box, phases, pc.SDPD(reference_speed=0.1), species)
    chemistry = made.chemistry
    chemistry.set_concentration("C", lambda x: 1 + x[:, 0] + 10 * x[:, 1])
    chemistry.set_count("M", lambda x: np.rint(x[:, 0] + 10 * x[:, 1]))
    made.start()
    for by_id in (False, True):
        before = chemistry.concentration("C", by_id), chemistry.count("M", by_id)
        chemistry.set_concentration("C", 2 * before[0], by_id=by_id)
        chemistry.set_count("M", 2 * before[1], by_id=by_id)
        assert chemistry.concentration("C", by_id) == pytest.approx(2 * before[0], rel=1e-15)
        assert np.array_equal(chemistry.count("M", by_id), 2 * before[1])
    with pytest.raises(pc.InputError, match=r"values of C = 'of shape \(5,\)'"):
        chemistry.set_concentration("C", np.ones(5))
