"""Fields of a run at points of one's own: see :meth:`particell.output.run.Run.on_points`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from particell.analysis.fields import interpolate
from particell.output.sources import known

if TYPE_CHECKING:
    from particell.output.run import Run


def on_points(
    run: Run,
    name: str,
    points: np.ndarray,
    frame: int,
    groups: str | Sequence[str] | None,
    order: int,
    kernel: str,
    support: float | None,
) -> np.ndarray:
    """The field at the points; all arguments as for the method."""
    frame = run.checked(frame)
    known("field", name, run.field_names)
    chosen = run.chosen(groups)
    return interpolate(
        points,
        run.source.read("position", frame)[chosen],
        run.source.read(name, frame)[chosen],
        volume=_volume(run, frame)[chosen],
        support=_given(run, "support", frame)[chosen] if support is None else support,
        domain=run.domain,
        kernel=kernel,
        order=order,
    )


def _volume(run: Run, frame: int) -> np.ndarray:
    """Volumes of the particles, up to a factor (particles at rest have no density field)."""
    mass = _given(run, "mass", frame)
    known_density = "density" in run.field_names or "density" in run.static
    return mass / _given(run, "density", frame) if known_density else mass


def _given(run: Run, name: str, frame: int) -> np.ndarray:
    """A field of a frame, or the static one where it does not change."""
    return run.source.read(name, frame) if name in run.field_names else run.static[name]
