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
    def sponge_length(self) -> float: ...
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
    values = run.on_points(field, line, frame)
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
    outside = np.abs(table["x_star"] - case.position / case.height) > case.radius / case.height
    for star in TIMES:
        if star > case.end * (1 + 1e-9):
            continue
        frame = run.at(star * case.time_unit)
        for kind, suffix in suffixes(run).items():
            limit = largest if kind == "concentrations" else None
            _, ligand = centreline(case, run, f"concentration/L{suffix}", frame)
            expected = table[time_column("L", star)]
            # within the cell, particles say where the membrane ends: to a spacing
            good = np.isfinite(expected) & (outside | np.isfinite(ligand))
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
    arranged = plots.arrangement(position, run.static["group"], run.group_names, domain=run.domain)
    save("particles", _with_sponge(case, run, arranged))
    save("cell", _close_up(case, run, last))
    save("receptors", _receptors(case, run, last))
    carrying = run.carrying("velocity")
    speed = np.linalg.norm(run.field("velocity")[last], axis=1) / case.mean_velocity
    star = f"t* = {run.times[last] / case.time_unit:.2g}"
    maps: dict[str, tuple[Any, ...]] = {"speed": (carrying, speed, "|v| / v₀", star, None)}
    for kind, suffix in suffixes(run).items():
        name = f"concentration/L{suffix}"
        ligand = run.field(name)[last] / case.concentration
        title = f"{kind}, {star}"
        maps[f"ligand_{kind}"] = (run.carrying(name), ligand, "L / L₀", title, (0.0, 1.0))
    for name, (chosen, values, label, title, limits) in maps.items():
        figure = plots.field_map(
            position[chosen],
            values[chosen],
            domain=run.domain,
            others=position[~chosen],
            label=label,
            title=title,
            limits=limits,
        )
        save(name, _with_sponge(case, run, figure))
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
def _with_sponge(case: Channel, run: Run, figure: Any) -> Any:
    """A map of the channel, with the cell and the zone marked in which the inflow is made."""
    factor, _ = plots.length_scale(float(run.domain.lengths.max()))
    axes, title = figure.axes[0], figure.axes[0].get_title()
    plots.mark_zone(axes, -case.sponge_length / factor, 0.0, "sponge")
    axes.set_title("")
    axes.set_title(title, loc="right")  # beside the zone's name
    around = np.linspace(0, 2 * np.pi, 100)
    x, y = np.array(case.centre)[:, None] + case.radius * np.array([np.cos(around), np.sin(around)])
    axes.plot(x / factor, y / factor, "-", color="black", linewidth=0.8)
    return figure


def _cell_axes(case: Channel) -> tuple[Any, Any, float]:
    """A figure round the cell, and the area of a particle's disc in it."""
    figure, axes = plots.new_figure(5.0, 3.6)
    reach, circle = 5 * case.radius * 1e6, np.linspace(0, 2 * np.pi, 200)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set(xlabel="x − x(cell) [µm]", ylabel="y − y(cell) [µm]")
    r = case.radius * 1e6
    axes.plot(r * np.cos(circle), r * np.sin(circle), "-", color="black", linewidth=0.8)
    return figure, axes, 30.0


@plots.styled
def _close_up(case: Channel, run: Run, frame: int):
    """The particles at the cell by group."""
    figure, axes, area = _cell_axes(case)
    position = (run.field("position")[frame] - np.array(case.centre)) * 1e6
    for k, name in enumerate(run.group_names):
        x = position[run.static["group"] == k]
        if np.any(np.abs(x).max(axis=1) < axes.get_xlim()[1]):
            axes.scatter(*x.T, s=area, color=plots.COLOURS[k], linewidths=0, label=name)
    figure.legend(loc="outside right upper")
    return figure


@plots.styled
def _receptors(case: Channel, run: Run, frame: int):
    """The share of receptors that are bound in the membrane's particles; others are grey."""
    figure, axes, area = _cell_axes(case)
    suffix = next(iter(suffixes(run).values()))
    name = f"concentration/RL{suffix}"
    x, chosen = run.field("position")[frame] - np.array(case.centre), run.carrying(name)
    bound = run.field(name)[frame][chosen] / case.concentration
    most = float(bound.max()) or 1.0
    axes.scatter(*(x[run.group("fluid")] * 1e6).T, s=area, color="0.92", linewidths=0)
    axes.scatter(*(x[~chosen & ~run.group("fluid")] * 1e6).T, s=area, color="0.7", linewidths=0)
    mesh = axes.scatter(*(x[chosen] * 1e6).T, s=area, c=bound, vmin=0.0, vmax=most, linewidths=0)
    scale = axes.inset_axes((1.04, 0.0, 0.04, 1.0))
    figure.colorbar(mesh, cax=scale, label="RL / R₀ in the membrane")
    axes.set_title(f"t* = {run.times[frame] / case.time_unit:.2g}")
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
    plots.legend(axes)
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
    plots.legend(axes)


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
    plots.legend(axes)
    return figure
