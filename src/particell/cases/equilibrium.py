r"""A fluid at rest in thermal equilibrium, in a periodic box: what its fluctuations must be.

Water at rest, starting without any motion on a lattice. The noise heats it until

- the kinetic temperature is that of the noise, :math:`\langle\frac12 m v^2\rangle=\frac D2 k_BT`;
- velocity components are normal (Maxwell's distribution), tested by chi-square on frames that are
  far enough apart to be independent;
- the total momentum is still zero to round-off;
- density fluctuates as the equation of state says. For the longest waves of the box the structure
  factor :math:`S(k) = \langle|\sum_i e^{-ik\cdot x_i}|^2\rangle/N` is compared with

  .. math:: S(k) = \frac{1}{1 + \hat W(k)^2\, m c_0^2/(k_BT)},

  with Ŵ the transform of the kernel: the energy is that of the summed density. This is the
  mean-field result for the free energy :math:`\frac12 c_0^2 (W*\rho)^2/\rho_0` plus the ideal
  gas's. It knows nothing of how particles arrange themselves, so it is a guide and not a limit;
  :mod:`particell.cases.thermal_modes` measures the compressibility with care. (Particles alone
  make a softer liquid than smeared-out mass; :mod:`particell.schemes.summation` allows for it.)

Equilibrium does not depend on the time step; with ``dt_factor`` 0.5 and 0.25 the temperature and
the variance of density stay what they are (``tests/physics/test_equilibrium_time_step.py``; with
40² particles the variance is 3.97(2)e-4).

The arrangement forgets its lattice within some 1000 h²ρ/η, long after the velocities. In three
dimensions the variance of density still wanders with it by 10 % over a default run, more than its
printed standard error says: run longer (``samples``) where that number matters.

Drops of 50 nm (two dimensions: discs as thick as their spacing) fluctuate by 0.2 m/s; the sound
speed follows from that by rule. One frame is taken every h²ρ/η, 20 automatic time steps.

References
----------
Español & Revenga, Phys. Rev. E 67 (2003) 026705. Hansen & McDonald, Theory of Simple Liquids
(2006) (structure factor, mean-field closure).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field
from scipy.stats import norm

from particell import plots
from particell.analysis.statistics import block_average, maxwellian_test
from particell.cases.base import Case, Context, Density, Length, Metric, Temperature, Viscosity
from particell.cases.equilibrium_structure import mean_field, shortest_waves, structure_factor
from particell.cases.scores import chi_square_metric
from particell.geometry.domain import Domain
from particell.materials import BOLTZMANN, Fluid
from particell.output.run import Run
from particell.phases import fluid
from particell.schemes.sdpd import SDPD
from particell.simulation import Simulation

#: Frames between those whose velocities are tested: longer than the slowest wave's memory.
THINNING = 20
#: Part of the run that is equilibration.
DISCARDED = 0.2


class Equilibrium2D(Case):
    """A fluid at rest in two dimensions."""

    name = "equilibrium-2d"
    title = "A fluctuating fluid at rest in two dimensions: temperature, Maxwell, density"
    reference: ClassVar[str] = "equipartition, the normal distribution, mean-field structure factor"
    full: ClassVar[dict[str, Any]] = {"resolution": 64}
    dim: ClassVar[int] = 2

    resolution: Annotated[int, Field(ge=9, le=512)] = 40
    """Particles along an edge."""
    spacing: Annotated[Length, Field(gt=0)] = 50e-9
    """Distance of the particles (and thickness of the plane)."""
    temperature: Annotated[Temperature, Field(gt=0)] = 300.0
    """Temperature of the fluid."""
    density: Annotated[Density, Field(gt=0)] = 1000.0
    """Density of the fluid."""
    viscosity: Annotated[Viscosity, Field(gt=0)] = 1e-3
    """Shear viscosity η."""
    bulk_viscosity: Annotated[Viscosity, Field(ge=0)] = 0.0
    """Bulk viscosity ζ."""
    exponent: Annotated[float, Field(gt=0)] = 7.0
    """γ of the equation of state."""
    kernel: Literal["lucy", "wendland-c2", "cubic-spline", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    support: Annotated[float, Field(ge=2, le=4)] = 3.0
    """Its support in particle spacings."""
    integrator: Literal["velocity-verlet", "trapezoidal"] = "velocity-verlet"
    """How time is stepped."""
    density_mode: Literal["summation", "continuity"] = "summation"
    """Whether the density is summed or integrated."""
    noise: Literal["bounded", "gaussian"] = "bounded"
    """The random numbers."""
    dt_factor: Annotated[float, Field(gt=0, le=4)] = 1.0
    """Time step in units of the automatic one."""
    samples: Annotated[int, Field(ge=40)] = 600
    """Frames, one every h²ρ/η; the first fifth is equilibration."""

    @property
    def viscous_time(self) -> float:
        """h²ρ/η in s."""
        return (self.support * self.spacing) ** 2 * self.density / self.viscosity

    @property
    def every(self) -> float:
        """Time between frames in s."""
        return self.viscous_time

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.samples * self.every

    @property
    def mass(self) -> float:
        """Mass of a particle in kg."""
        return self.density * self.spacing**3

    def build(self, context: Context) -> Simulation:
        """The fluid on a lattice, without motion."""
        edge = self.resolution * self.spacing
        domain = Domain(
            (0,) * self.dim, (edge,) * self.dim, periodic="xyz"[: self.dim], depth=self.spacing
        )
        material = Fluid(
            density=self.density,
            viscosity=self.viscosity,
            bulk_viscosity=self.bulk_viscosity,
            temperature=self.temperature,
            exponent=self.exponent,
        )
        scheme = SDPD(
            kernel=self.kernel,
            support=self.support,
            density=self.density_mode,
            integrator=self.integrator,
            fluctuations=True,
            noise=self.noise,
        )
        simulation = Simulation(
            domain,
            fluid(domain, material, self.spacing),
            scheme,
            seed=context.seed,
            device=context.device,
        )
        if self.dt_factor != 1:
            simulation.dt = self.dt_factor * simulation.largest_step()
            simulation.timing.automatic = False
        return simulation

    def first(self, run: Run) -> int:
        """The first frame that is in equilibrium."""
        return math.ceil(DISCARDED * (len(run) - 1))

    def temperatures(self, run: Run) -> np.ndarray:
        """Kinetic temperature of every frame, in K."""
        energy = run.observable("kinetic_energy")
        freedom = self.dim * (len(run.static["id"]) - 1)  # the total momentum is fixed
        return 2 * energy / (BOLTZMANN * freedom)

    def density_variances(self, run: Run) -> np.ndarray:
        """Variance of ρ/ρ₀ over the particles, of every frame."""
        density = run.field("density")
        return np.array([np.var(density[k] / self.density) for k in range(len(run))])

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Temperature, momentum, Maxwell's distribution, fluctuations of density."""
        first = self.first(run)
        temperature = block_average(self.temperatures(run)[first:])
        variance = block_average(self.density_variances(run)[first:])
        test = self.maxwellian(run)
        found = {
            "temperature_deviation": Metric(
                float(temperature.mean) / self.temperature - 1, limit=1e-2
            ),
            "temperature_standard_error": Metric(float(temperature.error) / self.temperature),
            "momentum_drift": Metric(simulation.conservation()["momentum"], limit=1e-10),
            "maxwell_chi2": chi_square_metric(test.statistic, test.freedom),
            "density_variance": Metric(float(variance.mean)),
            "density_variance_error": Metric(float(variance.error)),
            "density_mean_deviation": Metric(
                float(run.field("density")[-1].mean() / self.density - 1)
            ),
        }
        waves = shortest_waves(self.dim, 1)
        structure = block_average(self.structure(run, waves).mean(axis=1))
        expected = self.expected_structure(simulation, 1.0)
        found["structure_factor_ratio"] = Metric(float(structure.mean / expected))
        found["structure_factor_error"] = Metric(float(structure.error / expected))
        return found

    def maxwellian(self, run: Run):
        """Chi-square of velocity components against Maxwell's distribution."""
        velocity = np.array(run.field("velocity")[self.first(run) :: THINNING])
        n = velocity.shape[1]
        # the fixed total momentum takes 1/N of the variance
        return maxwellian_test(velocity, np.full(n, self.mass), self.temperature * (1 - 1 / n))

    def structure(self, run: Run, waves: np.ndarray) -> np.ndarray:
        """S(k) of the frames in equilibrium and given waves (numbers of periods along the axes)."""
        edge = self.resolution * self.spacing
        positions = run.field("position")
        frames = range(self.first(run), len(run))
        return np.array([structure_factor(positions[k] / edge, waves) for k in frames])

    def expected_structure(self, simulation: Simulation, periods: float) -> float:
        """Mean-field S(k) of waves with a number of periods along the box."""
        sound_speed = simulation.materials[0].sound_speed
        assert sound_speed is not None
        ratio = self.mass * sound_speed**2 / (BOLTZMANN * self.temperature)
        q = 2 * math.pi * periods / self.resolution * self.support
        return mean_field(q, ratio, self.kernel, self.dim)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Temperature in time, velocity distribution, density fluctuations."""
        made = {
            "temperature": self._temperature_figure(run),
            "velocities": self._velocity_figure(run),
            "density": self._density_figure(run),
        }
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _temperature_figure(self, run: Run):
        figure, axes = plots.new_figure(5.2, 3.0)
        star, values = run.times / self.viscous_time, self.temperatures(run)
        first = self.first(run)
        mean = block_average(values[first:])
        deviation = self.temperature * math.sqrt(2 / (self.dim * len(run.static["id"])))
        axes.axhspan(
            self.temperature - 2 * deviation,
            self.temperature + 2 * deviation,
            color="0.9",
            label="T ± 2 deviations of the canonical ensemble",
        )
        axes.plot(star, values, ".", markersize=2, label="frames")
        axes.axhline(self.temperature, color="black", linewidth=0.8)
        axes.set(xlabel="t η / (ρ h²)", ylabel="kinetic temperature [K]")
        spread = 5 * deviation
        axes.set_ylim(self.temperature - spread, self.temperature + 1.4 * spread)
        axes.set_title(f"mean {float(mean.mean):.2f} ± {float(mean.error):.2f} K")
        plots.legend(axes, loc="upper right", ncols=2)
        return figure

    @plots.styled
    def _velocity_figure(self, run: Run):
        figure, axes = plots.new_figure()
        velocity = np.array(run.field("velocity")[self.first(run) :: THINNING])
        z = velocity.ravel() * math.sqrt(self.mass / (BOLTZMANN * self.temperature))
        edges = np.linspace(-5, 5, 61)
        height, _ = np.histogram(z, edges)
        centre = 0.5 * (edges[1:] + edges[:-1])
        density = height / (z.size * np.diff(edges))
        shown = height > 0
        axes.plot(centre, norm.pdf(centre), "-", color="black", linewidth=1, label="Maxwell")
        axes.errorbar(
            centre[shown],
            density[shown],
            density[shown] / np.sqrt(height[shown]),
            fmt="o",
            markersize=3,
            mfc="none",
            elinewidth=0.8,
            label=f"{z.size} components",
        )
        axes.set(yscale="log", xlabel="v √(m / kT)", ylabel="probability density")
        axes.set_ylim(1e-6, 2)
        plots.legend(axes, loc="lower center")
        return figure

    @plots.styled
    def _density_figure(self, run: Run):
        figure, (left, right) = plots.new_figure(7.0, 3.0, columns=2)
        star = run.times / self.viscous_time
        left.plot(star[1:], self.density_variances(run)[1:], ".", markersize=2)
        left.set(xlabel="t η / (ρ h²)", ylabel="variance of ρ / ρ₀", ylim=(0, None))
        position = run.field("position")[len(run) - 1] / self.spacing
        if self.dim == 3:
            position = position[position[:, 2] < 2]
        right.plot(position[:, 0], position[:, 1], ".", markersize=min(4, 120 / self.resolution))
        right.set(xlabel="x / Δx", ylabel="y / Δx", aspect="equal")
        right.set(xlim=(0, self.resolution), ylim=(0, self.resolution))
        right.set_title("last frame" if self.dim == 2 else "last frame, z < 2 Δx")
        return figure


class Equilibrium3D(Equilibrium2D):
    """A fluid at rest in three dimensions."""

    name = "equilibrium-3d"
    title = "A fluctuating fluid at rest in three dimensions: temperature, Maxwell, density"
    full: ClassVar[dict[str, Any]] = {"resolution": 24}
    dim: ClassVar[int] = 3

    resolution: Annotated[int, Field(ge=9, le=128)] = 12
    """Particles along an edge."""
    samples: Annotated[int, Field(ge=40)] = 300
    """Frames, one every h²ρ/η; the first fifth is equilibration."""
