"""Flow in a square cavity whose lid slides.

The lid y = L moves with U along x; the fluid is at rest first. The run ends when the kinetic energy
changes by less than a thousandth per L/U, but not before a time that depends on Re (the energy
passes through slow turns on its way), and at the latest at ``end``. Velocities are means over the
time between the last frames: sound, which never dies away, is stronger than the corner vortices.

References
----------
Ghia, Ghia & Shin, J. Comput. Phys. 48 (1982) 387 (tables of the centrelines' velocities); Jacob,
Drawert, Yi & Petzold, Eng. Anal. Bound. Elem. 128 (2021) 274 (sizes of the corner vortices). Corner
vortices, and the centrelines once more, are compared with our own finite elements
(``references/lid_driven_cavity_fem.py``), from which Ghia's table is up to 0.009 away at Re = 100,
0.019 at 1000 and 0.04 at 10000.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from particell.averages import TimeAverage
from particell.boundaries.reflection import Reflection
from particell.cases import lid_driven_cavity_results as results
from particell.cases.base import Case, Context, Density, Length, Metric, Velocity
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace
from particell.materials import Fluid
from particell.observers import SteadyState
from particell.output.run import Run
from particell.phases import Phase, box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import MOST_DIFFUSION, TransportVelocity
from particell.simulation import Simulation

LID = "y-upper"
LAYERS = 3
#: Largest relative change of the kinetic energy per L/U at which the flow counts as steady.
STEADY = 1e-3
#: Largest UΔp/ν at which viscosity calms particles that the corners throw against the walls.
RESOLVED = 10.0


class LidDrivenCavity(Case):
    """Flow in a square cavity whose lid slides."""

    name = "lid-driven-cavity"
    title = "Flow in a square cavity whose lid slides"
    reference: ClassVar[str] = "Ghia, Ghia & Shin (1982), and finite elements"
    full: ClassVar[list[dict[str, Any]]] = [
        {"resolution": n, "reynolds": re} for re in (100, 1000, 10000) for n in (50, 100, 200)
    ]

    resolution: Annotated[int, Field(ge=20, le=1000)] = 50
    """Particles along a side."""
    reynolds: Annotated[float, Field(ge=1, le=2e4)] = 100.0
    """Re = U L/ν; there are tables for 100, 1000 and 10000."""
    length: Annotated[Length, Field(gt=0)] = 1.0
    """Side L."""
    speed: Annotated[Velocity, Field(gt=0)] = 1.0
    """Velocity U of the lid."""
    density: Annotated[Density, Field(gt=0)] = 1.0
    """Density of the fluid."""
    scheme: Literal["transport-velocity", "sdpd"] = "transport-velocity"
    """SPH with a transport velocity, or plain SPH with shifting."""
    kernel: Literal["lucy", "cubic-spline", "wendland-c2", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    support: Annotated[float, Field(ge=2, le=3)] = 2.6
    """Its support in particle spacings."""
    mach: Annotated[float, Field(gt=0, le=0.3)] = 0.1
    """U over the sound speed."""
    momentum_flux: Literal["uniform", "conserving", "none"] = "uniform"
    """Form of the momentum that crosses between particles (transport velocity)."""
    pressure_force: Literal["symmetric", "difference"] = "symmetric"
    """Form of the pressure's force (transport velocity)."""
    fixed_volume: bool = True
    """Whether the mean density is kept (transport velocity)."""
    filter_every: Annotated[int, Field(ge=0)] | None = None
    """Steps between applications of the density filter: by default 20, and 1 where UΔp/ν > 10."""
    density_diffusion: Annotated[float, Field(ge=0, le=MOST_DIFFUSION)] = 0.0
    """δ of the density's diffusion (transport velocity)."""
    pressure_switch: bool = False
    """Whether pairs that attract repel instead (transport velocity; symmetric force only)."""
    after: Annotated[float, Field(gt=0)] | None = None
    """Earliest end in L/U: 10 at Re up to 100, 40 up to 1000, 150 beyond."""
    end: Annotated[float, Field(gt=0)] | None = None
    """Latest end in L/U: three times the earliest one."""
    frames: Annotated[int, Field(ge=1)] = 5
    """Frames at the end, 1 L/U apart, over whose intervals velocities are averaged."""
    samples: Annotated[int, Field(ge=1)] | None = None
    """Samples of the velocity between two of them: by default one in about 16 time steps."""

    @property
    def earliest(self) -> float:
        """Earliest end in s."""
        by_rule = 10.0 if self.reynolds <= 100 else 40.0 if self.reynolds <= 1000 else 150.0
        return (self.after or by_rule) * self.every

    @property
    def until(self) -> float:
        """Latest end in s."""
        return 3 * self.earliest if self.end is None else self.end * self.every

    @property
    def every(self) -> float:
        """Interval of frames in s: L/U."""
        return self.length / self.speed

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles in m."""
        return self.length / self.resolution

    @property
    def smoothing(self) -> int:
        """Steps between applications of the density filter."""
        if self.filter_every is not None:
            return self.filter_every
        return 1 if self.reynolds > RESOLVED * self.resolution else 20

    @property
    def domain(self) -> Domain:
        """The cavity."""
        return Domain((0, 0), (self.length, self.length))

    def run_options(self) -> dict[str, Any]:
        """The run ends where the kinetic energy no longer changes; velocities are averaged."""
        steady = SteadyState("kinetic_energy", STEADY, interval=self.every, after=self.earliest)
        options: dict[str, Any] = {
            "samples": self.samples or self.resolution,
            "after": max(0.0, self.earliest - self.frames * self.every),
            "groups": ["fluid"],
        }
        averages = [
            TimeAverage(star * self.length, name=name, **options)
            for name, star in results.places(self).items()
        ]
        return {"stop": steady, "averages": averages}

    def build(self, context: Context) -> Simulation:
        """The fluid at rest on a square lattice, which the walls continue."""
        material = Fluid(
            density=self.density,
            viscosity=self.density * self.speed * self.length / self.reynolds,
            sound_speed=self.speed / self.mach,
            exponent=1.0,
        )
        lid = {LID: (self.speed, 0.0)}
        walls = box_walls(self.domain, material, self.spacing, layers=LAYERS, sliding=lid)
        return Simulation(
            self.domain,
            [fluid(self.domain, material, self.spacing), *walls],
            self.description(),
            boundaries=self.boundaries(walls),
            seed=context.seed,
            device=context.device,
        )

    def boundaries(self, walls: list[Phase]) -> list[Reflection]:
        """Plain SPH knows no bounce-back: what crosses a wall is mirrored."""
        planes = [w.surface for w in walls if isinstance(w.surface, HalfSpace)]
        return [Reflection(p) for p in planes] if self.scheme == "sdpd" else []

    def description(self) -> SDPD | TransportVelocity:
        """The scheme."""
        if self.scheme == "sdpd":
            return SDPD(
                kernel=self.kernel,
                support=self.support,
                reference_speed=self.speed,
                shifting=0.5,
            )
        return TransportVelocity(
            kernel=self.kernel,
            support=self.support,
            reference_speed=self.speed,
            momentum_flux=self.momentum_flux,
            pressure_force=self.pressure_force,
            fixed_volume=self.fixed_volume,
            pressure_switch=self.pressure_switch,
            filter_every=self.smoothing,
            density_diffusion=self.density_diffusion,
        )

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """See :mod:`particell.cases.lid_driven_cavity_results`."""
        return results.metrics(self, run, simulation)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """See :mod:`particell.cases.lid_driven_cavity_results`."""
        return results.figures(self, run, directory)
