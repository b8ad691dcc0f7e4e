"""Body forces of place and time."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.laws import cos, sin, where
from systems import unit_fluid


def still(force, dim=2, **options):
    box = pc.Domain((0,) * dim, (8,) * dim, periodic="xyz"[:dim], depth=1.0)
    inside = pc.fluid(box, unit_fluid(), 1.0)
    return pc.Simulation(
        box, inside, pc.SDPD(reference_speed=1.0), forces=[force], **{"dt": 0.01, **options}
    )


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_the_acceleration_is_the_function(dim):
    def force(*given):
        place, t = given[:-1], given[-1]
        return [(k + 1.0) * sin(0.25 * np.pi * x) + t for k, x in enumerate(place)]

    simulation = still(pc.BodyForce(force), dim)
    simulation.start()
    x = simulation.particles.host("x")
    wanted = np.arange(1.0, dim + 1) * np.sin(0.25 * np.pi * x)
    np.testing.assert_allclose(simulation.particles.host("a"), wanted, atol=1e-12)


def test_a_uniform_force_that_swings_is_integrated_to_second_order():
    errors = []
    for steps in (20, 40, 80):
        simulation = still(pc.BodyForce(lambda x, y, t: (cos(3.0 * t), 0.0)), dt=1.0 / steps)
        simulation.advance(steps)
        v = simulation.particles.host("v")
        assert np.ptp(v[:, 0]) < 1e-12
        errors.append(abs(v[0, 0] - np.sin(3.0) / 3.0))
    assert 3.8 < errors[0] / errors[1] < 4.2
    assert 3.9 < errors[1] / errors[2] < 4.1


def test_it_limits_the_automatic_step():
    simulation = still(pc.BodyForce(lambda x, y, t: (where(x > 4.0, 3000.0, 0.0), 0.0)), dt="auto")
    assert simulation.dt == pytest.approx(0.25 * (3.0 / 3000.0) ** 0.5)
    assert simulation.settings["largest_dt_by"] == "BodyForce"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: pc.BodyForce(3.0), "acceleration"),
        (lambda: still(pc.BodyForce(lambda x, y, t: (1.0,))).start(), "one for each dimension"),
        (lambda: still(pc.BodyForce(lambda x, y, t: 1.0)).start(), "gives 2 numbers"),
        (lambda: still(pc.BodyForce(lambda x, t: (1.0, 0.0))).start(), r"called with \(x, y, t\)"),
        (lambda: still(pc.BodyForce(lambda x, y, t: (np.nan, 0.0))).start(), "BodyForce = nan"),
        (lambda: still(pc.BodyForce(lambda x, y, t: (math_cos(t), 0.0))), "BodyForce.largest_step"),
        (
            lambda: pc.Simulation(
                pc.Domain((0, 0), (8, 8), periodic="xy"),
                pc.fluid(pc.Domain((0, 0), (8, 8), periodic="xy"), unit_fluid(), 1.0),
                pc.Static(),
                forces=[pc.BodyForce(lambda x, y, t: (0.0, 0.0))],
            ),
            "Static",
        ),
    ],
)
def test_wrong_forces_are_refused(make, words):
    with pytest.raises(pc.InputError, match=words):
        make()


def math_cos(t):
    raise TypeError("must be real number, not Node")
