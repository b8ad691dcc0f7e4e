"""Places in the box, and how far those outside were from it."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from systems import unit_fluid


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("lower", [0.0, -0.3, 1e5])
def test_wrapped_places_are_inside(kind, lower):
    """Beside both faces too, where the remainder of a tiny number rounds to the other face."""
    domain = pc.Domain((lower, lower), (lower + 1.1, lower + 1), periodic="x")
    faces = np.array([domain.lower[0], domain.upper[0], domain.lower[0] + 3 * 1.1], kind)
    near = [np.nextafter(faces, kind(side * np.inf)) for side in (-1, 1)]
    tiny = lower + np.array([-1e-20, 1e-20, -1e-300])
    x = np.concatenate([faces, *near, tiny, lower + np.linspace(-7, 7, 101)]).astype(kind)
    points = np.stack([x, x], axis=1)
    places, turns = domain.wrapped(points)
    assert places.dtype == kind
    assert (places[:, 0] >= domain.lower[0]).all() and (places[:, 0] < domain.upper[0]).all()
    assert np.array_equal(turns, np.rint(turns))
    again = places + turns * domain.lengths
    assert np.abs(again - points).max() <= 4 * np.finfo(kind).eps * np.abs(points).max()
    assert np.array_equal(places[:, 1], points[:, 1])  # not periodic


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("lower", [0.0, -4.0])
def test_frames_of_a_stream_through_periodic_faces(dim, lower):
    """Lists, and with them places, are made anew seldom where all flow together."""
    domain = pc.Domain((lower,) * dim, (lower + 8,) * dim, periodic="xyz"[:dim], depth=1.0)
    u = np.array((1.0, -0.5, 0.25)[:dim])
    phase = pc.fluid(domain, unit_fluid(), 1.0, velocity=tuple(u))
    schemes = [pc.SDPD(support=2.0)] + [pc.TransportVelocity(support=2.0)] * (dim > 1)
    for scheme in schemes:
        simulation = pc.Simulation(domain, phase, scheme)
        run = simulation.run(4.0, every=0.1, progress=False)
        assert simulation.neighbours.builds < 10
        x, image = run.field("position")[:], run.field("image")[:]
        assert (x >= domain.lower).all() and (x < domain.upper).all()
        moved = x + image * domain.lengths - x[0]
        assert moved == pytest.approx(u * run.times[:, None, None] + 0 * moved, abs=1e-10)


def test_functions_of_the_place_see_places_in_the_box():
    domain = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
    walls = pc.channel_walls(domain, unit_fluid(), 1.0, axis=1, velocity=((1.0, 0.0),) * 2)
    phases = [pc.fluid(domain, unit_fluid(), 1.0, velocity=(1.0, 0.0)), *walls]
    simulation = pc.Simulation(domain, phases, pc.SDPD(support=2.0), [pc.Species("C", 0.0)])
    for _ in range(60):
        simulation.advance(1)
        if outside := simulation.particles.view("x")[:, 0].max() > 8:
            break
    assert outside  # in memory they are not wrapped yet

    def value(x):
        assert (x[:, 0] >= 0).all() and (x[:, 0] < 8).all()
        return x[:, 0]

    simulation.chemistry.set_concentration("C", value)
    frame = simulation.frame()
    mobile = simulation.particles.by_id("is_wall") == 0
    found = frame["concentration/C"][mobile]
    assert found == pytest.approx(frame["position"][mobile, 0], abs=1e-12)
