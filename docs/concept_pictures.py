"""The diagrams of the pages on concepts and on methods.

    python docs/concept_pictures.py [names...] [--out docs/images]

Takes some seconds; needs nothing but what Particell needs. ``kernel-sums`` also prints its table.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import click
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Rectangle

from particell import plots
from particell.geometry.domain import Domain
from particell.geometry.fill import arranged, rings
from particell.geometry.shapes import Ball
from particell.kernels import CODES, normalisation, shape_f, shape_w

BLUE, RED, GREEN, PINK, ORANGE, SKY, BLACK = plots.COLOURS
GREY, PALE = "#8c8c8c", "#e8e8e8"


def bare(axes: Axes, xlim: tuple[float, float], ylim: tuple[float, float], title: str = "") -> None:
    """Axes without frame and ticks, one unit as long as the other."""
    axes.set(xlim=xlim, ylim=ylim, aspect="equal", xticks=[], yticks=[], title=title)
    for spine in axes.spines.values():
        spine.set_visible(False)


def arrow(
    axes: Axes,
    start: Sequence[float],
    end: Sequence[float],
    colour: str = BLACK,
    style: str = "-|>",
    **options,
) -> None:
    """An arrow from point to point."""
    options = {"mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.2, **options}
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle=style, color=colour, **options))


def box(
    axes: Axes,
    centre: Sequence[float],
    words: str,
    colour: str = BLACK,
    width: float = 2.0,
    height: float = 0.9,
) -> None:
    """A box with words in it."""
    corner = (centre[0] - width / 2, centre[1] - height / 2)
    shape = "round,pad=0,rounding_size=0.12"
    axes.add_patch(
        FancyBboxPatch(
            corner,
            width,
            height,
            boxstyle=shape,
            facecolor="white",
            edgecolor=colour,
            linewidth=1.3,
        )
    )
    axes.text(*centre, words, ha="center", va="center", fontsize=8)


def kernel() -> Figure:
    """Particles in the support of one, coloured by their weight, and the kernels."""
    figure, (left, right) = plots.new_figure(7.2, 3.1, columns=2)
    domain = Domain((0, 0), (11, 11), periodic="xy")
    points = arranged(domain, 1.0, "packed", seed=3)
    middle = points[np.argmin(np.linalg.norm(points - 5.5, axis=1))]
    r, h = np.linalg.norm(points - middle, axis=1), 3.0
    weight = np.array([shape_w(q, CODES["lucy"]) for q in r / h])
    near = (r < h) & (r > 0)
    left.scatter(*points[~near].T, s=60, color=PALE)
    left.scatter(*points[near].T, s=60, c=weight[near], cmap="Blues", vmin=-0.3, vmax=0.8)
    for point in points[near]:
        left.plot(*np.stack([middle, point]).T, color=GREY, linewidth=0.4, zorder=0)
    left.scatter(*middle, s=70, color=RED, zorder=3)
    left.add_patch(Circle(middle, h, fill=False, color=RED, linewidth=1.2))
    edge = middle + h * np.array([np.cos(0.35), np.sin(0.35)])
    arrow(left, middle, edge, RED)
    left.text(*(0.35 * middle + 0.65 * edge + (0.0, 0.3)), "h", color=RED, fontsize=11)
    left.text(middle[0] - 0.15, middle[1] + 0.3, "i", color=RED, fontsize=11, ha="right")
    bare(left, (0, 11), (0, 11), "particle i sees those within its support h")
    q = np.linspace(0, 1, 200)
    for name, code in CODES.items():
        w = normalisation(code, 2) * np.array([shape_w(s, code) for s in q])
        right.plot(q, w, label=name)
    right.set(
        xlabel="distance r / h", ylabel="W h² (2D)", title="the kernels, all named by support"
    )
    right.legend()
    return figure


def volumes() -> Figure:
    """Four ways of placing particles, each with a volume of its own."""
    figure, axes = plots.new_figure(7.2, 2.1, columns=4)
    domain = Domain((0, 0), (6, 6), periodic="xy")
    for ax, name in zip(axes[:3], ("square", "hexagonal", "packed"), strict=True):
        points = arranged(domain, 1.0, name, seed=2)
        ax.scatter(*points.T, s=26, color=BLUE)
        bare(ax, (-0.2, 6.2), (-0.2, 6.2), name)
        ax.add_patch(Rectangle((0, 0), 6, 6, fill=False, color=GREY, linewidth=0.8))
    for k in range(1, 6):
        axes[0].plot([k, k], [0, 6], color=GREY, linewidth=0.4, zorder=0)
        axes[0].plot([0, 6], [k, k], color=GREY, linewidth=0.4, zorder=0)
    axes[0].add_patch(Rectangle((2, 3), 1, 1, color=SKY, alpha=0.6, zorder=0))
    axes[0].text(2.78, 3.1, "V", ha="center", color=BLUE, fontsize=8)
    points, volume = rings(Ball((3, 3), 2.9), 0.0, 2.9, 0.97)
    axes[3].scatter(*points.T, s=26 * volume / volume.max(), color=BLUE)
    axes[3].add_patch(Circle((3, 3), 2.9, fill=False, color=GREY, linewidth=0.8))
    bare(axes[3], (-0.2, 6.2), (-0.2, 6.2), "rings")
    return figure


def walls() -> Figure:
    """No slip through a known surface, and the volume fraction where none is known."""
    figure, (left, right) = plots.new_figure(7.2, 3.2, columns=2)
    xs = np.arange(7) + 0.5
    for ax in (left, right):
        ax.add_patch(Rectangle((0, -3), 7, 3, color=PALE, zorder=0))
        for y in (-0.5, -1.5, -2.5):
            ax.scatter(xs, np.full(7, y), s=40, color=GREY, zorder=2)
        for y in (0.5, 1.5, 2.5, 3.5):
            ax.scatter(xs, np.full(7, y), s=40, color=SKY, zorder=2)
    left.axhline(0, color=BLACK, linewidth=1.2)
    left.text(7.1, 0.12, "surface", fontsize=8)
    i, j = np.array([2.5, 1.5]), np.array([3.5, -1.5])
    left.scatter(*i, s=55, color=RED, zorder=3)
    left.scatter(*j, s=55, color=BLACK, zorder=3)
    for (x, y), name in ((i, "$d_i$"), (j, "$d_j$")):
        arrow(left, (x, y), (x, 0), BLACK, "<|-|>", linewidth=0.9)
        left.text(x - 0.15, y / 2, name, ha="right", va="center")
    left.text(i[0] + 0.2, i[1] + 0.15, "i", color=RED)
    left.text(j[0] + 0.25, j[1] - 0.5, "j")
    for y in (3.5, 2.5, 1.5, 0.5):
        arrow(left, (4.6, y), (4.6 + 0.55 * y, y), BLUE)
    for y in (-0.5, -1.5):
        arrow(left, (4.6, y), (4.6 + 0.55 * y, y), RED)
    left.plot([4.6 - 0.55 * 1.9, 4.6 + 0.55 * 3.9], [-1.9, 3.9], color=BLUE, linewidth=0.8)
    bare(left, (-0.2, 8.4), (-3.2, 4.2), "surface known: velocity mirrored through it")
    i = np.array([3.0, 1.1])
    share = Circle(i, 2.6, color=ORANGE, alpha=0.35, zorder=1)
    right.add_patch(share)
    share.set_clip_path(Rectangle((0, -3), 7, 3, transform=right.transData))
    right.add_patch(Circle(i, 2.6, fill=False, color=RED, linewidth=1.0))
    right.scatter(*i, s=55, color=RED, zorder=3)
    right.text(i[0] + 0.25, i[1] - 0.1, "i", color=RED)
    right.text(3.0, -1.0, r"$\varphi_i$", ha="center", fontsize=11, zorder=4)
    arrow(right, i, (i[0], i[1] + 1.6), BLACK)
    right.text(3.12, 1.9, r"$e_i = -\nabla\varphi/|\nabla\varphi|$", fontsize=8)
    bare(right, (-0.2, 7.2), (-3.2, 4.2), "not known: distance from the share in the wall")
    return figure


def exchange() -> Figure:
    """What a pair exchanges of a concentration, and how molecules jump and react."""
    figure, axes = plots.new_figure(7.2, 2.2, columns=3)
    for ax, title in zip(
        axes, ("an amount is exchanged", "molecules jump", "they react inside"), strict=True
    ):
        bare(ax, (-0.1, 4.1), (-0.2, 2.2), title)
    levels = (0.9, 0.35)
    for x, level in zip((0.95, 3.05), levels, strict=True):
        axes[0].add_patch(Circle((x, 1), 0.9, facecolor="white", edgecolor=BLACK, zorder=0))
        disc = Circle((x, 1), 0.9, color=BLUE, alpha=0.15 + 0.6 * level, zorder=1)
        axes[0].add_patch(disc)
    arrow(axes[0], (1.2, 1), (2.8, 1), RED, linewidth=2)
    axes[0].text(2.0, 1.12, r"$q\,dt$", ha="center", color=RED)
    axes[0].text(0.95, 0.3, r"$-q\,dt$", ha="center", fontsize=8)
    axes[0].text(3.05, 0.3, r"$+q\,dt$", ha="center", fontsize=8)
    random = np.random.default_rng(4)
    for ax in axes[1:]:
        for x in (0.95, 3.05):
            ax.add_patch(Circle((x, 1), 0.9, facecolor="white", edgecolor=BLACK, zorder=0))
    for x, number in ((0.95, 9), (3.05, 3)):
        angle, r = random.uniform(0, 2 * np.pi, number), 0.72 * random.uniform(0, 1, number) ** 0.5
        axes[1].scatter(x + r * np.cos(angle), 1 + r * np.sin(angle), s=16, color=BLUE)
    arrow(axes[1], (1.4, 1.25), (2.7, 1.35), RED, connectionstyle="arc3,rad=-0.35")
    arrow(axes[1], (2.75, 0.7), (1.45, 0.6), RED, connectionstyle="arc3,rad=-0.35")
    for x, reacts in ((0.95, True), (3.05, False)):
        spots = np.array([(-0.45, 0.35), (0.3, 0.45), (-0.3, -0.4)]) * (1 if reacts else -1)
        axes[2].scatter(x + spots[:, 0], 1 + spots[:, 1], s=16, color=BLUE)
        if reacts:
            axes[2].scatter([x + 0.0, x + 0.14], [1.0, 1.0], s=16, color=[BLUE, RED])
            arrow(axes[2], (x + 0.2, 0.92), (x + 0.45, 0.6), BLACK, mutation_scale=6)
            axes[2].scatter(x + 0.5, 0.5, s=30, color=GREEN)
    axes[2].text(2.0, -0.12, "A + B → C, in each particle for itself", ha="center", fontsize=8)
    return figure


def data_flow() -> Figure:
    """From a description to an analysis, one way."""
    figure, ax = plots.new_figure(7.2, 2.9)
    bare(ax, (-0.2, 14.6), (-0.3, 5.4))
    parts = ("Domain", "Phases", "Scheme", "Species, Reactions", "Boundaries")
    for k, words in enumerate(parts):
        box(ax, (1.4, 4.8 - 1.1 * k), words, BLUE, 2.8, 0.8)
        arrow(ax, (2.85, 4.8 - 1.1 * k), (4.15, 2.6 + 0.18 * (2 - k)), GREY)
    box(ax, (5.3, 2.6), "Simulation", RED, 2.2, 1.3)
    arrow(ax, (4.7, 3.3), (5.9, 3.3), RED, connectionstyle="arc3,rad=-1.3")
    ax.text(5.3, 4.45, "steps", ha="center", fontsize=8, color=RED)
    arrow(ax, (6.45, 2.6), (7.35, 2.6), GREY)
    box(ax, (8.4, 2.6), "Observers", GREEN, 2.0, 1.3)
    ax.text(8.4, 1.45, "frames, checkpoints,\nprogress, stop", ha="center", va="top", fontsize=7)
    for y, words in ((3.7, "run.h5"), (1.5, "checkpoint.h5")):
        arrow(ax, (9.45, 2.6 + 0.2 * (y - 2.6)), (10.2, y), GREY)
        box(ax, (11.3, y), words, ORANGE, 2.1, 0.8)
    arrow(ax, (12.4, 3.7), (12.9, 3.7), GREY)
    box(ax, (13.7, 3.7), "Run", PINK, 1.5, 0.9)
    ax.text(13.7, 3.1, "fields, lines,\ngrids, figures", ha="center", va="top", fontsize=7)
    arrow(ax, (11.3, 1.05), (5.3, 1.9), GREY, connectionstyle="arc3,rad=-0.34")
    ax.text(8.6, 0.02, "resume, to the same bits", ha="center", fontsize=7)
    ax.text(1.4, 5.35, "description", ha="center", fontsize=8, color=BLUE)
    return figure


def time_step() -> Figure:
    """What happens in a step of the flow, and how often species, frames and lists come."""
    figure, (top, bottom) = plots.new_figure(7.2, 3.0, rows=2)
    bare(top, (-0.2, 14.4), (-0.9, 1.1), "one step of the flow (velocity-Verlet)")
    stages = (
        ("half a kick\nv += a dt/2", BLUE),
        ("density at\nthe half step", SKY),
        ("drift\nx += v dt", BLUE),
        ("walls turn\nback, reflect", GREY),
        ("forces\na(x, v)", RED),
        ("half a kick\nv += a dt/2", BLUE),
    )
    for k, (words, colour) in enumerate(stages):
        box(top, (1.1 + 2.42 * k, 0.2), words, colour, 2.0, 1.2)
        if k:
            arrow(top, (2.42 * k - 0.3, 0.2), (2.42 * k + 0.08, 0.2), GREY, mutation_scale=7)
    bottom.set(xlim=(-0.5, 24.6), ylim=(-0.6, 3.6), xticks=[], yticks=range(4))
    bottom.set_yticklabels(["frames", "neighbour list", "species", "flow"])
    bottom.tick_params(length=0)
    for spine in bottom.spines.values():
        spine.set_visible(False)
    rows = (
        (3, range(25), BLUE, 40),
        (2, range(0, 25, 4), GREEN, 90),
        (1, (0, 7, 13, 20), GREY, 90),
        (0, (0, 12, 24), ORANGE, 120),
    )
    for y, times, colour, size in rows:
        bottom.axhline(y, color=PALE, zorder=0)
        bottom.scatter(
            list(times), [y] * len(times), color=colour, s=size, marker="|", linewidths=2
        )
    bottom.set_title(
        "in time: a frame is a whole number of steps of the species, those of the flow"
    )
    return figure


def kernel_sum(name: str, support: float, dim: int) -> tuple[float, int]:
    """(1/D) Σ V F r² on the unit lattice, which should be 1, and the number of neighbours."""
    reach = range(-int(np.ceil(support)), int(np.ceil(support)) + 1)
    r = np.linalg.norm(np.array(list(itertools.product(reach, repeat=dim))), axis=1)
    r = r[(r > 0) & (r < support)]
    code = CODES[name]
    f = np.array([shape_f(q, code) for q in r / support])
    scale = normalisation(code, dim) / support ** (dim + 2)
    return float((scale * f * r**2).sum() / dim), len(r)


def kernel_sums() -> Figure:
    """How far the kernel sum is off on square and cubic lattices."""
    figure, axes = plots.new_figure(7.2, 2.8, columns=2)
    supports = np.linspace(1.6, 4.0, 97)
    for ax, dim in zip(axes, (2, 3), strict=True):
        for name in CODES:
            off = [100 * (kernel_sum(name, s, dim)[0] - 1) for s in supports]
            ax.plot(supports, off, label=name)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set(ylim=(-12, 7), xlabel="support h / Δp", title=f"{dim}D lattice")
    axes[0].set_ylabel("error of the sum [%]")
    axes[0].legend()
    for s in (1.8, 2.0, 2.4, 2.6, 3.0, 4.0):
        both = {n: [kernel_sum(n, s, dim) for dim in (2, 3)] for n in CODES}
        counts = ", ".join(str(number) for _, number in both["lucy"])
        errors = "  ".join(
            f"{n} " + ", ".join(f"{100 * (v - 1):+.1f} %" for v, _ in both[n]) for n in CODES
        )
        click.echo(f"h = {s}: {counts} neighbours; {errors}")
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    "kernel": kernel,
    "volumes": volumes,
    "walls": walls,
    "exchange": exchange,
    "data-flow": data_flow,
    "time-step": time_step,
    "kernel-sums": kernel_sums,
}


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(list(PICTURES)))
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"))
def main(names: tuple[str, ...], out: Path) -> None:
    """Draw the diagrams (default: all)."""
    for name in names or PICTURES:
        path = out / f"concepts-{name}.png"
        plots.save(plots.styled(PICTURES[name])(), path)
        click.echo(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
