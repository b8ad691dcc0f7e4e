"""Pressure by the virial, and answers of waves, against what is exact."""

from __future__ import annotations

import numpy as np
import pytest

from particell.analysis.modes import (
    Responses,
    decay_rate,
    friction_transform,
    jackknife,
    polarisations,
    responses,
    slopes,
    sound,
    sound_answer,
    virial_pressure,
    waves_up_to,
)
from particell.cases.equilibrium_structure import kernel_transform
from particell.kernels import CODES, kernel_code, normalisation, shape_w
from systems import lattice_viscosity, periodic_lattice, unit_fluid


def summed(x: np.ndarray, edge: float, kernel: str, support: float) -> np.ndarray:
    """Σ W of particles of mass 1 in a periodic box."""
    offset = x[:, None] - x[None]
    offset -= edge * np.rint(offset / edge)
    q = np.linalg.norm(offset, axis=2) / support
    code, dim = kernel_code(kernel), x.shape[1]
    w = np.vectorize(lambda s: shape_w.py_func(s, code))(q)
    return w.sum(axis=1) * normalisation(code, dim) / support**dim


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kernel", ["lucy", "wendland-c2"])
def test_the_virial_is_the_derivative_of_the_energy(dim, kernel):
    """P = −dE/dV + n k_BT with E = Σ ρ_i²/2, whose derivative P/ρ² by ρ_i is ρ_i."""
    edge, support = 5.0, 2.1
    x = np.random.default_rng(1).uniform(0, edge, (40, dim))
    ones = np.ones(len(x))

    def energy(scale: float) -> float:
        return float(0.5 * (summed(scale * x, scale * edge, kernel, support) ** 2).sum())

    step = 1e-5
    slope = (energy(1 + step) - energy(1 - step)) / (2 * step)  # dE/d ln L
    term = summed(x, edge, kernel, support)  # dE/dρ_i
    found = virial_pressure(x, np.full(dim, edge), ones, term, support, kernel, 0.7)
    expected = -slope / (dim * edge**dim) + 0.7 * len(x) / edge**dim
    assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("kernel", CODES)
def test_slopes_are_those_of_the_kernel(kernel):
    code, step = kernel_code(kernel), 1e-5
    r = np.linspace(0.1, 1.9, 19)
    scale = normalisation(code, 3) / 8
    w = [[shape_w.py_func(s / 2, code) for s in r + d] for d in (step, -step)]
    expected = -scale * (np.array(w[0]) - np.array(w[1])) / (2 * step) / r
    assert slopes(r, 2.0, kernel, 3) == pytest.approx(expected, abs=2e-6)
    assert slopes(np.array([2.0, 3.0]), 2.0, kernel, 3).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("dim", "number"), [(1, 2), (2, 10), (3, 28)])
def test_waves_come_once_and_directions_are_orthonormal(dim, number):
    waves = waves_up_to(dim, 5)
    assert len(waves) == number
    assert len({tuple(w) for w in np.vstack([waves, -waves])}) == 2 * number
    directions = polarisations(waves)
    product = np.einsum("amd,bmd->mab", directions, directions)
    assert product == pytest.approx(np.broadcast_to(np.eye(dim), product.shape), abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_friction_of_long_waves_is_the_viscosity_and_of_short_ones_less(dim):
    for kernel in CODES:
        assert friction_transform(1e-2, kernel, dim) == pytest.approx(1, abs=1e-5)
        found = friction_transform(1e-2, kernel, dim, along=True)
        assert found == pytest.approx(2 * (1 - 1 / dim), abs=1e-5)
    # a fine lattice knows the transform of a wave as long as 7 supports
    wave = np.eye(dim)[0] * 0.9 / 6
    for along in (False, True):
        fine = lattice_viscosity(dim, 6.0, 1.0, 0.0, wave, np.eye(dim)[0 if along else 1])
        assert friction_transform(0.9, "lucy", dim, along) == pytest.approx(fine, rel=2e-3)


def test_velocity_verlet_tends_to_the_exact_motion_by_its_order():
    """And is what the map of one step makes of it: det = 1 − λ dt, trace = 2 − λ dt − ω² dt²."""
    time = np.linspace(0, 4, 5)
    exact = sound_answer(time, 1.5, 0.8)
    error = [np.abs(sound_answer(time, 1.5, 0.8, dt) - exact).max() for dt in (0.02, 0.01)]
    assert 1.8 < error[0] / error[1] < 2.3  # the friction is half a step late
    v = sound_answer(0.1 * np.arange(20), 1.5, 0.8, 0.1)[2:]
    assert v[2:] == pytest.approx((2 - 0.08 - 0.0225) * v[1:-1] - (1 - 0.08) * v[:-2], abs=1e-12)


def test_a_lattice_without_noise_decays_as_its_sum_says():
    """Transverse waves of a resting lattice: ν k², as without noise friction leads half a step."""
    material = unit_fluid(viscosity=0.5, sound_speed=5.0)
    pair = [periodic_lattice(16, 2, material, density="summation") for _ in range(2)]
    p = pair[0].particles
    states = [(p.by_id("x"), p.by_id("v"))] * 2
    steps = np.array([0, 20, 60])
    waves = np.array([[1.0, 0.0], [0.0, 1.0]])
    found = responses(*pair, states, waves, steps, 1e-6)
    k = 2 * np.pi / 16
    nu = 0.5 * lattice_viscosity(2, 3.0, 1.0, 0.0, np.array([k, 0.0]), np.array([0.0, 1.0]))
    rate = nu * k * k
    # velocities at whole steps, and the first half step
    assert decay_rate(found, k).value == pytest.approx(rate, rel=2e-3)
    c, attenuation = sound(found, k, (5.0, 0.5))
    assert c.value == pytest.approx(5.0 * kernel_transform(3 * k, "lucy", 2), rel=5e-3)
    assert attenuation.value == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("damping", [0.05, 3.0])
def test_sound_is_found_again_oscillating_or_not(damping):
    k, c = 0.5, 2.0
    time = np.linspace(0, 8, 33)
    half = 0.5 * damping * c / k * k * k
    omega = np.emath.sqrt((c * k) ** 2 - half**2 + 0j)
    u = np.exp(-half * time) * (np.cos(omega * time) - half / omega * np.sin(omega * time)).real
    answers = Responses(
        time, np.array([k]), np.tile(u[None, :, None], (3, 1, 1)), np.ones((3, 33, 1))
    )
    speed, attenuation = sound(answers, k, (1.1 * c, 0.8 * damping * c / k))
    assert speed.value == pytest.approx(c, rel=1e-6)
    assert attenuation.value == pytest.approx(damping * c / k, rel=1e-6)
    assert speed.error == pytest.approx(0, abs=1e-6)


def test_jackknife_of_a_mean_is_its_standard_error():
    samples = np.random.default_rng(2).normal(3, 1, 50)
    (found,) = jackknife(samples, lambda mean: mean)
    assert found.value == pytest.approx(samples.mean())
    assert found.error == pytest.approx(samples.std(ddof=1) / np.sqrt(50))
