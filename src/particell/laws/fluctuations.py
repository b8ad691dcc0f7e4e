r"""Thermal fluctuations that balance the viscous friction.

For the pair friction :math:`\Gamma = a I + b\,ee` the random force is

.. math:: \tilde F_{ij}\,dt = \sqrt{2 k_B T}\left[\sqrt{a}\,(I-ee)\cdot\xi_{ij}
          + \sqrt{a+b}\; e\,(e\cdot\xi_{ij})\right]\sqrt{dt},\qquad \xi_{ij} = -\xi_{ji}

with D independent numbers of zero mean and unit variance a pair. Its covariance is
:math:`2 k_B T\,\Gamma\,dt`, as the fluctuation-dissipation theorem asks, for every a, a + b ≥ 0
(the construction from a traceless symmetric matrix of Español & Revenga does not exist for all of
them). Where temperatures differ T is 2T_iT_j/(T_i+T_j).

The numbers need not be Gaussian for weak accuracy: sums of 16-bit uniforms cost a quarter. They are
drawn from the ordered pair of persistent ids, so both ends find the same and momentum is conserved
to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from particell.compute.expressions import sqrt
from particell.compute.philox import bounded_normal2, bounded_normal4, inlined_philox, normal_pair
from particell.laws.law import Adds, Law
from particell.laws.viscosity import Viscosity, harmonic_mean


@njit(inline="always")
def pair_numbers(id_i, id_j, step, key0, key1, GAUSSIAN, DIM):
    """Three numbers of zero mean and unit variance (the first DIM count), antisymmetric in i, j."""
    low = np.uint64(min(id_i, id_j))
    high = np.uint64(max(id_i, id_j))
    step_low = np.uint64(step) & np.uint64(0xFFFFFFFF)
    step_high = np.uint64(step) >> np.uint64(32)
    w0, w1, w2, w3 = inlined_philox(low, high, step_low, step_high, key0, key1)
    if GAUSSIAN:
        n0, n1 = normal_pair(w0, w1)
        n2, _ = normal_pair(w2, w3)
    elif DIM < 3:
        n0 = bounded_normal4(w0, w1)
        n1 = bounded_normal4(w2, w3)
        n2 = 0.0
    else:
        n0 = bounded_normal2(w0)
        n1 = bounded_normal2(w1)
        n2 = bounded_normal2(w2)
    sign = 1.0 if id_i < id_j else -1.0
    return sign * n0, sign * n1, sign * n2


@dataclass(frozen=True)
class ThermalNoise(Law):
    """The random force that balances a friction.

    Attributes
    ----------
    friction
        The law that it balances.
    gaussian
        Numbers are normal, not sums of uniform ones.
    """

    friction: Viscosity
    gaussian: bool = False

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """√(2k_BT/Δt) [√a (1 − ee)·ξ + √(a+b) e e·ξ] √(F/(d_i d_j)) / m_i, in m/s²."""
        across, along = self.friction.coefficients(i, j)
        thermal = harmonic_mean(i.thermal, j.thermal)
        strength = (2.0 * i.inverse_dt) * thermal
        # friction with a wall is larger by the extrapolation: so is noise squared
        fading = self.friction.friction(i, j, ij) * ((1.0 / i.mass) * strength)
        fading = fading * ij.extrapolation
        noise = ij.noise(self.gaussian)
        transverse = sqrt(across * fading)
        force = transverse * noise
        if self.friction.radial:
            longitudinal = sqrt((across + along) * fading)
            force = force + ((longitudinal - transverse) * noise.dot(ij.e)) * ij.e
        return {"a": force}
