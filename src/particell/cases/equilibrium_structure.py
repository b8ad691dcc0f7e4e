"""Structure factor of particles in a periodic box, and its mean-field value for SDPD."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.integrate import quad
from scipy.special import j0

from particell.kernels import kernel_code, normalisation, shape_w


def shortest_waves(dim: int, square: int) -> np.ndarray:
    """Whole wave numbers (m, dim) with n·n = ``square``, one of each pair ±n."""
    reach = range(-math.isqrt(square), math.isqrt(square) + 1)
    found = [n for n in itertools.product(reach, repeat=dim) if sum(k * k for k in n) == square]
    return np.array([n for n in found if n > tuple(-k for k in n)], dtype=float)


def structure_factor(position: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """|Σ exp(−2πi n·x)|²/N for positions (N, D) in units of the edge and waves n (m, D)."""
    amplitude = np.exp(-2j * np.pi * position @ waves.T).sum(axis=0)
    return np.abs(amplitude) ** 2 / len(position)


def kernel_transform(q: float, kernel: str, dim: int) -> float:
    """Fourier transform of a kernel of support h at q = k h; 1 at q = 0."""
    code = kernel_code(kernel)
    wave = {
        1: lambda r: 2 * math.cos(q * r),
        2: lambda r: 2 * math.pi * r * j0(q * r),
        3: lambda r: 4 * math.pi * r * r * np.sinc(q * r / math.pi),
    }[dim]
    value = quad(lambda r: shape_w.py_func(r, code) * wave(r), 0, 1, epsabs=1e-10, limit=200)[0]
    return float(normalisation(code, dim) * value)


def mean_field(q: float, stiffness: float, kernel: str, dim: int) -> float:
    """S = 1/(1 + Ŵ² m c₀²/k_BT) at q = k h; ``stiffness`` is m c₀²/k_BT."""
    return 1.0 / (1.0 + stiffness * kernel_transform(q, kernel, dim) ** 2)
