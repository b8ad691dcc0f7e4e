"""The animation of the lid-driven cavity: particles coloured by the height they started from.

    python docs/cavity_animation.py docs/images/lid-driven-cavity.gif [--resolution 50]

Takes a minute; needs nothing but what Particell needs.
"""

from __future__ import annotations

import io
from pathlib import Path

import click
import numpy as np
from PIL import Image

from particell import plots
from particell.cases.base import Context
from particell.cases.lid_driven_cavity import LidDrivenCavity


def picture(x: np.ndarray, colour: np.ndarray, size: float, title: str) -> Image.Image:
    """One frame, of 32 colours."""
    figure, axes = plots.new_figure(3.2, 3.3)
    axes.scatter(x[:, 0], x[:, 1], c=colour, s=size, linewidths=0, cmap="viridis", vmin=0, vmax=1)
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xticks=[], yticks=[], title=title)
    file = io.BytesIO()
    figure.savefig(file, dpi=72)
    return Image.open(file).convert("RGB").quantize(32)


@click.command()
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--resolution", default=50, show_default=True, help="Particles along a side.")
@click.option("--end", default=8.0, show_default=True, help="In L/U.")
@click.option("--frames", default=45, show_default=True, help="Number of frames.")
def main(out: Path, resolution: int, end: float, frames: int) -> None:
    """Run the cavity at Re = 100 and write its animation."""
    case = LidDrivenCavity(resolution=resolution, end=end)
    run = case.build(Context()).run(case.until, case.until / frames)
    fluid = run.group("fluid")
    positions = [run.field("position")[k][fluid] / case.length for k in range(len(run))]
    size = 0.8 * (72 * 2.8 / resolution) ** 2
    pictures = [
        picture(x, positions[0][:, 1], size, f"t = {t / case.every:.1f} L/U")
        for x, t in zip(positions, run.times, strict=True)
    ]
    first, *others = pictures
    first.save(out, save_all=True, append_images=others, duration=150, loop=0, optimize=True)
    print(f"{out}: {out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
