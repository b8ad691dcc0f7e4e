"""Install all that the program needs at its lower bounds, in a fresh environment, and try it.

    python .ci/lower_bounds.py DIRECTORY [--with EXTRA …]

makes the environment in DIRECTORY (which must not exist), installs every dependency of
``pyproject.toml`` at exactly the version after ``>=``, and runs a smoke test: import, a tiny run
with frames on the disk, pictures, export, the command line.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

SMOKE = """
import subprocess, sys
import numpy as np
import particell as pc
from particell.output.export import export_vtkhdf

box = pc.Domain((0, 0), (1e-5, 1e-5), "x")
water = pc.Fluid(1000, 1e-3)
phases = [pc.fluid(box, water, 1e-6), *pc.channel_walls(box, water, 1e-6, axis=1)]
held = pc.FixedValueWall("wall-upper", {"A": 1.0})
species = [pc.Species("A", 1e-9), pc.Species("M", 1e-9, molecules=True)]
simulation = pc.Simulation(
    box, phases, pc.SDPD(gravity=(1.0, 0.0)), species, [pc.Reaction("A -> 0", 1.0)], [held]
)
simulation.chemistry.set_count("M", 5)
run = simulation.run(2e-6, every=1e-6, out="run", progress=False)
assert np.isfinite(run.field("velocity")[-1]).all()
line = run.on_line("concentration/A", (5e-6, 0), (5e-6, 1e-5), points=5)
assert abs(line[-1] - 1.0) < 1e-9, line
run.plot("velocity", path="a.png")
run.plot.map("concentration/A", path="b.png")
run.plot.series(path="c.png")
export_vtkhdf(run, "run.vtkhdf")
case = subprocess.run([sys.executable, "-m", "particell", "new", "my.toml"], check=True)
subprocess.run([sys.executable, "-m", "particell", "check", "--no-timing", "my.toml"], check=True)
subprocess.run([sys.executable, "-m", "particell", "info"], check=True)
print("all well at the lower bounds")
"""


def bounds(extras: list[str]) -> list[str]:
    """Requirements at their lower bounds: ``numpy>=2.0`` as ``numpy==2.0``."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = list(project["dependencies"])
    for extra in extras:
        needed += project["optional-dependencies"][extra]
    return [re.sub(r">=([\w.]+).*", r"==\1", each) for each in needed]


def main() -> int:
    """Make the environment and try it; gives the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--with", dest="extras", action="append", default=[], metavar="EXTRA")
    arguments = parser.parse_args()
    if arguments.directory.exists():
        parser.error(f"{arguments.directory} exists")
    venv.create(arguments.directory, with_pip=True)
    python = arguments.directory.resolve() / ("Scripts" if sys.platform == "win32" else "bin")
    pip = [str(python / "python"), "-m", "pip", "install", "--quiet"]
    subprocess.run([*pip, *bounds(arguments.extras)], check=True)
    subprocess.run([*pip, "--no-deps", str(ROOT)], check=True)
    with tempfile.TemporaryDirectory() as place:
        done = subprocess.run([str(python / "python"), "-c", SMOKE], cwd=place)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
