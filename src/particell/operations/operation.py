"""What happens between the loops of a scheme: at a moment of a step, every n steps, or both.

Walls that move, reflecting surfaces, sponges, forces that depend on species, the species' own
steps, and what a user's script wants done are all operations. An operation has a moment, fields of
its own, something that it does, numbers that it shows, and a state that goes into checkpoints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from typing import Any

from particell.checks import takes
from particell.errors import InputError
from particell.fields import Field
from particell.state import State


class When(Enum):
    """Moments of a simulation at which operations act, in the order in which they come.

    The first three come once before the first step, the others in every step (``LIST`` in those
    that build the neighbour list).
    """

    #: The first neighbour list is there.
    START = "start"
    #: Densities and pressures are known for the first time.
    BEGUN = "begun"
    #: The neighbour list has been built; rows have changed places.
    LIST = "list built"
    #: Positions have reached a part of the step (:attr:`.Clock.now`); walls follow.
    MOVED = "moved"
    #: Sums over neighbours come next.
    PAIRS = "pairs"
    #: Half-way through a step, where the scheme has fluxes there.
    HALF = "half"
    #: Positions have reached the end of the step: what has crossed a surface is turned back.
    DRIFTED = "drifted"
    #: Densities, pressures and volumes are known, forces come next.
    FORCES = "forces"
    #: Velocities have reached the end of the step.
    END = "end"
    #: The step is done and counted; species have had theirs.
    DONE = "done"


class Operation:
    """Something that happens at a moment; derive from it and write :meth:`__call__`.

    Attributes
    ----------
    when
        The moment.
    every
        Steps from one call to the next; it is called in step n where n is a multiple of it. What
        comes once (``START``, ``BEGUN``) or with the neighbour list comes always.
    fields
        Fields of its own, which are in checkpoints like all others.
    """

    when: When = When.DONE
    every: int = 1
    fields: tuple[Field, ...] = ()

    @property
    def name(self) -> str:
        """What it is called in checkpoints."""
        return type(self).__name__

    def attach(self, state: State) -> None:
        """Look up what it needs, once, before anything runs."""

    def __call__(self, state: State) -> None:
        """Do it."""

    def acts(self) -> Mapping[When, Callable[[State], None]]:
        """What it does, by moments; for operations that have more than one."""
        return {self.when: self}

    def observables(self, state: State) -> dict[str, float]:
        """Numbers for the time series, at every frame."""
        return {}

    def counts(self, state: State) -> dict[str, float]:
        """What it has counted, which stands beside what is conserved."""
        return {}

    def saved(self) -> dict[str, Any]:
        """What a run that goes on needs besides fields, for :meth:`restore`."""
        return {}

    def check(self, saved: Mapping[str, Any]) -> None:
        """Refuse what another kind of run has :meth:`saved`, before anything is restored."""

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Put the :meth:`saved` state of another run back."""


class Operations:
    """The operations of a simulation, in the order in which they act at a moment.

    Raises
    ------
    InputError
        For what is no operation, and for fields whose names are taken.
    """

    def __init__(self, state: State, operations: Iterable[Operation]):
        self.state = state
        self.by_name: dict[str, Operation] = {}
        for operation in operations:
            if not isinstance(operation, Operation):
                allowed = "an Operation: a class derived from particell.Operation, or Every"
                raise InputError("operations", operation, allowed)
            if not (isinstance(operation.every, int) and operation.every >= 1):
                raise InputError(f"every of {operation.name}", operation.every, "1 or more steps")
            for when in operation.acts():
                if not isinstance(when, When):
                    raise InputError(f"when of {operation.name}", when, "one of particell.When")
            _check(operation)
            name, number = operation.name, 2
            while name in self.by_name:
                name, number = f"{operation.name} {number}", number + 1
            self.by_name[name] = operation
            for field in operation.fields:
                state.particles.add(field)
            operation.attach(state)

    def at(self, when: When) -> Callable[[], None] | None:
        """All that acts at a moment, as one call; None where nothing does."""
        state, clock = self.state, self.state.clock
        found = [
            (operation, operation.acts()[when])
            for operation in self.by_name.values()
            if when in operation.acts()
        ]
        if not found:
            return None
        # steps are counted when they are done, before the last moment
        ahead = 0 if when is When.DONE else 1
        always = when in (When.START, When.BEGUN, When.LIST)

        def fire() -> None:
            for operation, act in found:
                if always or (clock.step + ahead) % operation.every == 0:
                    try:
                        act(state)
                    except Exception as error:
                        error.add_note(
                            f"(in operation {operation.name}, step {clock.step + ahead})"
                        )
                        raise

        return fire

    def observables(self) -> dict[str, float]:
        """Numbers for the time series."""
        found: dict[str, float] = {}
        for name, operation in self.by_name.items():
            _add(found, operation.observables(self.state), name)
        return found

    def counts(self) -> dict[str, float]:
        """What operations have counted."""
        found: dict[str, float] = {}
        for name, operation in self.by_name.items():
            _add(found, operation.counts(self.state), name)
        return found

    def saved(self) -> dict[str, Any]:
        """What :meth:`restore` puts back, by the operations' names."""
        return {name: operation.saved() for name, operation in self.by_name.items()}

    def check(self, saved: Mapping[str, Any]) -> None:
        """Refuse what other operations have saved.

        Raises
        ------
        InputError
            Naming both.
        """
        if set(saved) != set(self.by_name):
            allowed = f"as now: {', '.join(self.by_name) or 'none'}"
            raise InputError("operations of the checkpoint", ", ".join(map(str, saved)), allowed)
        for name, operation in self.by_name.items():
            if not isinstance(saved[name], Mapping):
                raise InputError(f"operation '{name}' of the checkpoint", saved[name], "a table")
            operation.check(saved[name])

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Put what another run's operations have saved back."""
        for name, operation in self.by_name.items():
            operation.restore(saved[name])


#: What an operation does one of.
_DOES = ("__call__", "acts", "attach", "observables", "counts")


def _check(operation: Operation) -> None:
    """Refuse an operation that would do nothing, or that declares what is no field."""
    kind, name = type(operation), operation.name
    if all(getattr(kind, does) is getattr(Operation, does) for does in _DOES):
        raise InputError(f"operation {name}", operation, "one with a method '__call__' or 'acts'")
    for field in operation.fields:
        if not isinstance(field, Field):
            raise InputError(f"fields of {name}", field, "particell.Field(name)")
    for act in operation.acts().values():
        takes(f"what {name} does", act, "state")


def _add(found: dict[str, float], more: Mapping[str, float], whose: str) -> None:
    """Take numbers over, of which none may be there already."""
    if not isinstance(more, Mapping):
        raise InputError(f"numbers of {whose}", more, "a table of numbers by name")
    for name, value in more.items():
        if name in found:
            raise InputError(f"number of {whose}", name, "a name that nothing else has")
        found[name] = value
