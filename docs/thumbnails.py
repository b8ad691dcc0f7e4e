"""The small pictures of the gallery's index, from the figures of its pages.

    python docs/thumbnails.py

Make them again where a figure has changed.
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

IMAGES = Path(__file__).parent / "images"
SIZE = (230, 140)
#: The figure that stands for each case.
FIGURES = {
    "annihilation-1d": "annihilation-1d-profiles",
    "birth-death": "birth-death-distribution",
    "couette": "couette-profiles",
    "diffusion-1d": "diffusion-1d-profiles",
    "diffusion-2d": "diffusion-2d-map",
    "drag-array": "drag-array-speed",
    "effective-diffusivity": "effective-diffusivity-decay",
    "equilibrium-2d": "equilibrium-2d-velocities",
    "equilibrium-3d": "equilibrium-3d-density",
    "isomerisation": "isomerisation-share",
    "lid-driven-cavity": "lid-driven-cavity-speed",
    "min-oscillation": "min-oscillation-kymograph",
    "natural-convection": "convection-concentration",
    "poiseuille": "poiseuille-profiles",
    "rotating-cylinder": "rotating-cylinder-particles",
    "taylor-green": "taylor-green-speed",
    "thermal-modes": "thermal-modes-modes",
    "turing": "turing-pattern",
    "yeast-channel": "yeast",
}


def main() -> None:
    """Write ``images/small/CASE.png`` for every case."""
    (IMAGES / "small").mkdir(exist_ok=True)
    for case, figure in FIGURES.items():
        with Image.open(IMAGES / f"{figure}.png") as whole:
            small = whole.convert("RGB")
        small.thumbnail(SIZE, Image.Resampling.LANCZOS)
        path = IMAGES / "small" / f"{case}.png"
        small.quantize(96).save(path, optimize=True)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
