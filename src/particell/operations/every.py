"""Functions of a script that are called while a simulation runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from particell.checks import checked, positive, takes
from particell.errors import InputError
from particell.operations.operation import Operation, When
from particell.state import State

#: Part of a step by which a multiple of an interval may be missed: times are sums of steps.
SLACK = 1e-3


@checked
class Every(Operation):
    """Call a function every so many steps, or every interval of time.

    Parameters
    ----------
    function
        Called with the :class:`~particell.state.State`, of which it may read and set fields.
    steps
        Steps from one call to the next.
    interval
        Or the time in s: it is called at the end of the first step that has reached a multiple of
        it.
    when
        The moment of the step, by default its end.
    name
        By which checkpoints know it; by default that of the function.

    Raises
    ------
    InputError
        Where it is not one of ``steps`` and ``interval``.
    """

    def __init__(
        self,
        function: Callable[[State], None],
        steps: int | None = None,
        interval: float | None = None,
        when: When = When.DONE,
        name: str | None = None,
    ):
        takes("function", function, "state")
        if (steps is None) == (interval is None):
            raise InputError("steps", steps, "given, or interval, and not both")
        if steps is not None and steps < 1:
            raise InputError("steps", steps, "1 or more")
        if when in (When.START, When.BEGUN):
            raise InputError("when", when, "a moment of every step")
        if interval is not None:
            positive("interval", interval)
        self.function, self.interval, self.when = function, interval, when
        self.every = steps or 1
        self._name: str = name or str(getattr(function, "__name__", type(function).__name__))

    @property
    def name(self) -> str:
        """See the class."""
        return self._name

    def __call__(self, state: State) -> None:
        """Call the function, where it is time to."""
        if self.interval is not None:
            clock = state.clock
            end = clock.time if self.when is When.DONE else clock.time + clock.dt
            end += SLACK * clock.dt
            due = math.floor(end / self.interval)
            if due == math.floor((end - clock.dt) / self.interval):
                return
        self.function(state)


class Observables(Operation):
    """Numbers of a script in the time series: functions of the state, by name."""

    def __init__(self, functions: Mapping[str, Callable[[State], float]]):
        self.functions = dict(functions)
        for name, function in self.functions.items():
            if not isinstance(name, str) or not name or "/" in name:
                raise InputError("name of an observable", name, "text without '/'")
            takes(f"observable '{name}'", function, "state")

    def acts(self) -> Mapping[When, Callable[[State], None]]:
        """It only looks."""
        return {}

    def saved(self) -> dict[str, Any]:
        """Their names: a run goes on with the series that it began with."""
        return {"names": sorted(self.functions)}

    def check(self, saved: Mapping[str, Any]) -> None:
        """See :meth:`.Operation.check`."""
        if saved.get("names") != sorted(self.functions):
            allowed = f"as now: {', '.join(sorted(self.functions))}"
            raise InputError("observables of the checkpoint", saved.get("names"), allowed)

    def observables(self, state: State) -> dict[str, float]:
        """One number of each.

        Raises
        ------
        InputError
            Where a function returns no number.
        """
        found = {}
        for name, function in self.functions.items():
            value = function(state)
            if np.ndim(value) or not np.isrealobj(value) or isinstance(value, str | None):
                raise InputError(f"observable '{name}'", value, "a number")
            found[name] = float(value)
        return found
