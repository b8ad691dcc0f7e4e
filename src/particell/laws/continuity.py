r"""Continuity: how density follows the flow.

.. math::

   \frac{d\rho_i}{dt} = -\rho_i \sum_j V_j F_{ij}\, v_{ij}\cdot x_{ij}
   + \delta h c_0 \sum_j 2 V_j (\rho_j - \rho_i) F_{ij}

The first sum is the divergence of velocity: particles that separate give a positive one. The second
is the density diffusion of Molteni & Colagrossi (Comput. Phys. Commun. 180 (2009) 861), which
removes the noise of the pressure; δ = 0.1 by default. It is dissipation without a fluctuation and
is therefore refused together with thermal noise.
"""

from __future__ import annotations

from numba import njit


@njit
def divergence(volume_j, f, v_dot_x):
    """The pair's part of the divergence of velocity, V_j F_ij v_ij·x_ij, in 1/s."""
    return volume_j * f * v_dot_x


@njit
def density_diffusion(volume_j, f, density_i, density_j):
    """The pair's part of the Laplacian of density, 2 V_j (ρ_j − ρ_i) F_ij, in kg/m⁵."""
    return 2.0 * volume_j * f * (density_j - density_i)
