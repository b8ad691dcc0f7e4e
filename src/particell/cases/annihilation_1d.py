r"""A + B → ∅ in a slab: A comes in through one wall, B through the other.

C_A(0) = C_B(L) = C₀, C_A(L) = C_B(0) = 0 and both 0 at first; both have the diffusivity κ. The
Damköhler number :math:`Da = kC_0L^2/\kappa` decides what it looks like: at Da = 1 the species pass
through each other, at large Da they meet in a layer of thickness :math:`Da^{-1/3} L`. Whatever Da
is, the difference is diffusion alone and known exactly,

.. math:: \frac{C_A - C_B}{C_0} = s(x, t) - s(L - x, t),

with the series of images :math:`s` of :mod:`particell.cases.diffusion_1d`.

**When.** The papers draw five times up to 0.1 L²/κ and print errors of the steady state (their
t = 100 s is 10 L²/κ). A run up to :data:`STEADY` is compared with it: what is left of the start is
3e-7 then.

**Which Da the papers' numbers belong to.** They print k = 0.1 and C₀ = 1e4 molecules a particle in
molecules/m³, 1.6e5, 3.2e5 and 6.4e5 on their three grids. Taken at its word that is Da = 1.6e5,
3.2e5 and 6.4e5: another problem on each grid. Their scripts have a tenth of that; and if
concentrations are meant in units of C₀, Da is 1. ``PAPER`` is compared at the printed Da; at Da
below, the errors of other Da stand without a paper's number.

Molecules: the propensity is :math:`k N_A N_B/(V𝒩)`, without the papers' further ½. Several
realisations are independent slabs in a row, far enough from each other for the kernel.

References
----------
Drawert, Jacob, Li, Yi & Petzold, J. Comput. Phys. 378 (2019) 1, table 1 (the case and the printed
errors, means of 100 realisations; table 2.3 of Jacob, thesis, UCSB 2020, is the same). Reference
profiles: ``data/annihilation_Da*.csv`` (ours), and what :mod:`.annihilation_1d_profiles` computes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from particell import plots
from particell.analysis.statistics import epsilon_error, relative_l2
from particell.cases import reference
from particell.cases.annihilation_1d_profiles import (
    TIMES,
    UNIT,
    reference_profiles,
    steady_profile,
)
from particell.cases.base import Case, Context, Diffusivity, Length, Metric
from particell.cases.diffusion_1d import slab
from particell.cases.scores import chi_square_metric
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import FixedValueWall
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace, Shape
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import Phase
from particell.schemes.static import Static
from particell.simulation import Simulation

#: The papers' ε of concentrations and of molecules by resolution, at the steady state; of molecules
#: for the mean of so many realisations.
REALISATIONS = 100
PAPER = {16: (1.856e-4, 7.285e-4), 32: (1.698e-4, 5.334e-4), 64: (2.325e-4, 6.644e-4)}
#: The Damköhler numbers with committed profiles.
COMMITTED = (1, 16_000, 32_000, 64_000, 160_000, 320_000, 640_000)
#: From this κt/L² on the state is steady: of the slowest mode exp(-π² 1.5) = 3.7e-7 is left.
STEADY = 1.5
#: The error of the difference at 0.1 L²/κ by the number of particles (1/n²; with supports of more
#: than two spacings by the support's square) and of steps (1/m). Measured with 16, 32 and 64
#: particles and 200 to 4000 steps: 0.226/n² − 0.12/m. At the end of a steady run it is round-off.
DIFFERENCE, DIFFERENCE_STEPS, DIFFERENCE_STEADY = 0.25, 0.13, 1e-10
#: Largest step in (kernel support)²/κ.
LONGEST = 0.05
WATER = Fluid(density=1000.0, viscosity=1e-3)


class Repeated(Shape):
    """A shape on a line, repeated with a period (m) about a centre (m)."""

    def __init__(self, shape: Shape, centre: float, period: float):
        self.shape, self.centre, self.period = shape, centre, period

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        copies = np.rint((points - self.centre) / self.period)
        return self.shape.signed_distance(points - copies * self.period)


class Annihilation1D(Case):
    """Two species that meet and annihilate."""

    name = "annihilation-1d"
    title = "Two species that meet and annihilate, with concentrations and with molecules"
    reference: ClassVar[str] = "finite differences with Richardson extrapolation; exact difference"
    # the last three are the printed parameters taken at their word
    full: ClassVar[Sequence[Mapping[str, Any]]] = [
        {"resolution": n, "damkohler": da or 1e4 * n, "realisations": 100, "end": 1.5, "steps": m}
        for da in (1.0, 1.6e4, None)
        for n, m in ((16, 1000), (32, 2500), (64, 2600))
    ]

    damkohler: Annotated[float, Field(ge=0, le=1e7)] = 1.0
    """Da = k C₀ L²/κ."""
    resolution: Annotated[int, Field(ge=8, le=512)] = 32
    """Particles across the slab."""
    length: Annotated[Length, Field(gt=0)] = 1.0
    """Thickness L of the slab; its cross-section is 1 m²."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 0.1
    """Diffusivity κ of both species."""
    molecules: Annotated[int, Field(ge=1, le=10**8)] = 10_000
    """Molecules in a particle at the concentration C₀ of the walls; sets C₀."""
    realisations: Annotated[int, Field(ge=2, le=1000)] = 20
    """Number of realisations of the molecules."""
    support: Annotated[float, Field(ge=1.2, le=4)] = 1.8
    """Support of the kernel in particle spacings."""
    normalise: bool = True
    """Whether to divide by the kernel sum."""
    steps: Annotated[int, Field(ge=100, le=10**6)] = 4000
    """Number of time steps in 0.1 L²/κ."""
    end: Annotated[float, Field(ge=0.1, le=10)] = 0.1
    """End of the run in units of L²/κ; from 1.5 on it is the steady state."""

    @property
    def unit(self) -> float:
        """0.1 L²/κ in s: the last of the papers' five times."""
        return UNIT * self.length**2 / self.diffusivity

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end / UNIT * self.unit

    @property
    def every(self) -> float:
        """Time between frames in s: a twentieth of the five times, or a fifth of a long run's."""
        return self.until / round(self.end / UNIT * (20 if self.end < STEADY else 5))

    @property
    def dt(self) -> float:
        """Time step in s."""
        return self.unit / self.steps

    @property
    def spacing(self) -> float:
        """Distance of the particles in m."""
        return self.length / self.resolution

    @property
    def concentration(self) -> float:
        """C₀ in mol/m³."""
        return self.molecules / (AVOGADRO * self.spacing)

    @property
    def rate_constant(self) -> float:
        """k in m³/(mol s)."""
        return self.damkohler * self.diffusivity / (self.concentration * self.length**2)

    @property
    def layers(self) -> int:
        """Particles of a wall."""
        return 2 * math.ceil(self.support)

    @property
    def period(self) -> float:
        """Distance from one slab to the next in m."""
        return self.length + 2 * self.layers * self.spacing

    def build(self, context: Context) -> Simulation:
        """The slabs, empty, between their walls."""
        limit = LONGEST * (self.support * self.spacing) ** 2 / self.diffusivity
        if self.dt > limit:
            raise InputError("steps", self.steps, f"at least {math.ceil(self.unit / limit)}")
        species, boundaries = [], []
        for suffix in ("", "_molecules"):
            # concentrations once; they are the same in every slab
            where = "slab" if suffix == "" else ["slab", "more-slabs"]
            for name in "AB":
                kind = Species(name + suffix, self.diffusivity, suffix != "", only_in=where)
                species.append(kind)
        for wall, full in (("left", "A"), ("right", "B")):
            values = {s.name: self.concentration * (s.name[0] == full) for s in species}
            boundaries.append(FixedValueWall(wall, values))
        domain = Domain([0.0], [self.realisations * self.period], depth=1.0)
        return Simulation(
            domain,
            self.phases(),
            Static(support=self.support),
            species,
            [
                Reaction(f"A{suffix} + B{suffix} -> 0", self.rate_constant)
                for suffix in ("", "_molecules")
            ],
            boundaries,
            seed=context.seed,
            dt=self.dt,
            device=context.device,
            normalise_diffusion=self.normalise,
        )

    def phases(self) -> list[Phase]:
        """The first slab, the others, and all left and all right walls."""
        dx, layers, first = self.spacing, self.layers, self.layers * self.spacing
        within = first + (np.arange(self.resolution) + 0.5) * dx
        starts = self.period * np.arange(self.realisations)[:, None]
        inside = (starts + within)[:, :, None]
        deep = (np.arange(layers) + 0.5) * dx
        sides = {
            "left": (starts + first - deep, first, 1),
            "right": (starts + first + self.length + deep, first + self.length, -1),
        }
        phases = [
            Phase("slab", WATER, inside[0], dx),
            Phase("more-slabs", WATER, inside[1:].reshape(-1, 1), dx),
        ]
        for name, (x, face, sign) in sides.items():
            surface = Repeated(HalfSpace([face], [sign]), face, self.period)
            points = x.reshape(-1, 1)
            phases.append(Phase(name, WATER, points, dx, kind="wall", surface=surface))
        return phases

    @property
    def x(self) -> np.ndarray:
        """Places x/L of the particles of a slab."""
        return (np.arange(self.resolution) + 0.5) / self.resolution

    def profiles(self, run: Run, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """C/C₀ of A and B: concentrations (2, n), and molecules (2, realisations, n)."""
        position = run.field("position")[0][:, 0]
        every = np.argsort(position)
        every = every[run.group("slab", "more-slabs")[every]]
        once = every[run.group("slab")[every]]
        shape = (self.realisations, self.resolution)
        first, second = [], []
        for name in "AB":
            first.append(run.field(f"concentration/{name}")[frame][once])
            second.append(run.field(f"concentration/{name}_molecules")[frame][every].reshape(shape))
        return np.array(first) / self.concentration, np.array(second) / self.concentration

    def table(self) -> dict[str, np.ndarray]:
        """Reference profiles, committed or computed."""
        if self.damkohler in COMMITTED:
            return reference.load(f"annihilation_Da{int(self.damkohler)}")
        return reference_profiles(self.damkohler)

    def expected(self, table: dict[str, np.ndarray], t: float) -> np.ndarray:
        """Reference C/C₀ of A and B, (2, n), at one of :data:`TIMES`."""
        return np.array([np.interp(self.x, table["x"], table[f"{s}_t{t}"]) for s in "AB"])

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Errors at five times and in the steady state, exact difference, the molecules' mean."""
        last = len(run) - 1
        values, counted = self.profiles(run, last)
        mean = counted.mean(axis=1)
        found = self.steady_errors(values, mean)
        table = self.table()
        for t in TIMES:
            frame = run.at(t * self.unit)
            if not math.isclose(run.times[frame], t * self.unit):
                continue  # an odd end: no frame is at this time
            now, _ = self.profiles(run, frame)
            found[f"l2_t{t:g}"] = Metric(relative_l2(now, self.expected(table, t)), limit=1e-2)
        found |= self.difference_errors(run)
        fourier = self.end
        # Without reaction A - B is a difference of independent Poisson numbers. A pair that
        # annihilates leaves its mean as it is and takes away variance: the chi-square is less.
        both = slab(self.x, fourier) + slab(1 - self.x, fourier)
        poisson = both / (self.molecules * self.realisations)
        scores = (mean[0] - mean[1] - (values[0] - values[1])) ** 2 / poisson
        found["difference_molecules_chi2"] = chi_square_metric(float(scores.sum()), scores.size)
        scatter = counted[0].std(axis=0, ddof=1) * math.sqrt(self.molecules)
        there = values[0] > 1e-3
        found["scatter_of_A"] = Metric(float(np.mean(scatter[there] / np.sqrt(values[0, there]))))
        bias = (mean[0] - values[0]).sum() / values[0].sum()
        found["molecules_bias"] = Metric(float(bias), limit=1e-2)
        drift = simulation.conservation()
        found["drift"] = Metric(max(abs(v) for k, v in drift.items() if "amount" in k), limit=1e-10)
        return found

    def steady_errors(self, values: np.ndarray, mean: np.ndarray) -> dict[str, Metric]:
        """The papers' ε and the relative error, where the run reaches the steady state."""
        if self.end < STEADY:
            return {}
        expected = steady_profile(self.damkohler, self.x)
        first, second = PAPER.get(self.resolution, (None, None))
        limits = first, second if self.realisations >= REALISATIONS else None
        # the papers' C₀ is 1e4 molecules per volume of a particle, and k = κ = 0.1
        printed = math.isclose(self.damkohler, 1e4 * self.resolution)
        found = {}
        for name, profile, limit in zip(("", "_molecules"), (values, mean), limits, strict=True):
            error = epsilon_error(profile[0], expected[0], 1.0)
            found[f"eps{name}"] = Metric(error, limit if printed else None, limit)
        found["l2_steady"] = Metric(relative_l2(values, expected), limit=1e-2)
        return found

    def difference_errors(self, run: Run) -> dict[str, Metric]:
        """Relative errors of the difference: at the last of the five times, and steady."""
        reach = max(1.0, self.support / 2) ** 2
        limit = DIFFERENCE * reach / self.resolution**2 + DIFFERENCE_STEPS / self.steps
        looked_at = {"difference_l2": (run.at(self.unit), limit)}
        if self.end >= STEADY:
            looked_at["difference_l2_steady"] = len(run) - 1, DIFFERENCE_STEADY
        found = {}
        for name, (frame, most) in looked_at.items():
            fourier = UNIT * run.times[frame] / self.unit
            exact = slab(self.x, fourier) - slab(1 - self.x, fourier)
            now, _ = self.profiles(run, frame)
            found[name] = Metric(relative_l2(now[0] - now[1], exact), limit=most)
        return found

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Profiles of both species, and the difference against the exact series."""
        made = {"profiles": self._profiles_figure(run), "difference": self._difference_figure(run)}
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _profiles_figure(self, run: Run):
        figure, axes = plots.new_figure(5.2, 3.4)
        table = self.table()
        for k, t in enumerate((0.2, 0.4, 1.0)):
            values, counted = self.profiles(run, run.at(t * self.unit))
            for s in range(2):
                first = k == s == 0
                axes.plot(
                    table["x"], table[f"{'AB'[s]}_t{t}"], "k-", lw=0.8, zorder=1,
                    label="reference" if first else None,
                )  # fmt: skip
                colour = plots.COLOURS[k]
                label = f"{t * self.unit:.3g} s" if s == 0 else None
                axes.plot(self.x, values[s], "o", color=colour, mfc="none", mew=0.8, label=label)
                axes.plot(self.x, counted[s].mean(axis=0), "x", color=colour, ms=3.5, mew=0.8)
        axes.plot([], [], "o", color="0.4", mfc="none", label="concentrations")
        axes.plot([], [], "x", color="0.4", label=f"molecules, mean of {self.realisations}")
        axes.set(xlabel="x / L", ylabel="C / C₀", xlim=(0, 1), title=f"Da = {self.damkohler:g}")
        plots.legend(axes, loc="upper center")
        return figure

    @plots.styled
    def _difference_figure(self, run: Run):
        figure, axes = plots.new_figure()
        fine = np.linspace(0, 1, 401)
        for k, t in enumerate((0.2, 0.4, 1.0)):
            values, counted = self.profiles(run, run.at(t * self.unit))
            exact = slab(fine, UNIT * t) - slab(1 - fine, UNIT * t)
            axes.plot(fine, exact, "k-", lw=0.8, label=None if k else "exact")
            colour = plots.COLOURS[k]
            axes.plot(self.x, values[0] - values[1], "o", color=colour, mfc="none", mew=0.8)
            mean = counted.mean(axis=1)
            label = f"{t * self.unit:.3g} s"
            axes.plot(self.x, mean[0] - mean[1], "x", color=colour, ms=3.5, label=label)
        axes.set(xlabel="x / L", ylabel="(C of A − C of B) / C₀", xlim=(0, 1))
        plots.legend(axes)
        return figure
