r"""What a fluid of particles is: its pressure by the virial, and how its waves answer to a kick.

A velocity :math:`\epsilon\,e\cos(k\cdot x+\varphi)` is added to a state, and the run goes on twice
with the same noise, with and without it. The difference, projected on the wave, is the wave's
linear response; by Onsager's regression it is the normalised correlation of the wave's fluctuations
:math:`\langle j_k(t)\,j_k^*(0)\rangle/\langle|j_k|^2\rangle`, but the noise, being in both, has
gone. So decay rates that fluctuations give to 5 % in some hundred decay times are had to 0.5 % in
ten.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import quad
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from particell.kernels import kernel_code, normalisation, shape_f
from particell.laws.viscosity import friction_coefficients

if TYPE_CHECKING:
    from particell.simulation import Simulation


def slopes(distance: np.ndarray, support: float, kernel: str, dim: int) -> np.ndarray:
    """F = −W'/r at distances in m, for one support in m."""
    code = kernel_code(kernel)
    # between tabulated values, which are right to 1e-7 of the largest
    q = np.linspace(0.0, 1.0, 4001)
    table = np.array([shape_f.py_func(value, code) for value in q])
    scale = normalisation(code, dim) / support ** (dim + 2)
    return scale * np.interp(distance / support, q, table, right=0.0)


def virial_pressure(
    position: np.ndarray,
    edges: np.ndarray,
    mass: np.ndarray,
    term: np.ndarray,
    support: float,
    kernel: str,
    thermal: float,
) -> float:
    r"""Pressure of a periodic box in Pa, :math:`n k_BT + \frac1{DV}\sum_{i<j} f_{ij}\cdot x_{ij}`.

    Friction and noise have no mean, and are left out.

    Parameters
    ----------
    position
        (N, D) in m.
    edges
        (D,) of the box, in m.
    mass
        (N,) in kg (per m^(3-D) of the missing dimensions).
    term
        (N,), what the pressure term of the equation of motion has: P/ρ², in m⁵/(kg s²).
    support, kernel
        Of the pairs.
    thermal
        k_B T in J (per m^(3-D)).
    """
    edges = np.asarray(edges, float)
    n, dim = position.shape
    tree = cKDTree(np.mod(position, edges), boxsize=edges)
    i, j = tree.query_pairs(support, output_type="ndarray").T
    offset = position[i] - position[j]
    offset -= edges * np.rint(offset / edges)
    square = (offset**2).sum(axis=1)
    f = slopes(np.sqrt(square), support, kernel, dim)
    virial = (mass[i] * mass[j] * (term[i] + term[j]) * f * square).sum()
    volume = float(np.prod(edges))
    return float(virial / (dim * volume) + n * thermal / volume)


def waves_up_to(dim: int, square: int) -> np.ndarray:
    """Whole wave numbers (m, D) with 0 < n·n ≤ ``square``, one of each pair ±n."""
    reach = range(-math.isqrt(square), math.isqrt(square) + 1)
    found = itertools.product(reach, repeat=dim)
    return np.array(
        [n for n in found if 0 < sum(k * k for k in n) <= square and n > tuple(-k for k in n)],
        dtype=float,
    )


def polarisations(waves: np.ndarray) -> np.ndarray:
    """Unit vectors (D, m, D) along each wave, and across it."""
    along = waves / np.linalg.norm(waves, axis=1)[:, None]
    dim = waves.shape[1]
    if dim == 1:
        return along[None]
    if dim == 2:
        return np.array([along, np.stack([-along[:, 1], along[:, 0]], axis=1)])
    axis = np.where(np.abs(along[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = np.cross(along, axis)
    across /= np.linalg.norm(across, axis=1)[:, None]
    return np.array([along, across, np.cross(along, across)])


@dataclass(frozen=True)
class Responses:
    """Answers of waves to a kick.

    Attributes
    ----------
    time
        (t,) since the kick, in s; the first is 0.
    wave_number
        (m,) in rad/m.
    longitudinal, transverse
        (starts, t, m), 1 at the beginning; the mean of both polarisations in 3D.
    """

    time: np.ndarray
    wave_number: np.ndarray
    longitudinal: np.ndarray
    transverse: np.ndarray

    def of_length(self, wave_number: float) -> tuple[np.ndarray, np.ndarray]:
        """Longitudinal and transverse answers (starts, t), averaged over waves of this length."""
        same = np.isclose(self.wave_number, wave_number)
        return self.longitudinal[:, :, same].mean(axis=2), self.transverse[:, :, same].mean(axis=2)


def responses(
    plain: Simulation,
    kicked: Simulation,
    states: Iterable[tuple[np.ndarray, np.ndarray]],
    waves: np.ndarray,
    steps: np.ndarray,
    amplitude: float,
    seed: int = 1,
) -> Responses:
    """Kick states of a periodic box, and follow them with the same noise as without.

    Parameters
    ----------
    plain, kicked
        Two simulations of the same box, with the same seed and time step.
    states
        Positions and velocities (N, D), by id, to start from.
    waves
        (m, D) whole wave numbers; all are kicked at once, with random phases.
    steps
        (t,) time steps after which to look, from 0 on.
    amplitude
        Of each wave, in m/s: small beside thermal velocities.
    seed
        Of the phases.
    """
    domain = plain.domain
    k = 2 * np.pi * waves / domain.lengths
    directions = polarisations(waves)
    random = np.random.default_rng(seed)
    plain.start()
    kicked.start()
    found = []
    for x, v in states:
        phase = random.uniform(0, 2 * np.pi, (len(directions), len(waves)))
        kick = np.zeros_like(v)
        for along, shift in zip(directions, phase, strict=True):
            kick += amplitude * np.cos(x @ k.T + shift) @ along
        _put(plain, x, v, plain.step)
        _put(kicked, x, v + kick, plain.step)
        rows, done = [], 0
        for step in steps:
            plain.advance(int(step - done))
            kicked.advance(int(step - done))
            done = step
            change = _currents(kicked, k, directions) - _currents(plain, k, directions)
            rows.append((change * np.exp(-1j * phase)).real * 2 / (len(x) * amplitude))
        found.append(rows)
    answers = np.array(found)  # (starts, t, D, m)
    # a kick's projection on itself is 1 but for the particles' disorder
    answers /= answers[:, :1].mean(axis=0)
    across = answers[:, :, 1:].mean(axis=2) if len(directions) > 1 else answers[:, :, 0]
    return Responses(
        np.asarray(steps) * plain.dt, np.linalg.norm(k, axis=1), answers[:, :, 0], across
    )


def _put(simulation: Simulation, x: np.ndarray, v: np.ndarray, step: int) -> None:
    """Go on from a state at a time step's number."""
    ids = simulation.particles.host("id")
    simulation.particles.set("x", x[ids])
    simulation.particles.set("v", v[ids])
    simulation.step = step
    simulation.solver.start()


def _currents(simulation: Simulation, k: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Σ e·v exp(−ik·x) for directions e (D, m, D) and waves k (m, D)."""
    x, v = simulation.particles.host("x"), simulation.particles.host("v")
    turn = np.exp(-1j * x @ k.T)
    return np.array([(turn * (v @ e.T)).sum(axis=0) for e in directions])


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error."""

    value: float
    error: float


def jackknife(samples: np.ndarray, number) -> list[Estimate]:
    """Numbers that a function makes of samples' mean, with errors by leaving one out at a time.

    Parameters
    ----------
    samples
        (n, ...), independent.
    number
        Gives an array of numbers for the mean of samples.
    """
    n = len(samples)
    total = samples.sum(axis=0)
    whole = np.atleast_1d(number(total / n))
    without = np.array([np.atleast_1d(number((total - s) / (n - 1))) for s in samples])
    error = np.sqrt((n - 1) / n * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
    return [Estimate(float(a), float(b)) for a, b in zip(whole, error, strict=True)]


def decay_rate(answers: Responses, wave_number: float) -> Estimate:
    """Rate in 1/s of the decay of a transverse wave, over all but the first of the times.

    The first interval is left out: friction has to find its way among the particles first.
    """
    _, transverse = answers.of_length(wave_number)
    span = answers.time[-1] - answers.time[1]

    def rate(mean: np.ndarray) -> float:
        return math.log(mean[1] / max(mean[-1], 1e-12)) / span

    return jackknife(transverse, rate)[0]


def sound(
    answers: Responses, wave_number: float, guess: tuple[float, float], dt: float | None = None
) -> list[Estimate]:
    r"""Sound speed in m/s and longitudinal viscosity in m²/s of a wave.

    The answer of :math:`\ddot u + \nu_l k^2\dot u + c^2k^2 u = 0` from u = 1,
    :math:`\dot u = -\nu_l k^2`, is fitted to that of the particles.

    Parameters
    ----------
    answers, wave_number
        What was measured.
    guess
        Of both numbers.
    dt
        Time step in s: that of velocity-Verlet, whose answer differs where a wave decays in few
        steps. None: the exact answer.
    """
    longitudinal, _ = answers.of_length(wave_number)
    k = wave_number

    def fitted(mean: np.ndarray) -> np.ndarray:
        def misfit(scale: np.ndarray) -> np.ndarray:
            c, nu = scale * guess
            return sound_answer(answers.time, c * k, nu * k * k, dt) - mean

        return least_squares(misfit, [1.0, 1.0]).x * guess

    return jackknife(longitudinal, fitted)


def sound_answer(
    time: np.ndarray, frequency: float, rate: float, dt: float | None = None
) -> np.ndarray:
    r"""Velocity of :math:`\ddot q = -\omega^2q - \lambda\dot q` after q = 0, v = 1.

    Parameters
    ----------
    time
        (t,) in s.
    frequency, rate
        ω and λ in 1/s.
    dt
        Time step of velocity-Verlet (kick, drift, new force with the velocity half a step before,
        kick), or None for the exact motion.
    """
    if dt is None:
        half = 0.5 * rate
        omega = np.emath.sqrt(frequency**2 - half**2 + 0j) + 1e-12 / time[-1]
        turn = omega * time
        return (np.exp(-half * time) * (np.cos(turn) - half / omega * np.sin(turn))).real
    steps = np.rint(time / dt).astype(int)
    q, v, a, found = 0.0, 1.0, -rate, [1.0]
    for _ in range(steps[-1]):
        v += 0.5 * dt * a
        q += dt * v
        a = -(frequency**2) * q - rate * v
        v += 0.5 * dt * a
        found.append(v)
    return np.array(found)[steps]


def friction_transform(q: float, kernel: str, dim: int, along: bool = False) -> float:
    """Viscosity of a transverse wave (or of one ``along`` k) over that of long transverse ones.

    At q = k h and ζ = 0, in 2D and 3D; along k it is 2(1 − 1/D) of long waves.
    """
    code = kernel_code(kernel)
    transverse, radial = friction_coefficients(1.0, 0.0, dim)
    # over directions: μ = cos of the angle with k, and the mean of (e·v)² at it
    angle = (np.arange(800) + 0.5) * math.pi / 800
    mu = np.cos(angle)
    weight = np.ones_like(mu) * 2 * math.pi if dim == 2 else 2 * math.pi**2 * np.sin(angle)
    part = mu**2 if along else (1 - mu**2) / (1.0 if dim == 2 else 2.0)

    def shell(r: float) -> float:
        moment = ((transverse + radial * part) * (1 - np.cos(q * r * mu)) * weight).mean()
        return shape_f.py_func(r, code) * moment * r ** (dim - 1)

    return float(normalisation(code, dim) * quad(shell, 0, 1, limit=200)[0] / q**2)
