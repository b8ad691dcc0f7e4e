r"""Fields carried by particles, evaluated anywhere: kernel interpolation, exact where it matters.

With the weights :math:`w_j = V_j W(|x - x_j|, h_j)`, order 0 is Shepard's mean

.. math:: A(x) = \sum_j w_j A_j / \sum_j w_j,

and order 1 the value at :math:`x` of the linear function that fits the :math:`A_j` best in the
sense of the same weights (moving least squares), which reproduces every linear field exactly,
at walls and surfaces too.

**Walls that hold a value** :math:`A_w` at their surface (no slip, fixed concentrations) are one
datum more in the fit at :math:`x`: that value at the nearest point of the surface, at the distance
d, with the weight :math:`W(2d, h)/(2d/h)^2` times that of all particles. It grows without bound, so
that the fit has the wall's value at the wall (interpolating moving least squares, Lancaster &
Salkauskas, section 3); beyond half a support there is nothing of it.

References
----------
Shepard, Proc. 23rd ACM Nat. Conf. (1968) 517; Lancaster & Salkauskas, Math. Comput. 37 (1981) 141.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from particell.compute.elementwise import elementwise
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.kernels import kernel_code, shape_w

# Points treated at once: bounds the memory for pairs.
_BLOCK = 20_000
# How near a point is to a wall that it is on, in supports; bounds the weight of a wall's datum.
_TOUCHES = 1e-6
# Below this reciprocal condition number the fit is not determined: too few particles in reach.
_SINGULAR = 1e-8


@dataclass(frozen=True)
class Held:
    """Values at surfaces near some of m points.

    Attributes
    ----------
    points
        Which points, (k,).
    offset
        From each of them to the nearest point of the surface, (k, D), in m.
    values
        There, (k,) or (k, …).
    """

    points: np.ndarray
    offset: np.ndarray
    values: np.ndarray


def line(start: Sequence[float], end: Sequence[float], points: int) -> np.ndarray:
    """Equally spaced points from ``start`` to ``end``, both included, (points, D)."""
    return np.linspace(np.asarray(start, float), np.asarray(end, float), points)


def grid(domain: Domain, shape: int | Sequence[int]) -> np.ndarray:
    """Centres of a regular grid of cells that fills a domain, (nx, ny, …, D)."""
    counts = [shape] * domain.dim if isinstance(shape, int) else list(shape)
    if len(counts) != domain.dim or min(counts) < 1:
        raise InputError("shape", shape, f"a positive number, or {domain.dim} of them")
    axes = [
        low + (np.arange(n) + 0.5) * length / n
        for low, length, n in zip(domain.lower, domain.lengths, counts, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def plane(
    domain: Domain, shape: int | Sequence[int], normal: int | None, at: float | None = None
) -> np.ndarray:
    """Centres of a regular grid of cells on a plane that cuts a domain, (n1, n2, D).

    Parameters
    ----------
    domain
        The box.
    shape
        Cells along the plane's axes.
    normal
        The axis that it is perpendicular to; None in 2D, where there is one plane only.
    at
        The plane's coordinate in m; by default the middle of the domain.
    """
    if normal is None:
        return grid(domain, shape)
    counts = [shape] * (domain.dim - 1) if isinstance(shape, int) else list(shape)
    if len(counts) != domain.dim - 1:
        raise InputError("cells", shape, f"a positive number, or {domain.dim - 1} of them")
    counts.insert(normal, 1)  # one cell: its centre is in the middle
    points = np.squeeze(grid(domain, counts), axis=normal)
    if at is not None:
        if not domain.lower[normal] <= at <= domain.upper[normal]:
            low, high = domain.lower[normal], domain.upper[normal]
            raise InputError("at", at, f"between {low:g} and {high:g} m")
        points[..., normal] = at
    return points


def interpolate(
    points: np.ndarray,
    position: np.ndarray,
    values: np.ndarray,
    *,
    volume: np.ndarray,
    support: float | np.ndarray,
    domain: Domain,
    kernel: str = "wendland-c2",
    order: int = 1,
    held: Sequence[Held] = (),
) -> np.ndarray:
    """Interpolate values carried by particles.

    Parameters
    ----------
    points
        Where, (m, D), in m.
    position
        Of the particles, (n, D), in m.
    values
        Of the particles, (n,) or (n, …).
    volume
        Of the particles, (n,), in any unit: only ratios matter.
    support
        Support of the kernel in m, one number or (n,).
    domain
        The box; distances are the shortest ones over its periodic axes.
    kernel
        Name of a kernel.
    order
        0: exact on constants; 1: exact on linear fields (and order 0 where fewer particles than
        it takes are in reach).
    held
        What walls hold at their surfaces near the points.

    Returns
    -------
    numpy.ndarray
        (m,) or (m, …); NaN where no particle is in reach.

    Raises
    ------
    InputError
        Where the order or the kernel does not exist, or the shapes do not fit.
    """
    if order not in (0, 1):
        raise InputError("order", order, "0 or 1")
    code = kernel_code(kernel)
    points = np.atleast_2d(np.asarray(points, float))
    if points.ndim != 2 or points.shape[1] != domain.dim:
        raise InputError("points", points.shape, f"an array of shape (m, {domain.dim})")
    values = np.asarray(values, float)
    reach = np.broadcast_to(np.asarray(support, float), len(position))
    if not np.all(reach > 0):
        raise InputError("support", support, "positive")
    result = np.full((len(points), *values.shape[1:]), np.nan)
    if not len(position):
        return result
    tree = domain.tree(position)
    size = float(reach.max())
    for start in range(0, len(points), _BLOCK):
        block = slice(start, start + _BLOCK)
        targets = domain.tree(points[block])
        pairs = targets.sparse_distance_matrix(tree, size, output_type="ndarray")
        i, j = pairs["i"], pairs["j"]
        q = pairs["v"] / reach[j]
        inside = q < 1.0
        i, j, q = i[inside], j[inside], q[inside]
        weight = volume[j] * _shape(q, code) / reach[j] ** domain.dim
        offset = domain.shortest(tree.data[j] - targets.data[i])
        data: list[tuple[np.ndarray, ...]] = [(i, weight, offset / size, values[j])]
        total = np.bincount(i, weights=weight, minlength=targets.n)
        data += [_datum(h, start, total, size, code) for h in held]
        i, weight, offset, seen = (np.concatenate(parts) for parts in zip(*data, strict=True))
        result[block] = _fit(targets.n, i, weight, offset, seen, order)
    return result


def _datum(
    held: Held, start: int, total: np.ndarray, size: float, code: int
) -> tuple[np.ndarray, ...]:
    """Point, weight, offset in supports and value of what walls hold, for a block of points."""
    rows = np.flatnonzero((held.points >= start) & (held.points < start + len(total)))
    offset = held.offset[rows] / size
    weight = _wall_weight(np.linalg.norm(offset, axis=1), code)
    i, near = held.points[rows] - start, weight > 0.0
    return i[near], (total[i] * weight)[near], offset[near], held.values[rows][near]


def _wall_weight(distance: np.ndarray, code: int) -> np.ndarray:
    """Weight of a wall's datum, in that of all particles, at distances (k,) in supports."""
    q = np.maximum(2.0 * distance, _TOUCHES)
    return np.where(q < 1.0, _shape(np.minimum(q, 1.0), code) / q**2, 0.0)


def _shape(q: np.ndarray, code: int) -> np.ndarray:
    """The kernel's shape for an array of q = r/h."""
    return elementwise(shape_w)(q, code)


def _fit(
    n: int, i: np.ndarray, weight: np.ndarray, offset: np.ndarray, values: np.ndarray, order: int
) -> np.ndarray:
    """Weighted fit of a constant or a linear function at n points, evaluated there."""

    def total(per_pair: np.ndarray) -> np.ndarray:
        return np.bincount(i, weights=per_pair, minlength=n)

    weights = total(weight)
    found = weights > 0
    weight = weight / np.where(found, weights, 1.0)[i]
    columns = np.ascontiguousarray(values.reshape(len(i), -1).T)
    mean = np.stack([total(weight * column) for column in columns], axis=-1)
    mean[~found] = np.nan
    if order == 1:
        # The deviation from the mean, so that a constant comes out to the last bit.
        deviations = [column - mean[i, c] for c, column in enumerate(columns)]
        weighted = [weight, *(weight * x for x in offset.T)]
        basis = [np.ones(len(i)), *np.ascontiguousarray(offset.T)]
        size = len(basis)
        moments = np.empty((n, size, size))
        for a in range(size):
            for b in range(a + 1):
                moments[:, a, b] = moments[:, b, a] = total(weighted[a] * basis[b])
        right = np.stack([np.stack([total(w * d) for d in deviations], -1) for w in weighted], 1)
        _correct(mean, moments, right, found)
    return mean.reshape((n, *values.shape[1:]))


def fit_of_sums(
    moments: np.ndarray, right: np.ndarray, held: Sequence[Held], size: float, code: int
) -> np.ndarray:
    """Weighted fit of a linear function at m points from sums over particles, evaluated there.

    Parameters
    ----------
    moments, right
        Sums of w b b, (m, D + 1, D + 1), and of w b A, (m, D + 1, columns), with b = (1, offset).
    held
        What walls hold at their surfaces near the points.
    size
        Unit of the offsets in m.
    code
        The kernel of walls' weights.

    Returns
    -------
    numpy.ndarray
        (m, columns); NaN where no particle was in reach.
    """
    total = moments[:, 0, 0]
    moments, right = moments.copy(), right.copy()
    for h in held:
        i, weight, offset, values = _datum(h, 0, total, size, code)
        basis = np.concatenate([np.ones((len(offset), 1)), offset], axis=1)
        weighted = weight[:, None] * basis
        moments[i] += weighted[:, :, None] * basis[:, None, :]
        right[i] += weighted[:, :, None] * values.reshape(len(i), 1, right.shape[2])
    found = total > 0
    weights = np.where(found, moments[:, 0, 0], 1.0)[:, None, None]
    moments, right = moments / weights, right / weights
    mean = np.where(found[:, None], right[:, 0], np.nan)
    _correct(mean, moments, right - moments[:, :, :1] * right[:, :1], found)
    return mean


def _correct(
    mean: np.ndarray, moments: np.ndarray, deviations: np.ndarray, found: np.ndarray
) -> None:
    """Make means (n, columns) those of a linear function, from moments of deviations from them."""
    correction, solvable = _value_of_linear_fit(moments, deviations, found)
    mean[solvable] += correction


def _value_of_linear_fit(
    moments: np.ndarray, right: np.ndarray, found: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """First unknown of normal equations (n, k, k) and (n, k, columns), and where it is determined.

    Returns (number determined, columns) and a mask (n,). ``found`` marks those to look at.
    """
    # The moments scale as 1, r, r^2: compare them as a correlation does.
    scale = np.sqrt(np.maximum(np.einsum("nkk->nk", moments), 1e-300))
    balanced = moments / (scale[:, :, None] * scale[:, None, :])
    smallest = np.linalg.eigvalsh(np.where(found[:, None, None], balanced, 0.0))[:, 0]
    solvable = found & (smallest > _SINGULAR)
    solution = np.linalg.solve(balanced[solvable], right[solvable] / scale[solvable, :, None])
    return solution[:, 0] / scale[solvable, 0, None], solvable
