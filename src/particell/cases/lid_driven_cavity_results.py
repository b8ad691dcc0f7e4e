"""What the lid-driven cavity is compared with, and its figures.

Velocities are those of the fluid's particles alone, averaged over time at points inside
(:mod:`particell.averages`). Points on the walls, where the velocity is given, do not count.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from particell import plots
from particell.analysis.arrangement import evenness
from particell.cases import reference
from particell.cases.base import Metric
from particell.cases.scores import density_drift
from particell.output.run import Run
from particell.simulation import Simulation

#: Largest r.m.s. difference from Ghia's points, over U, by Re: from a number of particles along a
#: side on, and inversely as that number below it.
GHIA_LIMIT = {100: (0.01, 100), 1000: (0.02, 200)}
#: The Re at which corner vortices have a limit, that limit, and the resolution from which it holds.
CORNERS_AT, CORNER_LIMIT, CORNER_RESOLUTION = 1000, 0.1, 200
CORNERS = ("left_width", "left_height", "right_width", "right_height")
#: The papers' sizes of the corner vortices at Re = 1000.
PAPER_CORNERS = dict(zip(CORNERS, (0.20, 0.15, 0.30, 0.35), strict=True))
#: Limits of the arrangement in spacings: the largest void has the size of a missing particle, and
#: the closest pair half a spacing.
VOID_LIMIT, CLOSEST_LIMIT = 1.0, 0.5
#: Largest speed of a particle over U: a lid that turns one back gives it up to 2, and it had some.
SPEED_LIMIT = 2.5
#: Points along a centreline in figures.
FINE = 161
#: Ghia's value of u at Re = 10000 and y = 1/2 is thought to be misprinted.
MISPRINT = (10000, 0.5)


class Cavity(Protocol):
    """What is read of a :class:`.LidDrivenCavity`, which says what it means."""

    resolution: int
    reynolds: float
    length: float
    speed: float
    density: float
    mach: float
    frames: int

    @property
    def spacing(self) -> float: ...
    @property
    def every(self) -> float: ...
    @property
    def earliest(self) -> float: ...


class Line(NamedTuple):
    """Places along a centreline over L, the run's velocity over U there, Ghia's, finite elements'.

    The last two are NaN where there is no table for the Reynolds number.
    """

    s: np.ndarray
    value: np.ndarray
    ghia: np.ndarray
    fem: np.ndarray


def places(case: Cavity) -> dict[str, np.ndarray]:
    """Points over L at which velocities are averaged, by name.

    Both centrelines at Ghia's points (``"u"``, ``"v"``) and finely (``"vertical"``,
    ``"horizontal"``); what :func:`corner_sizes` needs, (4, 2, n, 2): next to the walls in the order
    of :data:`CORNERS`, one and two spacings away; a grid of cells, (n, n, 2).
    """
    found = {}
    for component in "uv":
        s = ghia_places(case, component)
        half = np.full_like(s, 0.5)
        found[component] = np.stack([half, s] if component == "u" else [s, half], axis=1)
    fine = np.linspace(0.5 / case.resolution, 1 - 0.5 / case.resolution, FINE)
    half = np.full_like(fine, 0.5)
    found["vertical"] = np.stack([half, fine], axis=1)
    found["horizontal"] = np.stack([fine, half], axis=1)
    along, near = corner_places(case)
    lines = []
    for off in near:
        away = np.full_like(along, off)
        sides = ((along, away), (away, along), (1 - along, away), (1 - away, along))
        lines.append([np.stack(side, axis=1) for side in sides])
    found["corners"] = np.swapaxes(np.array(lines), 0, 1)
    number = min(2 * case.resolution, 200)
    star = (np.arange(number) + 0.5) / number
    found["map"] = np.stack(np.meshgrid(star, star, indexing="ij"), axis=-1)
    return found


def mean_velocity(case: Cavity, run: Run, where: str) -> np.ndarray:
    """Averaged velocity over U at one of the :func:`places`."""
    frames = range(max(1, len(run) - case.frames), len(run))
    return run.average("velocity", where, frames) / case.speed


def ghia_places(case: Cavity, component: str) -> np.ndarray:
    """Ghia's points inside the cavity along a centreline, over L."""
    s = reference.load(f"lid_driven_cavity_ghia_{component}")["y" if component == "u" else "x"]
    inner = (s > 0) & (s < 1)
    if component == "u" and tabulated(case) == MISPRINT[0]:
        inner &= s != MISPRINT[1]
    return s[inner]


def corner_places(case: Cavity) -> tuple[np.ndarray, tuple[float, float]]:
    """Distances from the corners, and from the walls, at which the walls' shear is measured."""
    d = 1.0 / case.resolution
    return np.linspace(2 * d, 0.48, 4 * case.resolution), (d, 2 * d)


def tabulated(case: Cavity) -> int | None:
    """The Reynolds number in the tables, or None where it is not."""
    return round(case.reynolds) if case.reynolds in (100, 1000, 10000) else None


def centreline(case: Cavity, run: Run, component: str) -> Line:
    """u along x = 1/2 (``"u"``) or v along y = 1/2 (``"v"``) at Ghia's points inside."""
    s, number = ghia_places(case, component), tabulated(case)
    value = mean_velocity(case, run, component)[:, 0 if component == "u" else 1]
    ghia = fem = np.full_like(s, np.nan)
    if number is not None:
        table = reference.load(f"lid_driven_cavity_ghia_{component}")
        ghia = table[f"{component}_{number}"][np.isin(table["y" if component == "u" else "x"], s)]
        solution = reference.load("lid_driven_cavity_fem")
        fem = np.interp(s, solution["s"], solution[f"{component}_{number}"])
    return Line(s, value, ghia, fem)


def rms(lines: list[Line], other: str) -> float:
    """Root mean square difference of all lines from ``"ghia"`` or ``"fem"``."""
    squares = np.concatenate([(line.value - getattr(line, other)) ** 2 for line in lines])
    return float(np.sqrt(squares.mean()))


def corner_sizes(case: Cavity, run: Run) -> dict[str, float]:
    """Distances from the bottom corners at which the wall's shear changes sign, over L.

    The shear is the derivative of the parabola through the wall's zero velocity and those one and
    two spacings away. NaN where the shear does not change sign up to 0.48 L from the corner.
    """
    s, _ = corner_places(case)
    mean = mean_velocity(case, run, "corners")
    found = {}
    for name, (one, two), component in zip(CORNERS, mean, (0, 1, 0, 1), strict=True):
        shear = 2 * one[:, component] - 0.5 * two[:, component]
        change = np.flatnonzero(shear[:-1] * shear[1:] < 0)
        if len(change) == 0:
            found[name] = float("nan")
            continue
        k = int(change[-1])  # beyond it the main vortex; within, smaller and smaller ones
        share = shear[k] / (shear[k] - shear[k + 1])
        found[name] = float(s[k] + share * (s[k + 1] - s[k]))
    return found


def metrics(case: Cavity, run: Run, simulation: Simulation) -> dict[str, Metric]:
    """Velocities on the centrelines, corner vortices, evenness, walls."""
    number = tabulated(case)
    found: dict[str, Metric] = {}
    if number is not None:
        lines = [centreline(case, run, c) for c in "uv"]
        limit, least = GHIA_LIMIT.get(number, (None, 1))
        coarse = max(1.0, least / case.resolution)
        found["ghia_rms"] = Metric(
            rms(lines, "ghia"), limit=None if limit is None else limit * coarse
        )
        found["fem_rms"] = Metric(rms(lines, "fem"))
    if number == CORNERS_AT:  # at 100 they are a few spacings wide, beyond there are many
        rows = reference.load("lid_driven_cavity_corners")
        row = int(np.flatnonzero(rows["reynolds"] == number)[0])
        limited = case.resolution >= CORNER_RESOLUTION
        for name, size in corner_sizes(case, run).items():
            found[f"corner_{name}"] = Metric(size, paper=PAPER_CORNERS[name])
            error = size / rows[name][row] - 1
            found[f"corner_{name}_error"] = Metric(error, limit=CORNER_LIMIT if limited else None)
    energy = run.observable("kinetic_energy")
    change = (energy[-1] / energy[-2] - 1) / (run.times[-1] - run.times[-2]) * case.every
    found["energy_change"] = Metric(float(change))
    found["end_time"] = Metric(float(run.times[-1] / case.every))
    even = evenness(run.field("position")[-1], case.spacing, run.domain)
    found["largest_void"] = Metric(even.void, limit=VOID_LIMIT)
    found["crowding"] = Metric(crowding(case, run), limit=1 / CLOSEST_LIMIT)
    found |= outliers(case, run)
    found |= density_drift(run, simulation, case.density, case.every)
    counts = simulation.conservation()
    if "inside walls" in counts:
        found["inside_walls"] = Metric(counts["inside walls"], limit=0.0)
        found["bounces"] = Metric(counts["bounces"])
    return found


def crowding(case: Cavity, run: Run) -> float:
    """Spacing over the distance of the closest pair: the mean over the second half of the frames.

    Of a single frame it is that of one pair beside the lid, 1.6 to 2.0 in turn.
    """
    frames = run.field("position")[len(run.times) // 2 :]
    return float(np.mean([1 / evenness(x, case.spacing, run.domain).closest for x in frames]))


def outliers(case: Cavity, run: Run) -> dict[str, Metric]:
    """The fastest particle and the density farthest from ρ₀, of all frames.

    A wall that turns a particle back changes its velocity by up to 2U, relative to a lid that it
    has hardly followed; sound of that amplitude is a density of 2U/c₀. More is not calm.
    """
    fluid, frames = run.group("fluid"), range(len(run))
    velocity, density = run.field("velocity"), run.field("density")
    speed = max(float(np.linalg.norm(velocity[k][fluid], axis=1).max()) for k in frames)
    compression = max(float(np.abs(density[k][fluid] / case.density - 1).max()) for k in frames)
    return {
        "largest_speed": Metric(speed / case.speed, limit=SPEED_LIMIT),
        "largest_compression": Metric(compression, limit=2 * case.mach),
    }


def figures(case: Cavity, run: Run, directory: Path) -> list[Path]:
    """Speed with streamlines, profiles, particles, convergence."""
    made = {
        "profiles": _profiles_figure(case, run),
        "speed": _speed_figure(case, run),
        "particles": _particles_figure(case, run),
        "convergence": _convergence_figure(case, run),
    }
    return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]


@plots.styled
def _profiles_figure(case: Cavity, run: Run):
    figure, (left, right) = plots.new_figure(7.0, 3.2, columns=2)
    fine = places(case)["vertical"][:, 1]
    vertical = mean_velocity(case, run, "vertical")[:, 0]
    horizontal = mean_velocity(case, run, "horizontal")[:, 1]
    left.plot(vertical, fine, "-", label=f"{case.resolution}²")
    right.plot(fine, horizontal, "-", label=f"{case.resolution}²")
    number = tabulated(case)
    if number is not None:
        solution = reference.load("lid_driven_cavity_fem")
        u, v = (reference.load(f"lid_driven_cavity_ghia_{c}") for c in "uv")
        dashed = {"color": "black", "linestyle": "--", "linewidth": 0.8, "label": "finite elements"}
        dots = {"color": plots.COLOURS[1], "mfc": "none", "label": "Ghia et al. 1982"}
        left.plot(solution[f"u_{number}"], solution["s"], **dashed)
        right.plot(solution["s"], solution[f"v_{number}"], **dashed)
        left.plot(u[f"u_{number}"], u["y"], "o", **dots)
        right.plot(v["x"], v[f"v_{number}"], "o", **dots)
    left.set(xlabel="u / U on x = L/2", ylabel="y / L", ylim=(0, 1))
    right.set(xlabel="x / L", ylabel="v / U on y = L/2", xlim=(0, 1))
    plots.legend(left)
    return figure


@plots.styled
def _speed_figure(case: Cavity, run: Run):
    figure, axes = plots.new_figure(4.6, 3.8)
    star = places(case)["map"][:, 0, 0]
    v = mean_velocity(case, run, "map")
    speed = np.linalg.norm(v, axis=-1)
    mesh = axes.pcolormesh(star, star, speed.T, shading="nearest", vmin=0, vmax=1)
    axes.streamplot(
        star,
        star,
        v[..., 0].T,
        v[..., 1].T,
        color="white",
        linewidth=0.5,
        arrowsize=0.6,
        density=0.8,
        broken_streamlines=False,
    )
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="x / L", ylabel="y / L")
    axes.set_title(f"Re = {case.reynolds:g}, t = {run.times[-1] / case.every:.4g} L/U")
    figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label="|v| / U")
    return figure


@plots.styled
def _particles_figure(case: Cavity, run: Run):
    """All particles, and those at the corner that the lid moves towards."""
    figure, pair = plots.new_figure(7.4, 3.5, columns=2)
    star = run.field("position")[-1] / case.length
    speed = np.linalg.norm(run.field("velocity")[-1], axis=1) / case.speed
    fluid = run.group("fluid")
    near = max(0.15, 12 / case.resolution)
    for axes, low in zip(pair, ((0.0, 0.0), (1 - near, 1 - near)), strict=True):
        width = 1 - low[0]
        edge = 0.25 * near if width < 1 else 0.0
        size = (72 * 2.6 / ((width + edge) * case.resolution)) ** 2 * 0.6
        axes.scatter(*star[~fluid].T, s=size, color="0.7", linewidths=0)
        mesh = axes.scatter(*star[fluid].T, s=size, c=speed[fluid], vmin=0, vmax=1, linewidths=0)
        axes.set(xlim=(low[0], 1 + edge), ylim=(low[1], 1 + edge), aspect="equal")
        axes.set(xlabel="x / L", ylabel="y / L")
    figure.colorbar(mesh, cax=pair[1].inset_axes((1.04, 0.0, 0.04, 1.0)), label="|v| / U")
    return figure


@plots.styled
def _convergence_figure(case: Cavity, run: Run):
    figure, (left, right) = plots.new_figure(6.8, 3.0, columns=2)
    star = run.times / case.every
    mass = run.static["mass"][run.group("fluid")].sum()
    energy = run.observable("kinetic_energy") / (mass * case.speed**2)
    left.plot(star, energy)
    left.set(xlabel="t U / L", ylabel="kinetic energy / (m U²)")
    change = np.abs(np.diff(energy) / energy[1:] / np.diff(star))
    right.semilogy(star[1:], change, "o-", mfc="none", linewidth=0.8)
    right.axhline(1e-3, color="black", linewidth=0.8, linestyle="--")
    right.axvline(case.earliest / case.every, color="0.7", linewidth=0.8)
    right.set(xlabel="t U / L", ylabel="change of the energy per L/U")
    return figure
