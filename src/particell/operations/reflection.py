"""Reflecting surfaces: what has crossed one is mirrored back at the end of a drift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particell.boundaries.reflection import Reflection, reflect, surface_table
from particell.errors import InputError
from particell.fields import Field
from particell.geometry.shapes import Ball
from particell.operations.operation import Operation, When
from particell.state import State


class Reflect(Operation):
    """All reflecting surfaces of a simulation.

    Raises
    ------
    InputError
        For bodies of another dimension.
    """

    when = When.DRIFTED
    fields = (Field("reflections", kind=np.int64),)

    def __init__(self, surfaces: Sequence[Reflection], dim: int):
        for surface in surfaces:
            body = surface.body
            if len(body.center if isinstance(body, Ball) else body.point) != dim:
                raise InputError("body of Reflection", body, f"in {dim} dimensions")
        self.surfaces = list(surfaces)

    def attach(self, state: State) -> None:
        """Bind the loop."""
        table = state.device.array(surface_table(self.surfaces, state.dim))
        more = {"surfaces": table, "number": len(self.surfaces)}
        self._reflect = state.bind(reflect, more, DIM=state.dim)

    def __call__(self, state: State) -> None:
        """Mirror what has crossed."""
        self._reflect(state.n)

    def counts(self, state: State) -> dict[str, float]:
        """How often particles were reflected."""
        return {"reflections": float(state.particles.host("reflections").sum())}
