r"""Is the fluctuating fluid the one that was asked for? Its waves and its pressure at rest.

A periodic box of a fluid with noise, in equilibrium. Given are density ρ, viscosity η, temperature
T and the (isothermal) sound speed :math:`c_0`; measured is what the particles make of them:

- the mean **pressure**, from the virial, less the confinement
  (:mod:`particell.schemes.summation`), in units of :math:`\rho c_0^2`: 0 is asked for;
- the **compressibility** from the density's fluctuations: the structure factor
  :math:`S(k) = \langle|\sum_i e^{-ik\cdot x_i}|^2\rangle/N` of the longest waves gives S(0), which
  is :math:`k_BT/(m c_0^2)`;
- the **viscosity**, from the decay :math:`e^{-\nu k^2t}` of transverse waves;
- **sound speed** and **attenuation**, from longitudinal waves,
  :math:`\ddot u + \nu_l k^2\dot u + c_0^2k^2u = 0` with
  :math:`\nu_l = [2\eta(1 - 1/D) + \zeta]/\rho`.

Waves of some supports see less than long ones, and decay in some time steps. Both are known, and
divided out: the transforms of the friction, across and along k; with the kernel's
:math:`\hat W(k)` the stiffness of a density that is a sum over neighbours,

.. math::

   \frac1{S(k)} \propto 1 + \frac m{k_BT}
   \left[c_p^2\hat W^2 + \frac{2P_c}\rho(\hat W - \hat W^2)\right] \propto c^2(k),

(for Gaussian fluctuations about the energy in :mod:`particell.schemes.summation`); and
velocity-Verlet, which leaves :math:`1 - \nu k^2\,dt` of a transverse wave a step. In boxes of 32²
that is 0.8 % of the viscosity and 1.5 % of the sound speed, in boxes of 12³ 5 % and 9 %.

Waves are kicked, and compared with the same run that was not (:mod:`particell.analysis.modes`): the
response is the normalised correlation of their fluctuations, without the noise. The kicks start
from frames that are evenly spread over the run.

Errors are standard errors: of pressure and S(k) from 20 equal blocks of time (each the mean over
the waves of equal length, which are equivalent), by leaving out one block at a time where a number
is fitted; of decays by leaving out one kick at a time. A limit is what is aimed at (0.2 % of
:math:`\rho c_0^2` of pressure, compressibility 5 %, viscosity 2 %, sound speed 2.5 %) and five
errors: a fluid that is within the aim fails once in 10⁶ runs.

References
----------
Hansen & McDonald, Theory of Simple Liquids (2006) (structure factor, hydrodynamic modes). Español &
Revenga, Phys. Rev. E 67 (2003) 026705.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr

from particell import plots
from particell.analysis.modes import (
    Estimate,
    Responses,
    decay_rate,
    friction_transform,
    jackknife,
    responses,
    sound,
    sound_answer,
    virial_pressure,
    waves_up_to,
)
from particell.analysis.statistics import block_average
from particell.cases import thermal_modes_figures as drawn
from particell.cases.base import (
    Case,
    Context,
    Density,
    Length,
    Metric,
    Temperature,
    Velocity,
    Viscosity,
)
from particell.cases.equilibrium_structure import kernel_transform, structure_factor
from particell.equilibrated import equilibrated
from particell.geometry.domain import Domain
from particell.materials import BOLTZMANN, Fluid
from particell.output.run import Run
from particell.phases import Phase
from particell.schemes.sdpd import SDPD
from particell.schemes.summation import DiscreteFluid, discrete_fluids
from particell.simulation import Simulation

#: Part of the run in which the fluid gets its velocities, and longest waves their fluctuations.
DISCARDED = 0.1
BLOCKS = 20
#: Waves of up to so many periods squared.
STRUCTURE, KICKED = 5, 2
#: A kick, in thermal velocities of a particle.
AMPLITUDE = 1e-3
#: Moments after a kick at which its answer is looked at, and the last in decay times.
MOMENTS, DECAYS = 16, 1.0
#: What is aimed at, and the standard errors that a limit allows besides.
PRESSURE, COMPRESSIBILITY, VISCOSITY, SOUND = 0.002, 0.05, 0.02, 0.025
ERRORS = 5.0


class ThermalModes(Case):
    """Pressure, compressibility, viscosity and sound of a fluctuating fluid at rest."""

    name = "thermal-modes"
    title = "A fluctuating fluid at rest: pressure, compressibility, viscosity, sound"
    reference: ClassVar[str] = "what was asked for: hydrodynamic modes, fluctuations of density"
    full: ClassVar[list[dict[str, Any]]] = [
        {"samples": 8000, "kicks": 200},
        {"dimensions": 3, "resolution": 16, "samples": 1000, "kicks": 60},
    ]

    dimensions: Literal[2, 3] = 2
    """Number of dimensions."""
    resolution: Annotated[int | None, Field(ge=9, le=256)] = None
    """Particles along an edge; by default 32 in two dimensions and 12 in three."""
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
    sound_speed: Annotated[Velocity | None, Field(gt=0)] = None
    """Sound speed; by default that of the rule, 30 times a particle's thermal velocity."""
    exponent: Annotated[float, Field(gt=0)] = 7.0
    """γ of the equation of state."""
    kernel: Literal["lucy", "wendland-c2", "cubic-spline", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    support: Annotated[float, Field(ge=2, le=4)] = 3.0
    """Its support in particle spacings."""
    integrator: Literal["velocity-verlet", "trapezoidal"] = "velocity-verlet"
    """How time is stepped."""
    samples: Annotated[int | None, Field(ge=80)] = None
    """Frames, one every 2 h²ρ/η, a tenth of it equilibration; by default 1000 (150 in 3D)."""
    kicks: Annotated[int, Field(ge=4)] = 24
    """Frames from which waves are kicked."""

    _answers: Responses | None = PrivateAttr(default=None)

    @property
    def side(self) -> int:
        """Particles along an edge."""
        return self.resolution or {2: 32, 3: 12}[self.dimensions]

    @property
    def every(self) -> float:
        """Time between frames in s, 2 h²ρ/η."""
        return 2 * self.viscous_time

    @property
    def viscous_time(self) -> float:
        """h²ρ/η in s."""
        return (self.support * self.spacing) ** 2 * self.density / self.viscosity

    @property
    def until(self) -> float:
        """End of the run in s."""
        return (self.samples or {2: 1000, 3: 150}[self.dimensions]) * self.every

    @property
    def mass(self) -> float:
        """Mass of a particle in kg."""
        return self.density * self.spacing**3

    @property
    def edge(self) -> float:
        """Length of the box in m."""
        return self.side * self.spacing

    def build(self, context: Context) -> Simulation:
        """The fluid with particles where they are in equilibrium, without motion."""
        dim = self.dimensions
        domain = Domain((0,) * dim, (self.edge,) * dim, periodic="xyz"[:dim], depth=self.spacing)
        material = Fluid(
            density=self.density,
            viscosity=self.viscosity,
            bulk_viscosity=self.bulk_viscosity,
            temperature=self.temperature,
            sound_speed=self.sound_speed,
            exponent=self.exponent,
        )
        scheme = SDPD(
            kernel=self.kernel,
            support=self.support,
            density="summation",
            integrator=self.integrator,
            fluctuations=True,
        )
        points = equilibrated(domain, material, self.spacing, scheme, context.seed, context.device)
        return Simulation(
            domain,
            Phase("fluid", material, points, self.spacing**dim),
            scheme,
            seed=context.seed,
            device=context.device,
        )

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Pressure, compressibility, viscosity, sound speed and attenuation."""
        c = self.asked_sound(simulation)
        stiffness = self.density * c**2
        pressure = block_average(self.pressures(run, simulation), BLOCKS)
        waves, blocks = self.structure(run)
        long = [self.softer(simulation, 2 * math.pi / self.edge * math.sqrt(n)) for n in waves]
        compressibility = jackknife(blocks * long, lambda s: self.long_waves(waves, s))[0]
        answers = self.answers(run, simulation)
        k = 2 * math.pi / self.edge
        decay = decay_rate(answers, k)
        expected = c * math.sqrt(self.softer(simulation, k)), self.along(k)
        speed, attenuation = sound(answers, k, expected, self.explicit_step(simulation))
        ideal = self.ideal(simulation)
        found = {
            "pressure": (
                Estimate(float(pressure.mean) / stiffness, float(pressure.error) / stiffness),
                0.0,
                PRESSURE,
            ),
            "compressibility": (
                scaled(compressibility, ideal),
                1.0,
                COMPRESSIBILITY,
            ),
            "viscosity": (scaled(decay, self.decay_asked(k, simulation.dt)), 1.0, VISCOSITY),
            "sound_speed": (scaled(speed, expected[0]), 1.0, SOUND),
            "attenuation": (scaled(attenuation, expected[1]), 1.0, None),
        }
        metrics = {}
        for name, (estimate, asked, aim) in found.items():
            limit = None if aim is None else aim + ERRORS * estimate.error
            metrics[f"{name}_deviation"] = Metric(estimate.value - asked, limit=limit)
            metrics[f"{name}_error"] = Metric(estimate.error)
        density = np.array([run.field("density")[n].mean() for n in self.frames(run)])
        metrics["density_mean_deviation"] = Metric(float(density.mean() / self.density - 1))
        freedom = self.dimensions * (self.side**self.dimensions - 1)
        energy = run.observable("kinetic_energy")[self.frames(run).start :].mean()
        hot = 2 * energy / (BOLTZMANN * freedom * self.temperature)
        metrics["temperature_deviation"] = Metric(float(hot) - 1)
        return metrics

    def asked_sound(self, simulation: Simulation) -> float:
        """Sound speed in m/s that is asked for."""
        c = simulation.materials[0].sound_speed
        assert c is not None
        return c

    def ideal(self, simulation: Simulation) -> float:
        """S(0) that is asked for, k_B T/(m c²)."""
        c = self.asked_sound(simulation)
        return BOLTZMANN * self.temperature / (self.mass * c**2)

    def explicit_step(self, simulation: Simulation) -> float | None:
        """Time step in s of velocity-Verlet, which waves see; None of the trapezoidal rule."""
        return simulation.dt if self.integrator == "velocity-verlet" else None

    def decay_asked(self, k: float, dt: float) -> float:
        """Rate in 1/s of a transverse wave: ν k², as kernel and time step make it."""
        seen = friction_transform(k * self.support * self.spacing, self.kernel, self.dimensions)
        rate = seen * self.viscosity / self.density * k * k
        if self.integrator == "trapezoidal":
            return 2 * math.atanh(0.5 * rate * dt) / dt
        return -math.log1p(-rate * dt) / dt

    def along(self, k: float) -> float:
        """ν_l in m²/s that a longitudinal wave sees; ζ as long ones do."""
        length = self.support * self.spacing
        seen = friction_transform(k * length, self.kernel, self.dimensions, along=True)
        return (seen * self.viscosity + self.bulk_viscosity) / self.density

    def softer(self, simulation: Simulation, k: float) -> float:
        """c²(k)/c²(0) = S(0)/S(k) of a density that is a sum over neighbours."""
        c, unit = self.asked_sound(simulation), self.mass / (BOLTZMANN * self.temperature)
        confinement = self.given(simulation).confinement / self.density
        w = kernel_transform(k * self.support * self.spacing, self.kernel, self.dimensions)
        return (1 + unit * (c**2 * w**2 + 2 * confinement * (w - w**2))) / (1 + unit * c**2)

    def given(self, simulation: Simulation) -> DiscreteFluid:
        """What particles are given."""
        scheme, depth = simulation.scheme, simulation.system.depth_factor
        return discrete_fluids(scheme, simulation.particles, simulation.materials, depth)[0]  # type: ignore[arg-type]

    def frames(self, run: Run) -> range:
        """The frames in equilibrium."""
        return range(math.ceil(DISCARDED * (len(run) - 1)), len(run))

    def pressures(self, run: Run, simulation: Simulation) -> np.ndarray:
        """Pressure of frames by the virial, without the confinement, in Pa."""
        given, depth = self.given(simulation), simulation.system.depth_factor
        mass = np.full(len(simulation.particles), self.mass / depth)
        edges = simulation.domain.lengths
        thermal = BOLTZMANN * self.temperature / depth
        position, density = run.field("position"), run.field("density")
        pressure = run.field("pressure")
        found = []
        for n in self.frames(run):
            term = (pressure[n] + given.confinement) / (given.density_sum * density[n] ** 2)
            found.append(
                virial_pressure(
                    position[n],
                    edges,
                    mass,
                    term,
                    self.support * self.spacing,
                    self.kernel,
                    thermal,
                )
            )
        return np.array(found) - given.confinement

    def structure(self, run: Run) -> tuple[np.ndarray, np.ndarray]:
        """Periods squared (m,) of waves, and S of blocks of frames (BLOCKS, m)."""
        waves = waves_up_to(self.dimensions, STRUCTURE)
        square = (waves**2).sum(axis=1)
        position = run.field("position")
        frames = self.frames(run)
        values = np.array([structure_factor(position[n] / self.edge, waves) for n in frames])
        squares = np.unique(square)
        mean = np.array([values[:, square == n].mean(axis=1) for n in squares]).T
        length = len(mean) // BLOCKS
        blocks = mean[len(mean) - BLOCKS * length :].reshape(BLOCKS, length, -1).mean(axis=1)
        return squares, blocks

    def long_waves(self, squares: np.ndarray, structure: np.ndarray) -> float:
        """S(0): the mean of ``structure``, waves weighted alike."""
        number = [
            ((waves_up_to(self.dimensions, STRUCTURE) ** 2).sum(1) == n).sum() for n in squares
        ]
        return float(np.average(structure, weights=number))

    def answers(self, run: Run, simulation: Simulation) -> Responses:
        """Responses to kicks of states of the run."""
        if self._answers is None:
            plain, kicked = (self.build(Context(simulation.seed)) for _ in range(2))
            plain.dt = kicked.dt = simulation.dt
            frames = np.linspace(self.frames(run).start, len(run) - 1, self.kicks).astype(int)
            states = [(run.field("position")[n], run.field("velocity")[n]) for n in frames]
            k = 2 * math.pi / self.edge
            last = DECAYS * self.density / (self.viscosity * k * k) / plain.dt
            steps = np.unique(np.linspace(0, max(2, last), MOMENTS + 1).astype(int))
            thermal = math.sqrt(BOLTZMANN * self.temperature / self.mass)
            waves = waves_up_to(self.dimensions, KICKED)
            self._answers = responses(plain, kicked, states, waves, steps, AMPLITUDE * thermal)
        return self._answers

    def exact_answers(self, simulation: Simulation, k: float, time: np.ndarray) -> list[np.ndarray]:
        """Longitudinal and transverse answers to a kick, as kernel and time step make them."""
        frequency = self.asked_sound(simulation) * k * math.sqrt(self.softer(simulation, k))
        damping, step = self.along(k) * k * k, self.explicit_step(simulation)
        transverse = np.exp(-self.decay_asked(k, simulation.dt) * time)
        return [sound_answer(time, frequency, damping, step), transverse]

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Structure factor, answers to kicks, pressure in time."""
        simulation = self.build(Context())
        simulation.dt = run.times[1] / max(1, run.steps[1])
        made = {
            "structure": self._structure_figure(run, simulation),
            "modes": self._modes_figure(run, simulation),
            "pressure": self._pressure_figure(run, simulation),
        }
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    def _structure_figure(self, run: Run, simulation: Simulation):
        squares, blocks = self.structure(run)
        fine = np.linspace(0, squares[-1], 50)
        asked = [1 / self.softer(simulation, 2 * math.pi / self.edge * math.sqrt(n)) for n in fine]
        unit = (2 * math.pi / self.side * self.support) ** 2
        mean = block_average(blocks / self.ideal(simulation), BLOCKS)
        return drawn.structure(unit * squares, mean, unit * fine, asked)

    def _modes_figure(self, run: Run, simulation: Simulation):
        answers, dt = self.answers(run, simulation), simulation.dt
        fine = dt * np.arange(round(answers.time[-1] / dt) + 1)
        modes = []
        for n in (1, 2):
            k = 2 * math.pi / self.edge * math.sqrt(n)
            exact = self.exact_answers(simulation, k, fine)
            modes.append(drawn.Mode(k * self.support * self.spacing, answers.of_length(k), exact))
        unit = self.viscous_time
        return drawn.modes(answers.time / unit, fine / unit, modes)

    def _pressure_figure(self, run: Run, simulation: Simulation):
        values = self.pressures(run, simulation)
        values /= self.density * self.asked_sound(simulation) ** 2
        times = run.times[self.frames(run).start :] / self.viscous_time
        return drawn.pressure(times, values, block_average(values, BLOCKS))


def scaled(estimate: Estimate, unit: float) -> Estimate:
    """An estimate in other units."""
    return Estimate(estimate.value / unit, estimate.error / unit)
