r"""Diffusion across a slab from one wall to the other, as concentrations and as molecules.

C(0) = C₀ and C(L) = 0 by walls with fixed surface values, C = 0 at first. The same resting
particles carry the species twice. Reference: the exact series of images,

.. math:: \frac{C}{C_0} = \sum_{n\ge0} \operatorname{erfc}\frac{2nL+x}{2\sqrt{\kappa t}}
          - \operatorname{erfc}\frac{2(n+1)L-x}{2\sqrt{\kappa t}}.

Three neighbours at h = 1.8 spacings with the kernel sum normalised are the central difference; its
error of truncation is that of any three-point scheme: at t = 0.04 s, where it is largest of the
times looked at, 5.3e-2 (relative L2) with 16 particles, 1.1e-2 with 32 and 2.3e-3 with 64. The
limits of 1e-2, there and for the fitted diffusivity (−2.2 %, −0.5 %, −0.1 %), are met from about 34
particles on and are left alone below: such runs report that they are too coarse for t = 0.04 s.

The counts inside are independent Poisson numbers about the deterministic solution (molecules do
not know of each other, and come in as a Poisson stream), which the molecules are tested against.

References
----------
Jacob, thesis, UCSB 2020, table 2.1 (the case and the printed errors; the stochastic ones are
means of 100 realisations, by default ours is a single one). Crank, The Mathematics of Diffusion
(1975).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.optimize import minimize_scalar
from scipy.special import erfc

from particell import plots
from particell.analysis.statistics import epsilon_error, relative_l2
from particell.cases import diffusion_1d_ensemble
from particell.cases.base import Case, Context, Diffusivity, Length, Metric, Time
from particell.cases.scores import poisson_metric
from particell.chemistry.reservoirs import FixedValueWall
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import channel_walls, fluid
from particell.schemes.static import Static
from particell.simulation import Simulation

if TYPE_CHECKING:
    from particell.ensemble.results import EnsembleRun

#: The papers' ε of concentrations and of molecules by resolution (κ = 0.1, t = 1).
PAPER = {16: (6.617e-4, 8.514e-4), 32: (4.669e-4, 5.278e-4), 64: (3.764e-4, 8.070e-4)}
#: Errors are looked at from this κt/L² on, and the diffusivity is fitted up to that one.
FIRST, LAST_OF_FIT = 0.004, 0.04


def slab(x: np.ndarray, fourier: float) -> np.ndarray:
    """C/C₀ at x/L (0 to 1) and κt/L² > 0; exact to round-off for κt/L² up to 1."""
    width = 2 * math.sqrt(fourier)
    total = np.zeros_like(x, dtype=float)
    for n in range(8 + math.ceil(3 * width)):
        total += erfc((2 * n + x) / width) - erfc((2 * n + 2 - x) / width)
    return total


class Diffusion1D(Case):
    """Diffusion across a slab."""

    name = "diffusion-1d"
    title = "Diffusion across a slab, with concentrations and with molecules"
    reference: ClassVar[str] = "exact series of images"
    # 1e6 molecules have the law of the mean of the papers' 100 realisations of 1e4
    full: ClassVar[Sequence[Mapping[str, Any]]] = [
        {"resolution": n, "molecules": 10**6} for n in (16, 32, 64)
    ]

    resolution: Annotated[int, Field(ge=8, le=512)] = 64
    """Particles across the slab."""
    length: Annotated[Length, Field(gt=0)] = 1.0
    """Thickness L of the slab; its cross-section is 1 m²."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 0.1
    """Diffusivity κ."""
    molecules: Annotated[int, Field(ge=1, le=10**9)] = 10_000
    """Molecules in a particle at the concentration C₀ of the wall; sets C₀."""
    support: Annotated[float, Field(gt=1, le=4)] = 1.8
    """Support of the kernel in particle spacings."""
    normalise: bool = True
    """Whether to divide by the kernel sum."""
    dt: Annotated[Time, Field(gt=0)] = 1e-4
    """Time step."""
    until: Annotated[Time, Field(gt=0)] = 1.0
    """End of the run."""
    every: Annotated[Time, Field(gt=0)] = 0.01
    """Time between frames."""

    @property
    def spacing(self) -> float:
        """Distance of the particles in m."""
        return self.length / self.resolution

    @property
    def concentration(self) -> float:
        """C₀ in mol/m³."""
        return self.molecules / (AVOGADRO * self.spacing)

    def build(self, context: Context) -> Simulation:
        """The slab, empty, between its walls."""
        dx = self.spacing
        domain = Domain([0.0], [self.length], depth=1.0)
        water = Fluid(density=1000.0, viscosity=1e-3)
        layers = max(1, math.ceil(self.support))
        lower, upper = channel_walls(domain, water, dx, axis=0, layers=layers)
        species = [
            Species("C", self.diffusivity),
            Species("C_molecules", self.diffusivity, molecules=True),
        ]
        boundaries = [
            FixedValueWall(wall.name, {s.name: value for s in species})
            for wall, value in ((lower, self.concentration), (upper, 0.0))
        ]
        return Simulation(
            domain,
            [fluid(domain, water, dx), lower, upper],
            Static(support=self.support),
            species,
            boundaries=boundaries,
            seed=context.seed,
            dt=self.dt,
            device=context.device,
            normalise_diffusion=self.normalise,
        )

    def profiles(self, run: Run, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x/L, and C/C₀ of concentrations and of molecules, in the order of x."""
        mask = run.group("fluid")
        x = run.field("position")[frame][mask, 0] / self.length
        order = np.argsort(x)
        fields = ("concentration/C", "concentration/C_molecules")
        first, second = (run.field(f)[frame][mask][order] / self.concentration for f in fields)
        return x[order], first, second

    def exact(self, x: np.ndarray, time: float, diffusivity: float | None = None) -> np.ndarray:
        """C/C₀ at x/L and a time in s."""
        kappa = self.diffusivity if diffusivity is None else diffusivity
        return slab(x, kappa * time / self.length**2)

    def later_frames(self, run: Run, last: float = math.inf) -> list[int]:
        """Frames from the first time that is looked at."""
        fourier = run.times * self.diffusivity / self.length**2
        return list(np.flatnonzero((fourier > FIRST * (1 - 1e-9)) & (fourier <= last)))

    def errors(self, run: Run) -> tuple[np.ndarray, np.ndarray]:
        """Times in s and relative L2 errors of the concentrations."""
        frames = self.later_frames(run)
        errors = []
        for k in frames:
            x, values, _ = self.profiles(run, k)
            errors.append(relative_l2(values, self.exact(x, run.times[k])))
        return run.times[frames], np.array(errors)

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Errors at the end and on the way, diffusivity, statistics of the molecules, booking."""
        last = len(run) - 1
        x, values, counted = self.profiles(run, last)
        expected = self.exact(x, run.times[last])
        paper = self.printed(run.times[last])
        found = {
            "eps": Metric(epsilon_error(values, expected, 1.0), paper[0], paper[0]),
            "eps_molecules": Metric(epsilon_error(counted, expected, 1.0), paper[1]),
        }
        _, errors = self.errors(run)
        if errors.size:
            found["l2_largest"] = Metric(float(errors.max()), limit=1e-2)
            found["l2_end"] = Metric(float(errors[-1]))
        frames = self.later_frames(run, LAST_OF_FIT * (1 + 1e-9))
        if frames:
            ratio = self._effective_diffusivity(run, frames) / self.diffusivity
            found["diffusivity_error"] = Metric(ratio - 1, limit=1e-2)
        number, mean = counted * self.molecules, values * self.molecules
        found["molecules_chi2"] = poisson_metric(number, mean)
        drift = self._drift(run, "C") / run.observable("amount_C")[-1]
        found["amount_drift"] = Metric(drift, limit=1e-10)
        found["molecules_drift"] = Metric(self._drift(run, "C_molecules"), limit=0.0)
        return found

    def printed(self, time: float) -> tuple[float | None, float | None]:
        """The papers' ε of concentrations and of molecules, where they have this time and size."""
        fourier = self.diffusivity * time / self.length**2
        as_printed = math.isclose(fourier, 0.1, rel_tol=1e-6)
        return PAPER.get(self.resolution, (None, None)) if as_printed else (None, None)

    def _drift(self, run: Run, name: str) -> float:
        """Change of the total of a species, net of what came in through the walls."""
        net = run.observable(f"amount_{name}") - run.observable(f"inflow_{name}")
        return float(net[-1] - net[0])

    def _effective_diffusivity(self, run: Run, frames: list[int]) -> float:
        """The κ whose exact solution is nearest to the concentrations of some frames."""
        data = [(run.times[k], *self.profiles(run, k)[:2]) for k in frames]

        def misfit(kappa: float) -> float:
            return sum(float(np.sum((c - self.exact(x, t, kappa)) ** 2)) for t, x, c in data)

        bounds = (0.5 * self.diffusivity, 2 * self.diffusivity)
        options = {"xatol": 1e-7 * self.diffusivity}
        return float(minimize_scalar(misfit, bounds=bounds, method="bounded", options=options).x)

    def _scores(self, values: np.ndarray, counted: np.ndarray) -> np.ndarray:
        """(N − λ)/√λ of the molecules, λ the number of the deterministic solution."""
        mean = np.maximum(values * self.molecules, 1e-300)
        return (counted * self.molecules - mean) / np.sqrt(mean)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Profiles, error in time, and the molecules' deviations."""
        made = {
            "profiles": self._profiles_figure(run),
            "error": self._error_figure(run),
            "molecules": self._scores_figure(run),
        }
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    def ensemble_metrics(self, ensemble: EnsembleRun) -> dict[str, Metric]:
        """See :mod:`particell.cases.diffusion_1d_ensemble`."""
        paper = self.printed(float(ensemble.times[-1]))[1]
        found = diffusion_1d_ensemble.metrics(self, ensemble, paper)
        return {**super().ensemble_metrics(ensemble), **found}

    def ensemble_figures(self, ensemble: EnsembleRun, directory: Path) -> list[Path]:
        """See :mod:`particell.cases.diffusion_1d_ensemble`."""
        made = super().ensemble_figures(ensemble, directory)
        return made + diffusion_1d_ensemble.figures(self, ensemble, directory)

    @plots.styled
    def _profiles_figure(self, run: Run):
        figure, axes = plots.new_figure(5.2, 3.4)
        fine = np.linspace(0, 1, 401)
        end = run.times[-1]
        for k, part in enumerate((0.04, 0.08, 0.16, 0.4, 1.0)):
            frame = run.at(part * end)
            x, values, counted = self.profiles(run, frame)
            time, colour = run.times[frame], plots.COLOURS[k]
            first = k == 0
            exact = self.exact(fine, time) if time > 0 else np.zeros_like(fine)
            axes.plot(fine, exact, "k-", lw=0.8, zorder=1, label="exact" if first else None)
            axes.plot(x, values, "o", color=colour, mfc="none", mew=0.8, label=f"{time:.3g} s")
            axes.plot(x, counted, "x", color=colour, ms=3.5, mew=0.8)
        axes.plot([], [], "o", color="0.4", mfc="none", label="concentrations")
        axes.plot([], [], "x", color="0.4", label="molecules")
        axes.set(xlabel="x / L", ylabel="C / C₀", xlim=(0, 1), ylim=(-0.02, 1.02))
        plots.legend(axes)
        return figure

    @plots.styled
    def _error_figure(self, run: Run):
        figure, axes = plots.new_figure()
        times, errors = self.errors(run)
        axes.loglog(times, errors, "o", mfc="none", label=f"{self.resolution} particles")
        axes.axhline(1e-2, color="black", linestyle="--", linewidth=0.8, label="limit")
        axes.set(xlabel="t [s]", ylabel="relative L2 error of C")
        plots.legend(axes)
        return figure

    @plots.styled
    def _scores_figure(self, run: Run):
        figure, axes = plots.new_figure(5.2, 2.6)
        x, values, counted = self.profiles(run, len(run) - 1)
        axes.axhspan(-2, 2, color="0.92", label="95 % of Poisson numbers")
        axes.plot(x, self._scores(values, counted), "o", color=plots.COLOURS[1], mfc="none")
        axes.axhline(0, color="black", linewidth=0.6)
        axes.set(xlabel="x / L", ylabel="(N − λ) / √λ", ylim=(-4.2, 4.2), xlim=(0, 1))
        axes.set_title(f"molecules, t = {run.times[-1]:.3g} s")
        plots.legend(axes, loc="lower left")
        return figure
