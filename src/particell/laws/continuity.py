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

from dataclasses import dataclass
from typing import Any

from numba import njit

from particell.compute.expressions import call, where
from particell.laws.law import Adds, Law
from particell.materials import compressibility


class Continuity(Law):
    """dρ_i/dt by the divergence of velocity."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """−ρ_i V_j F v_ij·x_ij, in kg/m³/s."""
        return {"density_rate": -i.density * (ij.weight * ij.v.dot(ij.x))}


@dataclass(frozen=True)
class DensityDiffusion(Law):
    """Diffusion of density among the particles of a fluid.

    Attributes
    ----------
    head
        What a fluid at rest has between two points is left alone.
    jumps
        Some fluids have another equation of state; between those density jumps.
    """

    head: HeadOfRest | None = None
    jumps: bool = False

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """2δc₀ h V_j F (ρ_j − ρ_i − ρ^H), in kg/m³/s; walls take no part."""
        if ij.wall:
            return {}
        more = j.density - i.density
        if self.head:
            more = more + self.head.difference(i, j, ij)
        if self.jumps:
            more = where(j.equation == i.equation, more, 0.0)
        return {"density_rate": (i.diffusion * ij.support) * (ij.weight * more)}


@dataclass(frozen=True)
class HeadOfRest:
    """What density differs by between two points of a fluid at rest.

    Attributes
    ----------
    walled
        Axes that are not periodic: along the others pressure has no slope.
    buoyancy
        Whether there is a force per mass besides gravity.
    """

    walled: tuple[bool, ...]
    buoyancy: bool = False

    def potential(self, i: Any, j: Any, ij: Any) -> Any:
        """w̄·x_ij in m²/s²."""
        dim = ij.x.dim  # 1 where the equation is written down
        walled = self.walled if dim == len(self.walled) else (True,) * dim
        gravity = i.gravity.parts(dim)
        total: Any = 0.0
        for base, factor in ij.x.terms.items():
            for d in range(dim):
                if not walled[d]:
                    continue
                force = gravity[d]
                if self.buoyancy:
                    mean = i.buoyancy.parts(dim)[d] + j.buoyancy.parts(dim)[d]
                    force = force + 0.5 * mean
                total = total + force * (factor * base.parts[d])
        return total

    def slope(self, i: Any, j: Any) -> Any:
        """dρ/dφ in the middle of the pair."""
        per_head = call(density_per_head, (i.density, i.reference, i.sound_speed, i.exponent))
        step = (1.0 - 0.5 * i.exponent) / i.density
        return per_head * (1.0 + step * (j.density - i.density))

    def difference(self, i: Any, j: Any, ij: Any) -> Any:
        """ρ_i − ρ_j of a fluid at rest, in kg/m³: what is added to ρ_j."""
        return self.slope(i, j) * self.potential(i, j, ij)


@njit
def density_per_head(density, reference, sound_speed, exponent):
    """dρ/dφ = ρ dρ/dP of a fluid at rest in a potential −φ, in kg/m³ per m²/s².

    In the middle of a pair it goes as ρ^(2−γ): linear in the difference, what is left out is its
    square, 1e-6.
    """
    return density * density * compressibility(density, reference, sound_speed, exponent)
