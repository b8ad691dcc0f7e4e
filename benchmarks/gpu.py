"""What a GPU makes of Particell's loops: agreement with the CPU, speed beside memory bandwidth.

    python benchmarks/gpu.py [--only agreement|speed] [--seconds 240] [--json benchmarks/gpu.json]

Needs a CUDA GPU and the extra 'cuda'. First small systems of every kind are advanced on both
devices and compared, field by field. Then a Taylor–Green vortex is timed, in 2D and 3D, in float64
and float32, at growing sizes until the time is up: the sweep over pairs, a build of the neighbour
list (which is sorted on the host today), and whole steps.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable

import numpy as np
from numba import cuda

import particell as pc
from particell.bench import SKIN, SUPPORT, VISCOSITY, vortex
from particell.compute.device import Device
from particell.materials import AVOGADRO, BOLTZMANN
from particell.schemes.stages import Forces

SIZES = {2: (100, 316, 1000, 2000), 3: (22, 46, 100)}


def flow(dim: int, n: int, noise: bool, device: Device) -> pc.Simulation:
    """The vortex of ``particell bench`` with n particles along an edge."""
    domain = pc.Domain((0,) * dim, (1,) * dim, periodic="xyz"[:dim], depth=1.0)
    temperature = 1e-3 * (1 / n) ** dim / BOLTZMANN
    material = pc.Fluid(1.0, VISCOSITY, temperature=temperature, sound_speed=10.0)
    options = {"density": "summation"} if noise else {}
    scheme = pc.SDPD(support=SUPPORT[dim], fluctuations=noise, skin=SKIN[dim], **options)
    inside = pc.fluid(domain, material, 1 / n, velocity=vortex)
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


def differences(make: Callable[[Device], pc.Simulation], steps: int) -> dict[str, float]:
    """Largest difference of each field between the devices, relative to its largest value."""
    fields = []
    for backend in ("cpu", "cuda"):
        simulation = make(Device(backend))
        simulation.advance(steps)
        fields.append({name: simulation.particles.by_id(name) for name in simulation.particles})
    found = {}
    for name, here in fields[0].items():
        finite = np.isfinite(here)
        gap = np.abs(here.astype(float) - fields[1][name])[finite].max(initial=0.0)
        found[name] = float(gap / (np.abs(here[finite]).max(initial=0.0) or 1.0))
    return found


def timed(work: Callable[[], object], repeats: int = 5) -> float:
    """Seconds of the fastest of several calls, each until the GPU is done."""
    work()
    best = np.inf
    for _ in range(repeats):
        cuda.synchronize()
        begin = time.perf_counter()
        work()
        cuda.synchronize()
        best = min(best, time.perf_counter() - begin)
    return best


def bandwidth() -> float:
    """Bytes a second that a copy within the GPU's memory reads and writes."""
    a, b = (cuda.device_array(1 << 27, np.float64) for _ in range(2))
    return 2 * a.nbytes / timed(lambda: b.copy_to_device(a))


def measured(dim: int, n: int, noise: bool, precision: str) -> dict[str, float | str | int]:
    """Speeds of one system, in particles a second."""
    simulation = flow(dim, n, noise, Device("cuda", precision))
    simulation.advance(3)
    solver, number = simulation.solver, len(simulation.particles)
    row: dict[str, float | str | int] = {
        "system": f"{dim}D {'noise' if noise else 'no noise'}",
        "precision": precision,
        "particles": number,
        "sweep": number / timed(lambda: solver.do(Forces(ahead=0))),
        "list": number / timed(solver.build_list, 2),
    }
    steps = 10
    builds = simulation.neighbours.builds
    row["step"] = steps * number / timed(lambda: simulation.advance(steps), 2)
    row["builds a step"] = (simulation.neighbours.builds - builds) / (3 * steps)
    return row


def agreement() -> dict[str, dict[str, float | str]]:
    """The field of each small system that differs most between the devices, and by how much."""
    systems: dict[str, tuple[Callable[[Device], pc.Simulation], int]] = {
        "SDPD 2D": (lambda d: flow(2, 20, False, d), 5),
        "SDPD 2D noise": (lambda d: flow(2, 20, True, d), 5),
        "SDPD 3D": (lambda d: flow(3, 10, False, d), 5),
        "SDPD 3D noise": (lambda d: flow(3, 10, True, d), 5),
        "transport velocity, walls, species": (channel, 5),
    }
    found: dict[str, dict[str, float | str]] = {}
    for label, (make, steps) in systems.items():
        gaps = differences(make, steps)
        worst = max(gaps, key=lambda k: gaps[k])
        found[label] = {"field": worst, "difference": gaps[worst]}
        print(f"{label:<36} differs by at most {gaps[worst]:.1e} ('{worst}')", flush=True)
    return found


def speeds(seconds: float) -> list[dict[str, float | str | int]]:
    """Rows of :func:`measured`, small systems first, until the time is up."""
    begin, found = time.perf_counter(), []
    for k in range(max(map(len, SIZES.values()))):
        for dim, sizes in SIZES.items():
            for noise in (False, True):
                for precision in ("float64", "float32"):
                    if k >= len(sizes) or time.perf_counter() - begin > seconds:
                        continue
                    row = measured(dim, sizes[k], noise, precision)
                    found.append(row)
                    print(
                        f"{row['system']:<12} {row['precision']} {row['particles']:>9}: "
                        + ", ".join(
                            f"{w} {row[w] / 1e6:.1f} M/s" for w in ("sweep", "list", "step")
                        )
                        + f", {row['builds a step']:.2f} lists a step",
                        flush=True,
                    )
    return found


def main() -> None:
    """Compare, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=["agreement", "speed"])
    parser.add_argument("--seconds", type=float, default=240)
    parser.add_argument("--json")
    options = parser.parse_args()
    name = cuda.get_current_device().name
    found: dict = {"device": name.decode() if isinstance(name, bytes) else name}
    if options.only != "speed":
        found["agreement"] = agreement()
    if options.only != "agreement":
        found["bandwidth"] = bandwidth()
        print(f"{found['device']}: copies move {found['bandwidth'] / 1e12:.2f} TB/s", flush=True)
        found["speed"] = speeds(options.seconds)
    if options.json:
        with open(options.json, "w") as file:
            json.dump(found, file, indent=1)
            file.write("\n")


if __name__ == "__main__":
    main()
