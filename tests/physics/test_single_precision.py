"""Physics on a device with single precision, within what rounding allows.

A number is stored to u = 2⁻²⁴ = 6e-8 of itself. What follows from that is written at each bound;
a formula with an error, or a sum that loses its antisymmetry, misses them by orders of magnitude.
"""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.compute.device import Device
from systems import lattice_viscosity, periodic_lattice, unit_fluid

ROUNDING = 2.0**-24
SIDE = 16
WAVE = 2 * np.pi / SIDE


def single() -> Device:
    return Device(precision="float32")


def shear(x):
    return 0.1 * np.stack([0 * x[:, 0], np.sin(WAVE * x[:, 0])], -1)


def swirl(x):
    """Taylor–Green vortices."""
    a, b = WAVE * x.T
    return 0.1 * np.stack([np.sin(a) * np.cos(b), -np.cos(a) * np.sin(b)], -1)


def test_fields_of_the_flow_are_single_and_amounts_are_not():
    simulation = diffusing(single())
    kinds = {name: simulation.particles[name].dtype for name in ("x", "v", "density", "amount")}
    assert kinds.pop("amount") == np.float64
    assert set(kinds.values()) == {np.dtype(np.float32)}


def test_friction_on_a_shear_wave_is_exact():
    """a = -ν k² v with the viscosity of the lattice; all differences of velocity are of order v.

    Σ_j of 28 terms, each rounded by a few u of v times its coefficient, which sum up to ν k² times
    1/(k h)² ~ 1: 100 u are room for all of them.
    """
    simulation = periodic_lattice(
        SIDE, 2, unit_fluid(viscosity=0.5), velocity=shear, device=single()
    )
    simulation.start()
    v, a = (simulation.particles.by_id(name).astype(float)[:, 1] for name in "va")
    viscosity = lattice_viscosity(2, 3.0, 0.5, 0.0, np.array([WAVE, 0.0]), np.array([0.0, 1.0]))
    expected = -viscosity * WAVE**2 * v
    assert np.abs(a - expected).max() < 100 * ROUNDING * np.abs(expected).max()


def test_momentum_is_kept_to_round_off():
    """Two kicks a step, each rounded by u |v|: 2 u Σ m|v| a step, were all of one sign."""
    steps = 100
    simulation = periodic_lattice(
        SIDE, 2, jitter=0.1, velocity=swirl, device=single(), density_diffusion=0.1
    )
    simulation.advance(steps)
    assert simulation.conservation()["momentum"] < 2 * steps * ROUNDING


def test_vortices_decay_as_in_double_precision():
    """The density's rounding is the largest: a pressure c² ρ u beside that of the flow, ρ U².

    It has random signs, and is one of 256 particles.
    """
    energies = []
    for device in (single(), Device()):
        simulation = periodic_lattice(
            SIDE, 2, unit_fluid(viscosity=0.5), velocity=swirl, device=device, dt=0.05
        )
        simulation.start()
        first = simulation.observables()["kinetic_energy"]
        simulation.advance(80)
        energies.append(simulation.observables()["kinetic_energy"] / first)
    assert 0.1 < energies[1] < 0.5
    pressure = 10.0**2 * ROUNDING / 0.1**2
    assert energies[0] == pytest.approx(energies[1], rel=pressure / SIDE)


def diffusing(device: Device) -> pc.Simulation:
    domain = pc.Domain((0, 0), (SIDE, SIDE), periodic="xy", depth=1.0)
    lattice = pc.fluid(domain, unit_fluid(), 1.0)
    noise = np.random.default_rng(5).uniform(-0.1, 0.1, lattice.points.shape)
    simulation = pc.Simulation(
        domain,
        pc.Phase("fluid", lattice.material, lattice.points + noise, 1.0),
        pc.SDPD(),
        [pc.Species("A", 0.5)],
        device=device,
    )
    simulation.chemistry.set_concentration("A", lambda x: 1 + np.cos(WAVE * x[:, 0]))
    return simulation


def test_diffusion_in_single_precision():
    """Amounts and their exchange are double: conserved as such. Places are single.

    A distance of about 1 between places of up to 16 is rounded by 16 u; the kernel's slope at the
    rim, in units of its sum, is of order 1: 100 u of the decay's exponent.
    """
    amplitudes = []
    for device in (single(), Device()):
        simulation = diffusing(device)
        simulation.advance(100)
        values = simulation.chemistry.concentration("A")
        waves = np.cos(WAVE * simulation.particles.host("x")[:, 0].astype(float))
        amplitudes.append(2 * float(np.mean(values * waves)))
        assert simulation.conservation()["amount A"] == pytest.approx(0.0, abs=1e-13)
    assert 0.1 < amplitudes[1] < 0.9
    assert amplitudes[0] == pytest.approx(amplitudes[1], rel=100 * ROUNDING)
