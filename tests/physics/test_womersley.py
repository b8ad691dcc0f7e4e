"""A body force of place and time, as a law of one's own, against exact solutions."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.laws import cos, sin, vector


class Oscillating(pc.Law):
    """A force per mass along x that swings in time."""

    def __init__(self, amplitude, frequency):
        self.amplitude, self.frequency = amplitude, frequency

    def finish(self, i, sums):
        return {"a": vector(self.amplitude * cos(self.frequency * i.time), 0.0)}


@pytest.mark.parametrize(
    "scheme",
    [pc.SDPD, pc.TransportVelocity, lambda **o: pc.SDPD(integrator="trapezoidal", **o)],
    ids=["sdpd", "transport velocity", "trapezoidal"],
)
def test_free_fluid_follows_the_force(scheme):
    """v = A sin(ωt)/ω, by the trapezoidal rule of the step: an error of (ω dt)²/12."""
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    force = Oscillating(0.3, 2.0)
    made = scheme(more=[force], reference_speed=0.5)
    simulation = pc.Simulation(box, pc.fluid(box, unit, 1.0), made, dt=0.02)
    simulation.advance(60)
    v = simulation.particles.by_id("v")
    expected = 0.3 * np.sin(2.0 * simulation.time) / 2.0
    assert v[:, 0] == pytest.approx(expected, rel=2 * (2.0 * 0.02) ** 2 / 12)
    assert np.abs(v[:, 1]).max() < 1e-12


class Standing(pc.Law):
    """A force that depends on place: along y, a wave along x."""

    def __init__(self, amplitude, wave):
        self.amplitude, self.wave = amplitude, wave

    def finish(self, i, sums):
        x, _ = i.x.parts(2)
        return {"a": vector(0.0, self.amplitude * sin(self.wave * x))}


def test_a_force_of_place_acts_where_the_particle_is():
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=0.0, sound_speed=10.0)
    made = pc.SDPD(more=[Standing(0.3, np.pi / 4)], reference_speed=0.5)
    simulation = pc.Simulation(box, pc.fluid(box, unit, 1.0), made)
    simulation.start()
    p = simulation.particles
    expected = 0.3 * np.sin(np.pi / 4 * p.by_id("x")[:, 0])
    np.testing.assert_allclose(p.by_id("a")[:, 1], expected, atol=1e-13)


def exact(y, time, half, amplitude, frequency, viscosity):
    """Womersley's flow between plates at ±half: of the force A cos(ωt)."""
    root = np.sqrt(1j * frequency / viscosity)
    shape = 1 - np.cosh(root * y) / np.cosh(root * half)
    return (amplitude / (1j * frequency) * shape * np.exp(1j * frequency * time)).real


@pytest.mark.parametrize("scheme", [pc.SDPD, pc.TransportVelocity])
def test_womersley_at_five(scheme):
    """The velocity at four phases within 1 % of its largest, 24 particles between the plates."""
    across, viscosity = 24, 1.0
    half = across / 2
    frequency = 25 * viscosity / half**2
    amplitude = 0.1 * frequency
    box = pc.Domain((0, 0), (8, across), periodic="x", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=viscosity, sound_speed=3.0)

    def start(x):
        u = exact(x[:, 1] - half, 0.0, half, amplitude, frequency, viscosity)
        return np.stack([u, np.zeros_like(u)], axis=1)

    inside = pc.Phase("fluid", unit, pc.fluid(box, unit, 1.0).points, 1.0, velocity=start)
    walls = pc.channel_walls(box, unit, 1.0, axis=1)
    made = scheme(more=[Oscillating(amplitude, frequency)], reference_speed=0.1)
    simulation = pc.Simulation(box, [inside, *walls], made)
    quarter = round(0.5 * np.pi / frequency / simulation.dt)
    largest = exact(0.0, np.linspace(0, 2 * np.pi / frequency, 99), half, amplitude, frequency, 1.0)
    for _ in range(8):
        simulation.advance(quarter)
        p = simulation.particles
        fluid = p.by_id("is_wall") == 0
        y, u = p.by_id("x")[fluid, 1], p.by_id("v")[fluid, 0]
        error = u - exact(y - half, simulation.time, half, amplitude, frequency, viscosity)
        assert np.sqrt(np.mean(error**2)) < 0.01 * largest.max()
