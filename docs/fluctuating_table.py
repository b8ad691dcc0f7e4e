r"""Measures the table of :mod:`particell.schemes.summation`.

    python docs/fluctuating_table.py [--processes 2] [--only lucy-2-3.0] > disorder.csv

For every kernel, support, dimension and strength of the noise: a periodic box of particles of unit
mass, spacing and temperature; s from the virial pressure, corrected twice; K from the pressure at
volumes 1 % smaller and larger; f and g from the decay of transverse waves that were kicked
(:mod:`particell.analysis.modes`) at two strengths of friction, R = ρ c_p h/η_p, which for long
waves is f + g R, with the finite wave length and time step divided out. Standard errors stand in
the last columns. It belongs into ``src/particell/schemes/``. An hour on one core.
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import click
import numpy as np

from particell.analysis.modes import (
    decay_rate,
    friction_transform,
    responses,
    virial_pressure,
    waves_up_to,
)
from particell.analysis.statistics import block_average
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.kernels import CODES
from particell.laws.viscosity import friction_coefficients
from particell.materials import BOLTZMANN, Fluid
from particell.phases import Phase
from particell.schemes.sdpd import SDPD
from particell.schemes.summation import confinement_of, lattice_sum
from particell.simulation import Simulation

SUPPORTS = {2: (2.0, 2.4, 2.7, 3.0, 3.5, 4.0), 3: (2.0, 2.5, 3.0, 4.0)}
SIDES = {2: 24, 3: 9}
STRENGTHS = {2: (1e-4, 1e-3, 4e-3), 3: (1e-4, 1e-3)}
#: R of the box whose pressure is measured, where particles mix quickly (in 20 h²ρ/η they go some
#: spacings, where those of a fluid with R = 1 take 1e4), and of those whose decay is.
MIXING, DECAYS = 25.0, (0.4, 2.5)
#: Length of runs in h²ρ/η: until particles are mixed, and until pressures are averaged.
REST, TIMES = 10, 20
#: Volumes of the box, of which the first is the reference.
VOLUMES = (1.0, 0.99, 1.01)


@dataclass(frozen=True)
class Entry:
    """A row of the table: where it is measured."""

    kernel: str
    dim: int
    support: float
    theta: float

    @property
    def name(self) -> str:
        """As for ``--only``."""
        return f"{self.kernel}-{self.dim}-{self.support}"

    @property
    def side(self) -> int:
        """Particles along an edge: at least what the neighbour list needs."""
        return max(SIDES[self.dim], math.ceil(2.5 * self.support) + 1)

    def build(self, ratio: float, s: float, volume: float = 1.0, seed: int = 1) -> Simulation:
        """A box at R = ``ratio`` whose densities are divided by s; mass, spacing, k_BT are 1."""
        sound = self.theta**-0.5
        viscosity = sound * self.support / ratio
        material = Fluid(1.0, viscosity, temperature=1 / BOLTZMANN, sound_speed=sound)
        edge = self.side * volume ** (1 / self.dim)
        box = Domain((0,) * self.dim, (edge,) * self.dim, periodic="xyz"[: self.dim], depth=1.0)
        points = lattice(box, edge / self.side)
        points += np.random.default_rng(seed).uniform(-0.25, 0.25, points.shape)
        phase = Phase("fluid", material, points % edge, np.ones(len(points)), spacing=1.0)
        scheme = SDPD(self.kernel, self.support, density="summation", fluctuations=True, skin=0.25)
        simulation = Simulation(box, phase, scheme, seed=seed)
        given = simulation.solver.flow.constants
        friction = friction_coefficients(viscosity, 0.0, self.dim)
        for name, value in (
            ("density_sum", s),
            ("confinement", confinement_of(self.theta) / self.theta),
            ("sound_speed", sound),
            ("transverse", friction[0]),
            ("radial", friction[1]),
        ):
            given[name] = simulation.device.array(np.array([value]))
        return simulation

    def viscous_steps(self, simulation: Simulation, ratio: float) -> float:
        """Time steps in h²ρ/η."""
        return self.support * ratio * self.theta**0.5 / simulation.dt

    def pressure(self, s: float, volume: float, rest: float, times: float, seed: int):
        """Virial pressure less P_c in ρ c², over ``times`` h²ρ/η after ``rest``: mean and error."""
        simulation = self.build(MIXING, s, volume, seed)
        unit = self.viscous_steps(simulation, MIXING)
        simulation.advance(int(rest * unit))
        p, confinement = simulation.particles, confinement_of(self.theta) / self.theta
        found = []
        for _ in range(int(times * 4)):
            simulation.advance(int(unit / 4))
            x, density = np.array(p.host("x")), p.host("density")
            term = (p.host("pressure") + confinement) / (s * density**2)
            edges = simulation.domain.lengths
            ones = np.ones(len(x))
            found.append(virial_pressure(x, edges, ones, term, self.support, self.kernel, 1.0))
        mean = block_average((np.array(found) - confinement) * self.theta, 10)
        return float(mean.mean), float(mean.error)

    def states(self, s: float, rest: float, number: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Positions and velocities in equilibrium, which knows nothing of the viscosity."""
        source = self.build(MIXING, s, seed=2)
        unit = self.viscous_steps(source, MIXING)
        source.advance(int(rest * unit))
        found = []
        for _ in range(number):
            source.advance(int(unit))
            found.append((source.particles.by_id("x"), source.particles.by_id("v")))
        return found

    def viscosity(self, ratio: float, s: float, states: list[tuple[np.ndarray, np.ndarray]]):
        """Viscosity of long waves over η at R = ``ratio``: mean and error."""
        plain, kicked = self.build(ratio, s), self.build(ratio, s)
        unit = self.viscous_steps(plain, ratio)
        waves = waves_up_to(self.dim, 2)
        k = 2 * math.pi / self.side
        last = int(0.8 * unit / (k * self.support) ** 2)
        steps = np.unique(np.array([0, max(2, last // 5), max(4, last)]))
        found = responses(plain, kicked, states, waves, steps, 1e-3)
        ratios = []
        for length in (k, k * math.sqrt(2)):
            rate = decay_rate(found, length)
            nu = self.theta**-0.5 * self.support / ratio
            seen = friction_transform(length * self.support, self.kernel, self.dim)
            part = nu * length**2 * seen * plain.dt  # velocity-Verlet does 1 - part a step
            left = math.exp(-rate.value * plain.dt)
            ratios.append(((1 - left) / part, rate.error * plain.dt * left / part))
        value, error = np.array(ratios).T
        weight = error**-2.0
        return float((value * weight).sum() / weight.sum()), float(weight.sum() ** -0.5)


def measure(entry: Entry, effort: float = 1.0) -> str:
    """The row of the table."""
    times, rest = TIMES * effort, REST * max(1.0, effort)
    s = 1.005 * lattice_sum(entry.kernel, entry.support, entry.dim)
    first, _ = entry.pressure(s, 1.0, rest, times / 2, 3)
    s *= 1 + first / 0.9
    found = [entry.pressure(s, volume, rest, times, 4) for volume in VOLUMES]
    (here, error), (small, small_error), (large, large_error) = found
    stiffness = (small - large) / (1 / VOLUMES[1] - 1 / VOLUMES[2])
    stiffness_error = math.hypot(small_error, large_error) / (1 / VOLUMES[1] - 1 / VOLUMES[2])
    s *= 1 + here / stiffness
    states = entry.states(s, rest, max(4, int(10 * effort)))
    low, high = (entry.viscosity(ratio, s, states) for ratio in DECAYS)
    collisions = (high[0] - low[0]) / (DECAYS[1] - DECAYS[0])
    friction = low[0] - collisions * DECAYS[0]
    return (
        f"{entry.kernel},{entry.dim},{entry.support},{entry.theta:g},{s:.5f},{stiffness:.4f},"
        f"{friction:.4f},{collisions:.4f},{error / stiffness:.5f},{stiffness_error:.4f},"
        f"{low[1]:.4f},{high[1]:.4f}"
    )


def entries(only: str | None) -> list[Entry]:
    """All rows, those that are used most first."""
    found = [
        Entry(kernel, dim, support, theta)
        for dim in (2, 3)
        for support in sorted(SUPPORTS[dim], key=lambda h: abs(h - 3.0))
        for kernel in CODES
        for theta in STRENGTHS[dim]
    ]
    return [entry for entry in found if only is None or entry.name.startswith(only)]


@click.command()
@click.option("--processes", default=2, show_default=True)
@click.option("--only", help="Rows whose kernel-dimension-support begins so.")
@click.option("--effort", default=1.0, show_default=True, help="Length of the runs.")
def main(processes: int, only: str | None, effort: float) -> None:
    """Print the table as it becomes known."""
    print("kernel,D,support,theta,s,K,f,g,error_s,error_K,error_low,error_high", flush=True)
    wanted = entries(only)
    with ProcessPoolExecutor(processes) as pool:
        for row in pool.map(measure, wanted, [effort] * len(wanted)):
            print(row, flush=True)


if __name__ == "__main__":
    main()
