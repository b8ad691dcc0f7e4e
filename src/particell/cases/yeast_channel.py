"""Reactive flow past a yeast cell in a microfluidic channel.

Two streams enter side by side; the upper one carries the ligand L (α-factor). L diffuses across
the mixing layer and binds to receptors R in the membrane of a cell that stands in it:
R + L ⇄ RL. The same flow carries the species twice, as concentrations and as whole molecules.

The channel is closed to a ring by a sponge upstream of x = 0, in which velocity and L are brought
to the inlet's values; a stretch of free flow separates it from the channel's end. The flow is
driven by the body force of an empty channel, 12 ν v₀/H², and by what it takes beyond that to keep
the flow rate: the cell's drag.
Channel walls and cell are made of fixed particles with the velocity extrapolated through their
surfaces.

At the real Reynolds number of 0.025 a step limited by viscosity takes 6e5 steps; the default raises
it to 1 with all other numbers kept. What that changes was measured with finite elements: 0.4 % in
RL around the membrane (t* = 0.5; 0.1 % later), 0.7 % in L along the centreline (t* = 0.5).

The membrane, 1 µm thick, is one ring of 8 particles at the default resolution, of 13 at 100. The
papers have 1250 particles in all, 25 across the channel: spacings of 4 µm for a cell of 5 µm. Such
a run is let through with a warning: it shows what they ran, not what happens at the cell.

References
----------
Drawert, Jacob, Li, Yi & Petzold, J. Comput. Phys. 378 (2019) 1, section 4.3, tables 3 and 4
(parameters; tables 2.4 and 2.5 of Jacob, thesis, UCSB 2020, are the same). The reference solution
is our own (``references/yeast_channel_fem.py``).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from particell.boundaries.mean_velocity import MeanVelocity
from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.cases import yeast_channel_ensemble
from particell.cases import yeast_channel_results as results
from particell.cases.base import (
    Case,
    Concentration,
    Context,
    Density,
    Diffusivity,
    Length,
    Metric,
    Quantity,
    Velocity,
)
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.errors import LawWarning
from particell.geometry.domain import Domain
from particell.geometry.fill import around, rings
from particell.geometry.shapes import Circle, HalfSpace
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import Phase, channel_walls
from particell.schemes.sdpd import SDPD
from particell.simulation import Simulation

if TYPE_CHECKING:
    from particell.ensemble.results import EnsembleRun

#: Particles across the channel from which the cell is two spacings wide.
RESOLVED = 40
#: What is added to the names of the species that are molecules.
MOLECULES = "_molecules"
#: What the finite-element reference has been computed for: the defaults of these.
COMPARED = (
    *("height", "length", "radius", "membrane", "position", "mean_velocity"),
    *("diffusivity", "concentration", "association", "dissociation"),
)


class YeastChannel(Case):
    """Reactive flow past a yeast cell."""

    name = "yeast-channel"
    title = "Reactive flow past a yeast cell, with concentrations and with molecules"
    reference: ClassVar[str] = "finite elements (deterministic)"
    full: ClassVar[Sequence[Mapping[str, Any]]] = [
        {"resolution": 100},
        {"resolution": 40, "reynolds": 0.025},
        {"resolution": 25},  # as many particles as the papers
    ]

    resolution: Annotated[int, Field(ge=25, le=400)] = 64
    """Particles across the channel; below 40 the cell is not resolved."""
    reynolds: Annotated[float, Field(gt=0, le=2)] = 1.0
    """Re = H v0/ν; the real one is 0.025 (Stokes similarity: see the case's description)."""
    chemistry: Literal["both", "concentrations", "molecules"] = "both"
    """How the species are carried."""
    height: Annotated[Length, Field(gt=0)] = 100e-6
    """Height H of the channel."""
    length: Annotated[Length, Field(gt=0)] = 200e-6
    """Length of the channel."""
    radius: Annotated[Length, Field(gt=0)] = 2.5e-6
    """Radius of the cell."""
    membrane: Annotated[Length, Field(gt=0)] = 1e-6
    """Thickness of the membrane, inside the radius."""
    position: Annotated[Length, Field(gt=0)] = 25e-6
    """Distance of the cell's centre from the inlet."""
    mean_velocity: Annotated[Velocity, Field(gt=0)] = 2.5e-4
    """Mean velocity v0."""
    density: Annotated[Density, Field(gt=0)] = 1000.0
    """Density of the fluid."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 347e-12
    """Diffusivity of L in fluid and membrane; L does not enter the cytoplasm."""
    concentration: Annotated[Concentration, Field(gt=0)] = 1.0
    """Concentration of L in the upper stream and of R in the membrane."""
    association: Annotated[float, Quantity("m^3/(mol*s)"), Field(ge=0)] = 1.0
    """Rate constant k of R + L → RL."""
    dissociation: Annotated[float, Quantity("1/s"), Field(ge=0)] = 1.0
    """Rate constant of RL → R + L."""
    molecules: Annotated[int, Field(ge=1)] = 1600
    """Molecules in a fluid particle at that concentration; sets the depth of the plane."""
    shifting: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Particle shifting in units of ρ c₀²: without it voids form behind the cell."""
    end: Annotated[float, Field(gt=0)] = 2.0
    """End of the run in units of H/v0."""
    frames: Annotated[int, Field(ge=4)] = 40
    """Number of frames."""

    @property
    def as_reference(self) -> bool:
        """Whether this is what the reference has been computed for; else nothing has a limit."""
        fields = type(self).model_fields
        return all(math.isclose(getattr(self, k), fields[k].default) for k in COMPARED)

    @property
    def time_unit(self) -> float:
        """H/v0 in s."""
        return self.height / self.mean_velocity

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end * self.time_unit

    @property
    def every(self) -> float:
        """Interval of frames in s."""
        return self.until / self.frames

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles in m."""
        return self.height / self.resolution

    @property
    def sponge_length(self) -> float:
        """Length of the sponge upstream of the inlet, in m: a whole number of spacings."""
        return round(0.2 * self.resolution) * self.spacing

    @property
    def outlet_length(self) -> float:
        """Length between the channel's end and the sponge, in m: more than a support."""
        return max(4, round(0.1 * self.resolution)) * self.spacing

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the cell in m."""
        return self.position, 0.5 * self.height

    def parabola(self, points: np.ndarray) -> np.ndarray:
        """Velocity (n, 2) of an empty channel at points (n, 2), in m/s."""
        y = np.clip(points[:, 1] / self.height, 0, 1)
        return np.stack([6 * self.mean_velocity * y * (1 - y), np.zeros(len(y))], axis=-1)

    def first_guess(self, points: np.ndarray) -> np.ndarray:
        """The parabola, slowed down around the cell: what the flow starts from."""
        gap = np.linalg.norm(points - np.array(self.centre), axis=1) / self.radius - 1
        return self.parabola(points) * (1 - np.exp(-np.maximum(gap, 0) / 3))[:, None]

    def inlet(self, points: np.ndarray) -> np.ndarray:
        """Concentration of L at the inlet: the upper stream carries it."""
        return np.where(points[:, 1] > 0.5 * self.height, self.concentration, 0.0)

    def build(self, context: Context) -> Simulation:
        """See :class:`~particell.cases.base.Case`."""
        dx = self.spacing
        if self.resolution < RESOLVED:
            warnings.warn(
                f"resolution = {self.resolution}: the cell is {2 * self.radius / dx:.2g} spacings "
                f"wide and its membrane {self.membrane / dx:.2g} thick: what happens there is not "
                f"resolved (from {RESOLVED} on it begins to be)",
                LawWarning,
                stacklevel=2,
            )
        depth = self.molecules / (self.concentration * AVOGADRO * dx**2)
        start = -self.sponge_length - self.outlet_length
        domain = Domain((start, 0), (self.length, self.height), periodic="x", depth=depth)
        nu = self.mean_velocity * self.height / self.reynolds
        sound_speed = self.sound_speed(nu)
        water = Fluid(
            density=self.density,
            viscosity=nu * self.density,
            sound_speed=sound_speed,
        )
        scheme = SDPD(
            gravity=(12 * nu * self.mean_velocity / self.height**2, 0.0),
            reference_speed=1.65 * self.mean_velocity,
            shifting=self.shifting,
        )
        species, reactions = self.species()
        cell = Circle(self.centre, self.radius)
        phases = self.phases(domain, water, cell)
        fluid_volume = len(phases[0].points) * dx**2
        simulation = Simulation(
            domain,
            phases,
            scheme,
            species,
            reactions,
            [
                self.sponge(species),
                MeanVelocity(self.mean_velocity * math.prod(domain.lengths) / fluid_volume),
                Reflection(cell),
                Reflection(HalfSpace((0, 0), (0, 1))),
                Reflection(HalfSpace((0, self.height), (0, -1))),
            ],
            seed=context.seed,
            device=context.device,
        )
        chemistry = simulation.chemistry
        assert chemistry is not None
        for s in species:
            if s.name.startswith("R") and not s.name.startswith("RL"):
                chemistry.set_concentration(s.name, self.concentration, "membrane")
        return simulation

    def sponge(self, species: list[Species]) -> Sponge:
        """The zone upstream of the inlet; its force keeps up with the flow's viscosity."""
        time = 3e-5 * self.time_unit * min(1.0, self.reynolds)
        targets = {s.name: self.inlet for s in species if s.name.startswith("L")}
        return Sponge(-self.sponge_length, 0.0, time, self.parabola, targets)

    def sound_speed(self, nu: float) -> float:
        """c₀ by rule: 10 U, or 10 √(Δp/ρ) with the pressure that the cell's drag costs."""
        # 15 µ v0/H over the channel (finite elements), and as much again in front of the cell
        drop = 30 * nu * self.mean_velocity / self.height
        return 10 * math.sqrt(max((1.65 * self.mean_velocity) ** 2, drop))

    def species(self) -> tuple[list[Species], list[Reaction]]:
        """L, R and RL, as concentrations, molecules or both."""
        species, reactions = [], []
        suffixes = {"both": ("", MOLECULES), "concentrations": ("",), "molecules": (MOLECULES,)}
        for suffix in suffixes[self.chemistry]:
            whole = suffix == MOLECULES
            where = {"fluid": self.diffusivity, "membrane": self.diffusivity}
            ligand, receptor, complex_ = (name + suffix for name in ("L", "R", "RL"))
            species += [
                Species(ligand, where, molecules=whole, only_in=["fluid", "membrane"]),
                Species(receptor, molecules=whole, only_in="membrane"),
                Species(complex_, molecules=whole, only_in="membrane"),
            ]
            reactions.append(
                Reaction(
                    f"{receptor} + {ligand} <-> {complex_}",
                    forward=self.association,
                    backward=self.dissociation,
                    only_in="membrane",
                )
            )
        return species, reactions

    def phases(self, domain: Domain, water: Fluid, cell: Circle) -> list[Phase]:
        """Fluid around the cell, membrane and cytoplasm on rings, and the channel's walls."""
        dx = self.spacing
        inner = self.radius - self.membrane
        membrane, membrane_area = rings(cell, inner, self.radius, min(dx, self.membrane * 1.25))
        cytoplasm, cytoplasm_area = rings(cell, 0.0, inner, dx)
        walls = channel_walls(domain, water, dx, axis=1)
        solid = np.concatenate([membrane, cytoplasm, *(w.points for w in walls)])
        points = around(domain, dx, cell, solid)
        return [
            Phase("fluid", water, points, dx**2, velocity=self.first_guess, spacing=dx),
            Phase(
                "membrane", water, membrane, membrane_area, kind="wall", spacing=dx, surface=cell
            ),
            Phase(
                "cytoplasm", water, cytoplasm, cytoplasm_area, kind="wall", spacing=dx, surface=cell
            ),
            *walls,
        ]

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """See :mod:`particell.cases.yeast_channel_results`."""
        return results.metrics(self, run)

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """See :mod:`particell.cases.yeast_channel_results`."""
        return results.figures(self, run, directory)

    def ensemble_metrics(self, ensemble: EnsembleRun) -> dict[str, Metric]:
        """See :mod:`particell.cases.yeast_channel_ensemble`."""
        found = yeast_channel_ensemble.metrics(self, ensemble)
        return {**super().ensemble_metrics(ensemble), **found}

    def ensemble_figures(self, ensemble: EnsembleRun, directory: Path) -> list[Path]:
        """See :mod:`particell.cases.yeast_channel_ensemble`."""
        made = super().ensemble_figures(ensemble, directory)
        return made + yeast_channel_ensemble.figures(self, ensemble, directory)
