r"""Whether particles fit into the space that there is: their volumes, and the spacing they declare.

Around particle i the volumes and the spacings of its neighbours, of whatever phase, fill

.. math:: \varphi_i = \sum_j V_j W(r_{ij}), \qquad \nu_i = \sum_j \Delta_j^D W(r_{ij})

of the space, both 1 where everything fits. The medians over a phase are looked at: at edges and in
thin layers both are smaller, which is no fault, and for points at random the particle's own part
makes them larger, by 0.4 in 1D.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.kernels import LUCY, normalisation
from particell.phases import Phase
from particell.units import place

#: Volumes in the domain may exceed it by this part and one layer of its surface: lattices that are
#: cut at shapes, rings of whole numbers of particles.
EXCESS = 0.05
#: A phase is too dense where the volumes around most of its particles fill the space so often.
OVERFULL = 1.75
#: Two phases overlap where their volumes around particles fill the space so often, of which other
#: phases so much, for more than this share of a phase's particles.
CROWDED, OF_OTHERS, SHARE = 1.4, 0.4, 0.01
#: By how much spacing and volume^(1/D), or spacing and the points' distances, may differ.
MISFIT = 1.6
#: What is smaller than its spacing by more is meant so: tracers without a volume to speak of.
TRACER = 10.0
#: A phase fills space where its particles do so at their declared spacing.
FILLED = 0.75
#: Support of the sums in spacings, particles per phase looked at, and neighbours of each.
SUPPORT, SAMPLE, NEAREST = 3.0, 400, 256


def check_filling(domain: Domain, phases: Sequence[Phase], static: bool) -> None:
    """Refuse particles that do not fit into the space that they are in.

    At rest (``static``) volumes may be smaller than spacings say: those of compartments.

    Raises
    ------
    InputError
        Where volumes add up to more than the domain holds, phases overlap, if by a part only, and
        where a phase's spacing fits neither its volumes nor its points.
    """
    points, volume, cell = (
        np.concatenate([part(p) for p in phases])
        for part in (lambda p: p.points, lambda p: p.volume, _cells)
    )
    places, _ = domain.wrapped(points)
    _check_total(domain, places, volume, phases)
    of_phase = np.repeat(np.arange(len(phases)), [len(p.points) for p in phases])
    tree = domain.tree(points)
    for k, p in enumerate(phases):
        if len(p.points):
            at = domain.wrapped_from_zero(_some(p.points))
            h = SUPPORT * p.particle_spacing
            r, j = tree.query(at, min(NEAREST, len(points)), distance_upper_bound=h)
            w = _weights(r.reshape(len(at), -1), h, domain.dim)
            j = np.minimum(j.reshape(len(at), -1), len(points) - 1)  # weight 0 where none is left
            filled = (w * volume[j]).sum(axis=1)
            foreign = np.where(of_phase[j] == k, 0.0, w * volume[j])
            crowded = (filled > CROWDED) & (foreign.sum(axis=1) > OF_OTHERS)
            if np.mean(crowded) > SHARE:
                row = int(np.argmax(np.where(crowded, filled, 0.0)))
                other = int(of_phase[j[row, np.argmax(foreign[row])]])
                raise _overlap(p, phases[other], filled[row], at[row] + domain.lower)
            if p.kind == "wall":
                continue
            fill = float(np.median(filled))
            declared = float(np.median((w * cell[j]).sum(axis=1)))
            own = float(np.median((w * cell[j] * (of_phase[j] == k)).sum(axis=1)))
            _check_phase(p, fill, declared, own, static)


def _overlap(one: Phase, other: Phase, filled: float, where: np.ndarray) -> InputError:
    names = " and ".join(sorted((one.name, other.name)))
    allowed = (
        f"beside each other: at {place(where)} their volumes fill {filled:.2g} times the space "
        "(leave out of a fluid what walls, bodies and other fluids fill: shape)"
    )
    return InputError("phases", names, allowed)


def _check_total(
    domain: Domain, places: np.ndarray, volume: np.ndarray, phases: Sequence[Phase]
) -> None:
    inside = ((places >= domain.lower) & (places <= domain.upper)).all(axis=1)
    total, number = float(volume[inside].sum()), int(inside.sum())
    allowed = domain.volume * (1 + EXCESS + max(number, 1) ** (-1 / domain.dim))
    if total > allowed:
        names = " and ".join(p.name for p in phases if len(p.points))
        raise InputError(
            f"volumes of {names}",
            f"{total:.4g} m^{domain.dim} in the domain",
            f"at most the domain's {domain.volume:.4g} (volume of one particle times their number)",
        )


def _check_phase(phase: Phase, fill: float, declared: float, own: float, static: bool) -> None:
    dim, spacing = phase.dim, phase.particle_spacing
    name = f"'{phase.name}'"
    if fill > OVERFULL:
        share = f"{fill:.2g} times the space around most of its particles"
        raise InputError(f"volume of {name}", share, "as large as the room that each particle has")
    if declared > MISFIT**dim:
        real = spacing / declared ** (1 / dim)
        allowed = f"about the distance of its points, {real:.3g} m (and a larger support instead)"
        raise InputError(f"spacing of {name}", spacing, allowed)
    size = float(np.median(phase.volume)) ** (1 / dim)
    if not static and own > FILLED and spacing / TRACER < size < spacing / MISFIT:
        allowed = f"about spacing^{dim} = {spacing**dim:.4g} m^{dim}: they leave most space empty"
        raise InputError(f"volume of {name}", float(np.median(phase.volume)), allowed)


def _cells(phase: Phase) -> np.ndarray:
    return np.full(len(phase.points), phase.particle_spacing**phase.dim)


def _some(points: np.ndarray) -> np.ndarray:
    """At most :data:`SAMPLE` of the points, always the same."""
    if len(points) <= SAMPLE:
        return points
    return points[np.sort(np.random.default_rng(1).choice(len(points), SAMPLE, replace=False))]


def _weights(r: np.ndarray, h: float, dim: int) -> np.ndarray:
    """Lucy's kernel of support h."""
    q = np.minimum(r / h, 1.0)
    return normalisation(LUCY, dim) / h**dim * (1 + 3 * q) * (1 - q) ** 3
