r"""Flow between two cylinders with one axis, of which one turns.

.. math::

   v_\theta(r) = A r + \frac{B}{r},\quad
   A = \frac{\Omega_2 R_2^2 - \Omega_1 R_1^2}{R_2^2 - R_1^2},\quad
   B = \frac{(\Omega_1 - \Omega_2) R_1^2 R_2^2}{R_2^2 - R_1^2},\qquad
   \frac{dp}{dr} = \rho\,\frac{v_\theta^2}{r}

is the steady flow in the plane at any Reynolds number (Taylor's vortices need a third dimension).
The cylinders are rings of particles which keep their places and have the velocity of the surface.

References
----------
Couette, Ann. Chim. Phys. 21 (1890) 433; any textbook of fluid mechanics.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from particell import plots
from particell.analysis.arrangement import evenness
from particell.cases.base import Case, Context, Density, Length, Metric, Velocity
from particell.cases.scores import density_drift
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice, packed, rings
from particell.geometry.shapes import Circle
from particell.materials import Fluid
from particell.output.run import Run
from particell.phases import Phase
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation

LAYERS = 3
#: Limit of the averaged velocity's error over U.
LIMIT = 0.01
#: Largest void and closest pair in spacings, as for the lid-driven cavity.
VOID_LIMIT, CLOSEST_LIMIT = 1.0, 0.5


class RotatingCylinder(Case):
    """Flow between two cylinders of which one turns."""

    name = "rotating-cylinder"
    title = "Flow between two cylinders of which one turns"
    reference: ClassVar[str] = "exact solution"
    full: ClassVar[list[dict[str, Any]]] = [
        {"resolution": n, "turns": which} for which in ("inner", "outer") for n in (10, 20, 40)
    ]

    resolution: Annotated[int, Field(ge=6, le=200)] = 16
    """Particles across the gap."""
    turns: Literal["inner", "outer"] = "inner"
    """Which cylinder turns."""
    reynolds: Annotated[float, Field(gt=0)] = 20.0
    """Re = U (R₂ − R₁)/ν."""
    inner_radius: Annotated[Length, Field(gt=0)] = 0.5
    """R₁."""
    outer_radius: Annotated[Length, Field(gt=0)] = 1.0
    """R₂."""
    speed: Annotated[Velocity, Field(gt=0)] = 1.0
    """Velocity U of the surface that turns, counter-clockwise."""
    density: Annotated[Density, Field(gt=0)] = 1.0
    """Density of the fluid."""
    kernel: Literal["lucy", "cubic-spline", "wendland-c2", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    support: Annotated[float, Field(ge=2, le=3)] = 2.6
    """Its support in particle spacings."""
    pressure_force: Literal["symmetric", "difference"] = "symmetric"
    """Form of the pressure's force."""
    end: Annotated[float, Field(gt=0)] = 1.2
    """End of the run in units of (R₂ − R₁)²/ν; the flow starts from rest."""
    averaging: Annotated[float, Field(gt=0)] = 0.2
    """Last part of the run over which profiles are averaged, in the same units."""

    @property
    def gap(self) -> float:
        """R₂ − R₁ in m."""
        return self.outer_radius - self.inner_radius

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles in m."""
        return self.gap / self.resolution

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity ν in m²/s."""
        return self.speed * self.gap / self.reynolds

    @property
    def time_unit(self) -> float:
        """(R₂ − R₁)²/ν in s."""
        return self.gap**2 / self.viscosity

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end * self.time_unit

    @property
    def every(self) -> float:
        """Interval of frames in s."""
        return min(0.02, self.end) * self.time_unit

    @property
    def inner(self) -> Circle:
        """The inner cylinder."""
        return Circle((0, 0), self.inner_radius)

    @property
    def outer(self) -> Circle:
        """The inside of the outer cylinder."""
        return Circle((0, 0), self.outer_radius)

    def exact(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity over U and pressure over ρU² (up to a constant) at radii in m, (m,) each."""
        a, b = self.coefficients()
        velocity = a * r + b / r
        pressure = 0.5 * a**2 * r**2 + 2 * a * b * np.log(r) - 0.5 * b**2 / r**2
        return velocity / self.speed, pressure / self.speed**2

    def coefficients(self) -> tuple[float, float]:
        """A in 1/s and B in m²/s."""
        r1, r2 = self.inner_radius**2, self.outer_radius**2
        spin = [self.speed / self.inner_radius, self.speed / self.outer_radius]
        spin[0 if self.turns == "outer" else 1] = 0.0
        return (spin[1] * r2 - spin[0] * r1) / (r2 - r1), (spin[0] - spin[1]) * r1 * r2 / (r2 - r1)

    def build(self, context: Context) -> Simulation:
        """The fluid at rest, packed between the cylinders."""
        if self.gap <= 0:
            least = f"greater than inner_radius = {self.inner_radius:g} m"
            raise InputError("outer_radius", self.outer_radius, least)
        material = Fluid(
            density=self.density,
            viscosity=self.density * self.viscosity,
            sound_speed=10 * self.speed,
            exponent=1.0,
        )
        scheme = TransportVelocity(
            kernel=self.kernel,
            support=self.support,
            reference_speed=self.speed,
            pressure_force=self.pressure_force,
            fixed_volume=True,
        )
        edge = self.outer_radius
        return Simulation(
            Domain((-edge, -edge), (edge, edge)),
            self.phases(material),
            scheme,
            seed=context.seed,
            device=context.device,
        )

    def phases(self, material: Fluid) -> list[Phase]:
        """The fluid and the two cylinders."""
        dx, centre = self.spacing, self.inner
        deep = LAYERS * dx
        walls, bodies = (
            [],
            [
                ("inner", max(0.0, self.inner_radius - deep), self.inner_radius, self.inner),
                ("outer", self.outer_radius, self.outer_radius + deep, ~self.outer),
            ],
        )
        for name, low, high, surface in bodies:
            points, area = rings(centre, low, high, dx)
            moving = self.surface_velocity if name == self.turns else None
            walls.append(
                Phase(
                    name,
                    material,
                    points,
                    area,
                    "wall",
                    velocity=moving,
                    spacing=dx,
                    surface=surface,
                    slides=True,
                )
            )
        points = self.fluid_points(np.concatenate([w.points for w in walls]))
        volume = math.pi * (self.outer_radius**2 - self.inner_radius**2) / len(points)
        return [Phase("fluid", material, points, volume, spacing=dx), *walls]

    def fluid_points(self, fixed: np.ndarray) -> np.ndarray:
        """As many packed points as the gap's area holds."""
        edge = self.outer_radius
        box = Domain((-edge, -edge), (edge, edge))
        region = self.outer - self.inner
        points = lattice(box, self.spacing)
        number = round(math.pi * (edge**2 - self.inner_radius**2) / self.spacing**2)
        order = np.argsort(region.signed_distance(points), kind="stable")
        return packed(points[order[:number]], box, self.spacing, fixed, keep_inside=region)

    def surface_velocity(self, x: np.ndarray) -> np.ndarray:
        """That of the surface at the points (n, 2) nearest to x, in m/s."""
        r = np.linalg.norm(x, axis=1, keepdims=True)
        return self.speed * np.stack([-x[:, 1], x[:, 0]], axis=1) / r

    def profile(self, run: Run) -> dict[str, np.ndarray]:
        """Means over rings of one spacing and the averaging time, of the run and exact.

        ``r`` in m; ``velocity`` and ``radial`` over U and ``pressure`` over ρU², the latter less
        its mean; ``exact_velocity``, ``exact_pressure``.
        """
        fluid = run.group("fluid")
        start = (self.end - self.averaging) * self.time_unit
        names = ("r", "velocity", "radial", "pressure", "exact_velocity", "exact_pressure")
        sums = {name: np.zeros(self.resolution) for name in ("number", *names)}
        for k in np.flatnonzero(run.times >= start * (1 - 1e-9)):
            x = run.field("position")[int(k)][fluid]
            v = run.field("velocity")[int(k)][fluid] / self.speed
            p = run.field("pressure")[int(k)][fluid] / (self.density * self.speed**2)
            r = np.linalg.norm(x, axis=1)
            row = ((r - self.inner_radius) / self.spacing).astype(int)
            row = np.clip(row, 0, self.resolution - 1)
            exact = self.exact(r)
            values = {
                "number": np.ones_like(r),
                "r": r,
                "velocity": (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]) / r,
                "radial": (x * v).sum(axis=1) / r,
                "pressure": p - p.mean(),
                "exact_velocity": exact[0],
                "exact_pressure": exact[1] - exact[1].mean(),
            }
            for name, value in values.items():
                sums[name] += np.bincount(row, value, self.resolution)
        found = sums["number"] > 0
        return {name: sums[name][found] / sums["number"][found] for name in names}

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Errors of velocity and pressure, evenness, walls."""
        line = self.profile(run)

        def error(name: str) -> float:
            return float(np.sqrt(np.mean((line[name] - line[f"exact_{name}"]) ** 2)))

        even = evenness(run.field("position")[-1], self.spacing, self.outer - self.inner)
        counts = simulation.conservation()
        return {
            "velocity_error": Metric(error("velocity"), limit=LIMIT),
            "radial_velocity": Metric(float(np.abs(line["radial"]).max()), limit=LIMIT),
            "pressure_error": Metric(error("pressure")),
            "largest_void": Metric(even.void, limit=VOID_LIMIT),
            "crowding": Metric(1 / even.closest, limit=1 / CLOSEST_LIMIT),
            **density_drift(run, simulation, self.density, self.gap / self.speed),
            "inside_walls": Metric(counts["inside walls"], limit=0.0),
            "bounces": Metric(counts["bounces"]),
        }

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """Profiles of velocity and pressure, and the particles."""
        made = {"profile": self._profile_figure(run), "particles": self._particles_figure(run)}
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _profile_figure(self, run: Run):
        figure, (left, right) = plots.new_figure(6.8, 3.0, columns=2)
        line, fine = self.profile(run), np.linspace(self.inner_radius, self.outer_radius, 101)
        velocity, pressure = self.exact(fine)
        # the exact pressure's mean over the particles
        pressure = pressure - np.mean(self.exact(line["r"])[1] - line["exact_pressure"])
        left.plot(fine, velocity, "k-", linewidth=1, label="exact")
        left.plot(line["r"], line["velocity"], "o", mfc="none", label=f"{self.resolution} across")
        right.plot(fine, pressure, "k-", linewidth=1)
        right.plot(line["r"], line["pressure"], "o", mfc="none")
        left.set(xlabel="r [m]", ylabel="velocity / U")
        right.set(xlabel="r [m]", ylabel="pressure / (ρ U²)")
        plots.legend(left)
        return figure

    @plots.styled
    def _particles_figure(self, run: Run):
        figure, axes = plots.new_figure(4.6, 3.8)
        fluid = run.group("fluid")
        x = run.field("position")[-1]
        speed = np.linalg.norm(run.field("velocity")[-1], axis=1) / self.speed
        edge = self.outer_radius + LAYERS * self.spacing
        size = (72 * 3.0 * self.spacing / (2 * edge)) ** 2 * 0.7
        axes.scatter(*x[~fluid].T, s=size, color="0.7", linewidths=0)
        mesh = axes.scatter(*x[fluid].T, s=size, c=speed[fluid], vmin=0, vmax=1, linewidths=0)
        axes.set(xlim=(-edge, edge), ylim=(-edge, edge), aspect="equal")
        axes.set(xlabel="x [m]", ylabel="y [m]")
        figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label="|v| / U")
        return figure
