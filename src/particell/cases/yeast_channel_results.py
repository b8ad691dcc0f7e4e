"""What the yeast channel's run is compared with, and its figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from particell import plots
from particell.analysis.statistics import relative_l2
from particell.cases import reference
from particell.cases.base import Metric
from particell.cases.scores import binomial_metric
from particell.output.run import Run

#: Limit of the relative L2 errors.
LIMIT = 0.05
TIMES = (1.0, 2.0)
#: Time of the map, which the finite elements have too.
MAP_TIME = 2.0


class Channel(Protocol):
    """What is read of a :class:`.YeastChannel`, which says what it means."""

    height: float
    radius: float
    position: float
    mean_velocity: float
    concentration: float
    end: float

    @property
    def chemistry(self) -> str: ...
    @property
    def as_reference(self) -> bool: ...
    @property
    def time_unit(self) -> float: ...
    @property
    def spacing(self) -> float: ...
    @property
    def centre(self) -> tuple[float, float]: ...


def suffixes(run: Run) -> dict[str, str]:
    """What species' names end in, by how they are carried."""
    both = {"concentrations": "", "molecules": "_molecules"}
    return {k: s for k, s in both.items() if f"concentration/L{s}" in run.field_names}


def centreline(case: Channel, run: Run, field: str, frame: int) -> tuple[np.ndarray, ...]:
    """x* and a field along y = H/2, outside the cytoplasm."""
    star = reference.load("yeast_channel_centreline")["x_star"]
    line = np.stack([star * case.height, np.full(len(star), 0.5 * case.height)], axis=-1)
    values = run.on_points(field, line, frame, groups=["fluid", "membrane"])
    return star, values[:, 0] if values.ndim > 1 else values


def around_membrane(case: Channel, run: Run, field: str, frame: int) -> tuple[np.ndarray, ...]:
    """Angle in degrees (0 = downstream) and a field of the membrane's particles."""
    mask = run.group("membrane")
    offset = run.field("position")[frame][mask] - np.array(case.centre)
    angle = np.degrees(np.arctan2(offset[:, 1], offset[:, 0])) % 360
    order = np.argsort(angle)
    return angle[order], run.field(field)[frame][mask][order]


def reference_around(angle: np.ndarray, column: str) -> np.ndarray:
    """The finite-element values at given angles."""
    table = reference.load("yeast_channel_membrane")
    theta = np.append(table["theta_deg"], 360.0)
    values = np.append(table[column], table[column][0])
    return np.interp(angle, theta, values)


def time_column(kind: str, star: float) -> str:
    """Name of the reference's column for a quantity and time."""
    return f"{kind}_t{star:.1f}"


def finite_elements(case: Channel) -> str:
    """The reference's name in a legend."""
    return "finite elements" + ("" if case.as_reference else " (default parameters)")


def metrics(case: Channel, run: Run) -> dict[str, Metric]:
    """Errors against the finite elements, and of the molecules against the concentrations."""
    found: dict[str, Metric] = {}
    largest = LIMIT if case.as_reference else None
    table = reference.load("yeast_channel_centreline")
    for star in TIMES:
        if star > case.end * (1 + 1e-9):
            continue
        frame = run.at(star * case.time_unit)
        for kind, suffix in suffixes(run).items():
            limit = largest if kind == "concentrations" else None
            _, ligand = centreline(case, run, f"concentration/L{suffix}", frame)
            expected = table[time_column("L", star)]
            good = np.isfinite(expected)
            error = relative_l2(ligand[good] / case.concentration, expected[good])
            found[f"L_centreline_{kind}_t{star:g}"] = Metric(error, limit=limit)
            angle, bound = around_membrane(case, run, f"concentration/RL{suffix}", frame)
            expected = reference_around(angle, time_column("RL", star))
            error = relative_l2(bound / case.concentration, expected)
            found[f"RL_membrane_{kind}_t{star:g}"] = Metric(error, limit=limit)
        if len(suffixes(run)) == 2:
            found[f"RL_chi2_t{star:g}"] = _molecules_against_concentrations(run, frame)
    frame = len(run) - 1
    _, speed = centreline(case, run, "velocity", frame)
    outside = np.abs(table["x_star"] - case.position / case.height) > case.radius / case.height
    found["u_centreline"] = Metric(
        relative_l2(speed[outside] / case.mean_velocity, table["u"][outside]), limit=largest
    )
    return found


def _molecules_against_concentrations(run: Run, frame: int) -> Metric:
    """Reduced chi-square of RL molecules about the deterministic fraction of bound receptors.

    Each of a particle's receptors is bound with that probability: the counts are binomial.
    """
    mask = run.group("membrane")

    def values(name: str) -> np.ndarray:
        return np.asarray(run.field(name)[frame], dtype=float)[mask]

    bound = values("concentration/RL")
    share = bound / np.maximum(bound + values("concentration/R"), 1e-300)
    number = values("count/RL_molecules") + values("count/R_molecules")
    return binomial_metric(values("count/RL_molecules"), number, share)


def figures(case: Channel, run: Run, directory: Path) -> list[Path]:
    """Particles, fields, centreline and membrane."""
    made = []

    def save(name: str, figure: object) -> None:
        made.append(plots.save(figure, directory / f"{name}.png"))  # type: ignore[arg-type]

    last = len(run) - 1
    position = run.field("position")[last]
    save(
        "particles",
        plots.arrangement(position, run.static["group"], run.group_names, domain=run.domain),
    )
    save("cell", _close_up(case, run, last))
    fluid = run.group("fluid", "membrane")
    speed = np.linalg.norm(run.field("velocity")[last], axis=1)
    save(
        "speed",
        plots.field_map(
            position[fluid],
            speed[fluid] / case.mean_velocity,
            domain=run.domain,
            label="|v| / v₀",
            title=f"t* = {run.times[last] / case.time_unit:.2f}",
        ),
    )
    for kind, suffix in suffixes(run).items():
        save(
            f"ligand_{kind}",
            plots.field_map(
                position[fluid],
                run.field(f"concentration/L{suffix}")[last][fluid] / case.concentration,
                domain=run.domain,
                label="L / L₀",
                title=f"{kind}, t* = {run.times[last] / case.time_unit:.2f}",
                limits=(0.0, 1.0),
            ),
        )
    if run.times[last] / case.time_unit > MAP_TIME * (1 - 1e-9):
        save("map", _map_figure(case, run, run.at(MAP_TIME * case.time_unit)))
    save("centreline", _centreline_figure(case, run))
    save("membrane", _membrane_figure(case, run))
    save("binding", _binding_figure(case, run))
    return made


def _frames(case: Channel, run: Run) -> dict[float, int]:
    end = run.times[-1] / case.time_unit
    return {s: run.at(s * case.time_unit) for s in TIMES if s <= end * (1 + 1e-9)}


@plots.styled
def _close_up(case: Channel, run: Run, frame: int):
    figure, axes = plots.new_figure(4.2, 3.6)
    position = (run.field("position")[frame] - np.array(case.centre)) * 1e6
    for k, name in enumerate(run.group_names):
        x = position[run.static["group"] == k]
        axes.scatter(x[:, 0], x[:, 1], s=30, color=plots.COLOURS[k], linewidths=0, label=name)
    reach = 5 * case.radius * 1e6
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set(xlabel="x − x(cell) [µm]", ylabel="y − y(cell) [µm]")
    circle = np.linspace(0, 2 * np.pi, 200)
    r = case.radius * 1e6
    axes.plot(r * np.cos(circle), r * np.sin(circle), "-", color="black", linewidth=0.8)
    return figure


@plots.styled
def _map_figure(case: Channel, run: Run, frame: int):
    """L in the channel: as it is carried, over what the finite elements have."""
    names = suffixes(run)
    figure, rows = plots.new_figure(5.6, 2.1 * (len(names) + 1) + 0.4, rows=len(names) + 1)
    fluid = run.group("fluid", "membrane")
    star = run.field("position")[frame][fluid] / case.height
    inside = (star[:, 0] > 0) & (star[:, 0] < 2)
    shown = {"cmap": "viridis", "vmin": 0.0, "vmax": 1.0}
    for axes, (kind, suffix) in zip(rows, names.items(), strict=False):
        values = run.field(f"concentration/L{suffix}")[frame][fluid] / case.concentration
        size = (72 * 4.2 / 2 * case.spacing / case.height) ** 2 * 1.4
        mesh = axes.scatter(*star[inside].T, c=values[inside], s=size, linewidths=0, **shown)
        axes.set_title(kind)
    table = reference.load("yeast_channel_map")
    x = [float(name.removeprefix("L_x")) / 1000 for name in table if name != "y_star"]
    expected = np.stack([column for name, column in table.items() if name != "y_star"], axis=1)
    rows[-1].pcolormesh(x, table["y_star"], expected, shading="nearest", **shown)
    rows[-1].set_title(finite_elements(case))
    angle = np.linspace(0, 2 * np.pi, 100)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) * case.radius + np.array(case.centre)
    for axes in rows:
        axes.plot(*(circle / case.height).T, "-", color="black", linewidth=0.8)
        axes.set(xlim=(0, 2), ylim=(0, 1), aspect="equal", ylabel="y / H")
    rows[-1].set_xlabel("x / H")
    figure.suptitle(f"ligand at t* = {MAP_TIME:g}")
    figure.colorbar(mesh, ax=list(rows), label="L / L₀")
    return figure


@plots.styled
def _centreline_figure(case: Channel, run: Run):
    figure, axes = plots.new_figure(5.2, 3.2)
    table = reference.load("yeast_channel_centreline")
    for k, (star, frame) in enumerate(_frames(case, run).items()):
        colour = plots.COLOURS[k]
        axes.plot(
            table["x_star"],
            table[time_column("L", star)],
            "-",
            color=colour,
            linewidth=1,
            label=f"{finite_elements(case)}, t* = {star:g}",
        )
        for (kind, suffix), marker in zip(suffixes(run).items(), "o^", strict=False):
            x, values = centreline(case, run, f"concentration/L{suffix}", frame)
            axes.plot(
                x[::8],
                values[::8] / case.concentration,
                marker,
                color=colour,
                markerfacecolor="none",
                markersize=4,
                label=f"{kind}, t* = {star:g}",
            )
    axes.set(xlabel="x / H", ylabel="L / L₀ on the centreline", ylim=(0, 0.6))
    axes.legend()
    return figure


@plots.styled
def _membrane_figure(case: Channel, run: Run):
    figure, axes = plots.new_figure(5.2, 3.2)
    theta = np.linspace(0, 360, 241)
    for k, (star, frame) in enumerate(_frames(case, run).items()):
        colour = plots.COLOURS[k]
        axes.plot(
            theta,
            reference_around(theta, time_column("RL", star)),
            "-",
            color=colour,
            linewidth=1,
            label=f"{finite_elements(case)}, t* = {star:g}",
        )
        for (kind, suffix), marker in zip(suffixes(run).items(), "o^", strict=False):
            angle, values = around_membrane(case, run, f"concentration/RL{suffix}", frame)
            axes.plot(
                angle,
                values / case.concentration,
                marker,
                color=colour,
                markerfacecolor="none",
                label=f"{kind}, t* = {star:g}",
            )
    finish_membrane(axes)
    return figure


def finish_membrane(axes: Any) -> None:
    """Labels of a figure of the membrane."""
    axes.set(xlabel="angle from downstream [°]", ylabel="RL / R₀ in the membrane", ylim=(0, None))
    axes.set_xticks(np.arange(0, 361, 45))
    axes.legend()


@plots.styled
def _binding_figure(case: Channel, run: Run):
    figure, axes = plots.new_figure(5.2, 3.2)
    table = reference.load("yeast_channel_mean")
    axes.plot(table["t_star"], table["RL_mean"], "-", color="black", label=finite_elements(case))
    mask = run.group("membrane")
    weight = run.static["mass"][mask]
    for (kind, suffix), marker in zip(suffixes(run).items(), "o^", strict=False):
        values = run.field(f"concentration/RL{suffix}")[:][:, mask] @ weight / weight.sum()
        axes.plot(
            run.times / case.time_unit,
            values / case.concentration,
            marker,
            color=plots.COLOURS[0 if suffix == "" else 1],
            markerfacecolor="none",
            markersize=4,
            label=kind,
        )
    axes.set(xlabel="t / t₀", ylabel="mean RL / R₀")
    axes.legend()
    return figure
