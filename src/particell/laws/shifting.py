r"""Particle shifting: a small velocity away from where neighbours crowd.

.. math:: \delta v_i = \frac{\Delta t}{2}\,\frac{P_s}{m_i}\sum_j (V_i^2 + V_j^2)\,F_{ij}\,x_{ij}

Particles are moved by v + δv but carry the momentum v: they stay evenly spread where streamlines
would pull them apart, as behind a body, without the disorder that a background pressure in the
momentum equation causes. P_s is of the order of ρ₀c₀². The sum is that of the transport velocity
of Adami, Hu & Adams, J. Comput. Phys. 241 (2013) 292, Eq. 13.

The fluxes of mass, momentum and species relative to the particles, of order δv, are left out. The
continuity equation therefore sees that particles crowd, but not that δv undoes it, and densities
would grow without end: the scheme scales them at each build of the neighbour list so that Σ m/ρ
stays the volume that the fluid fills. (With the divergence of v + δv in the continuity equation
volumes are kept too, but pressure then answers every shift by a flow: in the channel past a cell
three spacings wide that made the velocity's error half as large again.)
"""

from __future__ import annotations

from numba import njit

#: Largest displacement by shifting in one step, in supports.
LARGEST = 0.01


@njit
def crowding(volume_i, volume_j, f):
    """What multiplies x_ij in the sum: (V_i² + V_j²) F_ij."""
    return (volume_i * volume_i + volume_j * volume_j) * f
