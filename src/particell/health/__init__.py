"""Whether a run can be trusted: its flow, its walls, its species, each against a limit.

Most is a by-product of taking a frame; nothing is done between frames. What the limits are from is
in ``docs/faults.md``.
"""

from __future__ import annotations

from particell.health.finding import Finding, beyond
from particell.health.flow import Watch
from particell.health.noise import of_noise
from particell.health.species import of_species
from particell.health.walls import of_walls
from particell.simulated import Simulated

__all__ = ["Finding", "Watch", "beyond", "examine", "foresee"]


def foresee(simulation: Simulated) -> list[Finding]:
    """What is known before a simulation runs."""
    return [*of_walls(simulation), *of_noise(simulation)]


def examine(simulation: Simulated, watch: Watch) -> list[Finding]:
    """Everything: the description, the present state, and the worst of the frames so far."""
    watch.look()
    return [*foresee(simulation), *watch.findings(), *of_species(simulation)]
