r"""Particle shifting: a small velocity away from where neighbours crowd.

.. math::

   \delta v_i = \frac{\tau_i}{2}\,\frac{P_s}{m_i}\sum_j (V_i^2 + V_j^2)\,F_{ij}\,x_{ij},
   \qquad \tau_i = \min\left(\frac{h_i}{4c_0},\ \frac{h_i^2\rho_0}{20\,\eta}\right)

Particles are moved by v + δv but carry the momentum v: they stay evenly spread where streamlines
would pull them apart, as behind a body, without the disorder that a background pressure in the
momentum equation causes. P_s is of the order of ρ₀c₀² of the particle's own material. The sum is
that of the transport velocity of Adami, Hu & Adams, J. Comput. Phys. 241 (2013) 292, Eq. 13. In
place of their time step is τ, the step that sound and friction of the bulk allow: δv is then a
velocity that belongs to the fluid and its resolution, and the same whatever step a run takes.

The fluxes of mass, momentum and species relative to the particles, of order δv, are left out. The
continuity equation therefore sees that particles crowd, but not that δv undoes it, and densities
would grow without end: the scheme scales them every few steps so that Σ m/ρ
stays the volume that the fluid fills. (With the divergence of v + δv in the continuity equation
volumes are kept too, but pressure then answers every shift by a flow: in the channel past a cell
three spacings wide that made the velocity's error half as large again.)
"""

from __future__ import annotations

from typing import Any

from particell.laws.law import Adds, Law

#: Largest displacement by shifting in the time τ, in supports.
LARGEST = 0.01
#: τ in h/c₀ and in h²ρ/η.
SOUND, FRICTION = 0.25, 0.05


class Crowding(Law):
    """The sum that shifts particles."""

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """(V_i² + V_j²) F x_ij."""
        both = i.volume * i.volume + j.volume * j.volume
        return {"shift": (both * ij.F) * ij.x}
