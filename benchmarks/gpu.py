"""What a GPU makes of Particell's loops: agreement with the CPU, speed beside memory bandwidth.

    python benchmarks/gpu.py [--only agreement|speed] [--seconds 330] [--json benchmarks/gpu.json]

Needs a CUDA GPU and the extra 'cuda'. First small systems of every kind are started on both
devices: each sweep is run by itself, then whole steps, and fields are compared. Then a Taylor–Green
vortex is timed, in 2D and 3D, in float64 and float32, at growing sizes until the time is up: the
sweep over pairs, the decision whether the neighbour list holds, the sort, a build, whole steps. The
file is written after each row, so that a run that is killed leaves what it has.

``--dry`` takes a few particles, to see that the script runs (without a GPU on Numba's simulator:
``NUMBA_ENABLE_CUDASIM=1``).
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import cuda

import particell as pc
from particell.bench import SKIN, SUPPORT, VISCOSITY, vortex
from particell.compute.device import Device
from particell.compute.simulator import simulating
from particell.materials import AVOGADRO, BOLTZMANN
from particell.output.files import write_json

#: Particles along an edge: 1e4 … 4e6 in 2D, 1e4 … 4e6 in 3D.
SIZES = {2: (100, 316, 1000, 2000), 3: (22, 46, 100, 160)}
DRY = {2: (7,)}
#: Bytes that the bandwidth is measured with.
COPIED = 1 << 30


def flow(dim: int, n: int, noise: bool, device: Device) -> pc.Simulation:
    """The vortex of ``particell bench`` with n particles along an edge."""
    domain = pc.Domain((0,) * dim, (1,) * dim, periodic="xyz"[:dim], depth=1.0)
    temperature = 1e-3 * (1 / n) ** dim / BOLTZMANN
    material = pc.Fluid(1.0, VISCOSITY, temperature=temperature, sound_speed=10.0)
    options: dict[str, Any] = {"density": "summation"} if noise else {}
    scheme = pc.SDPD(support=SUPPORT[dim], fluctuations=noise, skin=SKIN[dim], **options)
    inside = pc.fluid(domain, material, 1 / n, velocity=vortex)
    return pc.Simulation(domain, inside, scheme, device=device)


def hot_channel(device: Device) -> pc.Simulation:
    """Noise beside walls, at which all scales are one."""
    domain = pc.Domain((0, 0), (12, 8), periodic="x", depth=1.0)
    material = pc.Fluid(1.0, 5.0, temperature=1 / BOLTZMANN, sound_speed=30.0)
    plates = pc.channel_walls(domain, material, 1.0, axis=1)
    scheme = pc.SDPD(fluctuations=True, density="summation")
    inside = [pc.fluid(domain, material, 1.0), *plates]
    return pc.Simulation(domain, inside, scheme, device=device)


def channel(device: Device) -> pc.Simulation:
    """Transport velocity between plates of which one moves, with species of both kinds."""
    domain = pc.Domain((0, 0), (12, 8), periodic="x", depth=1.0)
    material = pc.Fluid(1.0, 0.1, sound_speed=10.0)
    plates = pc.channel_walls(domain, material, 1.0, axis=1, velocity=(None, (0.5, 0.0)))
    species = [pc.Species("A", 0.05), pc.Species("B", 0.05, molecules=True)]
    simulation = pc.Simulation(
        domain,
        [pc.fluid(domain, material, 1.0), *plates],
        pc.TransportVelocity(gravity=(0.01, 0.0), species_flux=True),
        species,
        [pc.Reaction("B -> 0", 0.1)],
        device=device,
    )
    assert simulation.chemistry is not None
    simulation.chemistry.set_concentration("A", lambda x: x[:, 0])
    simulation.chemistry.set_concentration("B", lambda x: 20 * x[:, 0] / AVOGADRO)
    return simulation


SYSTEMS: dict[str, Callable[[Device], pc.Simulation]] = {
    "SDPD 2D": lambda device: flow(2, 20, False, device),
    "SDPD 2D noise": lambda device: flow(2, 20, True, device),
    "SDPD 3D": lambda device: flow(3, 10, False, device),
    "SDPD 3D noise": lambda device: flow(3, 10, True, device),
    "SDPD noise, walls": hot_channel,
    "transport velocity, walls, species": channel,
}


class Written:
    """Results, and the file that they are written to whenever there are more."""

    def __init__(self, path: str | None):
        self.path, self.found = path, dict[str, Any]()

    def put(self, **more: Any) -> None:
        """Keep, and write."""
        self.found |= more
        if self.path:
            write_json(Path(self.path), self.found)

    def fail(self, what: str, error: Exception) -> None:
        """Keep that something failed, and say where."""
        traceback.print_exception(error)
        print(f"{what}: FAILED", flush=True)
        self.put(failed=[*self.found.get("failed", []), f"{what}: {type(error).__name__}: {error}"])


def gap(one: pc.Simulation, other: pc.Simulation, names: Any) -> tuple[float, str]:
    """Largest difference of fields relative to their largest values, and whose it is."""
    worst = (0.0, "")
    for name in names:
        here, there = (s.particles.by_id(name).astype(float) for s in (one, other))
        finite = np.isfinite(here)
        scale = np.abs(here[finite]).max(initial=0.0) or 1.0
        worst = max(worst, (float(np.abs(here - there)[finite].max(initial=0.0) / scale), name))
    return worst


def compared(make: Callable[[Device], pc.Simulation], steps: int, precision: str) -> dict[str, Any]:
    """Differences between the devices after each sweep by itself, then after steps."""
    here, there = (make(d) for d in (Device(form="gather"), Device("cuda", precision)))
    found: dict[str, Any] = {}
    for simulation in (here, there):
        simulation.start()
    for sweep in here.solver.descriptions():
        for simulation in (here, there):
            flow = simulation.solver.flow
            flow.bound(sweep)(len(simulation.particles), **flow.numbers(1))
        found[f"sweep {sweep.name}"] = gap(here, there, sweep.writes())
    here, there = (make(d) for d in (Device(form="gather"), Device("cuda", precision)))
    for simulation in (here, there):
        simulation.advance(steps)
    found[f"{steps} steps"] = gap(here, there, here.particles)
    return found


def agreement(written: Written, dry: bool) -> None:
    """Of all systems in float64, of those without molecules in float32 too."""
    found: dict[str, Any] = {}
    systems = {"SDPD 2D": lambda device: flow(2, 7, False, device)} if dry else SYSTEMS
    for label, make in systems.items():
        for precision in ("float64", "float32"):
            if (dry and found) or (precision == "float32" and make is channel):
                continue
            try:
                rows = compared(make, 1 if dry else 5, precision)
            except Exception as error:  # the others are worth knowing still
                written.fail(f"{label}, {precision}", error)
                continue
            found[f"{label}, {precision}"] = rows
            written.put(agreement=found)
            shown = ", ".join(f"{what} {gap:.1e} ({name})" for what, (gap, name) in rows.items())
            print(f"{label}, {precision}: {shown}", flush=True)


def timed(work: Callable[[], object], repeats: int = 5) -> float:
    """Seconds of the fastest of several calls, each until the GPU is done; of one if simulated."""
    if simulating():
        repeats = 1
    else:
        work()
    best = math.inf
    for _ in range(repeats):
        cuda.synchronize()
        begin = time.perf_counter()
        work()
        cuda.synchronize()
        best = min(best, time.perf_counter() - begin)
    return best


def bandwidth(size: int) -> float:
    """Bytes a second that a copy within the GPU's memory reads and writes."""
    a, b = (cuda.device_array(size // 8, np.float64) for _ in range(2))
    return 2 * a.nbytes / timed(lambda: b.copy_to_device(a))


def launches() -> dict[str, float]:
    """Seconds of the host for one loop over few particles, and for a step of a few."""
    device = Device("cuda")
    few, others, order = device.zeros((64, 2)), device.zeros((64, 2)), device.zeros(64, np.int64)
    simulation = flow(2, 7, False, device)
    simulation.advance(1)
    return {
        "permutation of an array": timed(lambda: device.permute(few, order, others), 20),
        "step": timed(simulation.solver.step, 20),
    }


def least_bytes(simulation: pc.Simulation, sweep: Any) -> float:
    """Bytes that a sweep cannot but move: fields read and written once, and its rows."""
    particles, neighbours = simulation.particles, simulation.neighbours
    names = {*sweep.reads(), *sweep.reads_of_neighbours(), *sweep.writes()} & set(particles)
    arrays = sum(particles[name].nbytes for name in names)
    host = simulation.device.to_host
    return arrays + 4 * float((host(neighbours.stop) - host(neighbours.start)).sum())


def measured(dim: int, n: int, noise: bool, precision: str, copies: float) -> dict[str, Any]:
    """Speeds of one system, in particles a second."""
    simulation = flow(dim, n, noise, Device("cuda", precision))
    simulation.advance(1 if simulating() else 3)
    solver, number = simulation.solver, len(simulation.particles)
    neighbours, p = simulation.neighbours, simulation.particles
    flow_ = solver.flow
    sweep = next(s for s in solver.descriptions() if s.name in ("forces", "rates"))
    run, numbers = flow_.bound(sweep), flow_.numbers(0)
    seconds = timed(lambda: run(number, **numbers))
    given = (neighbours.cell, p["id"], neighbours.cell_start, neighbours.order)
    row: dict[str, Any] = {
        "system": f"{dim}D {'noise' if noise else 'no noise'}",
        "precision": precision,
        "particles": number,
        "sweep": number / seconds,
        "part of bandwidth": least_bytes(simulation, sweep) / seconds / copies,
        "decision": number / timed(lambda: neighbours.needs_build(p["x"], p["v"], solver.state.dt)),
        "sort": number / timed(lambda: neighbours._on_gpu.sort(*given), 2),
        "list": number / timed(solver.build_list, 2),
    }
    steps, builds = 1 if simulating() else 10, neighbours.builds
    done = solver.state.step
    row["step"] = steps * number / timed(lambda: [solver.step() for _ in range(steps)], 2)
    row["builds a step"] = (neighbours.builds - builds) / (solver.state.step - done)
    simulation.check()
    return row


def speeds(written: Written, until: float, dry: bool) -> None:
    """Rows of :func:`measured`, small systems first, until the time is up."""
    copies = bandwidth(1 << 12 if dry else COPIED)
    written.put(bandwidth=copies, launches=launches())
    print(f"copies move {copies / 1e12:.2f} TB/s; {written.found['launches']}", flush=True)
    rows: list[dict[str, Any]] = []
    sizes, precisions = (DRY, ("float64",)) if dry else (SIZES, ("float64", "float32"))
    for k in range(max(map(len, sizes.values()))):
        for dim, edges in sizes.items():
            for noise in (False,) if dry else (False, True):
                for precision in precisions:
                    if k >= len(edges) or time.monotonic() > until:
                        continue
                    try:
                        row = measured(dim, edges[k], noise, precision, copies)
                    except Exception as error:
                        written.fail(f"{dim}D, {edges[k]}, {noise=}, {precision}", error)
                        continue
                    rows.append(row)
                    written.put(speed=rows)
                    parts = ("sweep", "decision", "sort", "list", "step")
                    shown = ", ".join(f"{w} {row[w] / 1e6:.1f} M/s" for w in parts)
                    print(
                        f"{row['system']:<12} {precision} {row['particles']:>9}: {shown}, "
                        f"{row['builds a step']:.2f} lists a step, "
                        f"{row['part of bandwidth']:.2f} of the bandwidth",
                        flush=True,
                    )


def main() -> int:
    """Compare, measure, print; 1 where something failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=["agreement", "speed"])
    parser.add_argument("--seconds", type=float, default=330)
    parser.add_argument("--json")
    parser.add_argument("--dry", action="store_true")
    options = parser.parse_args()
    until = time.monotonic() + options.seconds
    name: Any = "simulator" if simulating() else cuda.get_current_device().name
    written = Written(options.json)
    written.put(device=name.decode() if isinstance(name, bytes) else name, version=pc.__version__)
    if options.only != "speed":
        agreement(written, options.dry)
    if options.only != "agreement":
        speeds(written, until, options.dry)
    return int("failed" in written.found)


if __name__ == "__main__":
    sys.exit(main())
