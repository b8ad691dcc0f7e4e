r"""The smoothing kernels.

A kernel is stated by its support :math:`h`: :math:`W(r) = 0` for :math:`r \ge h`, whatever its
literature scaling. With :math:`q = r/h` and the normalisation :math:`\alpha` in 1, 2, 3 dimensions:

=============  ==============================================  ==================================
kernel         :math:`W`                                       :math:`\alpha`
=============  ==============================================  ==================================
lucy           :math:`\alpha (1+3q)(1-q)^3`                    5/(4h), 5/(πh²), 105/(16πh³)
wendland-c2    :math:`\alpha (1-q)^4 (1+4q)`                   3/(2h), 7/(πh²), 21/(2πh³)
cubic-spline   M4, support 2s, s = h/2                         2/(3s), 10/(7πs²), 1/(πs³)
quintic-spline M6, support 3s, s = h/3                         1/(120s), 7/(478πs²), 1/(120πs³)
=============  ==============================================  ==================================

What the laws use is :math:`F(r) = -W'(r)/r \ge 0`, so that
:math:`\nabla_i W_{ij} = -F_{ij} x_{ij}`.

References
----------
Lucy, Astron. J. 82 (1977) 1013; Wendland, Adv. Comput. Math. 4 (1995) 389; Monaghan & Lattanzio,
Astron. Astrophys. 149 (1985) 135; Morris, Fox & Zhu, J. Comput. Phys. 136 (1997) 214.
"""

from __future__ import annotations

import math

from numba import njit

from particell.errors import unknown_name

LUCY, WENDLAND_C2, CUBIC_SPLINE, QUINTIC_SPLINE = 0, 1, 2, 3

CODES = {
    "lucy": LUCY,
    "wendland-c2": WENDLAND_C2,
    "cubic-spline": CUBIC_SPLINE,
    "quintic-spline": QUINTIC_SPLINE,
}

# alpha * h**dim of the shapes below
_NORMALISATION = {
    LUCY: (5 / 4, 5 / math.pi, 105 / (16 * math.pi)),
    WENDLAND_C2: (3 / 2, 7 / math.pi, 21 / (2 * math.pi)),
    CUBIC_SPLINE: (4 / 3, 40 / (7 * math.pi), 8 / math.pi),
    QUINTIC_SPLINE: (1 / 40, 63 / (478 * math.pi), 9 / (40 * math.pi)),
}


def kernel_code(name: str) -> int:
    """The compile-time code of a kernel's name."""
    if name not in CODES:
        raise unknown_name("kernel", name, CODES)
    return CODES[name]


def normalisation(code: int, dim: int) -> float:
    """The factor alpha * h**dim of a kernel in ``dim`` dimensions."""
    return _NORMALISATION[code][dim - 1]


@njit
def shape_w(q, KERNEL):
    """W without its normalisation, for q = r/h >= 0."""
    w = max(0.0, 1.0 - q)
    if KERNEL == 0:
        return (1.0 + 3.0 * q) * w * w * w
    if KERNEL == 1:
        return w * w * w * w * (1.0 + 4.0 * q)
    if KERNEL == 2:
        a = max(0.0, 2.0 - 2.0 * q)
        b = max(0.0, 1.0 - 2.0 * q)
        return 0.25 * a * a * a - b * b * b
    a = max(0.0, 3.0 - 3.0 * q)
    b = max(0.0, 2.0 - 3.0 * q)
    c = max(0.0, 1.0 - 3.0 * q)
    return a**5 - 6.0 * b**5 + 15.0 * c**5


@njit
def shape_f(q, KERNEL):
    """-(1/q) d(shape_w)/dq, so that F = alpha / h**2 * shape_f(r/h); finite at q = 0."""
    w = max(0.0, 1.0 - q)
    if KERNEL == 0:
        return 12.0 * w * w
    if KERNEL == 1:
        return 20.0 * w * w * w
    s = max(q, 1e-6)  # nearer to zero the differences below lose all their digits
    if KERNEL == 2:
        a = max(0.0, 2.0 - 2.0 * s)
        b = max(0.0, 1.0 - 2.0 * s)
        return (1.5 * a * a - 6.0 * b * b) / s
    a = max(0.0, 3.0 - 3.0 * s)
    b = max(0.0, 2.0 - 3.0 * s)
    c = max(0.0, 1.0 - 3.0 * s)
    return (15.0 * a**4 - 90.0 * b**4 + 225.0 * c**4) / s


@njit
def power(h, DIM):
    """h**DIM for DIM = 1, 2, 3."""
    if DIM == 1:
        return h
    if DIM == 2:
        return h * h
    return h * h * h
