"""What natural convection is compared with, and its figures.

Profiles are taken from the particles themselves, without interpolation, which would round off the
boundary layers: those within half a spacing of the centreline, in both halves of the cavity and in
all frames of the averaging time, are put into bins of one spacing along x. The reference is
averaged over the same particles' places.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from particell import plots
from particell.analysis.arrangement import evenness
from particell.analysis.statistics import epsilon_error
from particell.cases import reference
from particell.cases.base import Metric
from particell.cases.scores import density_drift, poisson_metric
from particell.geometry.shapes import Box, Circle
from particell.materials import AVOGADRO
from particell.output.run import Run
from particell.simulation import Simulation

#: Limit of the profiles' root mean square errors, as a part of their range.
PROFILE_LIMIT = 0.03
#: Limit of the transfers' relative errors.
TRANSFER_LIMIT = 0.05
#: The same with a transport velocity: of profiles (beyond Ra = 3e5 the second), of transfers.
TV_PROFILE_LIMIT, TV_TRANSFER_LIMIT = (0.02, 0.05), 0.03
#: Largest void in spacings: with a transport velocity no particle's place is empty.
VOID_LIMIT = 1.0
#: Half of the total transfer Q/(κΔC) by Ra, from the reference solution.
HALF_TRANSFER = {1e4: 2.06945, 1e5: 3.77456, 1e6: 6.10100}
#: The papers' errors ε of C* and of v_y* √(Ra/Sc) by what drives the flow and Ra (81²).
PAPER = {
    "concentrations": {1e4: (2.587e-3, 0.347), 1e5: (2.307e-3, 1.373), 1e6: (3.222e-3, 4.378)},
    "molecules": {1e4: (2.205e-3, 0.347), 1e5: (2.447e-3, 1.409), 1e6: (2.867e-3, 4.666)},
}
#: A run that ends before this time, in L/v₀, is not compared with the steady state.
STARTED = 6.0
#: False-alarm rate of the statistical metric.
ALARM = 1e-7
KINDS = {"concentrations": "C", "molecules": "C_molecules"}


class Convection(Protocol):
    """What is read of a :class:`.NaturalConvection`, which says what it means."""

    resolution: int
    rayleigh: float
    schmidt: float
    length: float
    velocity: float
    concentration: float
    density: float
    end: float
    averaging: float

    @property
    def scheme(self) -> str: ...
    @property
    def driven_by(self) -> str: ...
    @property
    def time_unit(self) -> float: ...
    @property
    def spacing(self) -> float: ...
    @property
    def depth(self) -> float: ...
    @property
    def diffusivity(self) -> float: ...
    @property
    def cylinder(self) -> Circle: ...


class Profile(NamedTuple):
    """Bins along the centreline: x/L (from 0.6 to 1), the run's value and the reference's."""

    x: np.ndarray
    value: np.ndarray
    expected: np.ndarray

    @property
    def error(self) -> float:
        """Root mean square difference as a part of the reference's range."""
        return float(np.sqrt(np.mean((self.value - self.expected) ** 2)) / np.ptp(self.expected))


def exact(case: Convection) -> dict[str, np.ndarray] | None:
    """The reference's columns, or None: other Ra and Sc, or a run that has only begun."""
    known = case.rayleigh in HALF_TRANSFER and abs(case.schmidt - 0.7) < 1e-9
    if not known or case.end < STARTED:
        return None
    exponent = round(np.log10(case.rayleigh))
    return reference.load(f"natural_convection_Ra1e{exponent}")


def averaged_frames(case: Convection, run: Run) -> np.ndarray:
    """The frames of the averaging time."""
    start = (case.end - case.averaging) * case.time_unit
    return np.flatnonzero(run.times >= start * (1 - 1e-9))


def profile(case: Convection, run: Run, kind: str) -> Profile:
    """Of ``"concentrations"`` or ``"molecules"`` in C₀, or of the upward ``"velocity"`` in v₀."""
    fluid = run.group("fluid")
    places, values = [], []
    for k in averaged_frames(case, run):
        star = run.field("position")[int(k)][fluid] / case.length
        near = np.abs(star[:, 1] - 0.5) < 0.5 / case.resolution
        if kind == "velocity":
            field = run.field("velocity")[int(k)][fluid][near, 1] / case.velocity
        else:
            field = run.field(f"concentration/{KINDS[kind]}")[int(k)][fluid][near]
            field = field / case.concentration
        places.append(0.5 + np.abs(star[near, 0] - 0.5))
        values.append(field)
    x, value = np.concatenate(places), np.concatenate(values)
    number = round(0.4 * case.resolution)
    bin_of = np.clip(((x - 0.6) / 0.4 * number).astype(int), 0, number - 1)
    table = exact(case)
    expected = np.full_like(x, np.nan)
    if table is not None:
        expected = np.interp(x, table["x_star"], table["vy" if kind == "velocity" else "C"])
    counts = np.bincount(bin_of, minlength=number)
    found = counts > 0

    def mean(a: np.ndarray) -> np.ndarray:
        return np.bincount(bin_of, a, number)[found] / counts[found]

    return Profile(mean(x), mean(value), mean(expected))


def asymmetry(case: Convection, run: Run) -> float:
    """The flow's mean angular momentum about the centre over v₀L/2: zero if it is symmetric."""
    fluid = run.group("fluid")
    total = 0.0
    frames = averaged_frames(case, run)
    for k in frames:
        offset = run.field("position")[int(k)][fluid] / case.length - 0.5
        v = run.field("velocity")[int(k)][fluid] / case.velocity
        total += 2 * float(np.mean(offset[:, 0] * v[:, 1] - offset[:, 1] * v[:, 0]))
    return total / len(frames)


def transfers(case: Convection, run: Run, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (m,) in L/v₀ and Q/2 from the cylinder and into the cavity's walls, frame by frame.

    What a particle books between two frames is counted for the body that is nearer to it (of
    molecules, fluid particles book what comes in, and wall particles what goes out).
    """
    name = KINDS[kind]
    scale = case.concentration * case.depth * case.diffusivity
    if kind == "molecules":
        scale *= AVOGADRO
    sums = []
    before = run.field(f"inflow/{name}")[0]
    for k in range(1, len(run)):
        booked = run.field(f"inflow/{name}")[k]
        x = run.field("position")[k]
        from_cylinder = case.cylinder.signed_distance(x)
        from_wall = np.minimum(x, case.length - x).min(axis=1)
        inside = from_cylinder < from_wall
        change = booked - before
        sums.append((change[inside].sum(), -change[~inside].sum()))
        before = booked
    rates = np.array(sums) / (scale * np.diff(run.times)[:, None])
    middle = 0.5 * (run.times[1:] + run.times[:-1]) / case.time_unit
    return middle, 0.5 * rates[:, 0], 0.5 * rates[:, 1]


def poisson_score(run: Run) -> Metric:
    """Reduced chi-square of the counts about the deterministic numbers, at the end.

    The cavity is empty at first and molecules, which do not know of each other, come in as a
    Poisson stream: where the flow does not depend on them, the counts are independent Poisson
    numbers whose means are the concentrations'. Particles with fewer than 20 are left out.
    """
    last = len(run) - 1
    fluid = run.group("fluid")
    volume = run.static["mass"] / run.field("density")[last]
    mean = (run.field("concentration/C")[last] * volume * AVOGADRO)[fluid]
    count = run.field("count/C_molecules")[last][fluid]
    return poisson_metric(count, mean, ALARM, fewest=20.0)


def limits(case: Convection) -> tuple[float, float]:
    """Of profiles and of transfers."""
    if case.scheme == "sdpd":
        return PROFILE_LIMIT, TRANSFER_LIMIT
    return TV_PROFILE_LIMIT[int(case.rayleigh > 3e5)], TV_TRANSFER_LIMIT


def wall_metrics(case: Convection, run: Run, simulation: Simulation) -> dict[str, Metric]:
    """What walls and evenly spread particles promise, and the volume that is put right.

    With a transport velocity nothing penetrates walls; with plain SPH surfaces reflect.
    """
    square = Box(list(run.domain.lower), list(run.domain.upper))
    even = evenness(run.field("position")[-1], case.spacing, square - case.cylinder)
    counts = simulation.conservation()
    promised = case.scheme == "transport-velocity"
    found = {
        "largest_void": Metric(even.void, limit=VOID_LIMIT if promised else None),
        "crowding": Metric(1 / even.closest),
        **density_drift(run, simulation, case.density, case.time_unit),
        "time_step": Metric(float(run.times[-1] / case.time_unit / simulation.step)),
    }
    if promised:
        found["inside_walls"] = Metric(counts["inside walls"], limit=0.0)
        found["bounces"] = Metric(counts["bounces"])
    else:
        found["reflections"] = Metric(counts["reflections"])
    return found


def metrics(case: Convection, run: Run) -> dict[str, Metric]:
    """Errors of profiles and transfers; limits on the species that drives the flow."""
    found: dict[str, Metric] = {}
    compared = exact(case) is not None
    rescale = np.sqrt(case.rayleigh / case.schmidt)
    at_paper_size = compared and case.resolution == 81 and case.scheme == "sdpd"
    profile_limit, transfer_limit = limits(case)
    if compared:
        speed = profile(case, run, "velocity")
        found["vy_error"] = Metric(speed.error, limit=profile_limit)
        error = epsilon_error(speed.value * rescale, speed.expected * rescale, 1.0)
        printed = PAPER[case.driven_by][case.rayleigh][1] if at_paper_size else None
        found["vy_eps"] = Metric(error, printed, limit=printed)
    for kind in KINDS:
        limited = kind == case.driven_by
        if compared:
            line = profile(case, run, kind)
            found[f"C_error_{kind}"] = Metric(line.error, limit=profile_limit if limited else None)
            error = epsilon_error(line.value, line.expected, 1.0)
            printed = PAPER[kind][case.rayleigh][0] if at_paper_size else None
            found[f"C_eps_{kind}"] = Metric(error, printed, limit=printed if limited else None)
        time, cylinder, walls = transfers(case, run, kind)
        late = time > case.end - case.averaging
        for body, series in (("cylinder", cylinder), ("walls", walls)):
            mean = float(series[late].mean())
            found[f"transfer_{body}_{kind}"] = Metric(mean)
            if compared:
                error = mean / HALF_TRANSFER[case.rayleigh] - 1
                found[f"transfer_{body}_{kind}_error"] = Metric(
                    error, limit=transfer_limit if limited else None
                )
        net = run.observable(f"amount_{KINDS[kind]}") - run.observable(f"inflow_{KINDS[kind]}")
        size = abs(run.observable(f"amount_{KINDS[kind]}")[-1])
        drift = float((net[-1] - net[0]) / max(size, 1e-300))
        found[f"drift_{kind}"] = Metric(drift, limit=0.0 if kind == "molecules" else 1e-10)
    if case.driven_by == "concentrations":
        found["molecules_chi2"] = poisson_score(run)
    found["asymmetry"] = Metric(asymmetry(case, run))
    fluid = run.group("fluid")
    density = run.field("density")[len(run) - 1][fluid] / case.density
    found["density_variation"] = Metric(float(np.ptp(density)))
    return found


def figures(case: Convection, run: Run, directory: Path) -> list[Path]:
    """Concentration, speed, particles at the cylinder, profiles, transfer in time."""
    made = {
        "concentration": _field_figure(case, run, "concentrations"),
        "molecules": _field_figure(case, run, "molecules"),
        "speed": _field_figure(case, run, "velocity"),
        "particles": _particles_figure(case, run),
        "profiles": _profiles_figure(case, run),
        "transfer": _transfer_figure(case, run),
    }
    return [plots.save(figure, directory / f"{name}.png") for name, figure in made.items()]


def _on_grid(case: Convection, run: Run, field: str) -> tuple[np.ndarray, np.ndarray]:
    """Grid coordinates (m,) over L, and a field of the last frame on it, NaN in the cylinder."""
    number = 3 * case.resolution
    values = run.on_grid(field, number, groups=["fluid"])
    star = (np.arange(number) + 0.5) / number
    x, y = np.meshgrid(star, star, indexing="ij")
    values[np.hypot(x - 0.5, y - 0.5) < 0.1] = np.nan
    return star, values


@plots.styled
def _field_figure(case: Convection, run: Run, kind: str):
    figure, axes = plots.new_figure(4.4, 3.6)
    if kind == "velocity":
        star, v = _on_grid(case, run, "velocity")
        v = v / case.velocity
        speed = np.linalg.norm(v, axis=-1)
        mesh = axes.pcolormesh(star, star, speed.T, shading="nearest")
        axes.streamplot(
            star, star, v[..., 0].T, v[..., 1].T, color="white", linewidth=0.5, arrowsize=0.6
        )
        label = "|v| / v₀"
    else:
        star, values = _on_grid(case, run, f"concentration/{KINDS[kind]}")
        values = values / case.concentration
        mesh = axes.pcolormesh(star, star, values.T, shading="nearest", vmin=0, vmax=1)
        levels = np.linspace(0.1, 0.9, 9)
        axes.contour(star, star, values.T, levels=levels, colors="white", linewidths=0.6)
        label = f"C / C₀, {kind}"
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.fill(0.5 + 0.1 * np.cos(angle), 0.5 + 0.1 * np.sin(angle), color="0.85")
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="x / L", ylabel="y / L")
    axes.set_title(f"Ra = {case.rayleigh:g}, t = {run.times[-1] / case.time_unit:.4g} L/v₀")
    figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label=label)
    return figure


@plots.styled
def _particles_figure(case: Convection, run: Run):
    figure, axes = plots.new_figure(4.4, 3.6)
    star = run.field("position")[len(run) - 1] / case.length
    concentration = run.field("concentration/C")[len(run) - 1] / case.concentration
    reach = min(0.2, 14 / case.resolution)
    size = (72 * 2.9 / (2 * reach * case.resolution)) ** 2 * 0.5
    fluid, body = run.group("fluid"), run.group("cylinder")
    axes.scatter(*star[body].T, s=size, color="0.6", linewidths=0)
    mesh = axes.scatter(
        *star[fluid].T, s=size, c=concentration[fluid], vmin=0, vmax=1, linewidths=0
    )
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.plot(0.5 + 0.1 * np.cos(angle), 0.5 + 0.1 * np.sin(angle), "k-", lw=0.8)
    middle = 0.6  # the top of the cylinder, where the plume leaves
    axes.set(xlim=(0.5 - reach, 0.5 + reach), ylim=(middle - reach, middle + reach))
    axes.set(aspect="equal", xlabel="x / L", ylabel="y / L")
    figure.colorbar(mesh, cax=axes.inset_axes((1.04, 0.0, 0.04, 1.0)), label="C / C₀")
    return figure


@plots.styled
def _profiles_figure(case: Convection, run: Run):
    figure, (left, right) = plots.new_figure(7.0, 3.0, columns=2)
    table = exact(case)
    rescale = np.sqrt(case.rayleigh / case.schmidt)
    if table is not None:
        left.plot(table["x_star"], table["C"], "k-", lw=1, label="finite elements")
        right.plot(table["x_star"], table["vy"] * rescale, "k-", lw=1, label="finite elements")
    for kind, marker in zip(KINDS, "o^", strict=True):
        line = profile(case, run, kind)
        left.plot(line.x, line.value, marker, mfc="none", ms=4, label=kind)
    line = profile(case, run, "velocity")
    label = f"driven by {case.driven_by}"
    right.plot(line.x, line.value * rescale, "o", mfc="none", ms=4, label=label)
    left.set(xlabel="x / L", ylabel="C / C₀", xlim=(0.6, 1), ylim=(0, 1.02))
    right.set(xlabel="x / L", ylabel="v_y √(Ra/Sc) / v₀", xlim=(0.6, 1))
    plots.legend(left)
    plots.legend(right)
    return figure


@plots.styled
def _transfer_figure(case: Convection, run: Run):
    figure, axes = plots.new_figure(5.2, 3.2)
    for kind, style in (("molecules", ":"), ("concentrations", "-")):
        time, cylinder, walls = transfers(case, run, kind)
        axes.plot(time, cylinder, style, color=plots.COLOURS[1], lw=1, label=f"cylinder, {kind}")
        axes.plot(time, walls, style, color=plots.COLOURS[0], lw=1, label=f"walls, {kind}")
    if exact(case) is not None:
        expected = HALF_TRANSFER[case.rayleigh]
        axes.axhline(expected, color="black", ls="--", lw=0.8, label=f"steady: {expected:.4g}")
    late = 0.5 * np.ptp(run.times) / case.time_unit
    highest = cylinder[time > late].max() if (time > late).any() else cylinder.max()
    axes.set(xlabel="t v₀ / L", ylabel="transfer Q / (2 κ ΔC)", ylim=(0, 2 * highest))
    plots.legend(axes)
    return figure
