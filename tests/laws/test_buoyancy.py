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


@pytest.mark.parametrize("molecules", [False, True])
def test_walls_bear_the_head_as_they_bear_that_of_gravity(molecules):
    """C uniform and gβC = 3 downwards: the same wall pressures as with that gravity."""

    def pressures(buoyant: bool) -> np.ndarray:
        domain = pc.Domain((0, 0), (1, 1), periodic="x", depth=1.0)
        fluid = pc.Fluid(density=1.0, viscosity=0.0, sound_speed=10.0)
        # 1e15 molecules in a particle of 0.01 m³ are 1.66e-7 mol/m³
        count = 10**15
        concentration = count / (0.01 * AVOGADRO)
        force = pc.Buoyancy("C", expansion=-1.0 / concentration, gravity=(0.0, -3.0))
        sim = pc.Simulation(
            domain,
            [pc.fluid(domain, fluid, 0.1), *pc.channel_walls(domain, fluid, 0.1, axis=1)],
            pc.SDPD(support=2.5, gravity=None if buoyant else (0.0, -3.0)),
            [pc.Species("C", molecules=molecules)],
            forces=[force] if buoyant else [],
            dt=1e-4,
        )
        if molecules:
            sim.chemistry.set_count("C", count)
        else:
            sim.chemistry.set_concentration("C", concentration)
        sim.start()
        assert np.abs(sim.particles.by_id("a")).max() > 0
        return sim.particles.by_id("pressure")[sim.particles.by_id("is_wall") != 0]

    with_gravity = pressures(False)
    assert np.ptp(with_gravity) > 0.3
    np.testing.assert_allclose(pressures(True), with_gravity, rtol=1e-9, atol=1e-12)
