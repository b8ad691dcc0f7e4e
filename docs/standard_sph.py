"""Figures of standard SPH beside the transport velocity, as the papers' figures 3, 4 and 11.

Standard SPH moves particles with the fluid (``scheme=sdpd shifting=0``), here from the lattice.

Usage: ``python docs/standard_sph.py --runs DIR --out docs/images``; some ten minutes where the runs
are not there yet. Each run is one that ``particell run`` would leave in ``DIR/NAME``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from particell import cases, plots
from particell.cases.execution import execute
from particell.output.run import Run

STANDARD, OURS = "standard SPH", "transport velocity"
VORTICES = {
    STANDARD: {"resolution": 50, "shifting": 0.0, "arrangement": "square"},
    OURS: {"resolution": 50, "scheme": "transport-velocity"},
}
CONVECTION = {
    STANDARD: {"resolution": 81, "rayleigh": 1e6, "end": 4.0, "averaging": 1.0, "shifting": 0.0},
    OURS: {
        "scheme": "transport-velocity",
        "resolution": 81,
        "rayleigh": 1e6,
        "end": 4.0,
        "averaging": 1.0,
    },
}


def made(kind: str, parameters: dict, directory: Path):
    """A case and its run, which is made where it is not there."""
    case = cases.load(kind)(**parameters)
    if not (directory / "summary.json").is_file():
        execute(case, directory, overwrite=True)
    return case, Run(directory)


@plots.styled
def vortices(runs: Path):
    """Particles at t* = 0.5, coloured by their speed, and the largest speed in time."""
    figure, panels = plots.new_figure(9.2, 3.2, columns=3)
    for axes, (name, parameters) in zip(panels, VORTICES.items(), strict=False):
        directory = runs / f"vortices-{name.replace(' ', '-')}"
        case, run = made("taylor-green", parameters, directory)
        frame = run.at(0.5 * case.length / case.speed)
        x = run.field("position")[frame] / case.length
        speed = np.linalg.norm(run.field("velocity")[frame], axis=1) / case.speed
        mesh = axes.scatter(*x.T, c=speed, s=4, linewidths=0, vmin=0, vmax=0.7)
        axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="x / L", ylabel="y / L")
        axes.set_title(f"{name}, t* = 0.5")
        star = run.times * case.speed / case.length
        largest = run.observable("largest_speed") / case.speed
        panels[-1].semilogy(star, largest, label=f"{name}, 50²")
        exact = np.exp(-case.rate * run.times)
    panels[-1].semilogy(star, exact, "k--", linewidth=1, label="exact")
    panels[-1].set(xlabel="t U / L", ylabel="largest speed / U")
    panels[-1].legend()
    figure.colorbar(mesh, ax=list(panels[:2]), label="|v| / U", shrink=0.8)
    return figure


@plots.styled
def convection(runs: Path):
    """Particles at t* = 4 and Ra = 1e6 around the cylinder, coloured by their speed."""
    figure, panels = plots.new_figure(8.2, 3.9, columns=2)
    for axes, (name, parameters) in zip(panels, CONVECTION.items(), strict=True):
        directory = runs / f"convection-{name.replace(' ', '-')}"
        case, run = made("natural-convection", parameters, directory)
        star = run.field("position")[-1] / case.length
        speed = np.linalg.norm(run.field("velocity")[-1], axis=1) / case.velocity
        fluid = run.group("fluid")
        axes.scatter(*star[~fluid].T, s=5, color="0.6", linewidths=0)
        mesh = axes.scatter(*star[fluid].T, c=speed[fluid], s=5, linewidths=0, vmin=0, vmax=0.6)
        axes.set(xlim=(0.25, 0.75), ylim=(0.35, 1.02), aspect="equal")
        axes.set(xlabel="x / L", ylabel="y / L", title=f"{name}, t* = 4")
    figure.colorbar(mesh, ax=list(panels), label="|v| / v₀", shrink=0.8)
    return figure


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    plots.save(vortices(args.runs), args.out / "taylor-green-standard-sph.png")
    plots.save(convection(args.runs), args.out / "convection-standard-sph.png")


if __name__ == "__main__":
    main()
