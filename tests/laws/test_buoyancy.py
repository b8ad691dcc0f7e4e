"""Boussinesq buoyancy against its formula, for concentrations and for molecules."""

import numpy as np
import pytest

import particell as pc
from particell.materials import AVOGADRO


def box(molecules: bool) -> pc.Simulation:
    domain = pc.Domain((0, 0), (1, 1), periodic="xy", depth=1.0)
    fluid = pc.Fluid(density=1.0, viscosity=0.0, sound_speed=10.0)
    return pc.Simulation(
        domain,
        pc.fluid(domain, fluid, 0.1),
        pc.SDPD(support=2.5),
        [pc.Species("C", molecules=molecules)],
        forces=[pc.Buoyancy("C", expansion=2.0, gravity=(0.0, -9.0), reference=1.0)],
        dt=1e-4,
    )


@pytest.mark.parametrize("molecules", [False, True])
def test_acceleration_is_minus_g_beta_times_the_excess(molecules):
    sim = box(molecules)
    concentration = 1.0 + sim.particles.host("x")[:, 0]
    if molecules:
        whole = np.rint(concentration * 0.01 * AVOGADRO * 1e-18)
        sim.chemistry.set_count("C", whole)
        concentration = whole / (0.01 * AVOGADRO)
    else:
        sim.chemistry.set_concentration("C", concentration)
    expected = np.empty(100)
    expected[sim.particles.host("id")] = 18.0 * (concentration - 1.0)
    sim.start()
    a = sim.particles.by_id("a")
    np.testing.assert_allclose(a[:, 1], expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(a[:, 0], 0.0, atol=1e-10)


def test_unknown_species_is_named():
    domain = pc.Domain((0, 0), (1, 1), periodic="xy")
    fluid = pc.Fluid(density=1.0, viscosity=0.0, sound_speed=10.0)
    with pytest.raises(pc.InputError, match="species = 'heat'"):
        pc.Simulation(
            domain,
            pc.fluid(domain, fluid, 0.1),
            pc.SDPD(support=2.5),
            [pc.Species("C")],
            forces=[pc.Buoyancy("heat", expansion=1.0, gravity=(0.0, -9.0))],
        )
