from __future__ import annotations

import numpy as np
import pytest

from particell.analysis.statistics import (
    BOLTZMANN,
    block_average,
    decay_rate,
    epsilon_error,
    kinetic_temperature,
    maxwellian_test,
    moments,
    relative_l2,
)
from particell.errors import InputError


def test_errors():
    assert relative_l2([3.0, 4.0], [3.0, 4.0]) == 0
    assert relative_l2([3.0, 9.0], [3.0, 4.0]) == pytest.approx(1.0)
    assert epsilon_error([1.0, 2.0, 2.0, 1.0], [1.0, 2.0, 2.0, 4.0], 2.0) == pytest.approx(3 / 8)
    with pytest.raises(InputError, match="not zero everywhere"):
        relative_l2([1.0], [0.0])
    with pytest.raises(InputError, match="equal to"):
        relative_l2([1.0], [1.0, 2.0])


def test_moments():
    found = moments([[1.0, 0.0], [3.0, 0.0], [5.0, 0.0]])
    assert found.mean.tolist() == [3.0, 0.0]
    assert found.deviation.tolist() == [2.0, 0.0]
    assert found.error[0] == pytest.approx(2 / np.sqrt(3))
    assert found.samples == 3
    with pytest.raises(InputError):
        moments([1.0])


def maxwellian(temperature: float, n: int = 20_000):
    random = np.random.default_rng(4)
    mass = random.uniform(1, 3, n) * 1e-18
    velocity = random.normal(size=(n, 3)) * np.sqrt(BOLTZMANN * temperature / mass)[:, None]
    return mass, velocity


def test_kinetic_temperature():
    mass, velocity = maxwellian(300.0)
    assert kinetic_temperature(mass, velocity, False) == pytest.approx(300, rel=0.02)
    moving = velocity + np.array([1.0, 0, 0])
    assert kinetic_temperature(mass, moving) == pytest.approx(
        kinetic_temperature(mass, velocity), rel=1e-9
    )
    # Two particles, equal and opposite: all energy in D degrees of freedom.
    two = kinetic_temperature([1.0, 1.0], [[1.0, 0.0], [-1.0, 0.0]])
    assert two == pytest.approx(2 / (2 * BOLTZMANN))


def test_maxwellian():
    mass, velocity = maxwellian(300.0)
    good = maxwellian_test(velocity, mass, 300.0)
    assert good.freedom == 19
    assert good.p_value > 0.01
    assert maxwellian_test(velocity, mass, 315.0).p_value < 1e-6
    frames = np.stack([velocity, -velocity[::1]])
    assert maxwellian_test(frames, mass, 300.0).statistic < 100
    with pytest.raises(InputError, match="bins"):
        maxwellian_test(velocity[:3], mass[:3], 300.0, bins=20)


def test_decay_rate():
    t = np.linspace(0, 2, 30)
    exact = decay_rate(t, 3 * np.exp(-1.7 * t))
    assert exact.rate == pytest.approx(1.7)
    assert exact.amplitude == pytest.approx(3.0)
    assert exact.error < 1e-12
    noise = np.exp(np.random.default_rng(1).normal(size=30) * 0.01)
    rough = decay_rate(t, 3 * np.exp(-1.7 * t) * noise)
    assert abs(rough.rate - 1.7) < 4 * rough.error
    with pytest.raises(InputError, match="positive"):
        decay_rate([0, 1], [1.0, 0.0])
    with pytest.raises(InputError, match="two different times"):
        decay_rate([1, 1], [1.0, 1.0])


def test_block_average_knows_the_memory_of_a_series():
    random = np.random.default_rng(1)
    steps = random.standard_normal(40_000)
    series = np.empty_like(steps)
    series[0] = 0.0
    for k in range(1, len(steps)):  # an AR(1) process with a memory of about 10
        series[k] = 0.9 * series[k - 1] + steps[k]
    exact = 10 / np.sqrt(len(steps))  # deviation of the mean: 1/(1 - 0.9)/sqrt(n)
    blocked = block_average(series)
    assert blocked.samples == 20
    assert float(blocked.error) == pytest.approx(exact, rel=0.6)
    assert abs(float(blocked.mean)) < 5 * exact
    with pytest.raises(InputError, match="blocks"):
        block_average(series[:5])
