"""The species' own steps: diffusion and reactions, every so many steps of the flow."""

from __future__ import annotations

from particell.chemistry.engine import Chemistry
from particell.operations.operation import Operation, When
from particell.state import State


class StepSpecies(Operation):
    """Diffusion and reactions of all species."""

    when = When.DONE

    def __init__(self, chemistry: Chemistry):
        self.chemistry = chemistry

    def __call__(self, state: State) -> None:
        """A step of the species, where one is due."""
        clock = state.clock
        if clock.step % clock.species_every == 0:
            self.chemistry.step(clock.step, clock.species_every * clock.dt, clock.time)
