"""The sound speed that is chosen for a flow in which friction counts, and not inertia."""

from __future__ import annotations

import numpy as np

import particell as pc


def test_a_slow_cavity_is_hardly_compressed():
    """Re = 1: with ten times the lid's velocity alone density changes by 23 %.

    (And with 20 particles across such a run breaks after 1.7 L/U.) Pressure is singular in the
    lid's corners; the particles next to them see some 8 μU/h.
    """
    domain, spacing = pc.Domain((0, 0), (1, 1)), 1 / 16
    water = pc.Fluid(density=1.0, viscosity=1.0)
    lid = {"y-upper": (1.0, 0.0)}
    simulation = pc.Simulation(
        domain,
        [pc.fluid(domain, water, spacing), *pc.box_walls(domain, water, spacing, sliding=lid)],
        pc.TransportVelocity(fixed_volume=True),
    )
    assert np.isclose(simulation.materials[0].sound_speed, 10 / np.sqrt(2.6 / 16))
    for _ in range(5):
        simulation.advance(100)
        mobile = simulation.particles.host("is_wall") == 0
        away = np.abs(simulation.particles.host("density")[mobile] - 1)
        assert away.max() < 0.1
        assert away.mean() < 0.01
