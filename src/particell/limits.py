"""Limits of the time step by laws of the user's: :meth:`.Law.largest_step` of all particles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from particell.compute.expressions import Vector
from particell.errors import InputError, unknown_name
from particell.laws.law import Law
from particell.schemes.flow import Flow
from particell.schemes.friction_limit import lattice_eigenvalue

#: A difference to a wall's value, extrapolated through its surface, raises the largest rate: to 3.2
#: times that of a lattice where a particle sits in a corner in three dimensions (Lucy's kernel).
BESIDE_WALLS = 2.5


class Mobile:
    r"""All mobile particles as laws see one: arrays of their fields, properties of their fluids.

    Besides there is ``laplacian``, the largest rate at which :math:`\sum_j 2 V_j F (f_j - f_i)`
    decays on a lattice (:mod:`particell.schemes.friction_limit`), in 1/m²; beside walls what keeps
    their surfaces' values stable.
    """

    def __init__(self, flow: Flow):
        state, scheme = flow.state, flow.scheme
        self._kernel = scheme.kernel, scheme.support
        self._beside = BESIDE_WALLS if flow.walls else 1.0
        self._particles, self._tables = state.particles, flow.properties.tables
        self._rows = state.particles.host("is_wall") == 0
        self.number = int(self._rows.sum())
        self.dim, self.time = state.dim, float(state.time)
        self.gravity = Vector.of("gravity", state.device.to_host(flow.constants["gravity"]))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name == "laplacian":
            largest = lattice_eigenvalue(*self._kernel, self.dim, 2.0, 0.0, False)
            return self._beside * largest / self.support**2
        if name == "specific_volume":
            return 1.0 / self.density
        if name == "volume":  # before the first step there is none
            return self.mass / self.density
        if name in self._tables:
            return self._tables[name][self._particles.host("group")[self._rows]]
        if name not in self._particles:
            known = {*self._particles, *self._tables, "gravity", "laplacian", "time"}
            raise unknown_name("what a law reads", name, known)
        values = np.asarray(self._particles.host(name)[self._rows], float)
        return Vector.of(name, values.T) if values.ndim > 1 else values


def law_limits(laws: Sequence[Law], particles: Any) -> dict[str, float]:
    """The smallest of the steps in s that laws allow, by the names of their classes.

    Raises
    ------
    InputError
        Where a law's answer is no positive time.
    """
    found: dict[str, float] = {}
    for law in laws:
        name = type(law).__name__
        try:
            steps = np.asarray(law.largest_step(particles), float)
            if steps.shape not in ((), (1,), (particles.number,)):
                wrong = f"numbers of shape {steps.shape}"
                raise InputError(f"{name}.largest_step", wrong, "one, or one for each particle")
            smallest = float(steps.min(initial=math.inf))
        except (TypeError, ValueError, AttributeError) as error:
            if isinstance(error, InputError):
                raise
            allowed = "arithmetic on what it is given, with where, sqrt, … of particell.laws"
            raise InputError(f"{name}.largest_step", str(error), allowed) from error
        if not smallest > 0.0:
            raise InputError(f"{name}.largest_step", smallest, "a positive time in s")
        if smallest < math.inf:
            found[name] = min(smallest, found.get(name, math.inf))
    return found
