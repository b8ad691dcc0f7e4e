r"""Molecules that come out of nothing and die: Poisson numbers at all times.

∅ → M with k₁ and M → ∅ with k₂ in each of many particles, none at first, with diffusion between
them. The numbers are independent Poisson numbers of the mean

.. math:: \lambda(t) = \frac{k_1 V 𝒩}{k_2} (1 - e^{-k_2 t})

at all times, with or without diffusion (the field starts uniform, and walkers that come, go and die
by themselves keep a Poisson field Poisson). The same as a concentration follows λ.

References
----------
Gardiner, Stochastic Methods (2009), 11.1; the values for a single system in
``tests/data/cme_reference.csv`` are our own (master equation).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field
from scipy.stats import poisson

from particell import plots
from particell.cases.base import Case, Context, Diffusivity, Length, Metric, Rate
from particell.cases.scores import chi_square_metric
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import fluid
from particell.schemes.static import Static
from particell.simulation import Simulation

#: False-alarm rate of each statistical metric.
ALARM = 2.5e-7
#: Looked at after this many lifetimes, and at the end.
EARLY = 1.0


class BirthDeath(Case):
    """Molecules that come out of nothing and die."""

    name = "birth-death"
    title = "Molecules that come out of nothing and die: Poisson numbers"
    reference: ClassVar[str] = "exact distribution"

    resolution: Annotated[int, Field(ge=8, le=1000)] = 64
    """Particles along an edge of the periodic square."""
    spacing: Annotated[Length, Field(gt=0)] = 1e-6
    """Distance of the particles, and thickness of the plane."""
    mean: Annotated[float, Field(gt=0, le=1e5)] = 10.0
    """Mean number of molecules in a particle in the end, k₁V𝒩/k₂."""
    death: Annotated[Rate, Field(gt=0)] = 0.5
    """Rate constant k₂ of M → ∅."""
    diffusivity: Annotated[Diffusivity, Field(ge=0)] = 1e-12
    """Diffusivity of M."""
    lifetimes: Annotated[float, Field(ge=2, le=1000)] = 10.0
    """End of the run in units of 1/k₂."""
    frames: Annotated[int, Field(ge=20, le=1000)] = 100
    """Number of frames."""

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.lifetimes / self.death

    @property
    def every(self) -> float:
        """Time between frames in s."""
        return self.until / self.frames

    @property
    def concentration(self) -> float:
        """Concentration in mol/m³ in the end."""
        return self.mean / (AVOGADRO * self.spacing**3)

    def expected(self, time: float | np.ndarray) -> np.ndarray:
        """λ at times in s."""
        return -self.mean * np.expm1(-self.death * np.asarray(time))

    def build(self, context: Context) -> Simulation:
        """A periodic square, empty."""
        edge = self.resolution * self.spacing
        domain = Domain((0, 0), (edge, edge), periodic="xy", depth=self.spacing)
        reactions = []
        for name in ("M", "M_molecules"):
            reactions.append(Reaction(f"0 -> {name}", self.death * self.concentration))
            reactions.append(Reaction(f"{name} -> 0", self.death))
        return Simulation(
            domain,
            fluid(domain, Fluid(density=1000.0, viscosity=1e-3), self.spacing),
            Static(support=1.8),
            [
                Species("M", self.diffusivity),
                Species("M_molecules", self.diffusivity, molecules=True),
            ],
            reactions,
            seed=context.seed,
            device=context.device,
            normalise_diffusion=True,
        )

    def counts(self, run: Run, frame: int) -> np.ndarray:
        """Molecules (n,) in the particles."""
        return run.field("count/M_molecules")[frame]

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Mean, variance and distribution, early and at the end; the concentration."""
        found = {}
        score = -5.2  # two-sided normal tail of 2e-7
        for label, time in (("early", EARLY / self.death), ("end", self.until)):
            frame = run.at(time)
            counts, mean = self.counts(run, frame), float(self.expected(run.times[frame]))
            n = counts.size
            found[f"mean_{label}"] = Metric(
                float((counts.mean() - mean) / math.sqrt(mean / n)), limit=-score, unit="sigma"
            )
            spread = float(np.mean((counts - mean) ** 2))
            sigma = math.sqrt((2 * mean**2 + mean) / n)
            found[f"variance_{label}"] = Metric((spread - mean) / sigma, limit=6.0, unit="sigma")
            found[f"chi2_{label}"] = chi_square_metric(*self.chi_square(counts, mean), ALARM)
        counts = self.counts(run, len(run) - 1)
        square = counts.reshape(self.resolution, -1) - self.mean
        product = float(np.mean(square * np.roll(square, 1, axis=0))) / self.mean
        found["correlation_of_neighbours"] = Metric(
            product * math.sqrt(counts.size), limit=6.0, unit="sigma"
        )
        field = run.field("concentration/M")[-1] / self.concentration
        error = float(np.abs(field - self.expected(run.times[-1]) / self.mean).max())
        found["concentration_error"] = Metric(error, limit=1e-5)
        return found

    def chi_square(self, counts: np.ndarray, mean: float) -> tuple[float, int]:
        """Statistic and degrees of freedom against Poisson, in bins of at least 10 expected."""
        n = counts.size
        low, high = (int(poisson.ppf(q, mean)) for q in (10 / n, 1 - 10 / n))
        while n * poisson.cdf(low, mean) < 10:
            low += 1
        while n * poisson.sf(high - 1, mean) < 10:
            high -= 1
        inside = np.bincount(np.clip(counts, low, high) - low, minlength=high - low + 1)
        expected = n * poisson.pmf(np.arange(low, high + 1), mean)
        expected[0], expected[-1] = n * poisson.cdf(low, mean), n * poisson.sf(high - 1, mean)
        return float(np.sum((inside - expected) ** 2 / expected)), len(expected) - 1

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Distribution early and at the end; mean and variance in time."""
        figure = self._figure(run)
        return [plots.save(figure, directory / "distribution.png")]

    @plots.styled
    def _figure(self, run: Run):
        figure, (left, right) = plots.new_figure(6.8, 3.0, columns=2)
        for k, time in enumerate((EARLY / self.death, self.until)):
            frame = run.at(time)
            counts, mean = self.counts(run, frame), float(self.expected(run.times[frame]))
            number = np.arange(counts.max() + 2)
            share = np.bincount(counts, minlength=len(number)) / counts.size
            colour, label = plots.COLOURS[k], f"t = {run.times[frame]:.3g} s"
            left.plot(number, share, "o", color=colour, mfc="none", label=label)
            exact = poisson.pmf(number, mean)
            left.plot(number, exact, "k-", lw=0.8, label=None if k else "Poisson")
        left.set(xlabel="molecules in a particle", ylabel="share of the particles")
        plots.legend(left)
        counts = np.array([self.counts(run, k) for k in range(len(run))])
        right.plot(run.times, self.expected(run.times), "k-", lw=0.8, label="exact")
        right.plot(run.times, counts.mean(axis=1), ".", label="mean")
        right.plot(run.times, counts.var(axis=1), "x", ms=3, mew=0.8, label="variance")
        right.set(xlabel="t [s]", ylabel="molecules in a particle")
        plots.legend(right)
        return figure
