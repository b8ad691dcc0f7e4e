"""How long time steps are: by the flow's rules, the species' limits, and the frames asked for."""

from __future__ import annotations

import math
from typing import Any

from particell.chemistry.engine import Chemistry
from particell.errors import InputError
from particell.limits import Mobile, law_limits
from particell.monitor import Monitor
from particell.schemes.flow import Flow
from particell.schemes.timestep import RULES, check_number_of_steps
from particell.speeds import check_given_step, flow_limits
from particell.state import State

#: A chemistry step moves particles by at most this part of the support.
CHEMISTRY_MOTION = 0.1
#: An automatic time step is chosen anew where it is larger by this factor than the flow allows.
LATE = 1.05
#: A run is refused where its automatic time step is larger by this factor than the flow allows.
#: It is then twice the Courant limit: what was slow to the sound speed is as fast as that.
TOO_LATE = 2.0


class TimeStep:
    """The time step of a simulation.

    Parameters
    ----------
    state, scheme, flow, chemistry
        What is simulated; no flow where particles are at rest.
    speed
        Largest initial or expected speed in m/s.
    dt
        In s, or ``"auto"``.

    Attributes
    ----------
    speed
        That for which an automatic step is chosen: the expected one, or what the flow has reached.
    automatic
        Whether the step follows the rules.
    """

    def __init__(
        self,
        state: State,
        scheme: Any,
        flow: Flow | None,
        chemistry: Chemistry | None,
        speed: float,
        dt: float | str,
    ):
        self.state, self.scheme, self.chemistry, self.flow = state, scheme, chemistry, flow
        self.speed, self.automatic = speed, dt == "auto"
        self.materials = state.materials
        if flow is not None:
            given, groups = flow.properties.given, state.particles.groups
            pairs = zip(given, groups, strict=True)
            self.materials = [m for m, g in pairs if g.kind == "fluid"] or given
        self._support = float(state.particles.host("support").min())
        self._take_law_limit()
        state.clock.dt = self.largest() if isinstance(dt, str) else float(dt)
        if not self.automatic:
            check_given_step(state.dt, self._support, self.materials, scheme, state.dim)

    def limits(self, speed: float | None = None) -> dict[str, float]:
        """The largest steps in s by what they come from, for a speed in m/s; by default ours.

        What particles are given counts (:mod:`particell.schemes.summation`), not what was asked
        for.
        """
        speed = self.speed if speed is None else speed
        carried = self.chemistry.limits() if self.chemistry else {}
        if self.flow is None:
            return carried or {"nothing": 1.0}
        flow = flow_limits(self._support, self.materials, self.scheme, speed, self.state.dim)
        found = {name: min(getattr(f, name) for f in flow) for name in RULES}
        diffusion = "diffusion of concentrations"  # which is explicit
        if diffusion in carried:
            found[diffusion] = carried[diffusion]
        return found | self._of_laws()

    def _of_laws(self) -> dict[str, float]:
        """What laws of the user's allow, by their names."""
        if self.flow is None or not self.flow.laws:
            return {}
        return law_limits(self.flow.laws, Mobile(self.flow))

    def _take_law_limit(self) -> None:
        """Let the flow know what laws of the user's allow: it decides how far fields lead."""
        if self.flow is not None:
            self.flow.law_limit = min(self._of_laws().values(), default=math.inf)

    def largest(self, speed: float | None = None) -> float:
        """The largest time step in s that the rules allow for a speed in m/s; by default ours."""
        return min(self.limits(speed).values())

    @property
    def limited_by(self) -> str:
        """What allows the smallest of the steps: a rule, or a law."""
        limits = self.limits()
        return min(limits, key=lambda name: limits[name])

    def _diffusive(self) -> float:
        """Largest step in s of the diffusion of concentrations, which is explicit."""
        limits = self.chemistry.limits() if self.chemistry else {}
        return limits.get("diffusion of concentrations", math.inf)

    def plan(self, every: float) -> int:
        """See :meth:`particell.simulation.Simulation.plan`."""
        clock = self.state.clock
        if not (every > 0 and math.isfinite(every)):
            raise InputError("every", every, "positive")
        largest = self.largest() if self.automatic else clock.dt
        self._take_law_limit()
        check_number_of_steps(largest, every)
        if largest > self._diffusive() * (1 + 1e-9):
            allowed = f"at most {self._diffusive():.3g} s (diffusion of concentrations)"
            raise InputError("dt", clock.dt, allowed)
        # frames may be closer than a step of the species could be long
        block = min(self._species_steps(largest), math.ceil(every / largest * (1 - 1e-12)))
        blocks = max(1, math.ceil(every / (block * largest) * (1 - 1e-12)))
        clock.species_every = block
        clock.dt = every / (blocks * block)
        return blocks * block

    def _species_steps(self, dt: float) -> int:
        """Steps of the flow that one of the species may take."""
        if self.chemistry is None or self.scheme.at_rest:
            return 1
        limits = [*self.chemistry.limits().values()]
        if self.speed > 0:
            limits.append(CHEMISTRY_MOTION * self._support / self.speed)
        return max(1, int(min(limits, default=dt) / dt))

    def outran(self, fastest: float) -> bool:
        """Whether a speed is too large for the automatic time step; if so, it is noted.

        The next :meth:`plan` is for that speed. Less than :data:`LATE` (the outliers of thermal
        noise) is no reason to choose the step anew.
        """
        if not self._late(LATE, fastest):
            return False
        self.speed = fastest
        return True

    def check(self, monitor: Monitor) -> None:
        """Refuse to go on where the flow is much too fast for an automatic time step."""
        fastest = monitor.largest_speed()
        if self._late(TOO_LATE, fastest):
            monitor.fail(
                f"the flow ({fastest:.3g} m/s) has become too fast for dt = {self.state.dt:.3g} s "
                "within a frame; give the speed that it reaches as reference_speed, or take "
                "shorter frames",
                "v",
                monitor.fastest(),
            )

    def _late(self, factor: float, speed: float) -> bool:
        """Whether an automatic dt is larger than ``factor`` times what the rules allow at a speed.

        Only where it was chosen for a smaller speed.
        """
        if self.scheme.at_rest or not self.automatic or speed <= self.speed:
            return False
        return self.state.dt > factor * self.largest(speed)

    def saved(self) -> dict[str, Any]:
        """What :meth:`restore` puts back."""
        limit = self.flow.law_limit if self.flow else math.inf
        return {"speed": self.speed, "law_limit": limit}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on for the speed that another run has reached."""
        self.speed = saved["speed"]
        if self.flow is not None:
            self.flow.law_limit = saved["law_limit"]
