r"""How particles lie: a sweep over the neighbour list, made when a frame is taken.

For particle i its closest neighbour, how many lie in its support, and how well the space around it
is filled,

.. math:: \varphi_i = \sum_j \frac{m_j}{\rho_0} W_{ij},

with itself: about 1 on every lattice, 0.9 where one neighbour is missing, 0.5 at the edge of a
void. (Not a composed sweep: the closest neighbour is a minimum, and sweeps sum.)
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from particell.compute.loop import particle_loop
from particell.kernels import kernel_code, normalisation, power, shape_w
from particell.laws.pairs import image_offset

if TYPE_CHECKING:
    from particell.simulation import Simulation


@particle_loop
def surroundings(
    i,
    x,
    mass,
    group,
    reference,
    support,
    start,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    closest,
    filled,
    number,
    *,
    DIM,
    KERNEL,
):
    """Closest neighbour in supports, part of the space that is filled, and neighbours of row i."""
    own = alpha / power(support[i], DIM)
    least, total, count = 1.0, mass[i] / reference[group[i]] * own * shape_w(0.0, KERNEL), 0
    wraps = crosses[i] != 0
    for k in range(start[i], stop[i]):
        j = neighbours[k]
        r2 = 0.0
        for d in range(DIM):
            offset = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += offset * offset
        h = 0.5 * (support[i] + support[j])
        q = math.sqrt(r2) / h
        if q < 1.0:
            count += 1
            least = min(least, q)
            volume = mass[j] / reference[group[j]]
            total += volume * alpha / power(h, DIM) * shape_w(q, KERNEL)
    closest[i] = least
    filled[i] = total
    number[i] = count


class Spacing:
    """:func:`surroundings` of a simulation."""

    def __init__(self, simulation: Simulation):
        self.simulation = simulation
        device, n = simulation.device, len(simulation.particles)
        density = [simulation.materials[g.material].density for g in simulation.particles.groups]
        self._own = {
            "closest": device.zeros(n, np.float64),
            "filled": device.zeros(n, np.float64),
            "number": device.zeros(n, np.int64),
            "reference": device.array(np.array(density)),
            "alpha": normalisation(kernel_code(simulation.scheme.kernel), simulation.domain.dim),
        }

    def measure(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Closest neighbour in spacings, filled part and neighbours of the fluid, each (n,)."""
        s = self.simulation
        fields = {**s.particles.fields, **s.neighbours.fields, **self._own}
        code = kernel_code(s.scheme.kernel)
        s.device.bind(surroundings, fields, DIM=s.domain.dim, KERNEL=code)(len(s.particles))
        mobile = s.particles.host("is_wall") == 0
        closest, filled, number = (
            s.device.to_host(self._own[name])[mobile] for name in ("closest", "filled", "number")
        )
        return closest * s.scheme.support, filled, number
