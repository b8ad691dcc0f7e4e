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
def divergence(weight, v_dot_x):
    """The pair's part of the divergence of velocity in 1/s; ``weight`` is V_j F_ij."""
    return weight * v_dot_x


@njit
def density_diffusion(weight, density_i, density_j):
    """The pair's part of *half* the Laplacian of density, V_j F_ij (ρ_j − ρ_i), in kg/m⁵."""
    return weight * (density_j - density_i)
