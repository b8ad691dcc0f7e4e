"""What of a run is shown: a field by its name, one component of it, or numbers of one's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from particell.errors import InputError, unknown_name
from particell.geometry.domain import AXES
from particell.output.recorded import Recorded
from particell.plots.style import field_label, label

#: What can be shown: a name, or numbers of the particles, (n,) or (frames, n), by id.
Quantity = str | np.ndarray
SPEED = "speed"


class Shown:
    """One number a particle.

    Parameters
    ----------
    run
        The run.
    what
        A field, or what does not change (``"mass"``, ``"group"``, …), by its name; ``"speed"``;
        or numbers (n,), or (frames, n), in the order of the particles' ids.
    component
        Of a vector: 0, 1, 2 or ``"x"``, ``"y"``, ``"z"``; None is its magnitude.
    label
        Instead of the name and unit.

    Raises
    ------
    InputError
        For unknown names and components, and arrays that do not fit.
    """

    def __init__(
        self,
        run: Recorded,
        what: Quantity,
        component: int | str | None = None,
        label: str | None = None,
    ):
        self.run, self.what = run, what
        self.component = _component(component, run.domain.dim)
        if isinstance(what, str):
            self.name = "velocity" if what == SPEED else what
            if self.name not in run.field_names and self.name not in run.static:
                raise unknown_name("field", what, {*run.field_names, *run.static, SPEED})
            if self.component is not None and (what == SPEED or not self._is_vector):
                raise InputError("component", component, f"left out: {what} is no vector")
        else:
            self.what = np.asarray(what, float)
            expected = (len(run), len(run.static["group"]))
            if self.what.shape not in (expected, expected[1:]):
                allowed = f"of shape {expected[1:]} or {expected}"
                raise InputError("values", f"of shape {self.what.shape}", allowed)
            if component is not None:
                raise InputError("component", component, "left out with values of one's own")
        self.label = self._label() if label is None else label

    @property
    def is_field(self) -> bool:
        """Whether it is read from the run's frames."""
        return isinstance(self.what, str) and self.name in self.run.field_names

    @property
    def _is_vector(self) -> bool:
        if self.name in self.run.field_names:
            return len(self.run.source.shape(self.name)[0]) == 3
        return self.run.static[self.name].ndim == 2

    def at(self, frame: int) -> np.ndarray:
        """Values (n,) at a frame, in the order of ids."""
        if isinstance(self.what, np.ndarray):
            return self.what[frame] if self.what.ndim == 2 else self.what
        if self.name in self.run.field_names:
            return self.scalar(self.run.source.read(self.name, frame))
        return self.scalar(self.run.static[self.name])

    def scalar(self, values: np.ndarray) -> np.ndarray:
        """The component or magnitude of vectors (…, D); other values as they are."""
        if isinstance(self.what, np.ndarray) or not self._is_vector:
            return values
        if self.component is None:
            return np.linalg.norm(values, axis=-1)
        return values[..., self.component]

    def _label(self) -> str:
        if not isinstance(self.what, str):
            return ""
        if self.name == "velocity" and self.component is None:
            return label(SPEED, "m/s")
        magnitude = self._is_vector and self.component is None
        unit = self.run.source.unit(self.name) if self.is_field else ""
        text = field_label(self.name, self.component, unit)
        return f"magnitude of {text}" if magnitude else text


def _component(component: Any, dim: int) -> int | None:
    axes = AXES[:dim]
    if component is None:
        return None
    if isinstance(component, str) and len(component) == 1 and component in axes:
        return axes.index(component)
    if isinstance(component, int) and not isinstance(component, bool) and 0 <= component < dim:
        return component
    names = ", ".join(f"'{axis}'" for axis in axes)
    raise InputError("component", component, f"one of {names}, or a number from 0 to {dim - 1}")
