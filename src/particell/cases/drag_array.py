r"""Slow flow through a periodic array of cylinders or spheres, or through a square duct.

A body force drives a fluid of small Reynolds number along x. With the force per volume G and the
mean velocity U over the whole cell (zero in the bodies), the drag of one body is G times the cell's
volume, and

.. math:: K = \frac{G L^2}{\mu U} \;\;(\text{cylinders}), \qquad
          K = \frac{G L^3}{6\pi\mu a U} \;\;(\text{spheres})

depend on the volume fraction only. A square duct of width a has the mean velocity

.. math:: U = 0.0351443\,\frac{G a^2}{\mu}, \qquad 0.0351443 = \frac{1}{12} - \frac{16}{\pi^5}
          \sum_{n\,\mathrm{odd}} \frac{\tanh(n\pi/2)}{n^5} .

References
----------
Sangani & Acrivos, Int. J. Multiphase Flow 8 (1982) 193 (square arrays of cylinders); Zick & Homsy,
J. Fluid Mech. 115 (1982) 13, Table 2 (simple cubic arrays of spheres); White, Viscous Fluid Flow
(ducts).
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from particell import plots
from particell.analysis.arrangement import evenness
from particell.cases.base import Case, Context, Density, Length, Metric, Viscosity
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import around, lattice, rings, shells
from particell.geometry.shapes import Ball
from particell.materials import Fluid
from particell.output.run import Run
from particell.phases import Phase, box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation

#: K by volume fraction.
CYLINDERS = {0.05: 15.56, 0.1: 24.83, 0.2: 51.53, 0.3: 102.90, 0.4: 217.89}
SPHERES = {0.027: 2.008, 0.064: 2.810, 0.125: 4.292, 0.216: 7.442, 0.343: 15.4}
#: Layers of particles of a body: as many as the support is wide.
LAYERS = 3
#: By how much the flow past a resting lattice is slowed down.
AT_REST = 1e-9
#: Largest relative errors of drag and flow rate.
LIMITS = {"cylinder": 0.01, "sphere": 0.02, "duct": 0.01}
#: Largest number of bounces per particle and passage of the cell.
BOUNCES = 0.01


class DragArray(Case):
    """Slow flow through an array of cylinders or spheres, or through a square duct."""

    name = "drag-array"
    title = "Slow flow through an array of cylinders or spheres, or through a square duct"
    reference: ClassVar[str] = "exact series"
    full: ClassVar[list[dict[str, Any]]] = [
        {"shape": shape, "resolution": n, "scheme": scheme, "lattice": "running"}
        for shape, sizes in (("cylinder", (5, 10)), ("sphere", (5, 7)), ("duct", (16,)))
        for n in sizes
        for scheme in ("transport-velocity", "sdpd")
    ]

    shape: Literal["cylinder", "sphere", "duct"] = "cylinder"
    """A square array of cylinders (2D), a cubic one of spheres (3D), or a square duct (3D)."""
    resolution: Annotated[int, Field(ge=3, le=100)] | None = None
    """Particles along the radius (by default 5), or across the duct (16)."""
    fraction: Annotated[float, Field(gt=0, lt=1)] | None = None
    """Volume fraction of the bodies, one of those tabulated: 0.2 for cylinders, 0.125 for spheres
    by default."""
    body: Literal["layers", "lattice"] = "layers"
    """Bodies on circles or spheres and fluid packed around them, or both cut out of a lattice."""
    lattice: Literal["running", "resting"] = "resting"
    """Whether the particles move, or stay in their places by a flow that is 10⁹ times slower."""
    reynolds: Annotated[float, Field(gt=0, le=1)] = 0.1
    """Re = U d/ν with the diameter (width of the duct) d, before the flow is slowed down."""
    size: Annotated[Length, Field(gt=0)] = 1.0
    """Diameter of the bodies, width of the duct."""
    density: Annotated[Density, Field(gt=0)] = 1.0
    """Density of the fluid."""
    viscosity: Annotated[Viscosity, Field(gt=0)] = 1.0
    """Its viscosity μ."""
    scheme: Literal["transport-velocity", "sdpd"] = "transport-velocity"
    """SPH with a transport velocity, or plain SPH with shifting where particles move."""
    kernel: Literal["lucy", "cubic-spline", "wendland-c2", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    support: Annotated[float, Field(ge=2, le=3)] | None = None
    """Its support in particle spacings: by default 2.6, and 3 with SDPD."""
    normalise_viscosity: bool = False
    """Whether friction is divided by the kernel sum (transport velocity)."""
    density_diffusion: Annotated[float, Field(ge=0, le=0.2)] = 0.0
    """δ of SDPD. Viscosity damps sound here, and δ lets the density leak through surfaces on which
    pressure has a slope, a velocity of about δ h/(ρc₀) ∂P/∂n."""
    end: Annotated[float, Field(gt=0)] | None = None
    """End of the run in units of (cell)²/ν: by default 0.5, and 3 where particles move."""

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return 2 if self.shape == "cylinder" else 3

    @property
    def across(self) -> int:
        """Particles along the radius, or across the duct."""
        return self.resolution or (16 if self.shape == "duct" else 5)

    @property
    def share(self) -> float:
        """The volume fraction."""
        return self.fraction or (0.2 if self.shape == "cylinder" else 0.125)

    @cached_property
    def cells(self) -> int:
        """Particles along an edge of the cell."""
        if self.shape == "duct":
            return self.across
        ball = math.pi if self.dim == 2 else 4 / 3 * math.pi
        return round(self.across * (ball / self.share) ** (1 / self.dim))

    @property
    def edge(self) -> float:
        """Edge of the cell in m."""
        if self.shape == "duct":
            return self.size
        ball = math.pi if self.dim == 2 else 4 / 3 * math.pi
        return 0.5 * self.size * (ball / self.share) ** (1 / self.dim)

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles in m."""
        return self.edge / self.cells

    @property
    def reach(self) -> float:
        """The kernel's support in particle spacings."""
        return self.support or (3.0 if self.scheme == "sdpd" else 2.6)

    @property
    def exact(self) -> float:
        """U μ/(G L²): mean velocity over the cell in units of the force."""
        if self.shape == "duct":
            n = np.arange(1, 100, 2)
            return float(1 / 12 - 16 / math.pi**5 * (np.tanh(n * math.pi / 2) / n**5).sum())
        table = CYLINDERS if self.shape == "cylinder" else SPHERES
        if self.share not in table:
            raise InputError("fraction", self.share, f"one of {', '.join(map(str, table))}")
        if self.shape == "cylinder":
            return 1.0 / table[self.share]
        return self.edge / (3 * math.pi * self.size * table[self.share])

    @property
    def scale(self) -> float:
        """The exact mean velocity in m/s."""
        slow = AT_REST if self.lattice == "resting" else 1.0
        return slow * self.reynolds * self.viscosity / (self.density * self.size)

    @property
    def force(self) -> float:
        """Body force per mass in m/s²."""
        return self.scale * self.viscosity / (self.density * self.exact * self.edge**2)

    @property
    def until(self) -> float:
        """End of the run in s."""
        units = self.end or (0.5 if self.lattice == "resting" else 3.0)
        return units * self.edge**2 * self.density / self.viscosity

    @property
    def every(self) -> float:
        """Interval of frames in s."""
        return self.until / 40

    @property
    def domain(self) -> Domain:
        """One cell, around a body; a duct is as long as the kernel needs."""
        if self.shape == "duct":
            long = max(8, math.ceil(2.5 * self.reach)) * self.spacing
            return Domain((0, 0, 0), (long, self.edge, self.edge), periodic="x")
        half = 0.5 * self.edge
        return Domain([-half] * self.dim, [half] * self.dim, periodic="xyz"[: self.dim])

    @property
    def ball(self) -> Ball:
        """The body."""
        return Ball([0.0] * self.dim, 0.5 * self.size)

    def build(self, context: Context) -> Simulation:
        """The fluid at rest, the body, the scheme."""
        kinematic = self.viscosity / self.density
        slow = AT_REST if self.lattice == "resting" else 1.0
        # as the rules have it, for the flow before it is slowed down
        square = max((self.scale / slow) ** 2, self.force / slow * self.edge)
        square = max(square, kinematic * self.scale / slow / (self.reach * self.spacing))
        material = Fluid(
            density=self.density,
            viscosity=self.viscosity,
            sound_speed=10 * math.sqrt(square),
            exponent=1.0,
        )
        gravity = (self.force,) + (0.0,) * (self.dim - 1)
        return Simulation(
            self.domain,
            self.phases(material),
            self.description(gravity),
            seed=context.seed,
            device=context.device,
        )

    def description(self, gravity: tuple[float, ...]) -> SDPD | TransportVelocity:
        """The scheme."""
        if self.scheme == "sdpd":
            return SDPD(
                kernel=self.kernel,
                support=self.reach,
                gravity=gravity,
                reference_speed=self.scale,
                density_diffusion=self.density_diffusion,
                shifting=0.5 if self.lattice == "running" else 0.0,
                impenetrable=True,
            )
        return TransportVelocity(
            kernel=self.kernel,
            support=self.reach,
            gravity=gravity,
            reference_speed=self.scale,
            fixed_volume=True,
            normalise_viscosity=self.normalise_viscosity,
        )

    def phases(self, material: Fluid) -> list[Phase]:
        """The fluid, and the body or the duct's walls."""
        domain, dx, ball = self.domain, self.spacing, self.ball
        if self.shape == "duct":
            return [fluid(domain, material, dx), *box_walls(domain, material, dx)]
        if self.body == "lattice":
            sites = lattice(domain, dx)
            gap = ball.signed_distance(sites)
            points, body = sites[gap >= 0], sites[(gap < 0) & (gap > -(LAYERS + 0.5) * dx)]
            volume: Any = dx**self.dim
        else:
            fill = rings if self.dim == 2 else shells
            body, volume = fill(ball, max(0.0, ball.radius - LAYERS * dx), ball.radius, dx)
            points = around(domain, dx, ball, body)
        each = (domain.volume - ball.volume(self.dim)) / len(points)
        return [
            Phase("fluid", material, points, each, spacing=dx),
            Phase("body", material, body, volume, "wall", spacing=dx, surface=ball),
        ]

    def mean_velocity(self, run: Run) -> np.ndarray:
        """Mean velocity along x over the cell in every frame, over the exact one."""
        fluid = run.group("fluid")
        mass, found = run.static["mass"][fluid], []
        for k in range(len(run)):
            volume = mass / run.field("density")[k][fluid]
            found.append(volume @ run.field("velocity")[k][fluid, 0] / volume.sum())
        body = 0.0 if self.shape == "duct" else self.ball.volume(self.dim)
        return np.array(found) * (1 - body / self.domain.volume) / self.scale

    def steady(self, run: Run) -> tuple[float, float]:
        """Mean over the last half of the run (where particles rest, its end), and its spread."""
        u = self.mean_velocity(run)
        if self.lattice == "resting":
            return float(u[-1]), float(u[-1] / u[-4] - 1)
        half, quarter = len(u) // 2, len(u) // 4
        return float(u[half:].mean()), float(u[-quarter:].mean() / u[half:-quarter].mean() - 1)

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Errors of drag or flow rate; whether that is steady; bounces."""
        u, change = self.steady(run)
        error = u - 1 if self.shape == "duct" else 1 / u - 1
        name = "flow_rate_error" if self.shape == "duct" else "drag_error"
        found = {
            name: Metric(error, limit=LIMITS[self.shape]),
            "last_change": Metric(change, limit=0.5 * LIMITS[self.shape]),
        }
        if self.shape != "duct":
            exact = (CYLINDERS if self.dim == 2 else SPHERES)[self.share]
            found["drag_coefficient"] = Metric(exact / u, paper=exact)
        inside = self.ball if self.shape == "duct" else ~self.ball
        if self.lattice == "running" and self.shape != "duct":
            even = evenness(run.field("position")[-1], self.spacing, inside)
            found["crowding"] = Metric(1 / even.closest)
        counts = simulation.conservation()
        passages = max(1.0, self.until * self.scale / self.edge)
        number = int(run.group("fluid").sum())
        found["inside_walls"] = Metric(counts["inside walls"], limit=0.0)
        found["bounces"] = Metric(counts["bounces"], limit=BOUNCES * number * passages)
        return found

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """The speed in a plane along the flow, and the approach to the steady state."""
        made = {"speed": self._speed_figure(run), "approach": self._approach_figure(run)}
        return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]

    @plots.styled
    def _speed_figure(self, run: Run):
        figure, axes = plots.new_figure(5.6, 3.8)
        x = run.field("position")[-1]
        low, high = self.domain.lower, self.domain.upper
        periodic = self.domain.periodic
        x = np.where(periodic, low + (x - low) % (high - low), x) / self.size
        u = run.field("velocity")[-1][:, 0] / self.scale
        first, second = (1, 2) if self.shape == "duct" else (0, 1)
        shown = np.ones(len(x), bool)
        if self.dim == 3:
            cut = 0 if self.shape == "duct" else 2
            middle = 0.5 * (low + high)[cut] / self.size
            shown = np.abs(x[:, cut] - middle) < 0.5 * self.spacing / self.size
        moves = run.group("fluid") & shown
        wide = x[shown][:, [first, second]]
        size = (72 * 2.7 * self.spacing / self.size / np.ptp(wide[:, 0])) ** 2 * 0.7
        still = shown & ~run.group("fluid")
        axes.scatter(x[still, first], x[still, second], s=size, color="0.7", linewidths=0)
        mesh = axes.scatter(x[moves, first], x[moves, second], s=size, c=u[moves], linewidths=0)
        unit = "width" if self.shape == "duct" else "diameter"
        axes.set(xlabel=f"{'xyz'[first]} / {unit}", ylabel=f"{'xyz'[second]} / {unit}")
        axes.set(aspect="equal")
        figure.colorbar(mesh, ax=axes, label="$u_x$ / U")
        return figure

    @plots.styled
    def _approach_figure(self, run: Run):
        figure, axes = plots.new_figure(4.6, 3.2)
        unit = self.edge**2 * self.density / self.viscosity
        axes.plot(run.times / unit, self.mean_velocity(run), "o-", mfc="none", markersize=3)
        axes.axhline(1.0, color="k", linewidth=1)
        axes.set(xlabel="time / (cell² / ν)", ylabel="mean velocity / exact", ylim=(0, None))
        return figure
