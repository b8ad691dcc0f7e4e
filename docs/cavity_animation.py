"""The animation of the lid-driven cavity: particles coloured by the height they started from.

    python docs/cavity_animation.py docs/images/lid-driven-cavity.gif [--resolution 50]

Takes a minute; needs nothing but what Particell needs.
"""

from __future__ import annotations

from pathlib import Path

import click

from particell.cases.base import Context
from particell.cases.lid_driven_cavity import LidDrivenCavity


@click.command()
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--resolution", default=50, show_default=True, help="Particles along a side.")
@click.option("--end", default=8.0, show_default=True, help="In L/U.")
@click.option("--frames", default=45, show_default=True, help="Number of frames.")
def main(out: Path, resolution: int, end: float, frames: int) -> None:
    """Run the cavity at Re = 100 and write its animation."""
    case = LidDrivenCavity(resolution=resolution, end=end)
    run = case.build(Context()).run(case.until, case.until / frames)
    height = run.field("position")[0][:, 1] / case.length
    options = {"groups": "fluid", "limits": (0, 1), "label": "height at the beginning [L]"}
    print(run.plot.animation(height, out, fps=7, dpi=72, shades=32, **options))


if __name__ == "__main__":
    main()
