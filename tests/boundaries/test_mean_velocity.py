from __future__ import annotations

import numpy as np
import pytest

from particell.boundaries.mean_velocity import MeanVelocity
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.phases import channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.simulation import Simulation
from systems import fluid_rows, periodic_lattice, unit_fluid


def test_channel_without_a_force_flows_as_asked():
    """From a plug to the parabola 6 u y (1 - y); walls cost 12 ν u/H², which nobody gave."""
    domain, material, spacing, mean = Domain((0, 0), (1, 1), periodic="x"), unit_fluid(), 0.1, 0.5
    simulation = Simulation(
        domain,
        [
            fluid(domain, material, spacing, velocity=(mean, 0)),
            *channel_walls(domain, material, spacing, axis=1),
        ],
        SDPD(),
        boundaries=[MeanVelocity(mean)],
    )
    simulation.run(4.0, progress=False)  # e^(-4 ν π² t/H²) = 1e-7
    rows = fluid_rows(simulation)
    y = simulation.particles.host("x")[rows, 1]
    v = simulation.particles.host("v")[rows, 0]
    assert v.mean() == pytest.approx(mean, rel=1e-12)
    np.testing.assert_allclose(v, 6 * mean * y * (1 - y), atol=0.02 * 1.5 * mean)


def test_mean_is_kept_per_mass_along_its_axis_alone():
    simulation = periodic_lattice(8, boundaries=[MeanVelocity(2.0, axis=1)])
    mass = simulation.particles.host("mass")
    before = (mass[:, None] * simulation.particles.host("v")).sum(axis=0) / mass.sum()
    simulation.advance(3)
    after = (mass[:, None] * simulation.particles.host("v")).sum(axis=0) / mass.sum()
    np.testing.assert_allclose(after, [before[0], 2.0], atol=1e-13)


def test_refused():
    with pytest.raises(InputError, match="velocity"):
        MeanVelocity(np.inf)
    domain = Domain((0, 0), (1, 1), periodic="x")
    with pytest.raises(InputError, match="periodic"):
        Simulation(
            domain, fluid(domain, unit_fluid(), 0.1), SDPD(), boundaries=[MeanVelocity(1, axis=1)]
        )
