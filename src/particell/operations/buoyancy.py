"""Body forces that depend on what particles carry: the field ``buoyancy``, which laws read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particell.chemistry.contents import Contents
from particell.errors import InputError
from particell.fields import work
from particell.laws.buoyancy import Buoyancy, measure_buoyancy
from particell.materials import AVOGADRO
from particell.operations.operation import Operation, When
from particell.state import State


class MeasureBuoyancy(Operation):
    """The sum of all such forces at the particles, per mass, before forces act.

    Raises
    ------
    InputError
        For species that there are not, or that switch, and for vectors of another dimension.
    """

    when = When.FORCES

    def __init__(self, forces: Sequence[Buoyancy], species: Contents | None, dim: int):
        known = species.species if species else {}
        for force in forces:
            if force.species not in known:
                raise InputError("species", force.species, f"one of {', '.join(known) or 'none'}")
            if known[force.species].switches:
                raise InputError("species", force.species, "one without switch_above, in a force")
            if len(force.gravity) != dim:
                raise InputError("gravity", force.gravity, f"{dim} numbers")
        self.forces, self.species = list(forces), species
        self.fields = (work("buoyancy", dim),)

    def attach(self, state: State) -> None:
        """Bind the loops."""
        assert self.species is not None
        particles, self._loops = state.particles, []
        for k, force in enumerate(self.forces):
            whole = self.species.species[force.species].molecules
            strength = -force.expansion * np.array(force.gravity, dtype=float)
            values = {
                "content": particles["count" if whole else "amount"],
                "s": self.species.column(force.species),
                "scale": 1.0 / (state.depth_factor * AVOGADRO) if whole else 1.0,
                "reference": force.reference,
                "strength": state.device.array(strength),
            }
            self._loops.append(state.bind(measure_buoyancy, values, DIM=state.dim, FIRST=k == 0))

    def __call__(self, state: State) -> None:
        """Measure."""
        for measure in self._loops:
            measure(state.n)
