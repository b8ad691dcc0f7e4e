"""The integrator's sound, and what a scheme refuses."""

from __future__ import annotations

import numpy as np
import pytest

from particell.errors import InputError
from particell.schemes.sdpd import SDPD
from particell.schemes.static import Static
from systems import periodic_lattice, unit_fluid


def test_sound_neither_decays_nor_grows_and_has_the_right_frequency():
    """A standing wave: within 1 % of c₀k, and no change of amplitude over five periods."""
    sound, number = 1.0, 64
    wave = 2 * np.pi / number
    simulation = periodic_lattice(
        (number, 8),
        material=unit_fluid(viscosity=0.0, sound_speed=sound),
        velocity=lambda x: 1e-5 * np.sin(wave * x[:, :1]) * np.array([1.0, 0.0]),
    )
    periods, steps = 5, int(5 * number / sound / simulation.dt)
    simulation.start()
    shape = np.sin(wave * (simulation.particles.by_id("x")[:, 0]))
    times, amplitude = [], []
    for _ in range(steps):
        simulation.advance(1)
        times.append(simulation.time)
        amplitude.append(2 * (simulation.particles.by_id("v")[:, 0] * shape).mean())
    t, y = np.array(times), np.array(amplitude) / 1e-5
    crossings = np.flatnonzero(y[1:] * y[:-1] < 0)
    roots = t[crossings] - y[crossings] * (t[crossings + 1] - t[crossings]) / (
        y[crossings + 1] - y[crossings]
    )
    frequency = np.pi / np.diff(roots).mean()
    assert len(roots) >= 2 * periods - 1
    assert frequency == pytest.approx(sound * wave, rel=0.01)
    half = len(t) // periods
    assert np.abs(y[-half:]).max() == pytest.approx(np.abs(y[:half]).max(), abs=3e-3)
    assert np.abs(y[-half:]).max() == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"kernel": "lucky"}, "kernel"),
        ({"support": 1.0}, "support"),
        ({"support": 11.0}, "support"),
        ({"density": "sum"}, "density"),
        ({"integrator": "euler"}, "integrator"),
        ({"noise": "white"}, "noise"),
        ({"skin": 0.0}, "skin"),
        ({"skin": 1.5}, "skin"),
        ({"density_diffusion": -0.1}, "density_diffusion"),
        ({"density_diffusion": 0.1, "fluctuations": True}, "density_diffusion"),
    ],
)
def test_refused(wrong, key):
    with pytest.raises(InputError) as error:
        SDPD(**wrong)
    assert error.value.key == key
    assert "\n" not in str(error.value)


def test_defaults():
    assert SDPD().delta == 0.1
    assert SDPD(density="summation").delta == SDPD(fluctuations=True).delta == 0
    assert SDPD().skin == 0.1
    assert SDPD(fluctuations=True).skin == 0.3
    with pytest.raises(InputError, match="support"):
        Static(support=0.5)
