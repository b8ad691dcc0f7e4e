r"""MinD and MinE oscillating from pole to pole of a bacterium, molecule by molecule.

The model of Huang, Meir & Wingreen in a cylinder with a membrane all around: in the cytosol
MinD-ADP becomes MinD-ATP, which binds to the membrane, by itself and helped by MinD that is there;
MinE binds to MinD in the membrane, and sets it free as MinD-ADP:

======================  ==========================  ==================
D_ADP → D_ATP           everywhere                  1 /s
D_ATP → d               at the membrane             0.025 µm/s
D_ATP + d → 2 d         at the membrane             0.0015 µm³/s
D_ATP + de → d + de     at the membrane             0.0015 µm³/s
E + d → de              at the membrane             0.093 µm³/s
de → D_ADP + E          in the membrane             0.7 /s
======================  ==========================  ==================

Cylinder: radius 0.5 µm, length 4 µm; 1000 MinD and 350 MinE (dimers) a µm; D_ADP, D_ATP and E
diffuse with 2.5 µm²/s. The authors' deterministic period is 39 s; periods in cells are 30 to 60 s
and more. In the membrane d and de diffuse with 0.01 µm²/s (Fange & Elf). The authors had them at
rest; molecule by molecule that lets MinD pile up in single particles (500 in one, measured), for
recruiting feeds on what is there; the period is then 42 s.

Particles are a cubic lattice cut to the cylinder. Those that miss one of 18 neighbours are the
group ``membrane``, which holds d and de besides the species of the cytosol. Its layer has the
thickness δ = volume/true area, so that the rate of binding per area σ becomes σ/δ per molecule in
the layer, and second-order constants stay what they are. Jumps go to the nearest neighbours, with
the constant factor of the infinite lattice taken out of the diffusivity; no particles outside, no
flux.

References
----------
Huang, Meir & Wingreen, Proc. Natl. Acad. Sci. 100 (2003) 12724 (model, constants, period); Fange &
Elf, PLoS Comput. Biol. 2 (2006) e80 (the stochastic model of the same kind); Raskin & de Boer,
Proc. Natl. Acad. Sci. 96 (1999) 4971 (periods in cells).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from particell import plots
from particell.cases.base import Case, Context, Diffusivity, Length, Metric, Quantity, Rate, Time
from particell.cases.base import Velocity as SurfaceRate
from particell.cases.effective_diffusivity import on_lattice
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.geometry.pairs import neighbour_pairs
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import Phase
from particell.schemes.static import Static
from particell.simulation import Simulation

#: Nearest neighbours of the cubic lattice only.
SUPPORT = 1.3
#: Period of the model at its authors' constants, in s, and how far off a run may be.
PERIOD, LIMIT = 39.0, 0.3
#: The oscillation is looked at from this time on, in s.
SETTLED = 40.0

SecondOrder = Annotated[float, Quantity("m^3/s"), Field(ge=0)]


class MinOscillation(Case):
    """MinD and MinE in a bacterium."""

    name = "min-oscillation"
    title = "MinD and MinE oscillating from pole to pole of a bacterium, molecule by molecule"
    reference: ClassVar[str] = "the model's period of 39 s (Huang, Meir & Wingreen 2003)"

    spacing: Annotated[Length, Field(gt=0, le=0.2e-6)] = 0.1e-6
    """Distance of the particles."""
    radius: Annotated[Length, Field(gt=0)] = 0.5e-6
    """Radius of the cylinder."""
    length: Annotated[Length, Field(gt=0)] = 4e-6
    """Its length."""
    min_d: Annotated[int, Field(ge=1)] = 4000
    """Molecules of MinD."""
    min_e: Annotated[int, Field(ge=0)] = 1400
    """Molecules (dimers) of MinE."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 2.5e-12
    """Diffusivity in the cytosol."""
    membrane_diffusivity: Annotated[Diffusivity, Field(ge=0)] = 0.01e-12
    """Diffusivity in the membrane."""
    exchange: Annotated[Rate, Field(ge=0)] = 1.0
    """D_ADP → D_ATP."""
    binding: Annotated[SurfaceRate, Field(ge=0)] = 0.025e-6
    """D_ATP → d, per area."""
    recruiting: SecondOrder = 0.0015e-18
    """D_ATP + d → 2 d and D_ATP + de → d + de, per pair of molecules."""
    capture: SecondOrder = 0.093e-18
    """E + d → de, per pair of molecules."""
    release: Annotated[Rate, Field(ge=0)] = 0.7
    """de → D_ADP + E."""
    dt: Annotated[Time, Field(gt=0)] = 2.5e-3
    """Time step: three jumps of a molecule."""
    until: Annotated[Time, Field(gt=0)] = 140.0
    """End of the run."""
    every: Annotated[Time, Field(gt=0)] = 1.0
    """Time between frames."""

    def build(self, context: Context) -> Simulation:
        """The cylinder, with all MinD as D_ADP in its left half."""
        dx = self.spacing
        across = 2 * math.ceil(self.radius / dx) * dx
        half = 0.5 * across
        domain = Domain((0, -half, -half), (self.length, half, half))
        points = lattice(domain, dx)
        points = points[np.hypot(points[:, 1], points[:, 2]) < self.radius]
        # with neighbours along edges, so that the layer is connected by nearest neighbours
        i, _, _ = neighbour_pairs(points, domain, 1.5 * dx)
        outside = np.bincount(i, minlength=len(points)) < 18
        # the volume is the cylinder's, whatever the steps of the lattice are
        volume = math.pi * self.radius**2 * self.length / len(points)
        area = 2 * math.pi * self.radius * (self.length + self.radius)
        layer = volume * np.count_nonzero(outside) / area
        water = Fluid(density=1000.0, viscosity=1e-3)
        simulation = Simulation(
            domain,
            [
                Phase("cytosol", water, points[~outside], volume, spacing=dx),
                Phase("membrane", water, points[outside], volume, spacing=dx),
            ],
            Static(support=SUPPORT),
            self.species(volume / dx**3),
            self.reactions(layer),
            seed=context.seed,
            dt=self.dt,
            device=context.device,
        )
        self.fill(simulation, context.seed)
        return simulation

    def species(self, part: float) -> list[Species]:
        """Three species of the cytosol, two of the membrane; ``part`` is V/Δx³ of the particles."""
        kappa = self.diffusivity / (on_lattice("lucy", SUPPORT, 3) * part)
        inside = [Species(name, kappa, molecules=True) for name in ("D_ADP", "D_ATP", "E")]
        slow = kappa * self.membrane_diffusivity / self.diffusivity
        bound = [Species(name, slow, molecules=True, only_in="membrane") for name in ("d", "de")]
        return inside + bound

    def reactions(self, layer: float) -> list[Reaction]:
        """The six reactions, with a membrane of a given thickness in m."""
        recruiting, capture = (AVOGADRO * k for k in (self.recruiting, self.capture))
        where = "membrane"
        return [
            Reaction("D_ADP -> D_ATP", self.exchange),
            Reaction("D_ATP -> d", self.binding / layer, only_in=where),
            Reaction("D_ATP + d -> 2 d", recruiting, only_in=where),
            Reaction("D_ATP + de -> d + de", recruiting, only_in=where),
            Reaction("E + d -> de", capture, only_in=where),
            Reaction("de -> D_ADP + E", self.release, only_in=where),
        ]

    def fill(self, simulation: Simulation, seed: int) -> None:
        """MinD in the left half, MinE everywhere, each molecule in a particle drawn at random."""
        random = np.random.default_rng(seed)
        chemistry = simulation.chemistry
        assert chemistry is not None
        x = simulation.particles.host("x")[:, 0]
        for name, number, chosen in (
            ("D_ADP", self.min_d, x < 0.5 * self.length),
            ("E", self.min_e, x < self.length),
        ):
            counts = np.zeros(len(x))
            counts[chosen] = random.multinomial(
                number, np.full(chosen.sum(), 1 / np.count_nonzero(chosen))
            )
            chemistry.set_count(name, counts)

    def along(self, run: Run, *names: str) -> np.ndarray:
        """Molecules of some species in slices of one spacing along the cell, (frames, slices)."""
        x = run.field("position")[0][:, 0]
        column = np.floor(x / self.spacing).astype(int)
        total = np.sum([run.field(f"count/{name}")[:] for name in names], axis=0)
        return np.array([np.bincount(column, frame, minlength=column.max() + 1) for frame in total])

    def dipole(self, run: Run) -> np.ndarray:
        """Mean place of MinD in the membrane, -1 (left pole) to 1, (frames,)."""
        bound = self.along(run, "d", "de")
        place = np.linspace(-1, 1, bound.shape[1])
        return bound @ place / np.maximum(bound.sum(axis=1), 1)

    def period(self, run: Run) -> float:
        """Period in s: mean distance of the dipole's upward passages through zero."""
        late = run.times >= SETTLED
        if np.count_nonzero(late) < 2 * 4.0 / self.every:
            return math.nan
        time, dipole = run.times[late], self.dipole(run)[late]
        window = max(1, round(4.0 / self.every))  # 4 s: noise must not count as a passage
        smooth = np.convolve(dipole, np.full(window, 1 / window), mode="valid")
        time = time[window - 1 :]
        up = np.flatnonzero((smooth[:-1] < 0) & (smooth[1:] >= 0))
        down = np.flatnonzero((smooth[:-1] > 0) & (smooth[1:] <= 0))
        spans = [t[-1] - t[0] for t in (time[up], time[down]) if len(t) > 1]
        number = sum(len(t) - 1 for t in (up, down) if len(t) > 1)
        return float(sum(spans) / number) if number else math.nan

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Period, how far the oscillation goes, mean profile, and both proteins' numbers."""
        late = run.times >= SETTLED
        if np.count_nonzero(late) < 2:
            late = run.times >= 0
        period = self.period(run)
        swing = float(np.abs(self.dipole(run)[late]).mean())
        mean = self.along(run, "d", "de")[late].mean(axis=0)
        n = len(mean)
        # the mean place of as many molecules anywhere, with nothing that oscillates
        noise = math.sqrt(1 / (3 * max(mean.sum(), 1)))
        # by the membrane there: the slices at the ends have more of it
        x = run.field("position")[0][run.group("membrane"), 0]
        share = mean / np.bincount(np.floor(x / self.spacing).astype(int), minlength=n)
        middle = share[n * 2 // 5 : n - n * 2 // 5].mean()
        poles = np.concatenate([share[: n // 5], share[n - n // 5 :]]).mean()
        lost = {}
        for label, names in (("MinD", ("D_ADP", "D_ATP", "d", "de")), ("MinE", ("E", "de"))):
            total = np.sum([run.observable(f"amount_{name}") for name in names], axis=0)
            lost[label] = float(np.abs(total - total[0]).max())
        return {
            "period": Metric(period, unit="s"),
            "period_error": Metric(period / PERIOD - 1, limit=LIMIT),
            "swing": Metric(swing),
            "swing_missing": Metric(max(0.0, 6 * noise - swing), limit=0.0),
            "middle_over_poles": Metric(float(middle / poles), limit=0.8),
            "MinD_lost": Metric(lost["MinD"], limit=0.0),
            "MinE_lost": Metric(lost["MinE"], limit=0.0),
        }

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Place and time of both proteins in the membrane, and the dipole."""
        made = {"kymograph": self._kymograph(run), "dipole": self._dipole_figure(run)}
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _kymograph(self, run: Run):
        figure, pair = plots.new_figure(6.8, 4.2, rows=2)
        edge = self.length * 1e6
        for axes, names, title in zip(
            pair, (("d", "de"), ("de",)), ("MinD in the membrane", "MinE in the membrane"),
            strict=True,
        ):  # fmt: skip
            values = self.along(run, *names)
            extent = (run.times[0], run.times[-1], 0, edge)
            mesh = axes.imshow(values.T, origin="lower", aspect="auto", extent=extent)
            axes.set(ylabel="x [µm]", title=title)
            figure.colorbar(mesh, ax=axes, label="molecules a slice")
        pair[1].set_xlabel("t [s]")
        return figure

    @plots.styled
    def _dipole_figure(self, run: Run):
        figure, (left, right) = plots.new_figure(6.8, 2.8, columns=2)
        left.plot(run.times, self.dipole(run))
        left.axhline(0, color="black", linewidth=0.6)
        left.set(xlabel="t [s]", ylabel="mean place of MinD in the membrane", ylim=(-1, 1))
        left.set_title(f"period {self.period(run):.1f} s")
        late = run.times >= SETTLED
        for names, label in ((("d", "de"), "MinD"), (("de",), "MinE")):
            mean = self.along(run, *names)[late].mean(axis=0)
            x = (np.arange(len(mean)) + 0.5) * self.spacing * 1e6
            right.plot(x, mean, label=label)
        right.set(xlabel="x [µm]", ylabel="molecules a slice, mean", ylim=(0, None))
        plots.legend(right)
        return figure
