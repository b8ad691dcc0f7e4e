"""Finds broken states; measures energy and momentum."""

from __future__ import annotations

import numpy as np

from particell.errors import RunError
from particell.fields import GIVEN, LOCAL, STATE, Field
from particell.geometry.domain import AXES
from particell.schemes.flow import Flow
from particell.state import State
from particell.suspects import suspects
from particell.units import place


class Monitor:
    """Finds non-finite fields and lost particles; measures energy and momentum.

    Parameters
    ----------
    state
        What is looked at.
    flow
        What moves; None where particles are at rest, and never leave.
    """

    def __init__(self, state: State, flow: Flow | None):
        self.state, self._flow = state, flow

    def check(self) -> None:
        """Refuse to go on with a broken state.

        Raises
        ------
        RunError
            Naming step, time, the first particle and the field.
        """
        declared = self.state.particles.declared.values()
        broken = {f.name: rows for f in declared if len(rows := self._bad_rows(f))}
        if broken:
            # A NaN spreads: from what never changes, and from where there are fewest.
            field = min(broken, key=lambda name: (self._rank(name), len(broken[name])))
            what = "negative" if field == "count" else "not finite"
            self.fail(f"a value is {what}", field, int(broken[field][0]))
        self._check_places()

    def _rank(self, name: str) -> int:
        """Which fields messages name first."""
        return {GIVEN: 0, STATE: 1}.get(self.state.particles.declared[name].role, 2)

    def _bad_rows(self, field: Field) -> np.ndarray:
        """Rows of a field that hold what they must not."""
        values = self.state.particles.view(field.name)
        if field.name == "count":
            bad = values < 0
        elif values.dtype.kind != "f" or field.role == LOCAL:  # unused in parts of the space
            return np.empty(0, np.int64)
        else:  # some distances are infinite where there is nothing near
            bad = ~np.isfinite(values) if field.role in (GIVEN, STATE) else np.isnan(values)
        return np.flatnonzero(bad.any(axis=1) if bad.ndim > 1 else bad)

    def _check_places(self) -> None:
        domain, particles = self.state.domain, self.state.particles
        bounded = ~domain.periodic
        if not bounded.any() or self._flow is None:
            return
        x = particles.view("x")
        h = particles.view("support")[:, None]
        beyond = np.stack([x < domain.lower - h, x > domain.upper + h]) & bounded
        lost = beyond.any(axis=(0, 2)) & (particles.view("is_wall") == 0)
        if lost.any():
            row = int(np.flatnonzero(lost)[0])
            side, axis = (int(k) for k in np.argwhere(beyond[:, row])[0])
            where = f"through its {('lower', 'upper')[side]} {AXES[axis]} side, to {place(x[row])}"
            self.fail(f"a particle has left the domain {where}", "position", row)

    def fail(self, message: str, field: str, row: int) -> None:
        """Raise an error that names a row's particle."""
        s = self.state
        particle = int(s.particles.view("id")[row])
        if self._flow is not None:
            message += suspects(self._flow, field)
        raise RunError(message, step=s.step, time=s.clock.time, field=field, particle=particle)

    def fastest(self) -> int:
        """The row of the fastest particle."""
        return int(np.argmax((self.state.particles.view("v").astype(float) ** 2).sum(axis=1)))

    def _masses(self) -> np.ndarray:
        p = self.state.particles
        mobile = p.view("is_wall") == 0
        return np.where(mobile, p.view("mass").astype(float), 0.0) * self.state.depth_factor

    def momentum(self) -> np.ndarray:
        """Σ m v of the mobile particles in kg m/s, shape (D,)."""
        v = self.state.particles.view("v").astype(float)
        return self.state.reduce.sum(self._masses()[:, None] * v)

    def absolute_momentum(self) -> float:
        """Σ m |v| of the mobile particles in kg m/s."""
        v = self.state.particles.view("v").astype(float)
        return float(
            self.state.reduce.sum((self._masses() * np.linalg.norm(v, axis=1))[:, None])[0]
        )

    def kinetic_energy(self) -> float:
        """½ Σ m v² of the mobile particles in J."""
        v = self.state.particles.view("v").astype(float)
        each = 0.5 * self._masses() * (v**2).sum(axis=1)
        return float(self.state.reduce.sum(each[:, None])[0])

    def largest_speed(self) -> float:
        """Largest |v| in m/s."""
        v = self.state.particles.view("v").astype(float)
        return float(np.sqrt((v**2).sum(axis=1).max(initial=0.0)))
