"""Speed of the parts and of whole steps on this machine: ``particell bench``.

The flow is a Taylor–Green vortex with U = 0.1 c₀ at the automatic time step, so that neighbour
lists are rebuilt as in a real run. Every figure is the best of several repeats, since other work on
a machine only ever slows a measurement down.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from particell.chemistry.species import Species
from particell.compute.threads import set_threads
from particell.geometry.domain import Domain
from particell.materials import BOLTZMANN, Fluid
from particell.output.files import write_json
from particell.phases import box_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.static import Static
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation

SIZE = {2: 200, 3: 34}
SUPPORT = {2: 3.0, 3: 2.8}
SKIN = {2: 0.1, 3: 0.2}
STEPS = {2: 40, 3: 8}
VISCOSITY = 1e-3
REPEATS = 5


def vortex(points: np.ndarray) -> np.ndarray:
    """Taylor–Green velocity of amplitude 1 in the unit box, shape (n, D)."""
    k = 2 * math.pi
    v = np.zeros_like(points)
    v[:, 0] = -np.cos(k * points[:, 0]) * np.sin(k * points[:, 1])
    v[:, 1] = np.sin(k * points[:, 0]) * np.cos(k * points[:, 1])
    return v


def flow(dim: int, fluctuations: bool, species: Sequence[Species] = ()) -> Simulation:
    """The moving vortex, with or without thermal noise (of a thousandth of the flow's energy)."""
    n = SIZE[dim]
    domain = Domain((0,) * dim, (1,) * dim, periodic="xyz"[:dim], depth=1.0)
    mass = (1 / n) ** dim
    material = Fluid(
        density=1.0,
        viscosity=VISCOSITY,
        temperature=1e-3 * mass / BOLTZMANN,
        sound_speed=10.0,
    )
    scheme = SDPD(support=SUPPORT[dim], fluctuations=fluctuations, skin=SKIN[dim])
    inside = fluid(domain, material, 1 / n, velocity=vortex)
    return Simulation(domain, inside, scheme, species, normalise_diffusion=True)


def walled(impenetrable: bool = True) -> Simulation:
    """The vortex in a closed box with no-slip walls, by the transport-velocity scheme."""
    n = SIZE[2]
    domain = Domain((0, 0), (1, 1), depth=1.0)
    material = Fluid(density=1.0, viscosity=VISCOSITY, sound_speed=10.0)
    inside = fluid(domain, material, 1 / n, velocity=lambda x: vortex(x + 0.25))
    scheme = TransportVelocity(support=SUPPORT[2], impenetrable=impenetrable)
    return Simulation(domain, [inside, *box_walls(domain, material, 1 / n)], scheme)


def molecules(number: int) -> Simulation:
    """Particles at rest with ``number`` diffusing molecules each, Λτ = 0.3 at dt."""
    n = SIZE[2]
    domain = Domain((0, 0), (1, 1), periodic="xy", depth=1.0)
    material = Fluid(density=1.0, viscosity=1.0, sound_speed=1.0)
    simulation = Simulation(
        domain,
        fluid(domain, material, 1 / n),
        Static(support=SUPPORT[2], skin=0.1),
        [Species("A", diffusivity=1.0, molecules=True)],
        dt=1.0,
    )
    chemistry = simulation.chemistry
    assert chemistry is not None
    chemistry.set_count("A", number)
    # Lucy's kernel in 2D: Λ = 2κ Σ V F = 20 κ/h²
    simulation.dt = 0.3 * (SUPPORT[2] / n) ** 2 / 20
    return simulation


def best_time(work: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of several calls."""
    best = math.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begin)
    return best


def entry(
    name: str, simulation: Simulation, threads: int, per_second: float, **more: Any
) -> dict[str, Any]:
    """One row of the result."""
    neighbours = simulation.neighbours
    neighbours.want("rows")
    rows = simulation.device.to_host(neighbours.stop) - simulation.device.to_host(neighbours.start)
    return {
        "name": name,
        "particles": len(simulation.particles),
        "neighbours": inside_support(simulation),
        "listed": float(rows.mean()),
        "skin": float(neighbours.skin / neighbours.support),
        "precision": str(simulation.device.real),
        "threads": threads,
        "per_second": per_second,
        **more,
    }


def inside_support(simulation: Simulation) -> float:
    """Mean number of neighbours within the support: that of a particle of a uniform fluid."""
    dim = simulation.domain.dim
    ball = {1: 2.0, 2: math.pi, 3: 4 / 3 * math.pi}[dim]
    return round(ball * SUPPORT[dim] ** dim, 1)


def flow_entries(dim: int, threads: int) -> list[dict[str, Any]]:
    """Rates sweep and whole steps, in particles per second."""
    rows = []
    for noise in (False, True):
        simulation = flow(dim, noise)
        simulation.advance(STEPS[dim])
        n = len(simulation.particles)
        if not noise:
            flow_ = simulation.solver.flow
            run, numbers = flow_.bound(flow_.sweeps().forces(density=True)), flow_.numbers(0)

            def sweep(run: Any = run, n: int = n, numbers: Any = numbers) -> None:
                for _ in range(5):
                    run(n, **numbers)

            sweep()
            rows.append(entry(f"rates sweep {dim}D", simulation, threads, 5 * n / best_time(sweep)))
            simulation.solver.start()
        builds, steps = simulation.neighbours.builds, simulation.step

        number = STEPS[dim]

        def step(simulation: Simulation = simulation, number: int = number) -> None:
            simulation.advance(number)

        seconds = best_time(step)
        built = simulation.neighbours.builds - builds
        name = f"velocity-Verlet step {dim}D, " + ("bounded noise" if noise else "no noise")
        every = (simulation.step - steps) / max(1, built)
        rows.append(
            entry(name, simulation, threads, number * n / seconds, steps_per_build=round(every, 1))
        )
    return rows


def wall_entries(threads: int) -> list[dict[str, Any]]:
    """Whole steps with walls that nothing penetrates, in particles (walls included) per second."""
    simulation = walled()
    number = STEPS[2]
    simulation.advance(number)
    builds, steps = simulation.neighbours.builds, simulation.step
    seconds = best_time(lambda: simulation.advance(number))
    every = (simulation.step - steps) / max(1, simulation.neighbours.builds - builds)
    rate = number * len(simulation.particles) / seconds
    name = "transport-velocity step 2D, walls"
    return [entry(name, simulation, threads, rate, steps_per_build=round(every, 1))]


def molecule_entries(threads: int) -> list[dict[str, Any]]:
    """Jumps per second at 20 molecules a particle; particles per second at 200 and 2000."""
    rows = []
    for number in (20, 200, 2000):
        simulation = molecules(number)
        simulation.advance(2)
        chemistry = simulation.chemistry
        assert chemistry is not None
        jumps, steps = chemistry.jumps, simulation.step

        def step(simulation: Simulation = simulation) -> None:
            simulation.advance(1)

        seconds = best_time(step, 15)
        per_step = (chemistry.jumps - jumps) / (simulation.step - steps)
        rows.append(
            entry(
                f"diffusion of molecules, {number} a particle",
                simulation,
                threads,
                len(simulation.particles) / seconds,
                jumps_per_second=per_step / seconds,
            )
        )
    return rows


def carried_entries(threads: int) -> list[dict[str, Any]]:
    """Steps of the species in a flow, where what depends on places is made anew in each."""
    rows = []
    diffusivity = 0.01 * VISCOSITY
    for name, species in (
        ("concentration", [Species("A", diffusivity)]),
        ("molecules, 20 a particle", [Species("A", diffusivity, molecules=True)]),
    ):
        simulation = flow(2, False, species)
        simulation.advance(2)
        chemistry = simulation.chemistry
        assert chemistry is not None
        if chemistry.species["A"].molecules:
            chemistry.set_count("A", 20)
        else:
            chemistry.set_concentration("A", 1.0)

        def step(simulation: Simulation = simulation) -> None:
            simulation.chemistry.step(simulation.step, simulation.dt)  # type: ignore[union-attr]

        step()
        rate = len(simulation.particles) / best_time(step, 15)
        rows.append(entry(f"species in a flow 2D: {name}", simulation, threads, rate))
    return rows


def main(json_file: str | Path | None = None) -> list[dict[str, Any]]:
    """Measure with one thread and with all, print a table, and write JSON if asked.

    Parameters
    ----------
    json_file
        Where to write the list of results.

    Returns
    -------
    list of dict
        One entry a measurement; ``per_second`` counts particles.
    """
    rows: list[dict[str, Any]] = []
    every = set_threads(None)
    try:
        for threads in sorted({1, every}):
            set_threads(threads)
            for dim in (2, 3):
                rows += flow_entries(dim, threads)
            rows += wall_entries(threads)
            rows += molecule_entries(threads) + carried_entries(threads)
    finally:
        set_threads(every)
    for row in rows:
        extra = ""
        if "jumps_per_second" in row:
            extra = f"  {row['jumps_per_second'] / 1e6:7.2f} M jumps/s"
        if "steps_per_build" in row:
            extra = f"  list built every {row['steps_per_build']} steps"
        print(
            f"{row['name']:<42} {row['threads']:>3} threads {row['neighbours']:>6} neighbours "
            f"{row['per_second'] / 1e6:8.2f} M/s{extra}"
        )
    if json_file is not None:
        write_json(json_file, rows)
    return rows
