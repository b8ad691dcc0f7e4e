"""Small systems of particles that many tests share, and what is exact about lattices."""

from __future__ import annotations

import csv
import itertools
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from particell.boundaries.mirror import Mirror
from particell.geometry.domain import Domain
from particell.geometry.fill import lattice
from particell.geometry.shapes import HalfSpace
from particell.kernels import LUCY, normalisation, shape_f
from particell.laws.viscosity import friction_coefficients
from particell.materials import BOLTZMANN, Fluid
from particell.operations.carriage import Carriage
from particell.operations.operation import When
from particell.phases import Phase, channel_walls, fluid
from particell.schemes.density_stages import (
    DensityRates,
    EquationOfState,
    FilterDensity,
    FluxRates,
    PredictDensity,
    WallPressure,
)
from particell.schemes.sdpd import SDPD
from particell.schemes.stages import At, Forces, KernelSums
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation

DATA = Path(__file__).parent / "data"
#: The temperature at which k_B T = 1 J.
UNIT_TEMPERATURE = 1 / BOLTZMANN


def lucy_sums() -> list[dict[str, float]]:
    """The table of lattice sums: rows with D, h (in spacings), kappa and eta (0 in 1D)."""
    with open(DATA / "lucy_lattice_sums.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    return [
        {"D": int(r[0]), "h": float(r[1]), "kappa": float(r[5]), "eta": float(r[7] or 0)}
        for r in rows[1:]
    ]


def lattice_offsets(dim: int, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n, dim) of the neighbours on the unit lattice, and V F of Lucy's kernel."""
    reach = range(-int(np.ceil(h)), int(np.ceil(h)) + 1)
    offsets = np.array([o for o in itertools.product(reach, repeat=dim) if any(o)], float)
    r = np.linalg.norm(offsets, axis=1)
    scale = normalisation(LUCY, dim) / h ** (dim + 2)
    return offsets, scale * np.array([shape_f.py_func(q, LUCY) for q in r / h])


def lattice_viscosity(
    dim: int, h: float, shear: float, bulk: float, wave: np.ndarray, along: np.ndarray
) -> float:
    """Viscous force per mass on v = e sin(k·x) on the unit lattice, over -k² v (density 1)."""
    offsets, f = lattice_offsets(dim, h)
    transverse, radial = friction_coefficients(shear, bulk, dim)
    projection = (offsets @ along) ** 2 / (offsets**2).sum(axis=1)
    turn = 2 * np.sin(0.5 * offsets @ wave) ** 2
    return float((f * (transverse + radial * projection) * turn).sum() / (wave @ wave))


def unit_fluid(**options: float) -> Fluid:
    """A fluid of density 1 and, unless given, viscosity 0.1 and sound speed 10."""
    return Fluid(**{"density": 1.0, "viscosity": 0.1, "sound_speed": 10.0, **options})


def periodic_lattice(
    side: int | tuple[int, ...],
    dim: int = 2,
    material: Fluid | None = None,
    jitter: float = 0.0,
    velocity=None,
    seed: int = 1,
    dt: float | str = "auto",
    boundaries=(),
    device=None,
    **scheme,
) -> Simulation:
    """Particles of volume 1 on a unit lattice that fills a periodic box of ``side`` spacings."""
    sides = (side,) * dim if isinstance(side, int) else side
    dim = len(sides)
    domain = Domain((0,) * dim, sides, periodic="xyz"[:dim], depth=1.0)
    phase = fluid(domain, material or unit_fluid(), 1.0)
    noise = np.random.default_rng(5).uniform(-jitter, jitter, phase.points.shape)
    points = (phase.points + noise) % np.array(sides)
    phase = Phase("fluid", phase.material, points, 1.0, velocity=velocity)
    scheme = {"density_diffusion": 0.0, **scheme}
    return Simulation(
        domain, phase, SDPD(**scheme), seed=seed, dt=dt, boundaries=boundaries, device=device
    )


def vortices(side: float):
    """Taylor and Green's, of speed 1, of period ``side``: velocities (n, D) at x (n, D)."""
    wave = 2 * np.pi / side

    def velocity(x):
        u = np.zeros_like(x)
        u[:, 0] = -np.cos(wave * x[:, 0]) * np.sin(wave * x[:, 1])
        u[:, 1] = np.sin(wave * x[:, 0]) * np.cos(wave * x[:, 1])
        return u

    return velocity


def transported_lattice(
    dim: int,
    side: int = 10,
    jitter: float = 0.0,
    velocity=None,
    species=(),
    dt: float | str = "auto",
    material: Fluid | None = None,
    seed: int = 0,
    periodic: bool = True,
    device=None,
    **scheme,
) -> Simulation:
    """As periodic_lattice, with a transport velocity."""
    axes = "xyz"[:dim] if periodic else ""
    domain = Domain((0,) * dim, (side,) * dim, periodic=axes, depth=1.0)
    points = lattice(domain, 1.0)
    noise = np.random.default_rng(5).uniform(-jitter, jitter, points.shape)
    points = (points + noise) % side
    phase = Phase("fluid", material or unit_fluid(), points, 1.0, velocity=velocity)
    made = TransportVelocity(**scheme)
    return Simulation(domain, phase, made, species=species, dt=dt, seed=seed, device=device)


def beside_a_mirror(device=None) -> Simulation:
    """Particles that move in front of a mirror."""
    domain = Domain((0, 0), (6, 5), periodic="x", depth=1.0)
    inside = fluid(domain, unit_fluid(), 1.0, velocity=lambda x: np.sin(x))
    floor = Mirror(HalfSpace((0, 0), (0, 1)), slip=False, velocity=(0.3, 0.0))
    scheme = SDPD(support=2.2, skin=0.3)
    return Simulation(domain, inside, scheme, boundaries=[floor], dt=0.01, device=device)


def channel(
    side: tuple[int, int],
    material: Fluid | None = None,
    velocity=None,
    wall_velocity=(None, None),
    boundaries=(),
    device=None,
    seed: int = 1,
    jitter: float = 0.0,
    **scheme,
) -> Simulation:
    """Unit lattice between walls across y; periodic along x; units as in periodic_lattice."""
    domain = Domain((0, 0), side, periodic="x", depth=1.0)
    material = material or unit_fluid()
    inside = fluid(domain, material, 1.0)
    noise = np.random.default_rng(5).uniform(-jitter, jitter, inside.points.shape)
    inside = Phase("fluid", material, inside.points + noise, 1.0, velocity=velocity)
    walls = channel_walls(domain, material, 1.0, axis=1, velocity=wall_velocity)
    scheme = {"density_diffusion": 0.0, **scheme}
    return Simulation(
        domain, [inside, *walls], SDPD(**scheme), seed=seed, boundaries=boundaries, device=device
    )


def fluid_rows(simulation: Simulation) -> np.ndarray:
    """Mask, in memory order, of the particles that are no walls."""
    return simulation.particles.host("is_wall") == 0


def standard_errors(comparisons: int, blocks: int) -> float:
    """How many standard errors, each taken from that many independent blocks, a mean may be off.

    By Student's law, so that the false-alarm rate of all comparisons together is 1e-6: few blocks
    know their own standard error badly.
    """
    return float(stats.t.isf(0.5e-6 / comparisons, blocks - 1))


def same_bits(one: Simulation, two: Simulation) -> list[str]:
    """Names of the fields that differ in any bit."""
    first, second = one.state()["fields"], two.state()["fields"]
    return [name for name in first if first[name].tobytes() != second[name].tobytes()]


def resting_poiseuille_error(scheme, ny: int, surface: bool = True) -> float:
    """L2 error of the steady velocity between plates on a resting lattice; its largest is 1.

    The viscous force there is a linear function of the rows' velocities: its matrix, column by
    column, from the sweep itself. Without ``surface`` the walls do not know where theirs is.
    """
    domain = Domain((0, 0), (8, ny), periodic="x", depth=1.0)
    material = unit_fluid(viscosity=1.0, sound_speed=1.0)
    walls = channel_walls(domain, material, 1.0, axis=1)
    if not surface:
        walls = [replace(wall, surface=None) for wall in walls]
    simulation = Simulation(domain, [fluid(domain, material, 1.0), *walls], scheme)
    simulation.start()
    p = simulation.particles
    inside = fluid_rows(simulation)
    row = np.floor(p.host("x")[:, 1]).astype(int)
    first = [np.flatnonzero(inside & (row == k))[0] for k in range(ny)]
    matrix = np.empty((ny, ny))
    for k in range(ny):
        p.set("v", ((row == k) & inside)[:, None] * np.array([1.0, 0.0]))
        forces(simulation, 0, 1.0)
        matrix[:, k] = p.host("a")[first, 0]
    u, s = np.linalg.solve(matrix, np.full(ny, -8 / ny**2)), p.host("x")[first, 1] / ny
    return float(np.sqrt(((u - 4 * s * (1 - s)) ** 2).mean()))


@contextmanager
def clock_at(simulation: Simulation, step: int, dt: float):
    """The simulation's clock at a step's number, with a time step in s."""
    clock = simulation.system.clock
    before = clock.step, clock.dt
    clock.step, clock.dt = step, dt
    yield
    clock.step, clock.dt = before


def forces(simulation: Simulation, step: int = 0, dt: float = 1.0) -> None:
    """Accelerations, with the noise of that step."""
    sums = [KernelSums()] if simulation.scheme.normalise_viscosity else []
    with clock_at(simulation, step, dt):
        simulation.solver.do(*sums, Forces(ahead=0))


def densities(simulation: Simulation) -> None:
    """Pressures and volumes of the densities that there are."""
    simulation.solver.do(EquationOfState(), At(When.FORCES), WallPressure())


def density_rates(simulation: Simulation) -> None:
    """The density's rate (and the flux of momentum) of the state as it is."""
    stages = simulation.solver.stages
    (rates,) = [stage for stage in stages if isinstance(stage, DensityRates | FluxRates)]
    with clock_at(simulation, 0, 1e-300):
        simulation.solver.do(PredictDensity(), rates)


def filter_density(simulation: Simulation) -> None:
    """The density filter, once."""
    simulation.solver.do(FilterDensity())
    densities(simulation)


def carriage(simulation: Simulation) -> Carriage:
    """What moves species with the shift."""
    found = simulation.operations.by_name["Carriage"]
    assert isinstance(found, Carriage)
    return found


def carry_species(simulation: Simulation, step: int, tau: float) -> None:
    """What the shift carries of species during tau."""
    with clock_at(simulation, step, tau):
        carriage(simulation)(simulation.system)
