r"""Continuity: how density follows the flow.

.. math::

   \frac{d\rho_i}{dt} = -\rho_i \sum_j V_j F_{ij}\, v_{ij}\cdot x_{ij}
   + 2\,\delta\, c_0 \sum_j h_{ij} V_j F_{ij}\,\bigl(\rho_j - \rho_i - \rho^H_{ij}\bigr),
   \qquad \rho^H_{ij} = \bar\rho_{ij}^2\,\bar\beta_{ij}\;\bar w_{ij}\cdot(x_j - x_i) .

The first sum is the divergence of velocity: particles that separate give a positive one. The second
is the density diffusion of Molteni & Colagrossi (Comput. Phys. Commun. 180 (2009) 861), which
removes the noise of the pressure; δ = 0.1 by default. It is dissipation without a fluctuation and
is therefore refused together with thermal noise.

:math:`\rho^H_{ij}` is the difference of density of two points of a fluid at rest under the body
force per mass w (gravity and buoyancy, along directions that are not periodic: along a periodic one
pressure has no slope), with :math:`\beta = d\ln\rho/dP` of the equation of state
and bars for what holds in the pair's middle: without it a fluid that rests would be pumped up its
own pressure gradient for ever. It is taken from the equation of state as Fourtakas et al. do
(Comput. Fluids 190 (2019) 346), but at the pair's density, so that it holds for any exponent. What
is left is zero for a fluid at rest pair by pair, at walls too, which take no part in the sum. Nor
do pairs of two fluids whose equations of state differ: between them density jumps.

:math:`h_{ij}` is the pair's support, the mean of both, as in the kernel: what one particle gains in
:math:`V\,d\rho` the other one loses, and between small particles the diffusion is that of small
particles.
"""

from __future__ import annotations

from numba import njit

from particell.materials import compressibility


@njit
def divergence(weight, v_dot_x):
    """The pair's part of the divergence of velocity in 1/s; ``weight`` is V_j F_ij."""
    return weight * v_dot_x


@njit
def density_diffusion(weight, density_i, density_j):
    """The pair's part of *half* the Laplacian of density, V_j F_ij (ρ_j − ρ_i), in kg/m⁵."""
    return weight * (density_j - density_i)


@njit
def density_per_head(density, reference, sound_speed, exponent):
    """dρ/dφ = ρ dρ/dP of a fluid at rest in a potential −φ, in kg/m³ per m²/s²."""
    return density * density * compressibility(density, reference, sound_speed, exponent)


@njit
def middle_of_pair(per_head, density_i, density_j, exponent):
    """:func:`density_per_head` in the middle of a pair, from that of particle i.

    It goes as ρ^(2−γ). Linear in the difference: what is left out is its square, 1e-6.
    """
    return per_head * (1.0 + (1.0 - 0.5 * exponent) * (density_j - density_i) / density_i)
