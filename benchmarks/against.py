"""Speed of this checkout relative to another one, measured alternately in one sitting.

    python benchmarks/against.py OTHER_CHECKOUT [--rounds 3]

Each round starts both versions in processes of their own; the best time of each counts, since other
work on a machine only ever slows a measurement down.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import click

HERE = Path(__file__).resolve().parent.parent
MEASURE = """
import json
from particell import bench
from particell.compute.threads import set_threads
set_threads(1)
rows = bench.flow_entries(2, 1) + bench.flow_entries(3, 1) + bench.wall_entries(1)
rows += bench.molecule_entries(1) + bench.carried_entries(1)
print(json.dumps({row["name"]: row["per_second"] for row in rows}))
"""


def measure(checkout: Path) -> dict[str, float]:
    """Rates of one checkout, by name."""
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src")}
    command = [sys.executable, "-c", MEASURE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


@click.command()
@click.argument("other", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--rounds", default=3, show_default=True, help="Measurements of each version.")
def main(other: Path, rounds: int) -> None:
    """Print the ratio of this checkout's speed to that of OTHER, part by part."""
    best: dict[Path, dict[str, float]] = {HERE: {}, other.resolve(): {}}
    for _ in range(rounds):
        for checkout, rates in best.items():
            for name, rate in measure(checkout).items():
                rates[name] = max(rate, rates.get(name, 0.0))
    ours, theirs = best.values()
    for name in ours:
        if name in theirs:
            ratio = ours[name] / theirs[name]
            print(f"{name:<42} {ours[name] / 1e6:8.2f} M/s  {ratio:6.2f} times")


if __name__ == "__main__":
    main()
