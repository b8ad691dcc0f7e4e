r"""Diffusion in a plate from its hot side to the three others, to the steady state.

C = C₀ on the side y = L, 0 on the other three, C = 0 at first. The same resting particles carry
the species twice. With :math:`b_n = 4/(n\pi)`, n odd, and x, y in units of L,

.. math:: \frac{C}{C_0} = \sum_n b_n \sin n\pi x \Big[\frac{\sinh n\pi y}{\sinh n\pi}
          - \sum_m \frac{2m(-1)^{m+1}}{\pi(m^2+n^2)} \sin m\pi y\;
          e^{-\pi^2(m^2+n^2)\kappa t/L^2}\Big].

The diffusivity is measured in the transient, which a steady state does not depend on: the part
:math:`A = \langle C \sin\pi x \sin\pi y\rangle` of the slowest mode approaches its end as
:math:`1 - A/A_\infty = e^{-2\pi^2\kappa t/L^2}` exactly.

Surfaces have fixed values (walls of particles, extrapolated). The two upper corners, where C jumps,
are walls of their own with the mean C₀/2, which is what the exact solution has on the diagonal.

The molecules' numbers are independent Poisson numbers about the deterministic solution, and the
mean of R realisations of N molecules is distributed as one realisation of R N divided by R
(molecules do not know of each other): so the mean of 50 realisations costs one run.

References
----------
Jacob, thesis, UCSB 2020, table 2.2 (the case and printed errors: 50 realisations; the number of
molecules at C₀ is that of the authors' scripts). Carslaw & Jaeger, Conduction of Heat in Solids
(1959), 5.3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from particell import plots
from particell.analysis.statistics import decay_rate, epsilon_error, relative_l2
from particell.cases import reference
from particell.cases.base import Case, Context, Diffusivity, Length, Metric
from particell.cases.scores import poisson_metric
from particell.chemistry.reservoirs import FixedValueWall
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.geometry.fill import arranged, lattice
from particell.geometry.shapes import HalfSpace
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import Phase
from particell.schemes.static import Static
from particell.simulation import Simulation

#: The papers' ε of concentrations and of molecules by resolution (steady state).
PAPER = {17: (2.337e-4, 2.902e-4), 33: (5.818e-5, 1.294e-4), 65: (1.438e-5, 2.043e-4)}
#: The decay of the slowest mode is fitted between these parts of it.
LARGEST_PART, SMALLEST_PART = 0.9, 0.15
#: Support in spacings: the nearest neighbours of a lattice, or enough for disorder.
SUPPORT = {"square": 1.8, "hexagonal": 1.8, "jittered": 3.0, "packed": 3.0}
WATER = Fluid(density=1000.0, viscosity=1e-3)


def steady_plate(points: np.ndarray) -> np.ndarray:
    """C/C₀ (n,) of the steady state at points (n, 2) in units of L, inside the plate."""
    x, y = points.T
    # terms fall as exp(-nπ(1 - y)): to 1e-12 at the row nearest to the hot side
    last = math.ceil(28 / (math.pi * (1 - float(y.max()))))
    total = np.zeros(len(points))
    for n in range(1, last + 1, 2):
        ratio = np.exp(n * np.pi * (y - 1)) * np.expm1(-2 * n * np.pi * y)
        total += 4 / (n * np.pi) * np.sin(n * np.pi * x) * ratio / math.expm1(-2 * n * math.pi)
    return total


def plate(points: np.ndarray, fourier: float, steady: np.ndarray | None = None) -> np.ndarray:
    """C/C₀ (n,) at points (n, 2) in units of L and κt/L² > 0; ``steady`` saves its series."""
    x, y = points.T
    last = math.ceil(math.sqrt(32 / (math.pi**2 * fourier))) + 1
    n, m = np.arange(1, last + 1, 2), np.arange(1, last + 1)
    square = m[None, :] ** 2 + n[:, None] ** 2
    factor = 4 / (n[:, None] * np.pi) * 2 * m * (-1.0) ** (m + 1) / (np.pi * square)
    factor = factor * np.exp(-(np.pi**2) * square * fourier)
    waves = np.sin(np.pi * np.outer(x, n)) @ factor
    transient = np.sum(waves * np.sin(np.pi * np.outer(y, m)), axis=1)
    return (steady_plate(points) if steady is None else steady) - transient


class Diffusion2D(Case):
    """Diffusion in a plate."""

    name = "diffusion-2d"
    title = "Diffusion in a plate, with concentrations and with molecules"
    reference: ClassVar[str] = "exact double series"
    full: ClassVar[Sequence[Mapping[str, Any]]] = [{"resolution": n} for n in (17, 33, 65)]

    resolution: Annotated[int, Field(ge=8, le=256)] = 33
    """Particles along an edge."""
    arrangement: Literal["square", "hexagonal", "jittered", "packed"] = "square"
    """How the particles are placed."""
    length: Annotated[Length, Field(gt=0)] = 1.0
    """Edge L of the plate."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 1e-2
    """Diffusivity κ."""
    molecules: Annotated[int, Field(ge=1, le=10**6)] = 1000
    """Molecules in a particle at C₀, in one realisation; sets C₀."""
    realisations: Annotated[int, Field(ge=1, le=10**4)] = 50
    """Number of realisations whose mean is taken."""
    support: Annotated[float, Field(ge=1.2, le=4)] | None = None
    """Support of the kernel in particle spacings (default: 1.8 on lattices, 3 without order)."""
    normalise: bool = True
    """Whether to divide by the kernel sum."""
    end: Annotated[float, Field(gt=0, le=10)] = 0.6
    """End of the run in units of L²/κ; the slowest mode has decayed to 7e-6 by 0.6."""
    frames: Annotated[int, Field(ge=20)] = 120
    """Number of frames."""

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end * self.length**2 / self.diffusivity

    @property
    def every(self) -> float:
        """Time between frames in s."""
        return self.until / self.frames

    @property
    def spacing(self) -> float:
        """Distance of the particles in m."""
        return self.length / self.resolution

    @property
    def concentration(self) -> float:
        """C₀ in mol/m³, of one realisation (the depth of the plane is 1 m)."""
        return self.molecules / (AVOGADRO * self.spacing**2)

    @property
    def support_used(self) -> float:
        """Support in spacings."""
        return SUPPORT[self.arrangement] if self.support is None else self.support

    def build(self, context: Context) -> Simulation:
        """The plate, empty, between its walls."""
        domain = Domain((0, 0), (self.length, self.length), depth=1.0)
        walls = list(self.walls(domain))
        fixed = np.concatenate([wall.points for wall, _ in walls])
        points = arranged(domain, self.spacing, self.arrangement, context.seed, fixed)
        body = Phase("plate", WATER, points, domain.volume / len(points), spacing=self.spacing)
        species = {
            "C": (Species("C", self.diffusivity), 1),
            "C_molecules": (
                Species("C_molecules", self.diffusivity, molecules=True),
                self.realisations,
            ),
        }
        boundaries = [
            FixedValueWall(
                wall.name,
                {name: part * times * self.concentration for name, (_, times) in species.items()},
            )
            for wall, part in walls
        ]
        return Simulation(
            domain,
            [body, *(wall for wall, _ in walls)],
            Static(support=self.support_used),
            [s for s, _ in species.values()],
            boundaries=boundaries,
            seed=context.seed,
            device=context.device,
            normalise_diffusion=self.normalise,
        )

    def walls(self, domain: Domain) -> Iterator[tuple[Phase, float]]:
        """The sides and corners, as a continued lattice, and the part of C₀ on their surfaces."""
        # kernel sums must be complete in every layer that the plate's particles see
        layers = 2 * math.ceil(self.support_used)
        depth = layers * self.spacing
        inner = lattice(
            domain, self.spacing, None, "hexagonal" if self.arrangement == "hexagonal" else "square"
        )
        volume = domain.volume / len(inner)
        names = {-1: ("left", "bottom"), 1: ("right", "top")}
        for sx in (-1, 0, 1):
            for sy in (-1, 0, 1):
                if sx == sy == 0:
                    continue
                points = inner + self.length * np.array([sx, sy])
                near = np.all((points > -depth) & (points < self.length + depth), axis=1)
                corner = self.length * np.array([max(sx, 0), max(sy, 0)])
                name = "-".join(names[s][axis] for axis, s in enumerate((sx, sy)) if s)
                surface = HalfSpace(corner, (-sx, -sy))
                value = (0.5 if sx else 1.0) if sy == 1 else 0.0
                yield (
                    Phase(
                        name,
                        WATER,
                        points[near],
                        volume,
                        kind="wall",
                        spacing=self.spacing,
                        surface=surface,
                    ),
                    value,
                )

    def points(self, run: Run) -> np.ndarray:
        """Places (n, 2) of the plate's particles in units of L."""
        return run.field("position")[0][run.group("plate")] / self.length

    def values(self, run: Run, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """C/C₀ (n,) of concentrations, and of the mean of all realisations of the molecules."""
        mask = run.group("plate")
        first, second = (run.field(f"concentration/{s}")[frame][mask] for s in ("C", "C_molecules"))
        return first / self.concentration, second / (self.concentration * self.realisations)

    def slowest_part(self, run: Run, kind: int) -> tuple[np.ndarray, np.ndarray]:
        """κt/L² and 1 - A/A∞ of frames; ``kind`` 0: concentrations, 1: molecules."""
        points = self.points(run)
        wave = np.prod(np.sin(np.pi * points), axis=1)
        last = float(wave @ steady_plate(points))
        found = [1 - float(wave @ self.values(run, k)[kind]) / last for k in range(len(run))]
        return run.times * self.diffusivity / self.length**2, np.array(found)

    def diffusivity_error(self, run: Run, kind: int) -> float:
        """Diffusivity that the slowest mode decays with, over κ, less one."""
        fourier, part = self.slowest_part(run, kind)
        fitted = (part < LARGEST_PART) & (part > SMALLEST_PART)
        if np.count_nonzero(fitted) < 3:
            return math.nan
        return decay_rate(fourier[fitted], part[fitted]).rate / (2 * math.pi**2) - 1

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Errors of the steady state, diffusivity, statistics of the molecules, booking."""
        points, last = self.points(run), len(run) - 1
        values, counted = self.values(run, last)
        expected = steady_plate(points)
        as_printed = self.end >= 0.5
        paper = PAPER.get(self.resolution, (None, None)) if as_printed else (None, None)
        found = {
            "eps": Metric(epsilon_error(values, expected, 1.0), paper[0], paper[0]),
            "eps_molecules": Metric(epsilon_error(counted, expected, 1.0), paper[1], paper[1]),
            "l2_steady": Metric(relative_l2(values, expected), limit=1e-2 if as_printed else None),
            "l2_transient": Metric(self.transient_errors(run)[1].max(), limit=1e-2),
            "diffusivity_error": Metric(self.diffusivity_error(run, 0), limit=1e-2),
            "diffusivity_error_molecules": Metric(self.diffusivity_error(run, 1)),
        }
        whole = self.molecules * self.realisations
        found["molecules_chi2"] = poisson_metric(counted * whole, values * whole)
        for name, limit in (("C", 1e-10), ("C_molecules", 0.0)):
            net = run.observable(f"amount_{name}") - run.observable(f"inflow_{name}")
            scale = run.observable("amount_C")[-1] if name == "C" else 1.0
            found[f"drift_{name}"] = Metric(float(net[-1] - net[0]) / scale, limit=limit)
        return found

    def transient_errors(self, run: Run) -> tuple[np.ndarray, np.ndarray]:
        """κt/L² of frames from 0.02 on, and relative L2 errors of the concentrations."""
        points = self.points(run)
        steady = steady_plate(points)
        fourier = run.times * self.diffusivity / self.length**2
        frames = [int(k) for k in np.flatnonzero(fourier > 0.02 * (1 - 1e-9))]
        errors = [
            relative_l2(self.values(run, k)[0], plate(points, fourier[k], steady)) for k in frames
        ]
        return fourier[frames], np.array(errors)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Maps, centrelines, and the decay of the slowest mode."""
        made = {
            "map": self._map_figure(run),
            "centrelines": self._centrelines_figure(run),
            "decay": self._decay_figure(run),
        }
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _map_figure(self, run: Run):
        figure, pair = plots.new_figure(6.8, 3.0, columns=2)
        points = self.points(run)
        fields = zip(pair, self.values(run, len(run) - 1), ("concentrations", "molecules"))  # noqa: B905
        for axes, values, title in fields:
            # discs of nearly the spacing: 2.1 inches for an edge
            size = (72 * 2.1 / self.resolution) ** 2
            mesh = axes.scatter(*points.T, c=values, s=size, vmin=0, vmax=1, linewidths=0)
            axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="x / L", ylabel="y / L")
            axes.set_title(title)
        figure.colorbar(mesh, ax=pair, label="C / C₀", shrink=0.9)
        return figure

    @plots.styled
    def _centrelines_figure(self, run: Run):
        figure, axes = plots.new_figure()
        table = reference.load("plate_diffusion_centrelines")
        axes.plot(table["s"], table["along_y"], "k-", lw=0.8, label="exact")
        axes.plot(table["s"], table["along_x"], "k-", lw=0.8)
        edge = np.full(self.resolution, 0.5)
        s = (np.arange(self.resolution) + 0.5) / self.resolution
        lines = {"x = L/2": np.stack([edge, s], -1), "y = L/2": np.stack([s, edge], -1)}
        for k, (label, line) in enumerate(lines.items()):
            for name, times, marker in (("C", 1, "o"), ("C_molecules", self.realisations, "x")):
                values = run.on_points(
                    f"concentration/{name}",
                    line * self.length,
                    groups=["plate"],
                    support=2.4 * self.spacing,
                )
                shown = values / (self.concentration * times)
                what = "molecules" if marker == "x" else "concentrations"
                axes.plot(
                    s, shown, marker, color=plots.COLOURS[k], mfc="none", ms=3.5, mew=0.8,
                    label=f"{label}, {what}",
                )  # fmt: skip
        axes.set(xlabel="x / L or y / L", ylabel="C / C₀", xlim=(0, 1))
        plots.legend(axes)
        return figure

    @plots.styled
    def _decay_figure(self, run: Run):
        figure, axes = plots.new_figure()
        for kind, (name, marker) in enumerate((("concentrations", "o"), ("molecules", "x"))):
            fourier, part = self.slowest_part(run, kind)
            shown = part > 1e-3
            axes.semilogy(
                fourier[shown], part[shown], marker, mfc="none", ms=3.5, mew=0.8, label=name
            )
        axes.semilogy(fourier, np.exp(-2 * np.pi**2 * fourier), "k-", lw=0.8, label="exact")
        axes.set(
            xlabel="κt / L²",
            ylabel="part of the slowest mode left",
            ylim=(1e-3, 1.2),
            xlim=(0, 0.36),
        )
        plots.legend(axes)
        return figure
