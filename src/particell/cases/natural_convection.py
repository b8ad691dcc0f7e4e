"""Natural convection from a cylinder at the centre of a closed square cavity.

The cylinder keeps a dissolved species at C = 1 and the cavity's walls keep it at 0; what dissolves
makes the fluid lighter and drives the flow. The same particles carry the species twice, as a
concentration and as whole molecules: one of the two drives, the other is carried along.

With L the side of the cavity, ΔC = C₀ and v₀ = √(gβΔC L): Ra = gβΔC L³/(νκ), Sc = ν/κ, and
Re = v₀L/ν = √(Ra/Sc), Pe = v₀L/κ = √(Ra Sc). Transfers are given as Q = (what the wall gives per
depth and time)/(κΔC).

Cylinder and walls are layers of fixed particles; velocity and concentration are extrapolated
through their surfaces. Profiles are means over the last part of the run, of both halves of the
centreline; transfers are what the walls' particles booked in that time.

References
----------
Moukalled & Acharya, J. Thermophys. Heat Transfer 10 (1996) 524 (the problem); Drawert, Jacob, Li,
Yi & Petzold, J. Comput. Phys. 378 (2019) 1, table 2 (81², the errors printed); Jacob, Drawert, Yi &
Petzold, Eng. Anal. Bound. Elem. 128 (2021) 274, figures 10 and 11 (200² with a transport velocity).
The reference solution is our own, by finite elements (``references/natural_convection_fem.py``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from particell.boundaries.reflection import Reflection
from particell.cases import natural_convection_results as results
from particell.cases.base import (
    Case,
    Concentration,
    Context,
    Density,
    Length,
    Metric,
    Velocity,
)
from particell.chemistry.reservoirs import FixedValueWall
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import fitting_spacing, lattice, packed, rings
from particell.geometry.shapes import Circle, HalfSpace
from particell.laws.buoyancy import Buoyancy
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import Phase, box_walls
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation

GRAVITY = 9.81
#: Kernel support in spacings by scheme, and layers of wall particles, which must fill it.
SUPPORT, LAYERS = {"sdpd": 3.0, "transport-velocity": 2.6}, 3


class NaturalConvection(Case):
    """Natural convection around a cylinder in a square cavity."""

    name = "natural-convection"
    title = "Natural convection around a cylinder in a square cavity, driven by a solute"
    full: ClassVar[Sequence[Mapping[str, Any]]] = [
        {"resolution": 81, "rayleigh": 1e4},
        {"resolution": 81, "rayleigh": 1e5, "end": 40.0},
        # it swings: averaged over two periods of 13.4 L/v0
        {"resolution": 81, "rayleigh": 1e6, "end": 80.0, "averaging": 26.8},
        {"resolution": 81, "rayleigh": 1e4, "driven_by": "molecules"},
        {"resolution": 81, "rayleigh": 1e5, "end": 40.0, "driven_by": "molecules"},
        {
            "resolution": 81,
            "rayleigh": 1e6,
            "end": 80.0,
            "averaging": 26.8,
            "driven_by": "molecules",
        },
        # figure 11 of the papers: standard SPH (no shifting) and a transport velocity at t* = 4
        {"resolution": 81, "rayleigh": 1e6, "end": 4.0, "averaging": 1.0, "shifting": 0.0},
        {
            "scheme": "transport-velocity",
            "resolution": 81,
            "rayleigh": 1e6,
            "end": 4.0,
            "averaging": 1.0,
        },
        *(
            # as many molecules in all as at 81²
            {
                "scheme": "transport-velocity",
                "resolution": 200,
                "every_star": 0.5,
                "molecules": 64,
                **more,
            }
            for more in (
                {"rayleigh": 1e4},
                {"rayleigh": 1e5, "end": 40.0},
                # three periods of the plume's swaying, which hardly decays
                {"rayleigh": 1e6, "end": 100.0, "averaging": 40.2},
            )
        ),
    ]

    resolution: Annotated[int, Field(ge=20, le=400)] = 40
    """Particles along a side of the cavity."""
    rayleigh: Annotated[float, Field(ge=1, le=1e7)] = 1e4
    """Ra; there is reference data for 1e4, 1e5 and 1e6."""
    schmidt: Annotated[float, Field(gt=0)] = 0.7
    """Sc."""
    driven_by: Literal["concentrations", "molecules"] = "concentrations"
    """Which of the two ways the species is carried acts on the flow."""
    molecules: Annotated[int, Field(ge=1)] = 400
    """Molecules in a particle at the cylinder's concentration; sets the depth of the plane."""
    length: Annotated[Length, Field(gt=0)] = 0.01
    """Side L of the cavity; the cylinder's diameter is L/5."""
    velocity: Annotated[Velocity, Field(gt=0)] = 0.01
    """Velocity v0 = √(gβΔC L); sets β."""
    concentration: Annotated[Concentration, Field(gt=0)] = 1.0
    """Concentration on the cylinder."""
    density: Annotated[Density, Field(gt=0)] = 1000.0
    """Density of the fluid."""
    scheme: Literal["sdpd", "transport-velocity"] = "sdpd"
    """Plain SPH with shifting, or SPH with a transport velocity."""
    shifting: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Particle shifting in units of ρ c₀² (plain SPH)."""
    species_flux: bool = False
    """Let the shift carry the species (transport velocity); otherwise they ride with particles."""
    end: Annotated[float, Field(gt=0)] = 25.0
    """End of the run in units of L/v0."""
    averaging: Annotated[float, Field(gt=0)] = 5.0
    """Last part of the run over which results are averaged, in units of L/v0."""
    every_star: Annotated[float, Field(gt=0, le=1)] = 0.25
    """Interval of frames in units of L/v0: short enough that no particle gets from wall to wall."""

    @property
    def time_unit(self) -> float:
        """L/v0 in s."""
        return self.length / self.velocity

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end * self.time_unit

    @property
    def every(self) -> float:
        """Interval of frames in s."""
        return self.every_star * self.time_unit

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles in m."""
        return self.length / self.resolution

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity ν in m²/s."""
        return self.velocity * self.length / math.sqrt(self.rayleigh / self.schmidt)

    @property
    def diffusivity(self) -> float:
        """κ in m²/s."""
        return self.viscosity / self.schmidt

    @property
    def depth(self) -> float:
        """Depth of the plane in m."""
        return self.molecules / (self.concentration * AVOGADRO * self.spacing**2)

    @property
    def domain(self) -> Domain:
        """The cavity."""
        return Domain((0, 0), (self.length, self.length), depth=self.depth)

    @property
    def cylinder(self) -> Circle:
        """The cylinder."""
        return Circle((0.5 * self.length, 0.5 * self.length), 0.1 * self.length)

    @property
    def driver(self) -> str:
        """The species that acts on the flow."""
        return "C_molecules" if self.driven_by == "molecules" else "C"

    def build(self, context: Context) -> Simulation:
        """The cavity at rest and empty."""
        v0, side = self.velocity, self.length
        water = Fluid(density=self.density, viscosity=self.viscosity * self.density)
        phases = self.phases(water)
        species = [
            Species("C", self.diffusivity),
            Species("C_molecules", self.diffusivity, molecules=True),
        ]
        expansion = v0**2 / (GRAVITY * side * self.concentration)
        return Simulation(
            self.domain,
            phases,
            self.description(),
            species,
            boundaries=[
                *self.values([s.name for s in species], phases),
                *self.safeguards(phases),
            ],
            forces=[Buoyancy(self.driver, expansion, (0.0, -GRAVITY))],
            seed=context.seed,
            device=context.device,
            normalise_diffusion=True,
        )

    def description(self) -> SDPD | TransportVelocity:
        """The scheme."""
        speeds: dict[str, Any] = {
            "reference_speed": 0.5 * self.velocity,
            # what the lightest column, through the cylinder, weighs less than one along a wall
            "pressure_drop": 0.5 * self.density * self.velocity**2,
        }
        support = SUPPORT[self.scheme]
        if self.scheme == "sdpd":
            if self.species_flux:
                raise InputError("species_flux", True, "False with scheme 'sdpd'")
            return SDPD(support=support, shifting=self.shifting, **speeds)
        return TransportVelocity(
            support=support, fixed_volume=True, species_flux=self.species_flux, **speeds
        )

    def safeguards(self, phases: list[Phase]) -> list[Reflection]:
        """Reflecting surfaces for plain SPH; the transport velocity has walls that bounce back."""
        if self.scheme != "sdpd":
            return []
        planes = [p.surface for p in phases if isinstance(p.surface, HalfSpace)]
        return [Reflection(self.cylinder), *(Reflection(plane) for plane in planes)]

    def values(self, species: list[str], phases: list[Phase]) -> list[FixedValueWall]:
        """C₀ on the cylinder and 0 on the cavity's walls."""
        return [
            FixedValueWall(
                p.name,
                dict.fromkeys(species, self.concentration if p.name == "cylinder" else 0.0),
            )
            for p in phases
            if p.kind == "wall"
        ]

    def phases(self, water: Fluid) -> list[Phase]:
        """The fluid, packed around the cylinder; the cylinder on rings; the cavity's walls."""
        dx, domain, cylinder = self.spacing, self.domain, self.cylinder
        inner = max(0.0, cylinder.radius - LAYERS * dx)
        body, body_area = rings(cylinder, inner, cylinder.radius, dx)
        walls = box_walls(domain, water, dx, layers=LAYERS)
        everything = lattice(domain, dx)
        gap = cylinder.signed_distance(everything)
        # as many particles as the fluid's area holds: leave out those nearest to the centre
        left_out = round(math.pi * cylinder.radius**2 / dx**2)
        points = everything[np.argsort(gap, kind="stable")[left_out:]]
        near = cylinder.signed_distance(points) < 6 * dx
        others = np.concatenate([points[~near], body])
        points[near] = packed(points[near], domain, dx, others, keep_inside=~cylinder)
        points = points[np.lexsort((points[:, 1], points[:, 0]))]
        volume = (domain.volume - math.pi * cylinder.radius**2) / len(points)
        spacing = float(np.max(fitting_spacing(domain, dx)))
        return [
            Phase("fluid", water, points, volume, spacing=spacing),
            Phase("cylinder", water, body, body_area, "wall", spacing=spacing, surface=cylinder),
            *walls,
        ]

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """See :mod:`particell.cases.natural_convection_results`."""
        return results.metrics(self, run) | results.wall_metrics(self, run, simulation)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """See :mod:`particell.cases.natural_convection_results`."""
        return results.figures(self, run, directory)
