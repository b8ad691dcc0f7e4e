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
