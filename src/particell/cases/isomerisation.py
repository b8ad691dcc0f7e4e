r"""A ⇌ B with equal rates under fast diffusion: half and half.

All molecules are A at first. Each changes by itself, whatever its walk, so that the number of B is
binomial at all times,

.. math:: N_B \sim \mathrm{Bin}\big(N, \tfrac12(1 - e^{-2kt})\big),

and the fluctuations about its mean have the correlation :math:`e^{-2k|t-t'|}`. It takes so little
to be right, and yet a program that uses one random number for two choices, or fires at least one
event in each step, settles elsewhere (0.11 instead of ½ has been measured).

References
----------
Gardiner, Stochastic Methods (2009), 7.1.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from particell import plots
from particell.cases.base import Case, Context, Length, Metric, Rate
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import fluid
from particell.schemes.static import Static
from particell.simulation import Simulation


class Isomerisation(Case):
    """A ⇌ B under fast diffusion."""

    name = "isomerisation"
    title = "A <-> B with equal rates under fast diffusion: half and half"
    reference: ClassVar[str] = "exact binomial distribution"

    resolution: Annotated[int, Field(ge=8, le=500)] = 24
    """Particles along an edge of the periodic square."""
    spacing: Annotated[Length, Field(gt=0)] = 1e-6
    """Distance of the particles, and thickness of the plane."""
    molecules: Annotated[int, Field(ge=1, le=10**6)] = 10
    """Molecules in a particle."""
    rate: Annotated[Rate, Field(gt=0)] = 1.0
    """Rate constant k of both directions."""
    jumps: Annotated[float, Field(ge=0, le=1e5)] = 100.0
    """κ/(k Δx²): how fast diffusion is; about four times as many jumps fall between reactions."""
    steps: Annotated[int, Field(ge=20, le=10**6)] = 1000
    """Number of time steps."""
    end: Annotated[float, Field(ge=2, le=1000)] = 10.0
    """End of the run in units of 1/k."""

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end / self.rate

    @property
    def every(self) -> float:
        """Time between frames in s."""
        return self.until / 100

    @property
    def total(self) -> int:
        """All molecules."""
        return self.molecules * self.resolution**2

    def build(self, context: Context) -> Simulation:
        """A periodic square full of A."""
        edge = self.resolution * self.spacing
        domain = Domain((0, 0), (edge, edge), periodic="xy", depth=self.spacing)
        diffusivity = self.jumps * self.rate * self.spacing**2
        simulation = Simulation(
            domain,
            fluid(domain, Fluid(density=1000.0, viscosity=1e-3), self.spacing),
            Static(support=1.8),
            [
                Species("A", diffusivity, molecules=True),
                Species("B", diffusivity, molecules=True),
                Species("a"),
                Species("b"),
            ],
            [Reaction("A <-> B", self.rate, self.rate), Reaction("a <-> b", self.rate, self.rate)],
            seed=context.seed,
            dt=self.until / self.steps,
            device=context.device,
            normalise_diffusion=True,
        )
        assert simulation.chemistry is not None
        simulation.chemistry.set_count("A", self.molecules)
        concentration = self.molecules / (AVOGADRO * self.spacing**3)
        simulation.chemistry.set_concentration("a", concentration)
        return simulation

    def expected(self, times: np.ndarray) -> np.ndarray:
        """Probability to be B at times in s."""
        return -0.5 * np.expm1(-2 * self.rate * np.asarray(times))

    def share(self, run: Run, name: str, other: str) -> np.ndarray:
        """Share of the second of two species in time, (frames,)."""
        first, second = (run.observable(f"amount_{s}") for s in (name, other))
        return second / (first + second)

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Scores of the share at the end and of the largest deviation; conservation."""
        share, expected = self.share(run, "A", "B"), self.expected(run.times)
        deviation = np.sqrt(np.maximum(expected * (1 - expected), 1e-300) / self.total)
        scores = (share - expected) / deviation
        later = run.times > 3 / self.rate
        # one of the scores of 100 frames beyond 6: below 2e-7; the one at the end beyond 5: 6e-7
        found = {
            "share_of_B": Metric(float(share[later].mean())),
            "score_end": Metric(float(scores[-1]), limit=5.0, unit="sigma"),
            "score_largest": Metric(float(np.abs(scores[1:]).max()), limit=6.0, unit="sigma"),
        }
        counts = run.field("count/B")[-1]
        # walkers that forget where they were: multinomial numbers over the particles
        mean = counts.mean()
        statistic = np.sum((counts - mean) ** 2) / mean
        freedom = counts.size - 1
        found["spread_score"] = Metric(
            float((statistic - freedom) / math.sqrt(2 * freedom)), limit=6.0, unit="sigma"
        )
        lost = run.observable("amount_A") + run.observable("amount_B") - self.total
        found["molecules_lost"] = Metric(float(np.abs(lost).max()), limit=0.0)
        error = np.abs(self.share(run, "a", "b") - expected).max()
        found["concentration_error"] = Metric(float(error), limit=1e-5)
        return found

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """The share of B in time."""
        figure = self._figure(run)
        return [plots.save(figure, directory / "share.png")]

    @plots.styled
    def _figure(self, run: Run):
        figure, axes = plots.new_figure()
        expected = self.expected(run.times)
        width = 2 * np.sqrt(expected * (1 - expected) / self.total)
        axes.fill_between(
            run.times, expected - width, expected + width, color="0.85", lw=0, label="exact ± 2σ"
        )
        axes.plot(run.times, self.share(run, "A", "B"), ".", label="molecules")
        axes.plot(run.times, self.share(run, "a", "b"), "-", lw=0.8, label="concentrations")
        axes.set(xlabel="t [s]", ylabel="share of B", ylim=(0, 0.6))
        plots.legend(axes, loc="lower right")
        return figure
