"""Order in the time step: halved twice, the same particles come to the same places and speeds."""

from __future__ import annotations

import numpy as np
import pytest

from particell.geometry.domain import Domain
from particell.phases import Phase, channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.timestep import EXPLICIT
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import periodic_lattice, transported_lattice, unit_fluid

SIDE = 8


def final_state(scheme, steps: int, walls: bool, viscosity: float) -> list[np.ndarray]:
    """x, v and ρ at t = 2 of sheared and compressed particles, off their lattice."""
    domain = Domain((0, 0), (SIDE, SIDE), periodic="x" if walls else "xy", depth=1.0)
    material = unit_fluid(viscosity=viscosity, sound_speed=3.0)
    points = fluid(domain, material, 1.0).points
    points = points + np.random.default_rng(5).uniform(-0.1, 0.1, points.shape)
    wave = 2 * np.pi / SIDE

    def velocity(x):
        if walls:
            speed = np.sin(wave * x[:, :1]) * np.sin(0.5 * wave * x[:, 1:])
            return 0.1 * speed * np.array([1.0, 0.5])
        return 0.1 * np.sin(wave * (x[:, ::-1] + 0.3 * x))

    phases = [Phase("fluid", material, points % [SIDE, SIDE], 1.0, velocity=velocity)]
    if walls:
        phases += channel_walls(domain, material, 1.0, axis=1)
    simulation = Simulation(domain, phases, scheme, dt=2.0 / steps)
    simulation.advance(steps)
    p = simulation.particles
    x = p.by_id("x")
    return [np.exp(1j * wave * x), p.by_id("v"), p.by_id("density")]


# The filter and what keeps the mean density act at times that depend on the step (the latter at
# builds of the list: of the densities here 3e-6).
SMOOTH = {"filter_every": 0, "fixed_volume": False}
TRANSPORT = TransportVelocity(**SMOOTH)
DIFFUSING = TransportVelocity(**SMOOTH, density_diffusion=0.1, normalise_viscosity=True)
PLAIN = TransportVelocity(**SMOOTH, renormalise=False, momentum_flux="conserving")


@pytest.mark.parametrize(
    ("scheme", "walls"),
    [
        (SDPD(), False),
        (SDPD(), True),
        (SDPD(density_diffusion=0.0, shifting=0.5), False),
        (SDPD(density="summation"), False),
        (SDPD(density_diffusion=0.0, integrator="trapezoidal"), False),
        (TRANSPORT, False),
        (DIFFUSING, True),
        (PLAIN, False),
    ],
)
def test_second_order(scheme, walls):
    """Positions, velocities and densities, with friction; it was first order in all but one."""
    runs = [final_state(scheme, steps, walls, 0.3) for steps in (20, 40, 80)]
    for coarse, middle, fine in zip(*runs, strict=True):
        order = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
        assert order > 1.8


def test_a_shift_is_the_same_at_any_step():
    """δv belongs to the fluid and its resolution, not to the step or the frames of a run."""
    found = []
    for dt in (0.01, 0.04):
        simulation = transported_lattice(2, 8, jitter=0.2, dt=dt)
        simulation.advance(1)
        p = simulation.particles
        found.append(p.by_id("transport") - p.by_id("v"))
        limit = 0.05 * np.linalg.norm(found[0], axis=1).max()
    assert np.abs(found[1] - found[0]).max() < limit


@pytest.mark.parametrize("make", [periodic_lattice, transported_lattice])
def test_friction_ahead_costs_no_stability(make):
    """λ dt (1 + lead) is never more than the automatic step's λ dt of friction without a lead."""
    material = unit_fluid(viscosity=30.0)
    if make is periodic_lattice:
        simulation = make(8, 2, material, jitter=0.3)
    else:
        simulation = make(2, 8, 0.3, material=material)
    flow, dt = simulation.solver.flow, simulation.dt
    leads = np.array([flow.lead(dt * f) for f in (0.1, 0.3, 0.6, 1.0, 1.3)])
    stiff = flow.properties.stiffness * dt * np.array([0.1, 0.3, 0.6, 1.0, 1.3])
    assert leads[0] == 1.0 and leads[-1] < 1.0
    assert np.all(stiff * (1 + leads) <= max(EXPLICIT, stiff[-1]) * (1 + 1e-12))
    p = simulation.particles
    simulation.start()
    p.set("v", np.random.default_rng(1).normal(size=p.host("v").shape))
    p.set("v", p.host("v") - p.host("v").mean(axis=0))
    start = simulation.monitor.kinetic_energy()
    simulation.advance(300)
    assert simulation.monitor.kinetic_energy() < 1e-3 * start
