r"""The largest eigenvalue of the friction between fluid particles, which limits explicit steps.

On a square or cubic lattice of spacing d the friction of a wave exp(i k·x) is the symmetric matrix

.. math:: \lambda(k) = \frac1\rho \sum_j d^D F(r_j) \left[a I + b\, e_j e_j\right]
          \left(1 - \cos k\cdot x_j\right)

with the coefficients of :mod:`particell.laws.viscosity`. Its largest eigenvalue over all k depends
on the kernel, on the support in spacings and on the dimension: 2/λ_max is 0.103 h²/ν with Lucy's
kernel and 0.058 with the quintic spline at three spacings in two dimensions, 0.078 and 0.048 in
three.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np

from particell.kernels import kernel_code, normalisation, shape_f
from particell.laws.viscosity import harmonic_mean

#: Wave numbers along an axis, from 0 to π/d; the eigenvalue found is at most 1 % short.
WAVES = 13


@functools.cache
def lattice_eigenvalue(
    kernel: str, support: float, dim: int, transverse: float, radial: float, normalise: bool
) -> float:
    """λ_max ρ h² on the lattice for coefficients a, b in Pa s, in Pa s.

    Parameters
    ----------
    kernel, support, dim
        The kernel, its support in spacings, the number of dimensions.
    transverse, radial
        a and b.
    normalise
        Whether friction is divided by the kernel sum (1/D) Σ V F r².
    """
    code, reach = kernel_code(kernel), math.ceil(support)
    axis = range(-reach, reach + 1)
    x = np.array([p for p in itertools.product(axis, repeat=dim) if any(p)], float)
    r = np.linalg.norm(x, axis=1)
    x, r = x[r < support], r[r < support]
    f = np.array([shape_f.py_func(q, code) for q in r / support])
    f *= normalisation(code, dim) / support**dim
    if normalise:
        f *= dim * support**2 / (f * r**2).sum()
    e = x / r[:, None]
    pairs = f[:, None, None] * (transverse * np.eye(dim) + radial * e[:, :, None] * e[:, None, :])
    ks = np.linspace(0.0, math.pi, WAVES)
    waves = np.array(list(itertools.combinations_with_replacement(ks, dim)))
    turns = 1.0 - np.cos(waves @ x.T)
    return float(np.linalg.eigvalsh(np.einsum("kn,nij->kij", turns, pairs)).max())


def stiffest(
    own: tuple[float, float],
    others: Sequence[tuple[float, float]],
    kernel: str,
    support: float,
    dim: int,
    normalise: bool,
) -> float:
    """:func:`lattice_eigenvalue` of a fluid among others, the one in which it is held most.

    Parameters
    ----------
    own, others
        Coefficients a, b of the fluid and of all that it may meet, itself included. A pair's are
        harmonic means, up to twice those of the less viscous one.
    kernel, support, dim, normalise
        As there.
    """
    found = 0.0
    for other in others:
        across = harmonic_mean(own[0], other[0])
        along = harmonic_mean(sum(own), sum(other))
        size = max(across, along)
        if size > 0.0:  # in units of its size, so that few kinds need to be remembered
            ratio = (round(across / size, 9), round((along - across) / size, 9))
            found = max(found, size * lattice_eigenvalue(kernel, support, dim, *ratio, normalise))
    return found
