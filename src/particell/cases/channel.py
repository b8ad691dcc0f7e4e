"""What the flows between two plates have in common: fluid, plates, times, errors, figures."""

from __future__ import annotations

import abc
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from particell import plots
from particell.cases.base import Case, Context, Density, Length, Metric, Velocity
from particell.cases.scores import density_drift
from particell.geometry.domain import Domain
from particell.materials import Fluid
from particell.output.run import Run
from particell.phases import channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation

#: By how much a flow past a resting lattice is slowed down.
AT_REST = 1e-9
#: Times of the profiles in the figure, and the first one whose error counts, in H²/ν.
SHOWN, FIRST = (0.025, 0.05, 0.1, 0.2), 0.025
#: Rows of particles next to a plate that tell the shear there.
ROWS = 4


class Profile(NamedTuple):
    """Rows of one spacing across the channel: y/H, mean velocity over U, and the exact one's."""

    y: np.ndarray
    value: np.ndarray
    expected: np.ndarray

    @property
    def error(self) -> float:
        """Root mean square of the difference."""
        return float(np.sqrt(np.mean((self.value - self.expected) ** 2)))

    @property
    def shear_error(self) -> float:
        """Error of the velocity's slope at the lower plate, relative to the exact one's.

        Both are the slopes at y = 0 of the parabola through rest there that fits the nearest
        :data:`ROWS` rows best.
        """
        y = self.y[:ROWS]
        powers = np.stack([y, y**2], axis=1)
        both = np.stack([self.value[:ROWS], self.expected[:ROWS]], axis=1)
        found, exact = np.linalg.lstsq(powers, both, rcond=None)[0][0]
        return float(found / exact - 1)


class ChannelFlow(Case):
    """Flow between plates at y = 0 and H, periodic along x, from rest.

    The equations of a flow along x are linear in the velocity. With ``lattice="resting"`` it is
    slowed down by a factor of 10⁹, so that particles keep their places on the lattice and nothing
    but the viscous sum and the walls count; with ``"running"`` rows of particles slide past each
    other, mix, and the pressure answers.

    The support differs: on the square lattice Lucy's viscous sum is right to 0.08 % at 3 spacings
    and to 0.6 % at 2.6, but at 3 the transport velocity does not keep moving particles in order.
    """

    resolution: Annotated[int, Field(ge=8, le=640)] = 20
    """Particles from plate to plate."""
    reynolds: Annotated[float, Field(gt=0)] = 10.0
    """Re = U H/ν, with the largest velocity U."""
    lattice: Literal["running", "resting"] = "running"
    """Whether the particles move, or stay on their lattice by a flow that is 10⁹ times slower."""
    height: Annotated[Length, Field(gt=0)] = 1.0
    """Distance H of the plates."""
    speed: Annotated[Velocity, Field(gt=0)] = 1.0
    """Largest velocity U (before it is slowed down)."""
    density: Annotated[Density, Field(gt=0)] = 1.0
    """Density of the fluid."""
    columns: Annotated[int, Field(ge=8, le=1000)] = 16
    """Length of the periodic channel in particle spacings."""
    scheme: Literal["transport-velocity", "sdpd"] = "transport-velocity"
    """SPH with a transport velocity, or plain SPH with shifting."""
    kernel: Literal["lucy", "cubic-spline", "wendland-c2", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    support: Annotated[float, Field(ge=2, le=3)] | None = None
    """Its support in particle spacings (at most 3): 2.6, and 3 on the resting lattice."""
    normalise_viscosity: bool = False
    """Whether the viscous sum is divided by the kernel's own (transport velocity)."""
    pressure_force: Literal["symmetric", "difference"] = "symmetric"
    """Form of the pressure's force (transport velocity)."""
    fixed_volume: bool = True
    """Whether the mean density is kept (transport velocity)."""
    pressure_switch: bool = False
    """Whether pairs that attract repel instead (transport velocity; symmetric force only)."""
    end: Annotated[float, Field(gt=0)] = 1.5
    """End of the run in units of H²/ν."""
    averaging: Annotated[float, Field(gt=0)] = 0.5
    """Last part of the run over which profiles are averaged, in units of H²/ν."""

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity ν in m²/s."""
        return self.speed * self.height / self.reynolds

    @property
    def time_unit(self) -> float:
        """H²/ν in s."""
        return self.height**2 / self.viscosity

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end * self.time_unit

    @property
    def every(self) -> float:
        """Interval of frames in s."""
        return min(0.025, self.end) * self.time_unit

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles in m."""
        return self.height / self.resolution

    @property
    def domain(self) -> Domain:
        """The channel."""
        return Domain((0, 0), (self.columns * self.spacing, self.height), periodic="x")

    @property
    def reach(self) -> float:
        """The kernel's support in particle spacings."""
        return self.support or (3.0 if self.lattice == "resting" else 2.6)

    @property
    def scale(self) -> float:
        """Largest velocity of the run in m/s."""
        return self.speed * (AT_REST if self.lattice == "resting" else 1.0)

    @abc.abstractmethod
    def drive(self) -> tuple[float, float]:
        """Body force per mass along x in m/s², and velocity of the upper plate in m/s."""

    @abc.abstractmethod
    def exact(self, y: np.ndarray, time: float) -> np.ndarray:
        """Exact velocity over U at heights y/H (m,), at a time in H²/ν."""

    def paper_error(self) -> float | None:
        """What the paper printed for the same error, if anything."""
        return None

    def limit(self) -> float | None:
        """Largest error of the averaged profile."""
        return None

    def build(self, context: Context) -> Simulation:
        """The fluid at rest on a square lattice, which the plates continue."""
        material = Fluid(
            density=self.density,
            viscosity=self.density * self.viscosity,
            sound_speed=10 * self.scale,
            exponent=1.0,
        )
        force, lid = self.drive()
        walls = channel_walls(
            self.domain, material, self.spacing, axis=1, velocity=(None, (lid, 0.0))
        )
        return Simulation(
            self.domain,
            [fluid(self.domain, material, self.spacing), *walls],
            self.description((force, 0.0)),
            seed=context.seed,
            device=context.device,
        )

    def description(self, gravity: tuple[float, float]) -> SDPD | TransportVelocity:
        """The scheme."""
        if self.scheme == "sdpd":
            return SDPD(
                kernel=self.kernel,
                support=self.reach,
                gravity=gravity,
                reference_speed=self.scale,
                shifting=0.5,
            )
        return TransportVelocity(
            kernel=self.kernel,
            support=self.reach,
            gravity=gravity,
            reference_speed=self.scale,
            normalise_viscosity=self.normalise_viscosity,
            pressure_force=self.pressure_force,
            fixed_volume=self.fixed_volume,
            pressure_switch=self.pressure_switch,
        )

    def profile(self, run: Run, frames: np.ndarray) -> Profile:
        """Means over frames and rows; the exact velocity is taken where the particles are."""
        fluid = run.group("fluid")
        n = self.resolution
        sums = np.zeros((4, n))
        for k in frames:
            y = run.field("position")[int(k)][fluid, 1] / self.height
            u = run.field("velocity")[int(k)][fluid, 0] / self.scale
            row = np.clip((y * n).astype(int), 0, n - 1)
            expected = self.exact(y, run.times[int(k)] / self.time_unit)
            for total, values in zip(sums, (np.ones_like(y), y, u, expected), strict=True):
                total += np.bincount(row, values, n)
        found = sums[0] > 0
        return Profile(*(sums[1:, found] / sums[0, found]))

    def averaged(self, run: Run) -> np.ndarray:
        """The frames of the averaging time."""
        start = (self.end - self.averaging) * self.time_unit
        return np.flatnonzero(run.times >= start * (1 - 1e-9))

    def single_errors(self, run: Run) -> np.ndarray:
        """Root mean square error over the particles, at every frame."""
        fluid = run.group("fluid")
        errors = []
        for k, time in enumerate(run.times):
            y = run.field("position")[k][fluid, 1] / self.height
            u = run.field("velocity")[k][fluid, 0] / self.scale
            errors.append(np.sqrt(np.mean((u - self.exact(y, time / self.time_unit)) ** 2)))
        return np.array(errors)

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Errors of the averaged profile, of single frames and on the way there."""
        single = self.single_errors(run)
        starting = run.times < (self.end - self.averaging) * self.time_unit
        starting &= run.times >= FIRST * self.time_unit * (1 - 1e-9)
        line = self.profile(run, self.averaged(run))
        found = {
            "profile_error": Metric(line.error, paper=self.paper_error(), limit=self.limit()),
            "wall_shear_error": Metric(line.shear_error),
            "particle_error": Metric(float(single[self.averaged(run)].mean())),
            "transient_error": Metric(
                float(single[starting].max(initial=0.0)), limit=self.transient_limit()
            ),
            **density_drift(run, simulation, self.density, self.height / self.scale),
        }
        counts = simulation.conservation()
        if "inside walls" in counts:
            found["inside_walls"] = Metric(counts["inside walls"], limit=0.0)
            found["bounces"] = Metric(counts["bounces"])
        return found

    def transient_limit(self) -> float | None:
        """Largest error on the way to the steady state."""
        return None

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Profiles in time, error of the averaged profile, arrangement of the particles."""
        made = {
            "profiles": self._profiles_figure(run),
            "error": self._error_figure(run),
            "arrangement": plots.arrangement(
                run.field("position")[-1],
                run.static["group"],
                run.group_names,
                domain=Domain(
                    (self.domain.lower[0], -3 * self.spacing),
                    (self.domain.upper[0], self.height + 3 * self.spacing),
                ),
            ),
        }
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _profiles_figure(self, run: Run):
        figure, axes = plots.new_figure(5.6, 3.4)
        fine = np.linspace(0, 1, 201)
        times = [t for t in SHOWN if t < self.end] + [self.end]
        for k, star in enumerate(times):
            last = k == len(times) - 1
            frame = int(np.argmin(np.abs(run.times - star * self.time_unit)))
            frames = self.averaged(run) if last else np.array([frame])
            line, colour = self.profile(run, frames), plots.COLOURS[k]
            name = "mean" if last else f"t ν/H² = {star:g}"
            exact = self.exact(fine, run.times[frame] / self.time_unit)
            axes.plot(exact, fine, "-", color=colour, linewidth=1)
            axes.plot(line.value, line.y, "o", color=colour, mfc="none", ms=3.5, label=name)
        axes.plot([], [], "-", color="black", linewidth=1, label="exact")
        axes.set(xlabel="u / U", ylabel="y / H", ylim=(0, 1))
        figure.legend(loc="outside right upper")
        return figure

    @plots.styled
    def _error_figure(self, run: Run):
        figure, (left, right) = plots.new_figure(6.8, 3.0, columns=2)
        left.semilogy(run.times[1:] / self.time_unit, self.single_errors(run)[1:], "o-", mfc="none")
        left.set(xlabel="t ν / H²", ylabel="r.m.s. error of the particles / U")
        line = self.profile(run, self.averaged(run))
        right.plot(1e3 * (line.value - line.expected), line.y, "o", mfc="none")
        right.axvline(0, color="black", linewidth=0.6)
        right.set(xlabel="error of the averaged profile / U [10⁻³]", ylabel="y / H", ylim=(0, 1))
        return figure
