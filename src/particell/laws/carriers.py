r"""Weights of diffusion that know which neighbours carry the species.

What a pair exchanges is multiplied by

.. math:: s_{ij} = \max\left(0, \tfrac12\, e\cdot(\Lambda_i + \Lambda_j)\cdot e\right),
    \qquad e = x_{ij}/r_{ij},

symmetric, so that amounts are conserved and molecules keep detailed balance. The tensor Λ makes
the second moments of the weights right over the *carriers*, the neighbours that hold the species
and diffuse it,

.. math:: \sum_j V_j F_{ij}\,(e\cdot\Lambda_i\cdot e)\, x_{ij} x_{ij}^T = T_i .

In the bulk T is the unit tensor and :math:`\sum_i V_i` of the moments, which bounds the effective
diffusivity from above, is exact whatever the arrangement; on lattices Λ is 1 over the kernel sum
:math:`\frac1D\sum_j V_jF_{ij}r_{ij}^2`. Where carriers are missing:

*Directions that are not carried.* T is the projector on the eigenvectors of
:math:`M = \sum_j V_jF_{ij}x_{ij}x_{ij}^T` with eigenvalues above :data:`LEAST` tr M: the tangents
of a single layer (d = 2), of a thread (d = 1). Distances along it are the chords r, which are
nearer to arcs than their projections are.

*Open edges.* With nobody on one side, half of the bonds along the normal are missing, and half of
the moment is right: the other half would belong to what is beyond. With the normal n along
:math:`\sum_jV_jF_{ij}x_{ij}` and :math:`p = x_{ij}\cdot n`,

.. math:: T = \Pi - \tfrac12 f(u)\, n n^T, \qquad
    u = \sum_j V_jF_{ij}\,p|p| \Big/ \sum_j V_jF_{ij}\,p^2 ,

u is 1 at the edge, a few tenths one spacing further in (for supports above two spacings), and noise
of 0.05 to 0.15 inside of disordered particles: f(u) is u, and 0 below :data:`NOISE`, with a smooth
step between. With f = u the parabola that is the solution at a closed end comes out within 0.02
spacings² times its curvature on lattices at any support (measured).

The equation is solved in the orthonormal components of symmetric tensors, where
:math:`P = \sum_j V_jF_{ij}r_{ij}^2\,(ee)(ee)^T` is symmetric and not negative. From
:math:`\Lambda = (\mathrm{tr}\,T/\mathrm{tr}\,M)\,I` two steps of iterated Tikhonov regularisation
follow, with the shift :data:`SHIFT` tr P: they leave alone what hardly any neighbour determines
(for nearest neighbours on a square lattice, the shear) and depend smoothly on the places.

At a wall with a value or a flux the wall's particles are carriers too, as their exchange is
extrapolated; as they have no amounts the factor of such a pair is that of the fluid's own Λ.

Symmetric weights cannot in general be exact for linear profiles on disordered particles; what that
costs is measured in the gallery (effective-diffusivity).

The loop for Λ is written by hand and not composed: what is summed at an edge lies along a normal
that is known only when the first sums are, and then for a few particles alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.compute.batches import batch_buffer, batch_row, batch_rows
from particell.compute.device import Device
from particell.compute.expressions import Number, Vector, early, maximum, where
from particell.compute.loop import particle_loop
from particell.compute.sweep import Sweep
from particell.kernels import power, shape_f
from particell.laws.diffusion import WEIGHED_WALLS
from particell.laws.law import Adds, Law
from particell.laws.pairs import image_offset
from particell.laws.tensors import carried, factorise, is_thin, substitute, times, within
from particell.sources.mobile import ALL
from particell.sources.source import Names

#: A direction with less than this part of tr M is not carried.
LEAST = 0.1
#: Regularisation, in tr P. The error that is left is (SHIFT/σ)² of what is to be corrected, with σ
#: the eigenvalue over tr P, about 1/4 in planes.
SHIFT = 0.05
#: What a group is to the species of another one.
APART, CARRIES, SURFACE_OF = 0, 1, 2
#: Below the first u is noise, from the second on there is an edge; twice that along lines, where
#: neighbours are few.
NOISE, EDGE = 0.15, 0.3
#: First moments smaller than this, in tr M/(D h), mean u < NOISE without looking.
EVEN = 0.2
_SQRT2 = math.sqrt(2.0)


def components(dim: int) -> int:
    """Independent components of a symmetric tensor."""
    return dim * (dim + 1) // 2


def work_width(dim: int) -> int:
    """Numbers of a row of ``moments``: P (lower triangle), right-hand side, first moments."""
    number = components(dim)
    return number * (number + 1) // 2 + number + dim


def tensor_fields(device: Device, n: int, dim: int, uniform: bool) -> dict[str, Any]:
    """Arrays that :func:`carrier_tensors` needs besides the pairs', and what it finds."""
    return {
        "tensor": device.zeros((n, components(dim)), np.float64),
        "moments": device.zeros(batch_rows(device, n) * work_width(dim), np.float64),
        "near_offset": batch_buffer(device, n, dim, np.float64),
        "near_product": batch_buffer(device, n, components(dim), np.float64),
        "near_square": batch_buffer(device, n, 1, np.float64),
        "near_volume": batch_buffer(device, n, 1, np.float64),
        "near_reach": batch_buffer(device, 0 if uniform else n, 1, np.float64),
    }


@particle_loop(vectorise=True)
def carrier_tensors(
    i,
    x,
    support,
    volume,
    group,
    start,
    stop,
    neighbours,
    crosses,
    period,
    inverse_period,
    alpha,
    carriers,
    near_offset,
    near_product,
    near_square,
    near_volume,
    near_reach,
    moments,
    exchange,
    tensor,
    *,
    DIM,
    KERNEL,
    UNIFORM,
    BATCH,
):
    """F_ij of all neighbours along row i of ``exchange``, and Λ_i of the module's docstring.

    ``carriers`` (G, G) says what a neighbour is to the species (:data:`APART`, …), ``tensor``
    (n, D(D+1)/2) takes Λ: xx, yy, zz, √2 xy, √2 yz, √2 zx, or 1/V per length² in SI.
    """
    h = support[i]
    scale = alpha / (power(h, DIM) * h * h)
    inverse = 1.0 / h
    wraps = crosses[i] != 0
    g = group[i]
    number = DIM * (DIM + 1) // 2
    packed = number * (number + 1) // 2
    thread = np.int64(batch_row(i))
    first = thread * (packed + number + DIM)
    right = first + packed
    first_order = right + number
    for a in range(packed + number + DIM):
        moments[first + a] = 0.0
    row = np.uint64(thread * BATCH)
    offsets = np.uint64(thread * BATCH * DIM)
    products = np.uint64(thread * BATCH * number)
    begin, last = np.uint64(start[i]), np.uint64(stop[i])
    while begin < last:
        end = min(last, begin + np.uint64(BATCH))
        count = end - begin
        for k in range(count):
            j = neighbours[begin + k]
            r2 = 0.0
            for d in range(DIM):
                r = image_offset(x, i, j, d, wraps, period, inverse_period)
                near_offset[offsets + np.uint64(d * BATCH) + k] = r
                r2 += r * r
            near_square[row + k] = r2
            near_volume[row + k] = volume[j] if carriers[g, group[j]] != 0 else 0.0
            if not UNIFORM:
                near_reach[row + k] = 0.5 * (support[i] + support[j])
        for k in range(count):
            r2 = near_square[row + k]
            if not UNIFORM:
                inverse = 1.0 / near_reach[row + k]
                scale = alpha * power(inverse, DIM) * inverse * inverse
            f = scale * shape_f(math.sqrt(r2) * inverse, KERNEL)
            exchange[begin + k] = f
            near_volume[row + k] *= f
            near_square[row + k] = 1.0 / r2 if r2 > 0.0 else 0.0
        for d in range(DIM):
            one = offsets + np.uint64(d * BATCH)
            other = offsets + np.uint64((d + 1) % DIM * BATCH)
            to, mixed = products + np.uint64(d * BATCH), products + np.uint64((DIM + d) * BATCH)
            total = 0.0
            for k in range(count):
                total += near_volume[row + k] * near_offset[one + k]
                near_product[to + k] = near_offset[one + k] * near_offset[one + k]
            moments[first_order + d] += total
            if DIM + d < number:
                for k in range(count):
                    near_product[mixed + k] = _SQRT2 * near_offset[one + k] * near_offset[other + k]
        for k in range(count):
            near_volume[row + k] *= near_square[row + k]
        for a in range(number):
            one = products + np.uint64(a * BATCH)
            for b in range(a + 1):
                other = products + np.uint64(b * BATCH)
                total = 0.0
                for k in range(count):
                    total += near_volume[row + k] * near_product[one + k] * near_product[other + k]
                moments[first + a * (a + 1) // 2 + b] += total
        begin = end
    # M is P applied to the unit tensor
    for a in range(number):
        total = 0.0
        for d in range(DIM):
            high, low = max(a, d), min(a, d)
            total += moments[first + high * (high + 1) // 2 + low]
        moments[right + a] = total
    trace = 0.0
    for d in range(DIM):
        trace += moments[right + d]
    for a in range(number):
        tensor[i, a] = 0.0
    if trace == 0.0:
        return
    # which directions are carried, and whether there is an edge
    xx, yy, zz, xy, yz, zx = moments[right], 0.0, 0.0, 0.0, 0.0, 0.0
    mx, my, mz = moments[first_order], 0.0, 0.0
    pxx, pyy, pzz, pxy, pyz, pzx = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if DIM > 1:
        yy, xy = moments[right + 1], moments[right + DIM] / _SQRT2
        my, pyy = moments[first_order + 1], 1.0
    if DIM > 2:
        zz, yz, zx = moments[right + 2], moments[right + 4] / _SQRT2, moments[right + 5] / _SQRT2
        mz, pzz = moments[first_order + 2], 1.0
    thin = False
    if DIM > 1:
        thin = is_thin(xx, yy, zz, xy, yz, zx, LEAST * trace, DIM)
        if thin:
            pxx, pyy, pzz, pxy, pyz, pzx = carried(xx, yy, zz, xy, yz, zx, LEAST * trace)
            mx, my, mz = times(pxx, pyy, pzz, pxy, pyz, pzx, mx, my, mz)
    projector = (pxx, pyy, pzz, pxy, pyz, pzx)
    length = math.sqrt(mx * mx + my * my + mz * mz)
    if length * h * DIM > EVEN * trace:
        mx, my, mz = mx / length, my / length, mz / length
        signed, square = 0.0, 0.0
        for k in range(start[i], stop[i]):
            j = neighbours[k]
            if carriers[g, group[j]] != 0:
                p = mx * image_offset(x, i, j, 0, wraps, period, inverse_period)
                if DIM > 1:
                    p += my * image_offset(x, i, j, 1, wraps, period, inverse_period)
                if DIM > 2:
                    p += mz * image_offset(x, i, j, 2, wraps, period, inverse_period)
                weight = volume[j] * exchange[k] * p * p
                square += weight
                signed += math.copysign(weight, p)
        if square > 0.0:
            missing = abs(signed) / square
            few = 2.0 if pxx + pyy + pzz < 1.5 else 1.0
            step = min(1.0, max(0.0, (missing - few * NOISE) / (few * (EDGE - NOISE))))
            missing *= 0.5 * step * step * (3.0 - 2.0 * step)
            pxx -= missing * mx * mx
            pyy -= missing * my * my
            pzz -= missing * mz * mz
            pxy -= missing * mx * my
            pyz -= missing * my * mz
            pzx -= missing * mz * mx
    mean = (pxx + pyy + pzz) / trace
    for d in range(DIM):
        tensor[i, d] = mean
    if DIM == 1:
        return
    pxx, pyy, pzz = pxx - mean * xx, pyy - mean * yy, pzz - mean * zz
    pxy, pyz, pzx = pxy - mean * xy, pyz - mean * yz, pzx - mean * zx
    if thin:
        pxx, pyy, pzz, pxy, pyz, pzx = within(projector, pxx, pyy, pzz, pxy, pyz, pzx)
    moments[right], moments[right + 1], moments[right + DIM] = pxx, pyy, _SQRT2 * pxy
    if DIM > 2:
        moments[right + 2] = pzz
        moments[right + 4], moments[right + 5] = _SQRT2 * pyz, _SQRT2 * pzx
    shift = SHIFT * trace
    factorise(moments, first, number, shift)
    for _ in range(2):
        # what is left of the right-hand side after the first solution is the shift times it
        substitute(moments, first, right, number)
        for a in range(number):
            tensor[i, a] += moments[right + a]
            moments[right + a] *= shift


@dataclass(frozen=True)
class CarrierWeights(Law):
    """2 V_i V_j F_ij s_ij, which take the place of F_ij along the list.

    Attributes
    ----------
    normalise
        Whether s_ij is that of the module's docstring, or 1.
    walls
        Whether there are surfaces with a value or a flux.
    """

    normalise: bool
    walls: bool

    own = ("row", "refused")

    def pair(self, i: Any, j: Any, ij: Any) -> Adds:
        """The weight; what it adds to the row, and 1 where its factor would be negative."""
        kind = ij.of_groups("carriers")
        if ij.wall:  # once more, with the weight that it has now
            grows = where(kind == SURFACE_OF, 0.5 * ij.extrapolation - 1.0, 0.0)
            return {"row": grows * ij.kept("exchange")}
        # i and j stand together, and early: vectors may change the order in which factors are
        # multiplied, and weights are the same from both ends to the bit
        weight = early(where(kind != APART, 2.0 * i.volume * j.volume, 0.0)) * ij.kept("exchange")
        adds: dict[str, Any] = {}
        if self.normalise:
            factor = _quadratic(self._both(i, j, kind), ij.x)
            adds["refused"] = where((weight > 0.0) & (factor < 0.0), 1.0, 0.0)
            there = ij.square > 0.0
            share = maximum(0.0, factor) / where(there, ij.square, 1.0)
            weight = where(there, 0.5 * weight * share, 0.0)
        return {"exchange": weight, "row": weight, **adds}

    def _both(self, i: Any, j: Any, kind: Any) -> list[Number]:
        """Components of Λ_i + Λ_j, of 2 Λ_i for what has no amounts."""
        pairs = zip(*(p.tensor.parts(p.tensor.dim) for p in (i, j)), strict=True)
        if not self.walls:
            return [early(own + its) for own, its in pairs]
        return [early(own + where(kind == SURFACE_OF, own, its)) for own, its in pairs]

    def finish(self, i: Any, sums: Any) -> Adds:
        """A bound of the eigenvalues (Gershgorin): the row over V_i, carriers' doubled."""
        return {"row_rate": 2.0 * sums.row / i.volume, "negative": sums.refused}


def _quadratic(parts: list[Number], x: Vector) -> Number:
    """x·Λ·x, with Λ in the components of :func:`carrier_tensors`."""
    dim = x.dim
    place = x.parts(dim)
    total: Number = 0.0
    for a, part in enumerate(parts):
        one, other = (a, a) if a < dim else (a - dim, (a - dim + 1) % dim)
        total = total + (1.0 if a < dim else _SQRT2) * part * place[one] * place[other]
    return total


def carrier_weights(dim: int, kernel: int, groups: int, normalise: bool, walls: bool) -> Sweep:
    """:class:`CarrierWeights` of all pairs, with the bound of a row and what was refused.

    ``row_rate`` (n,) is for unit diffusivity, in 1/m²; ``negative`` (n,) the number of pairs whose
    factor would have been negative, as seen from the particle.
    """
    fields = {"x": dim, "support": 0, "volume": 0, "tensor": components(dim)}
    names = Names(dim, {**fields, "row_rate": 0, "negative": 0}, groups=groups)
    return Sweep(
        "carrier_weights",
        (CarrierWeights(normalise, walls),),
        (ALL, WEIGHED_WALLS) if walls else (ALL,),
        names,
        kernel,
        uniform=True,
        targets="all",
        stored=("exchange",),
        exact=True,
    )
