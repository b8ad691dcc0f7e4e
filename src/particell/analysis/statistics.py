"""Numbers that say how good, how hot or how fast: errors, moments, temperature, rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from particell.errors import InputError

BOLTZMANN = 1.380649e-23  # J/K, exact in the SI


def relative_l2(values: ArrayLike, reference: ArrayLike) -> float:
    r"""Relative error :math:`\sqrt{\sum (a - a_{ref})^2 / \sum a_{ref}^2}` over all entries."""
    a, ref = _same_shape(values, reference)
    norm = float(np.sum(ref**2))
    if norm == 0:
        raise InputError("reference", 0.0, "not zero everywhere")
    return float(np.sqrt(np.sum((a - ref) ** 2) / norm))


def epsilon_error(values: ArrayLike, reference: ArrayLike, scale: float) -> float:
    r"""The papers' error :math:`\epsilon = \sqrt{\sum (C - C_{ref})^2}/(C_0 N)`.

    Note the N outside of the root: it is not a root mean square, and shrinks as
    :math:`1/\sqrt N` at a fixed error per particle.

    Parameters
    ----------
    values, reference
        The field and what it should be.
    scale
        The concentration :math:`C_0` it is measured against.
    """
    a, ref = _same_shape(values, reference)
    return float(np.sqrt(np.sum((a - ref) ** 2)) / (scale * a.size))


@dataclass(frozen=True)
class Moments:
    """Mean and deviation over samples.

    Attributes
    ----------
    mean
        Average over the samples.
    deviation
        Standard deviation of one sample (n - 1 in the denominator).
    error
        Standard error of the mean, for independent samples.
    samples
        Their number.
    """

    mean: np.ndarray
    deviation: np.ndarray
    error: np.ndarray
    samples: int


def moments(series: ArrayLike, axis: int = 0) -> Moments:
    """Mean, standard deviation and standard error over frames (or another axis)."""
    values = np.asarray(series, float)
    n = values.shape[axis]
    if n < 2:
        raise InputError("series", values.shape, "at least two samples")
    deviation = values.std(axis=axis, ddof=1)
    return Moments(values.mean(axis=axis), deviation, deviation / np.sqrt(n), n)


def block_average(series: ArrayLike, blocks: int = 20) -> Moments:
    """Mean of a correlated time series, its standard error from the means of equal blocks.

    Right where a block is longer than the series' memory. What does not fill the last block is
    left out at the beginning.

    Parameters
    ----------
    series
        (frames,), or (frames, ...).
    blocks
        Number of blocks.
    """
    values = np.asarray(series, float)
    length = len(values) // blocks
    if blocks < 2 or length < 1:
        raise InputError("blocks", blocks, f"between 2 and the {len(values)} samples")
    kept = values[len(values) - blocks * length :]
    return moments(kept.reshape(blocks, length, *values.shape[1:]).mean(axis=1))


def kinetic_temperature(
    mass: ArrayLike, velocity: ArrayLike, conserved_momentum: bool = True
) -> float:
    r"""Temperature in K by equipartition.

    .. math:: T = \sum_i m_i |v_i - u|^2 / (k_B D (N - 1))

    with the velocity :math:`u` of the centre of mass. Where momentum is not conserved (walls,
    a thermostat), :math:`u = 0` and N instead of N - 1.

    Parameters
    ----------
    mass
        (n,), in kg.
    velocity
        (n, D), in m/s.
    conserved_momentum
        Whether the centre of mass keeps its velocity.
    """
    m, v = np.asarray(mass, float), np.asarray(velocity, float)
    n, dim = v.shape
    if n < 2:
        raise InputError("velocity", v.shape, "the velocities of at least two particles")
    drift = (m @ v) / m.sum() if conserved_momentum else np.zeros(dim)
    freedom = dim * (n - 1 if conserved_momentum else n)
    return float(np.sum(m[:, None] * (v - drift) ** 2) / (BOLTZMANN * freedom))


@dataclass(frozen=True)
class ChiSquare:
    """Outcome of a chi-square test: statistic, degrees of freedom and probability of a larger one.

    A ``p_value`` below, say, 0.001 rejects the hypothesis.
    """

    statistic: float
    freedom: int
    p_value: float


def maxwellian_test(
    velocity: ArrayLike, mass: ArrayLike, temperature: float, bins: int = 20
) -> ChiSquare:
    r"""Chi-square test that velocity components are normal with variance :math:`k_B T/m`.

    Parameters
    ----------
    velocity
        (n, D) or (frames, n, D), in m/s: independent samples.
    mass
        (n,), in kg.
    temperature
        In K.
    bins
        Number of bins, equally probable under the hypothesis.
    """
    from scipy.stats import chi2, norm

    v, m = np.asarray(velocity, float), np.asarray(mass, float)
    z = (v * np.sqrt(m / (BOLTZMANN * temperature))[:, None]).ravel()
    expected = z.size / bins
    if bins < 2 or expected < 5:
        raise InputError("bins", bins, f"between 2 and {z.size // 5} for {z.size} components")
    counts = np.bincount(np.minimum((norm.cdf(z) * bins).astype(int), bins - 1), minlength=bins)
    statistic = float(np.sum((counts - expected) ** 2) / expected)
    return ChiSquare(statistic, bins - 1, float(chi2.sf(statistic, bins - 1)))


@dataclass(frozen=True)
class Decay:
    """Least-squares fit of amplitude * exp(-rate * t).

    Attributes
    ----------
    rate
        In 1/s.
    amplitude
        At t = 0, in the unit of the data.
    error
        Standard error of the rate, in 1/s.
    """

    rate: float
    amplitude: float
    error: float


def decay_rate(time: ArrayLike, values: ArrayLike) -> Decay:
    """Effective decay rate of positive values, by least squares on their logarithm."""
    t, a = _same_shape(time, values)
    if t.size < 2 or np.ptp(t) == 0:
        raise InputError("time", t.size, "at least two different times")
    if not np.all(a > 0):
        raise InputError("values", float(a.min()), "positive")
    centred = t - t.mean()
    logs = np.log(a)
    slope = float(centred @ logs / (centred @ centred))
    level = float(logs.mean() - slope * t.mean())
    residual = logs - level - slope * t
    variance = float(residual @ residual) / max(t.size - 2, 1)
    return Decay(-slope, float(np.exp(level)), float(np.sqrt(variance / (centred @ centred))))


def _same_shape(first: ArrayLike, second: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    a, b = np.asarray(first, float), np.asarray(second, float)
    if a.shape != b.shape:
        raise InputError("shape", a.shape, f"equal to {b.shape}")
    return a, b
