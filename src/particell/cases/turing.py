r"""Schnakenberg's kinetics in the plane: a Turing pattern, its growth and its wavelength.

.. math:: \dot u = D_u\nabla^2 u + k(a - u + u^2v), \qquad \dot v = D_v\nabla^2 v + k(b - u^2v)

(u, v in units of a concentration c) as ∅ → U, U → ∅, ∅ → V, 2 U + V → 3 U. The uniform state
u = a + b, v = b/(a + b)² is stable without diffusion; small waves grow at the rate σ(q), the larger
eigenvalue of

.. math:: J - q^2 \begin{pmatrix} D_u & 0 \\ 0 & D_v \end{pmatrix},\quad
          J = k \begin{pmatrix} (b-a)/(a+b) & (a+b)^2 \\ -2b/(a+b) & -(a+b)^2 \end{pmatrix}.

Concentrations start with small random differences between the particles, molecules with uniform
numbers: their own noise starts the pattern. Asked: the rate at which waves near the fastest one
grow while they are small, and the wavelength of the grown pattern, which nonlinearity shifts and
the periodic box makes discrete, against that of the fastest.

References
----------
Schnakenberg, J. Theor. Biol. 81 (1979) 389; Murray, Mathematical Biology II (2003), 2.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field
from scipy.optimize import minimize_scalar

from particell import plots
from particell.cases.base import Case, Context, Diffusivity, Length, Metric, Rate
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import fluid
from particell.schemes.static import Static
from particell.simulation import Simulation

#: Modes grow from the first to the second of these times (1/k) when their rate is measured.
GROWTH = (5.0, 10.0)


class Turing(Case):
    """A Turing pattern."""

    name = "turing"
    title = "A Turing pattern of Schnakenberg's kinetics, with concentrations and with molecules"
    reference: ClassVar[str] = "linear stability analysis"

    resolution: Annotated[int, Field(ge=16, le=500)] = 40
    """Particles along an edge of the periodic square."""
    spacing: Annotated[Length, Field(gt=0)] = 0.75e-6
    """Distance of the particles, and thickness of the plane."""
    source_u: Annotated[float, Field(gt=0)] = 0.1
    """a."""
    source_v: Annotated[float, Field(gt=0)] = 0.9
    """b."""
    rate: Annotated[Rate, Field(gt=0)] = 1.0
    """k."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 1e-12
    """D_u."""
    ratio: Annotated[float, Field(ge=1)] = 20.0
    """D_v/D_u."""
    molecules: Annotated[int, Field(ge=10, le=10**6)] = 500
    """Molecules of U in a particle at u = 1; sets c."""
    noise: Annotated[float, Field(gt=0, le=0.1)] = 0.01
    """Relative differences of the concentrations at first."""
    end: Annotated[float, Field(ge=12, le=10_000)] = 36.0
    """End of the run in units of 1/k."""

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end / self.rate

    @property
    def every(self) -> float:
        """Time between frames in s."""
        return self.until / 72

    @property
    def edge(self) -> float:
        """Edge of the square in m."""
        return self.resolution * self.spacing

    @property
    def concentration(self) -> float:
        """c in mol/m³."""
        return self.molecules / (AVOGADRO * self.spacing**3)

    def growth(self, q: float) -> float:
        """σ(q) in 1/s of a wave number in 1/m."""
        a, b = self.source_u, self.source_v
        s = a + b
        jacobian = self.rate * np.array([[(b - a) / s, s**2], [-2 * b / s, -(s**2)]])
        spread = self.diffusivity * np.diag([1.0, self.ratio])
        return float(np.linalg.eigvals(jacobian - q**2 * spread).real.max())

    def fastest(self) -> float:
        """The wave number in 1/m that grows fastest."""
        scale = math.sqrt(self.rate / self.diffusivity)
        bounds = (0.01 * scale, scale)
        return float(
            minimize_scalar(
                lambda q: -self.growth(q), bounds=bounds, method="bounded", options={"xatol": 1e-9}
            ).x
        )

    def build(self, context: Context) -> Simulation:
        """A periodic square near its uniform state."""
        domain = Domain((0, 0), (self.edge, self.edge), periodic="xy", depth=self.spacing)
        c, k = self.concentration, self.rate
        species, reactions = [], []
        for suffix in ("", "_molecules"):
            u, v = "U" + suffix, "V" + suffix
            species.append(Species(u, self.diffusivity, suffix != ""))
            species.append(Species(v, self.ratio * self.diffusivity, suffix != ""))
            reactions += [
                Reaction(f"0 -> {u}", k * self.source_u * c),
                Reaction(f"{u} -> 0", k),
                Reaction(f"0 -> {v}", k * self.source_v * c),
                Reaction(f"2 {u} + {v} -> 3 {u}", k / c**2),
            ]
        simulation = Simulation(
            domain,
            fluid(domain, Fluid(density=1000.0, viscosity=1e-3), self.spacing),
            Static(support=1.8),
            species,
            reactions,
            seed=context.seed,
            device=context.device,
            normalise_diffusion=True,
        )
        chemistry = simulation.chemistry
        assert chemistry is not None
        s = self.source_u + self.source_v
        random = np.random.default_rng(context.seed)
        for name, value in (("U", s), ("V", self.source_v / s**2)):
            start = 1 + self.noise * random.standard_normal(self.resolution**2)
            chemistry.set_concentration(name, value * c * start)
            chemistry.set_concentration(f"{name}_molecules", value * c)
        return simulation

    def field(self, run: Run, frame: int, name: str) -> np.ndarray:
        """u on the square lattice, (resolution, resolution)."""
        x = run.field("position")[0]
        column, row = np.floor(x / self.spacing).astype(int).T
        u = np.empty((self.resolution, self.resolution))
        u[column, row] = run.field(f"concentration/{name}")[frame] / self.concentration
        return u

    def modes(self, run: Run, frame: int, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Wave numbers in 1/m and powers of all modes but the mean."""
        u = self.field(run, frame, name)
        q = 2 * np.pi * np.fft.fftfreq(self.resolution, self.spacing)
        size = np.hypot(q[:, None], q[None, :]).ravel()
        power = np.abs(np.fft.fft2(u - u.mean())).ravel() ** 2
        return size[1:], power[1:]

    def growth_error(self, run: Run, name: str) -> float:
        """Growth rate of the modes near the fastest, over that of the linear analysis, less one."""
        start, stop = (run.at(t / self.rate) for t in GROWTH)
        q, first = self.modes(run, start, name)
        _, second = self.modes(run, stop, name)
        near = np.abs(q / self.fastest() - 1) < 0.25
        span = run.times[stop] - run.times[start]
        expected = first[near] * np.exp([2 * self.growth(w) * span for w in q[near]])
        growth = math.log(second[near].sum() / first[near].sum())
        return growth / math.log(expected.sum() / first[near].sum()) - 1

    def wavelength(self, run: Run, frame: int, name: str) -> float:
        """2π over the mean wave number of the pattern's strongest shell, in m."""
        q, power = self.modes(run, frame, name)
        unit = 2 * np.pi / self.edge
        shell = np.rint(q / unit).astype(int)
        strongest = np.argmax(np.bincount(shell, power))
        near = np.abs(shell - strongest) <= 1
        return float(2 * np.pi * power[near].sum() / (q[near] * power[near]).sum())

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Growth while small, wavelength and contrast when grown."""
        expected = 2 * math.pi / self.fastest()
        found = {"growth_error": Metric(self.growth_error(run, "U"), limit=0.05)}
        for label, name in (("", "U"), ("_molecules", "U_molecules")):
            length = self.wavelength(run, -1, name)
            found[f"wavelength{label}"] = Metric(length, unit="m")
            found[f"wavelength_error{label}"] = Metric(length / expected - 1, limit=0.2)
            contrast = float(self.field(run, -1, name).std())
            found[f"contrast{label}"] = Metric(contrast)
            # a grown pattern; Poisson numbers alone have a contrast of 1/sqrt(molecules)
            found[f"contrast_missing{label}"] = Metric(max(0.0, 0.3 - contrast), limit=0.0)
        return found

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """The patterns, and their spectra against the linear growth rate."""
        made = {"pattern": self._pattern_figure(run), "growth": self._growth_figure(run)}
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _pattern_figure(self, run: Run):
        figure, pair = plots.new_figure(6.8, 3.0, columns=2)
        factor, unit = plots.length_scale(self.edge)
        edge = self.edge / factor
        for axes, name, title in zip(
            pair, ("U", "U_molecules"), ("concentrations", "molecules"), strict=True
        ):
            u = self.field(run, -1, name)
            mesh = axes.imshow(u.T, origin="lower", extent=(0, edge, 0, edge))
            axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", title=title)
            figure.colorbar(mesh, ax=axes, label="u", shrink=0.85)
        return figure

    @plots.styled
    def _growth_figure(self, run: Run):
        figure, (left, right) = plots.new_figure(6.8, 3.0, columns=2)
        start, stop = (run.at(t / self.rate) for t in GROWTH)
        q, first = self.modes(run, start, "U")
        _, second = self.modes(run, stop, "U")
        span = run.times[stop] - run.times[start]
        factor = 1e6
        fine = np.linspace(0.2, 2.2, 200) * self.fastest()
        left.plot(fine / factor, [self.growth(w) for w in fine], "k-", lw=0.8, label="linear")
        shown = np.array([self.growth(w) > 0 for w in q])
        rates = np.log(second[shown] / first[shown]) / (2 * span)
        left.plot(q[shown] / factor, rates, ".", ms=3, label="each mode")
        left.set(xlabel="q [1/µm]", ylabel="growth rate [1/s]", ylim=(-0.2, None))
        plots.legend(left)
        for k, name in enumerate(("U", "U_molecules")):
            contrast = [self.field(run, f, name).std() for f in range(len(run))]
            label = ("concentrations", "molecules")[k]
            right.semilogy(run.times, contrast, color=plots.COLOURS[k], label=label)
        rise = np.exp(self.growth(self.fastest()) * (run.times - run.times[stop]))
        level = self.field(run, stop, "U").std()
        kept = run.times < 2.2 * run.times[stop]
        right.semilogy(run.times[kept], level * rise[kept], "k--", lw=0.8, label="fastest mode")
        right.set(xlabel="t [s]", ylabel="standard deviation of u")
        plots.legend(right)
        return figure
