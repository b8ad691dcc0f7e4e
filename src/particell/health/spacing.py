r"""How particles lie: a sweep over the neighbour list, made when a frame is taken.

For particle i its closest neighbour, how many lie in its support, and how well the space around it
is filled,

.. math:: \varphi_i = \sum_j \frac{m_j}{\rho_0} W_{ij},

with itself and images in mirrors: about 1 on every lattice, 0.9 where one neighbour is missing, 0.5
at the edge of a void. (Not a composed sweep: the closest neighbour is a minimum, and sweeps sum.)
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from particell.compute.loop import particle_loop
from particell.kernels import kernel_code, normalisation, power, shape_w
from particell.laws.pairs import image_offset
from particell.simulated import Simulated
from particell.sources.images import chains


@njit(inline="always")
def _before(x, i, planes, p, DIM):
    """s, how far particle i is from a mirror."""
    distance = -planes[p, DIM]
    for d in range(DIM):
        distance += planes[p, d] * x[i, d]
    return distance


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
    planes,
    chains,
    images,
    closest,
    filled,
    number,
    *,
    DIM,
    KERNEL,
):
    """Closest neighbour in supports, part of the space that is filled, and neighbours of row i.

    ``planes`` (P, D + 1) are mirrors, n and n·p, and the first ``images`` rows of ``chains`` (C, P)
    say in which of them an image is seen: |x_i − x_j'|² = r² + 4 Σ s_i s_j
    (:mod:`particell.sources.images`).
    """
    own = alpha / power(support[i], DIM)
    least, total, count = 1.0, mass[i] / reference[group[i]] * own * shape_w(0.0, KERNEL), 0
    wraps = crosses[i] != 0
    for k in range(start[i], stop[i] + 1):
        j = neighbours[k] if k < stop[i] else i  # itself, whose images are seen too
        r2 = 0.0
        for d in range(DIM):
            offset = image_offset(x, i, j, d, wraps, period, inverse_period)
            r2 += offset * offset
        h = 0.5 * (support[i] + support[j])
        volume = mass[j] / reference[group[j]]
        for c in range(-1 if k < stop[i] else 0, images):
            apart = r2
            if c >= 0:
                for p in range(len(planes)):
                    if chains[c, p] != 0:
                        own_side = _before(x, i, planes, p, DIM)
                        apart += 4.0 * own_side * _before(x, j, planes, p, DIM)
            q = math.sqrt(max(apart, 0.0)) / h
            if q < 1.0:
                count += 1
                least = min(least, q)
                total += volume * alpha / power(h, DIM) * shape_w(q, KERNEL)
    closest[i] = least
    filled[i] = total
    number[i] = count


class Spacing:
    """:func:`surroundings` of a simulation."""

    def __init__(self, simulation: Simulated):
        self.simulation = simulation
        device, n = simulation.device, len(simulation.particles)
        density = [simulation.materials[g.material].density for g in simulation.particles.groups]
        mirrors = simulation.system.mirrors
        seen = chains(mirrors, float(simulation.neighbours.support))
        planes = [[*plane.direction, plane.place] for plane in mirrors]
        marks = [[int(plane in chain) for plane in mirrors] for chain in seen]
        self._own = {
            "planes": device.array(np.array(planes or [[0.0] * (simulation.domain.dim + 1)])),
            "chains": device.array(np.array(marks or [[0]], np.int64)),
            "images": len(seen),
            "closest": device.zeros(n, np.float64),
            "filled": device.zeros(n, np.float64),
            "number": device.zeros(n, np.int64),
            "reference": device.array(np.array(density)),
            "alpha": normalisation(kernel_code(simulation.scheme.kernel), simulation.domain.dim),
        }

    def measure(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Closest neighbour in spacings, filled part and neighbours of the fluid, each (n,)."""
        s = self.simulation
        s.neighbours.want("rows")
        fields = {**s.particles.fields, **s.neighbours.fields, **self._own}
        code = kernel_code(s.scheme.kernel)
        s.device.bind(surroundings, fields, DIM=s.domain.dim, KERNEL=code)(len(s.particles))
        mobile = s.particles.host("is_wall") == 0
        closest, filled, number = (
            s.device.to_host(self._own[name])[mobile] for name in ("closest", "filled", "number")
        )
        return closest * s.scheme.support, filled, number
