r"""Fields averaged in time at points that do not move, while a simulation runs.

Particles that come within reach of a point :math:`x`, at any of the instants between two frames at
which samples are taken, contribute to the sums

.. math:: M_{ab} = \sum w_j b_a b_b, \quad R_a = \sum w_j b_a A_j, \qquad
          b = (1,\; x_j - x), \quad w_j = V_j W(|x_j - x|, h_j).

The mean is the value at :math:`x` of the linear function that fits all those :math:`A_j` best in
the sense of these weights: moving least squares over space and time at once. It is exact for steady
linear fields, at walls too, and every particle counts as much as it would in
:mod:`particell.analysis.fields`. Sums, not particles, are kept, so that many samples cost little.
Fields that other groups carry have sums of their own. What walls hold at their surfaces is added
when a mean is taken, as there; surfaces that move are left out of it.

The points are no particles and have no row in the neighbour list: candidates are taken from cells,
in a loop of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell import snapshot
from particell.analysis.fields import Held, fit_of_sums
from particell.checks import checked, not_negative, positive
from particell.compute.cells import (
    cell_at,
    cells_around,
    cells_of,
    counting_sort,
    place_of,
    wrap_cell,
)
from particell.compute.device import Device
from particell.compute.loop import particle_loop
from particell.compute.rounding import nearest_integer
from particell.errors import InputError, unknown_name
from particell.kernels import kernel_code, shape_w
from particell.roles import carriers
from particell.simulated import Simulated

#: Characters in the name of an average.
LONGEST_NAME = 100


@checked
@dataclass(frozen=True, eq=False)
class TimeAverage:
    """What :meth:`.Simulation.run` averages in time; read it back with :meth:`.Run.average`.

    Parameters
    ----------
    points
        Where, (…, D), in m: any shape, such as what :func:`particell.analysis.fields.grid` gives.
    fields
        Names as in a run's frames: ``"velocity"``, ``"pressure"``, ``"concentration/L"``, ….
    samples
        Samples between two frames, equally spaced in time; the last one is at the frame. There
        may be more, up to twice as many, as time steps are not divided, and never more than time
        steps.
    after
        Time in s from which on; before it the state at each frame is all that is sampled.
    groups
        The groups whose particles are used, and nothing but these. By default those that carry a
        field, bounded by walls whose surfaces do not move, as for :meth:`.Run.on_points`.
    name
        By which it is asked for where a run has several.
    kernel
        Name of the weights' kernel; its support is that of the particles.

    Raises
    ------
    InputError
        Where a value is not allowed.
    """

    points: np.ndarray
    fields: Sequence[str] = ("velocity",)
    samples: int = 20
    after: float = 0.0
    groups: Sequence[str] | None = None
    name: str = "mean"
    kernel: str = "wendland-c2"

    def __post_init__(self) -> None:
        kernel_code(self.kernel)
        positive("samples", self.samples)
        not_negative("after", self.after)
        points = np.array(self.points, float)
        if points.ndim < 2 or not points.size or not np.isfinite(points).all():
            raise InputError("points", f"of shape {points.shape}", "finite, of shape (…, D)")
        if not self.fields:
            raise InputError("fields", self.fields, "at least one name")
        good = self.name.strip(".") and self.name.isprintable() and len(self.name) <= LONGEST_NAME
        if not good or "/" in self.name:  # it is a part of a path in the file
            allowed = f"a word of at most {LONGEST_NAME} characters, without '/'"
            raise InputError("name", self.name, allowed)
        object.__setattr__(self, "points", points)


def check_averages(simulation: Simulated, averages: Sequence[TimeAverage]) -> None:
    """Refuse averages that a simulation cannot have.

    Raises
    ------
    InputError
        For unknown fields and groups, points of another dimension, and names used twice.
    """
    names = [average.name for average in averages]
    if len(set(names)) < len(names):
        raise InputError("averages", names, "with a name each")
    known = snapshot.field_names_of(simulation)
    groups = [g.name for g in simulation.particles.groups]
    dim = simulation.domain.dim
    for average in averages:
        for name in average.fields:
            if name not in known:
                raise unknown_name("field in averages", name, known)
        for group in average.groups or ():
            if group not in groups:
                raise unknown_name("group in averages", group, groups)
        shape = average.points.shape
        if shape[-1] != dim:
            raise InputError("points in averages", f"of shape {shape}", f"of shape (…, {dim})")


@particle_loop
def assign_wrapped_cells(i, x, lower, inverse_cell, cells, periodic, cell, *, DIM):
    """The cell of particle i, row-major: on a periodic axis of its image in the box."""
    index = 0
    for d in range(DIM):
        c = math.floor((x[i, d] - lower[d]) * inverse_cell[d])
        if periodic[d]:
            c -= cells[d] * math.floor(c / cells[d])
        index = index * cells[d] + min(max(c, 0), cells[d] - 1)
    cell[i] = index


@particle_loop
def add_sums(
    p,
    points,
    point_cell,
    x,
    values,
    volume,
    support,
    order,
    cell_start,
    cells,
    periodic,
    period,
    inverse_period,
    scale,
    sums,
    *,
    DIM,
    KERNEL,
    COLUMNS,
):
    """Add to the sums of point p: M (rows of its lower triangle), then R, in units of ``scale``."""
    ix, iy, iz = place_of(point_cell[p], cells, DIM)
    first_x, number_x, first_y, number_y, first_z, number_z = cells_around(
        ix, iy, iz, cells, periodic, 1, DIM
    )
    last = cells[DIM - 1]
    for ox in range(number_x):
        cx = wrap_cell(first_x + ox, cells[0]) if DIM == 3 else 0
        for oy in range(number_y):
            cy = wrap_cell(first_y + oy, cells[DIM - 2]) if DIM >= 2 else 0
            for oz in range(number_z):
                other = cell_at(cx, cy, wrap_cell(first_z + oz, last), cells, DIM)
                for k in range(cell_start[other], cell_start[other + 1]):
                    j = order[k]
                    dx = x[j, 0] - points[p, 0]
                    dx -= period[0] * nearest_integer(dx * inverse_period[0])
                    dy, dz = 0.0, 0.0
                    if DIM > 1:
                        dy = x[j, 1] - points[p, 1]
                        dy -= period[1] * nearest_integer(dy * inverse_period[1])
                    if DIM > 2:
                        dz = x[j, 2] - points[p, 2]
                        dz -= period[2] * nearest_integer(dz * inverse_period[2])
                    h = support[j]
                    q = math.sqrt(dx * dx + dy * dy + dz * dz) / h
                    if q >= 1.0 or volume[j] == 0.0:
                        continue
                    w = volume[j] * shape_w(q, KERNEL) / h**DIM
                    basis = (1.0, dx / scale, dy / scale, dz / scale)
                    m = 0
                    for a in range(DIM + 1):
                        for b in range(a + 1):
                            sums[p, m] += w * basis[a] * basis[b]
                            m += 1
                    for a in range(DIM + 1):
                        for s in range(COLUMNS):
                            sums[p, m] += w * basis[a] * values[j, s]
                            m += 1


class RunningAverage:
    """The sums of a :class:`TimeAverage` of one simulation; they are on the CPU."""

    def __init__(self, simulation: Simulated, average: TimeAverage):
        self.simulation, self.average = simulation, average
        roles, names = snapshot.roles_of(simulation), average.groups
        given = tuple(g for g, role in enumerate(roles) if role.name in (names or ()))
        carried = [given if names else carriers(roles, name) for name in average.fields]
        #: Groups that carry fields, and those fields: each set has sums of its own.
        self._sets = [
            (c, [f for f, g in zip(average.fields, carried, strict=True) if g == c])
            for c in dict.fromkeys(carried)
        ]
        self._shapes = {n: snapshot.field_of(simulation, n).shape[1:] for n in average.fields}
        self._columns = max(sum(map(self._width, fields)) for _, fields in self._sets)
        n, dim = len(simulation.particles), simulation.domain.dim
        points, size = average.points.reshape(-1, dim), dim + 1
        width = size * (size + 1) // 2 + size * self._columns
        self.sums = np.zeros((len(self._sets), len(points), width))
        self._scale = float(simulation.particles.host("support").max())
        self._bind(n, points, self._scale)

    def _width(self, name: str) -> int:
        return math.prod(self._shapes[name])

    def _bind(self, n: int, points: np.ndarray, reach: float) -> None:
        domain, device = self.simulation.domain, Device()
        dim = domain.dim
        cells = cells_of(domain.lengths, reach, n)
        self._cell_start = np.zeros(int(np.prod(cells)) + 1, np.int64)
        self._order = np.zeros(n, np.int64)
        self._now: dict[str, Any] = {
            "x": np.zeros((n, dim)),
            "values": np.zeros((n, self._columns)),
            "volume": np.zeros(n),
            "support": np.zeros(n),
            "cell": np.zeros(n, np.int64),
        }
        constant = {
            "lower": domain.lower,
            "cells": cells,
            "inverse_cell": cells / domain.lengths,
            "periodic": np.asarray(domain.periodic),
            "period": np.asarray(domain.lengths),
            "inverse_period": np.asarray(domain.inverse_periods),
            "points": points,
            "point_cell": np.zeros(len(points), np.int64),
            "order": self._order,
            "cell_start": self._cell_start,
            "scale": reach,
        }
        grid = {**constant, "x": points, "cell": constant["point_cell"]}
        device.bind(assign_wrapped_cells, grid, DIM=dim)(len(points))
        fields = {**constant, **self._now}
        self._assign = device.bind(assign_wrapped_cells, fields, DIM=dim)
        code = kernel_code(self.average.kernel)
        constants = {"DIM": dim, "KERNEL": code, "COLUMNS": self._columns}
        self._add = [device.bind(add_sums, {**fields, "sums": s}, **constants) for s in self.sums]

    def due_in(self, to_frame: int, per_frame: int) -> int:
        """Steps to the next sample, where the next frame is ``to_frame`` steps ahead."""
        if self.simulation.time + to_frame * self.simulation.dt <= self.average.after * (1 + 1e-9):
            return to_frame
        interval = max(1, per_frame // self.average.samples)
        return to_frame % interval or interval

    def sample(self) -> None:
        """Add the present state to the sums."""
        s, now = self.simulation, self._now
        particles, n = s.particles, len(now["x"])
        now["x"][...] = particles.view("x")
        now["support"][...] = particles.view("support")
        self._assign(n)
        counting_sort(now["cell"], particles.view("id"), self._cell_start, self._order)
        for (groups, fields), add in zip(self._sets, self._add, strict=True):
            np.divide(particles.view("mass"), particles.view("density"), out=now["volume"])
            now["volume"][~np.isin(particles.view("group"), groups)] = 0.0
            column = 0
            for name in fields:
                width = self._width(name)
                values = snapshot.field_of(s, name).reshape(-1, width)
                now["values"][:, column : column + width] = values
                column += width
            add(self.sums.shape[1])

    def take(self) -> dict[str, np.ndarray]:
        """The means by field, (…) or (…, D), NaN where no particle was in reach; new sums begin."""
        found: dict[str, np.ndarray] = {}
        walls = None if self.average.groups else self._walls()
        for (groups, fields), sums in zip(self._sets, self.sums, strict=True):
            found |= self._means(groups, fields, sums, walls)
        self.sums[...] = 0.0
        return {name: found[name] for name in self.average.fields}

    def _means(
        self, groups: tuple[int, ...], fields: list[str], sums: np.ndarray, walls: Any
    ) -> dict[str, np.ndarray]:
        """The means of the fields that the same groups carry."""
        size = self.simulation.domain.dim + 1
        rows, columns = np.tril_indices(size)
        moments = np.empty((len(sums), size, size))
        moments[:, rows, columns] = moments[:, columns, rows] = sums[:, : len(rows)]
        rights = sums[:, len(rows) :].reshape(-1, size, self._columns)
        found, column = {}, 0
        for name in fields:
            width = self._width(name)
            part = rights[:, :, column : column + width]
            column += width
            held = walls.held(name) if walls else []
            mean = fit_of_sums(moments, part, held, self._scale, kernel_code(self.average.kernel))
            if walls:
                mean[walls.hidden(groups)] = np.nan
            outer = self.average.points.shape[:-1]
            found[name] = mean.reshape(outer + self._shapes[name])
        return found

    def _walls(self) -> _Walls:
        return _Walls(self.simulation, self.average.points)


class _Walls:
    """What bounds fields at the points of an average; surfaces that move are left out."""

    def __init__(self, simulation: Simulated, points: np.ndarray):
        self._simulation = simulation
        self._points = points.reshape(-1, simulation.domain.dim)
        self._arrangement = snapshot.arrangement_of(simulation)
        seen = self._arrangement.seen(self._points)
        moving = simulation.walls.moving_surfaces() if seen else set()
        self._seen = {g: s for g, s in seen.items() if g not in moving}

    def held(self, name: str) -> list[Held]:
        values = np.asarray(snapshot.field_of(self._simulation, name), float)
        return self._arrangement.held(name, self._seen, self._points, values)

    def hidden(self, groups: tuple[int, ...]) -> np.ndarray:
        return self._arrangement.hidden(self._points, self._seen, groups, everywhere=True)
