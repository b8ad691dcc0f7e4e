"""A temperature that is advected and conducts: a field and a law of one's own."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import particell as pc
from particell.output.quantities import Shown
from systems import lattice_offsets

KAPPA = 0.5


class Conduction(pc.Law):
    """dT/dt = κ ∇²T along a particle's path."""

    def __init__(self, diffusivity):
        self.diffusivity = diffusivity

    def pair(self, i, j, ij):
        more = (j.temperature - i.temperature) * ij.extrapolation
        return {"temperature_rate": (2.0 * self.diffusivity) * (ij.weight * more)}


SCHEMES = {
    "sdpd": lambda **o: pc.SDPD(**o),
    "transport velocity": lambda **o: pc.TransportVelocity(support=3.0, **o),
    "trapezoidal": lambda **o: pc.SDPD(integrator="trapezoidal", **o),
}


def wave(name, dt=0.02, velocity=(0.0, 0.0), side=24):
    box = pc.Domain((0, 0), (side, side), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    scheme = SCHEMES[name](
        more=[Conduction(KAPPA)], fields=[pc.Field("temperature", 300.0)], reference_speed=1.0
    )
    inside = pc.Phase("fluid", unit, pc.fluid(box, unit, 1.0).points, 1.0, velocity=velocity)
    simulation = pc.Simulation(box, inside, scheme, dt=dt)
    x = simulation.particles.host("x")[:, 0]
    simulation.particles.set("temperature", 300.0 + 10.0 * np.sin(2 * np.pi * x / side))
    return simulation


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (1.0, 0.3)], ids=["at rest", "in a stream"])
@pytest.mark.parametrize("name", SCHEMES)
def test_a_wave_decays_as_the_sum_says_and_rides_with_the_fluid(name, velocity):
    """The sum's own eigenvalue, 1.5 % below κk² for a wave of 8 supports; the step adds (λ dt)²."""
    simulation = wave(name, velocity=velocity)
    p = simulation.particles
    start = p.by_id("temperature") - 300.0
    offsets, weights = lattice_offsets(2, 3.0)
    k = 2 * np.pi / 24
    rate = 2 * KAPPA * (weights * (1 - np.cos(k * offsets[:, 0]))).sum()
    assert rate == pytest.approx(KAPPA * k**2, rel=0.02)
    simulation.advance(100)
    expected = start * np.exp(-rate * simulation.time)
    error = (rate * simulation.dt) ** 2 * rate * simulation.time
    np.testing.assert_allclose(p.by_id("temperature") - 300.0, expected, atol=10 * error)
    assert p.by_id("temperature").mean() == pytest.approx(300.0, rel=1e-13)


class Decay(pc.Law):
    """dT/dt = −(1 + 0.3 t) T."""

    def finish(self, i, sums):
        return {"temperature_rate": -(1.0 + 0.3 * i.time) * i.temperature}


SMOOTH = {  # the filter and what keeps the mean density act at times that depend on the step
    **SCHEMES,
    "transport velocity": lambda **o: pc.TransportVelocity(
        support=3.0, filter_every=0, fixed_volume=False, **o
    ),
}


def order(errors):
    """Of errors, or differences, of steps of which each is half of that before."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@pytest.mark.parametrize("name", SMOOTH)
def test_fields_are_of_second_order_in_the_step(name):
    """An exact decay, and a temperature that conducts among particles that are stirred."""
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    wave = 2 * np.pi / 8

    def stirred(law, dt):
        points = pc.fluid(box, unit, 1.0).points
        speed = 0.3 * np.sin(wave * (points[:, ::-1] + 0.3 * points))
        phase = pc.Phase("fluid", unit, points, 1.0, velocity=speed)
        field = pc.Field("temperature", 1.0)
        scheme = SMOOTH[name](more=[law], fields=[field], reference_speed=1.0)
        simulation = pc.Simulation(box, phase, scheme, dt=dt)
        x = simulation.particles.host("x")[:, 0]
        if isinstance(law, Conduction):
            simulation.particles.set("temperature", 1.0 + np.sin(wave * x))
        simulation.advance(round(0.8 / dt))
        return simulation.particles.by_id("temperature")

    exact = np.exp(-0.8 - 0.15 * 0.8**2)
    errors = [np.abs(stirred(Decay(), dt) - exact).max() for dt in (0.04, 0.02, 0.01)]
    assert errors[0] < 1e-3 and order(errors) == pytest.approx(2.0, abs=0.1)
    found = [stirred(Conduction(KAPPA), dt) for dt in (0.04, 0.02, 0.01, 0.005)]
    changes = [np.linalg.norm(a - b) for a, b in itertools.pairwise(found)]
    assert order(changes).min() > 1.8 and order(changes)[-1] < 2.2


def test_between_walls_the_profile_is_linear():
    """Fixed temperatures on both surfaces: the steady profile is exact, at the wall too."""
    box = pc.Domain((0, 0), (8, 10), periodic="x", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    scheme = pc.SDPD(more=[Conduction(KAPPA)], fields=[pc.Field("temperature", 1.0)])
    walls = pc.channel_walls(box, unit, 1.0, axis=1)
    simulation = pc.Simulation(box, [pc.fluid(box, unit, 1.0), *walls], scheme)
    p = simulation.particles
    upper = p.host("x")[:, 1] > 10
    p.set("temperature", np.where(upper, 3.0, 1.0))
    simulation.advance(6000)
    fluid = p.by_id("is_wall") == 0
    y = p.by_id("x")[fluid, 1]
    np.testing.assert_allclose(p.by_id("temperature")[fluid], 1.0 + 0.2 * y, rtol=1e-6)


def test_it_is_in_frames_and_checkpoints(tmp_path):
    whole = wave("sdpd").run(until=0.4, every=0.1, out=tmp_path / "whole", progress=False)
    assert whole.field("temperature").shape == (5, 576)
    part = wave("sdpd")
    part.run(until=0.2, every=0.1, out=tmp_path / "part", progress=False)
    part.run(until=0.4, every=0.1, progress=False)
    np.testing.assert_array_equal(
        part.particles.by_id("temperature"), whole.field("temperature")[-1]
    )


def test_names_that_are_taken_are_refused():
    box = pc.Domain((0, 0), (8, 8), periodic="xy")
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    for name in ("density", "a b", "_x"):
        with pytest.raises(pc.InputError, match="name"):
            pc.Simulation(box, pc.fluid(box, unit, 1.0), pc.SDPD(fields=[pc.Field(name)]))


def test_units_of_fields_are_in_frames_and_labels(tmp_path):
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    scheme = pc.SDPD(fields=[pc.Field("brightness", 2.0, unit="cd"), pc.Field("mark")])
    for out in (None, tmp_path / "out"):
        simulation = pc.Simulation(box, pc.fluid(box, unit, 1.0), scheme, dt=0.01)
        run = simulation.run(0.02, 0.01, out, progress=False)
        assert run.source.unit("brightness") == "cd" and run.source.unit("mark") == ""
        assert run.source.unit("velocity") == "m/s"
        assert "cd" in run._repr_html_()
        assert Shown(run, "brightness").label == "brightness [cd]"
