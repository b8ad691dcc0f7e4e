r"""The diffusivity that particles really have: the decay of one Fourier mode.

A steady state does not depend on the diffusivity, so an error of 10 to 30 % in it can hide there;
the decay of :math:`C = C_0 (1 + \tfrac12\cos kx)` in a periodic box shows it,

.. math:: a(t) = a(0)\, e^{-D k^2 t}.

The box is one wavelength long and a few supports wide. The same particles carry the species as
concentrations and as molecules. What is left with the kernel sum divided out is the finite
wavelength, :math:`-\tfrac1{24}k^2 \sum V F x^4 / \tfrac12\sum V F x^2` on lattices: −0.08 % for
nearest neighbours and 64 spacings, a few times that for wider supports.

References
----------
Monaghan, Rep. Prog. Phys. 68 (2005) 1703, for the sum itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from particell import plots
from particell.analysis.statistics import decay_rate
from particell.cases.base import Case, Context, Diffusivity, Length, Metric
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import arranged, lattice
from particell.kernels import kernel_code, normalisation, shape_f
from particell.materials import AVOGADRO, Fluid
from particell.output.run import Run
from particell.phases import Phase
from particell.schemes.static import Static
from particell.simulation import Simulation

#: What an arrangement whose sum is normalised must keep.
LIMIT = 1e-2
#: Support in spacings from which on it does; with less, disorder costs up to 2 %.
ENOUGH = {"square": 0.0, "hexagonal": 0.0, "packed": 2.4, "jittered": 3.0}
#: Distance of neighbours of the hexagonal lattice with the area of a square one.
HEXAGONAL = math.sqrt(2 / math.sqrt(3))
#: Dimensions and arrangements of the table.
ARRANGEMENTS = (
    (1, "square"),
    (2, "square"),
    (2, "hexagonal"),
    (2, "jittered"),
    (2, "packed"),
    (3, "square"),
)


def on_lattice(kernel: str, support: float, dim: int) -> float:
    """Effective over given diffusivity on the square (cubic) lattice without normalisation."""
    reach = math.ceil(support)
    cube = Domain([-reach - 0.5] * dim, [reach + 0.5] * dim)
    r = np.linalg.norm(lattice(cube, 1.0), axis=1)
    code = kernel_code(kernel)
    shape = np.array([shape_f.py_func(q, code) if q > 0 else 0.0 for q in r / support])
    return float(np.sum(shape * r**2) * normalisation(code, dim) / support ** (dim + 2) / dim)


class EffectiveDiffusivity(Case):
    """The diffusivity that a Fourier mode decays with."""

    name = "effective-diffusivity"
    title = "The diffusivity that a Fourier mode decays with, on any arrangement of particles"
    reference: ClassVar[str] = "exact decay rate"
    full: ClassVar[Sequence[Mapping[str, Any]]] = [
        {"dimensions": d, "arrangement": a, "support": h, "normalise": n}
        for d, a in ARRANGEMENTS
        for h in (1.8, 2.4, 3.0)
        if d < 3 or h < 3  # 113 neighbours of 4096 particles take minutes
        for n in (True, False)
    ]

    dimensions: Annotated[int, Field(ge=1, le=3)] = 2
    """Number of dimensions."""
    arrangement: Literal["square", "hexagonal", "jittered", "packed"] = "packed"
    """How the particles are placed; ``square`` is a line in 1D and cubic in 3D."""
    support: Annotated[float, Field(ge=1.2, le=6)] = 2.4
    """Support of the kernel in particle spacings."""
    kernel: Literal["lucy", "wendland-c2", "cubic-spline", "quintic-spline"] = "lucy"
    """The smoothing kernel."""
    normalise: bool = True
    """Whether to divide by the kernel sum."""
    wavelength: Annotated[int, Field(ge=16, le=512)] = 64
    """Wavelength in particle spacings."""
    spacing: Annotated[Length, Field(gt=0)] = 1e-6
    """Distance of the particles."""
    diffusivity: Annotated[Diffusivity, Field(gt=0)] = 1e-10
    """Diffusivity κ that is asked for."""
    molecules: Annotated[int, Field(ge=1, le=10**9)] = 10**8
    """Mean number of molecules in a particle."""
    end: Annotated[float, Field(gt=0, le=3)] = 0.5
    """End of the run in units of 1/(κk²)."""

    @property
    def wave_number(self) -> float:
        """k in 1/m."""
        length = float(self.wavelength)
        if self.arrangement == "hexagonal":
            length = HEXAGONAL * round(length / HEXAGONAL)
        return 2 * math.pi / (length * self.spacing)

    @property
    def until(self) -> float:
        """End of the run in s."""
        return self.end / (self.diffusivity * self.wave_number**2)

    @property
    def every(self) -> float:
        """Time between frames in s."""
        return self.until / 20

    @property
    def concentration(self) -> float:
        """Mean concentration in mol/m³; missing dimensions are one spacing deep."""
        return self.molecules / (AVOGADRO * self.spacing**3)

    def build(self, context: Context) -> Simulation:
        """A periodic box with a wave in it."""
        if self.arrangement == "hexagonal" and self.dimensions != 2:
            raise InputError("arrangement", self.arrangement, "another one where it is not 2D")
        across = max(8, 2 * math.ceil(1.2 * self.support))
        numbers = [float(self.wavelength), across, across][: self.dimensions]
        if self.arrangement == "hexagonal":
            # whole cells of the regular lattice, of which no direction is stretched
            height = HEXAGONAL * math.sqrt(3)
            numbers = [
                HEXAGONAL * round(self.wavelength / HEXAGONAL),
                height * math.ceil(across / height),
            ]
        upper = [self.spacing * number for number in numbers]
        domain = Domain([0.0] * self.dimensions, upper, "xyz"[: self.dimensions], self.spacing)
        points = arranged(domain, self.spacing, self.arrangement, context.seed)
        body = Phase(
            "fluid",
            Fluid(density=1000.0, viscosity=1e-3),
            points,
            domain.volume / len(points),
            spacing=self.spacing,
        )
        simulation = Simulation(
            domain,
            body,
            Static(kernel=self.kernel, support=self.support),
            [
                Species("C", self.diffusivity),
                Species("C_molecules", self.diffusivity, molecules=True),
            ],
            seed=context.seed,
            device=context.device,
            normalise_diffusion=self.normalise,
        )
        assert simulation.chemistry is not None
        for name in ("C", "C_molecules"):
            simulation.chemistry.set_concentration(name, self.wave)
        return simulation

    def wave(self, points: np.ndarray) -> np.ndarray:
        """C (n,) in mol/m³ at t = 0."""
        return self.concentration * (1 + 0.5 * np.cos(self.wave_number * points[:, 0]))

    def amplitudes(self, run: Run, name: str) -> np.ndarray:
        """Amplitude of the wave over the mean, (frames,); its phase is left free."""
        x = run.field("position")[0][:, 0]
        factor = np.exp(1j * self.wave_number * x)
        field = run.field(f"concentration/{name}")
        values = np.array([field[k] for k in range(len(run))]) / self.concentration - 1
        return 2 * np.abs(values @ factor) / len(x)

    def ratio(self, run: Run, name: str) -> float:
        """Diffusivity of the decay over κ; the first frames are left to forget the start."""
        amplitude = self.amplitudes(run, name)[5:]
        rate = decay_rate(run.times[5:], amplitude).rate
        return rate / (self.diffusivity * self.wave_number**2)

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Both ways of carrying the species, and one against the other."""
        first, second = (self.ratio(run, name) for name in ("C", "C_molecules"))
        enough = self.support >= ENOUGH[self.arrangement]
        limit = LIMIT if self.normalise and enough else None
        # The explicit step shrinks a mode by 1 - r dt where the exact walks shrink it by
        # exp(-r dt): what is compared is the same r.
        asked = self.diffusivity * self.wave_number**2
        exact = -math.expm1(-first * asked * simulation.dt) / (simulation.dt * asked)
        # amplitudes near 0.4 have deviations of sqrt(2/N): 6 sigma of their slope, generously
        total = self.molecules * len(run.static["id"])
        doubt = 6 * math.sqrt(2 / total) / 0.3 / self.end * 4
        return {
            "diffusivity_error": Metric(first - 1, limit=limit),
            "diffusivity_error_molecules": Metric(second - 1, limit=limit),
            "molecules_against_concentrations": Metric(second - exact, limit=max(doubt, 1e-4)),
        }

    def figures(self, run: Run, directory: Path) -> list[Path]:
        """The decay."""
        exact = 0.5 * np.exp(-self.end * run.times / self.until)
        figure = plots.time_series(
            run.times,
            {"concentrations": self.amplitudes(run, "C"),
             "molecules": self.amplitudes(run, "C_molecules")},
            reference={"exp(-κk²t)": exact},
            ylabel="amplitude of the mode over the mean",
            logarithmic=True,
        )  # fmt: skip
        return [plots.save(figure, directory / "decay.png")]
