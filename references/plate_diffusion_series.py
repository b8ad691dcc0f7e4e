"""Exact series for steady diffusion in a unit square: C = 1 on y = 1, 0 on the other sides.

    C = sum over odd n of 4/(n pi) sin(n pi x) sinh(n pi y)/sinh(n pi),

with the ratio of the sinh written with exponentials that do not overflow.

Usage: ``python references/plate_diffusion_series.py --out DIR``; needs numpy; seconds. It writes
``plate_diffusion_centrelines.csv``: along x at y = 1/2 and along y at x = 1/2.
"""

import argparse
import pathlib

import numpy as np

PLACES = np.linspace(0, 1, 65)
HEADER = """Steady diffusion in a unit square: C/C0 = 1 on the side y = 1, 0 on the other three.
Exact series: references/plate_diffusion_series.py
s, along_x, along_y"""


def plate(x, y, terms):
    """C at one place inside, or on the side y = 0."""
    n = np.arange(1, 2 * terms, 2)
    ratio = np.exp(n * np.pi * (y - 1)) * -np.expm1(-2 * n * np.pi * y)
    ratio /= -np.expm1(-2 * n * np.pi)
    return float(np.sum(4 / (n * np.pi) * np.sin(n * np.pi * x) * ratio))


def centrelines():
    """The table (65, 3)."""
    along_x = [plate(s, 0.5, 100) for s in PLACES]
    along_y = [plate(0.5, s, 20_000) for s in PLACES[:-1]] + [1.0]  # at y = 1 the side's value
    return np.column_stack([PLACES, along_x, along_y])


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the CSV file")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "plate_diffusion_centrelines.csv"
    np.savetxt(path, centrelines(), fmt="%.12f", delimiter=",", header=HEADER)


if __name__ == "__main__":
    main()
