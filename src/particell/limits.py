"""What limits the time step: the rules of the flow, the species, and laws of the user's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.compute.expressions import Vector
from particell.errors import InputError, unknown_name
from particell.laws.law import Law
from particell.schemes.friction_limit import lattice_eigenvalue
from particell.speeds import flow_limits

if TYPE_CHECKING:
    from particell.simulation import Simulation

#: A difference to a wall's value, extrapolated through its surface, raises the largest rate: to 3.2
#: times that of a lattice where a particle sits in a corner in three dimensions (Lucy's kernel).
BESIDE_WALLS = 2.5
#: The limits of the flow's rules (:mod:`particell.schemes.timestep`).
RULES = ("sound", "viscosity", "acceleration")


def limits_of(simulation: Simulation, speed: float) -> dict[str, float]:
    """The largest time steps in s by what they come from, for a speed in m/s."""
    s = simulation
    carried = s.chemistry.limits() if s.chemistry else {}
    if s.static:
        return carried or {"nothing": 1.0}
    support = float(s.particles.host("support").min())
    flow = flow_limits(support, s.given_materials, s.scheme, speed, s.domain.dim)
    found = {name: min(getattr(f, name) for f in flow) for name in RULES}
    diffusion = "diffusion of concentrations"  # which is explicit
    if diffusion in carried:
        found[diffusion] = carried[diffusion]
    return found | law_limits(laws_of(s), Mobile(s))


def laws_of(simulation: Simulation) -> Sequence[Law]:
    """The laws of the user's; particles at rest have none."""
    return getattr(simulation.scheme, "more", ())


def law_limit(simulation: Simulation) -> float:
    """The smallest step in s that laws of the user's allow."""
    laws = laws_of(simulation)
    return (
        min(law_limits(laws, Mobile(simulation)).values(), default=math.inf) if laws else math.inf
    )


class Mobile:
    r"""All mobile particles as laws see one: arrays of their fields, properties of their fluids.

    Besides there is ``laplacian``, the largest rate at which :math:`\sum_j 2 V_j F (f_j - f_i)`
    decays on a lattice (:mod:`particell.schemes.friction_limit`), in 1/m²; beside walls what keeps
    their surfaces' values stable.
    """

    def __init__(self, simulation: Simulation):
        solver: Any = simulation.solver
        self._particles, self._tables = simulation.particles, solver.tables
        self._rows = simulation.particles.host("is_wall") == 0
        self.dim, self.time = simulation.domain.dim, float(solver.time)
        self._kernel = simulation.scheme.kernel, simulation.scheme.support
        self._beside = BESIDE_WALLS if solver.walls else 1.0
        self.gravity = Vector.of("gravity", simulation.device.to_host(solver.constants["gravity"]))

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
