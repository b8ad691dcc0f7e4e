"""Speed beside PySPH: transport-velocity SPH, measured alternately in one sitting.

    python benchmarks/against_pysph.py ENVIRONMENT [--rounds 3] [--json FILE]

ENVIRONMENT is a virtual environment of its own with PySPH, which has to be compiled (a quarter of
an hour): ``python -m venv ENVIRONMENT``, ``ENVIRONMENT/bin/pip install setuptools wheel 'numpy<2.3'
'cython<3.1' cyarray compyle mako`` and ``ENVIRONMENT/bin/pip install --no-build-isolation pysph``.
Particell does not depend on it.

The lid-driven cavity at Re = 100 and Taylor–Green vortices, with the same particles, cubic spline
with a support of 2.6 spacings, float64 in both; c₀ = 10 U. Each code takes its own time step, ours
twice that of PySPH's examples, which is a quarter of the smoothing length over c₀ + U: "a step"
compares single steps, "time of the flow" what a second of the flow takes. A round starts each code
in a process of its own; the best block of steps counts, since other work on a machine only ever
slows a measurement down. On one core processor time is compared, on more wall time.

What a step does is not the same: PySPH sums the density and has one sweep over pairs for it, one or
two for walls and one for all forces; ours integrates the density with a corrected gradient and
carries momentum with the shift in one sweep, and has one for forces.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from particell.cases.base import Case, Context
from particell.cases.lid_driven_cavity import LidDrivenCavity
from particell.cases.taylor_green import TaylorGreen
from particell.compute.threads import set_threads

SUPPORT, REYNOLDS = 2.6, 100.0
#: Steps before the first block (the lattice has broken up by then), of a block, and blocks.
FIRST, STEPS, BLOCKS = 300, 60, 3


def case_of(flow: str, n: int) -> Case:
    """Our case of a flow with n² particles."""
    shared: dict[str, Any] = {"resolution": n, "reynolds": REYNOLDS, "kernel": "cubic-spline"}
    shared |= {"support": SUPPORT, "scheme": "transport-velocity"}
    return LidDrivenCavity(**shared) if flow == "cavity" else TaylorGreen(**shared)


def ours_here(flow: str, n: int, cores: int) -> dict[str, Any]:
    """Seconds a step of all blocks, time step and final kinetic energy per mass."""
    set_threads(cores)
    clock = time.process_time if cores == 1 else time.perf_counter
    simulation = case_of(flow, n).build(Context())
    simulation.advance(FIRST)
    seconds = []
    for _ in range(BLOCKS):
        begin = clock()
        simulation.advance(STEPS)
        seconds.append((clock() - begin) / STEPS)
    p = simulation.particles
    mobile = p.host("is_wall") == 0
    mass = p.host("mass")[mobile].sum() * simulation.system.depth_factor
    energy = simulation.monitor.kinetic_energy() / mass
    return {"seconds": seconds, "dt": simulation.dt, "energy": energy}


def measure(command: list[str], cores: int) -> dict[str, Any]:
    """What a side prints, in a process of its own."""
    settings = {**os.environ, "OMP_NUM_THREADS": str(cores), "NUMBA_NUM_THREADS": str(cores)}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            command, cwd=folder, env=settings, capture_output=True, text=True, check=False
        )
    if done.returncode:
        raise click.ClickException(f"{command[0]} failed:\n{done.stdout[-2000:]}{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def rows(python: Path, rounds: int, sizes: tuple[int, ...], every: tuple[int, ...]) -> Iterator:
    """One row for each flow, size and number of cores."""
    side = str(Path(__file__).with_name("pysph_side.py").resolve())
    here = str(Path(__file__).resolve())
    for flow in ("cavity", "taylor-green"):
        for n in sizes:
            for cores in every:
                given = {"flow": flow, "n": n, "support": SUPPORT, "reynolds": REYNOLDS}
                given |= {"cores": cores, "first": FIRST, "steps": STEPS, "blocks": BLOCKS}
                theirs = [str(python), side, json.dumps(given)]
                ours = [sys.executable, here, "--ours", json.dumps([flow, n, cores])]
                found: dict[str, list[dict[str, Any]]] = {"ours": [], "pysph": []}
                for _ in range(rounds):
                    found["pysph"].append(measure(theirs, cores))
                    found["ours"].append(measure(ours, cores))
                best = {k: min(min(r["seconds"]) for r in v) for k, v in found.items()}
                first = {k: v[0] for k, v in found.items()}
                ratio = best["pysph"] / best["ours"]
                yield {
                    "flow": flow,
                    "n": n,
                    "cores": cores,
                    "ms_ours": 1e3 * best["ours"],
                    "ms_pysph": 1e3 * best["pysph"],
                    "ratio_a_step": ratio,
                    "ratio_time_of_flow": ratio * first["ours"]["dt"] / first["pysph"]["dt"],
                    "dt_ours": first["ours"]["dt"],
                    "dt_pysph": first["pysph"]["dt"],
                    "pysph": first["pysph"]["version"],
                }


@click.command()
@click.argument("environment", type=click.Path(exists=True, path_type=Path), required=False)
@click.option("--rounds", default=3, show_default=True, help="Processes of each code and flow.")
@click.option("--json", "json_file", type=click.Path(path_type=Path), help="Where to write rows.")
@click.option("--size", "sizes", multiple=True, type=click.IntRange(20), help="50 and 100.")
@click.option("--cores", "every", multiple=True, type=click.IntRange(1), help="1 and 2.")
@click.option("--ours", hidden=True, help="Measure ours in this process: internal.")
def main(
    environment: Path | None,
    rounds: int,
    json_file: Path | None,
    sizes: tuple[int, ...],
    every: tuple[int, ...],
    ours: str,
) -> None:
    """Print ratios of times to PySPH in ENVIRONMENT."""
    if ours:
        print(json.dumps(ours_here(*json.loads(ours))))
        return
    if environment is None:
        raise click.UsageError("a virtual environment with pysph is needed")
    python = environment.absolute() / "bin" / "python"
    result = []
    for row in rows(python, rounds, sizes or (50, 100), every or (1, 2)):
        print(
            f"{row['flow']:<13} {row['n']}², {row['cores']} core(s): ours {row['ms_ours']:.2f} ms, "
            f"PySPH {row['ms_pysph']:.2f} ms a step; {row['ratio_a_step']:.2f} times a step, "
            f"{row['ratio_time_of_flow']:.2f} times for the same time of the flow",
            flush=True,
        )
        result.append(row)
        if json_file is not None:
            json_file.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
