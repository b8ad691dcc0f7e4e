r"""A flow rate that is kept, whatever force that takes.

After every step the same is added to the velocity of all fluid particles:

.. math:: \Delta v = u - \frac{\sum_i m_i v_i}{\sum_i m_i},

which is a uniform body force :math:`\Delta v/dt`: what an obstacle's drag, or walls whose friction
is not known, cost beyond the force that is given. In an incompressible flow along a periodic axis
the flow rate is the same through every cross-section, so that the mean over the volume keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass

from particell.checks import checked
from particell.compute.loop import particle_loop
from particell.errors import InputError


@checked
@dataclass(frozen=True)
class MeanVelocity:
    """Keeps the mean velocity of the fluid along a periodic axis, by a uniform body force.

    Fluctuations of the total momentum along that axis are taken away with it.

    Parameters
    ----------
    velocity
        u in m/s: the mean over the mass of the fluid. In a channel of cross-section A with an
        obstacle, a flow rate Q means u = Q L/(V - V_obstacle) on a length L.
    axis
        0, 1 or 2.
    """

    velocity: float
    axis: int = 0

    def __post_init__(self) -> None:
        if self.axis not in (0, 1, 2):
            raise InputError("axis", self.axis, "0, 1 or 2")


@particle_loop
def axial_momentum(i, v, mass, is_wall, momentum, *, AXIS):
    """m_i v_i along an axis, shape (n, 1); 0 for wall particles."""
    momentum[i, 0] = 0.0 if is_wall[i] else mass[i] * v[i, AXIS]


@particle_loop
def add_velocity(i, v, is_wall, change, *, AXIS):
    """Add ``change`` (m/s) to the velocity of fluid particle i along an axis."""
    if not is_wall[i]:
        v[i, AXIS] += change
