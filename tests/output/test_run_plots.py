"""Pictures of a run show the numbers that it holds."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from PIL import Image, ImageSequence
from scipy.stats import poisson

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output import movie
from particell.output.run import Run

SIDE = 8
TIMES = [0.0, 0.001, 0.002, 0.003]


def a_run(dim: int = 2) -> Run:
    """A lattice whose fields are linear in space and time, so that interpolation is exact."""
    domain = Domain((0,) * dim, (4e-6,) * dim, depth=1e-6)
    line = (np.arange(SIDE) + 0.5) * 4e-6 / SIDE
    x = np.stack(np.meshgrid(*[line] * dim, indexing="ij"), -1).reshape(-1, dim)
    static = {
        "id": np.arange(len(x)),
        "group": (x[:, 0] > 2e-6).astype(np.int32),
        "mass": np.ones(len(x)),
        "support": np.full(len(x), 1.5e-6),
    }
    frames = []
    for k in range(len(TIMES)):
        velocity = np.zeros_like(x)
        velocity[:, 0] = -(1 + k) * x[:, -1]
        frames.append(
            {
                "position": x,
                "velocity": velocity,
                "concentration/L": x[:, 0] * (k + 1),
                "count/L": np.arange(len(x)) % 3,
            }
        )
    observables = [
        {"kinetic_energy": 2.0 * k, "amount_A": k, "amount_L": 5 - k, "momentum_x": k**2}
        for k in range(len(TIMES))
    ]
    groups = ["left", "right"]
    steps = list(range(len(TIMES)))
    return Run.from_memory(domain, groups, static, steps, TIMES, frames, observables)


@pytest.fixture
def run() -> Run:
    return a_run()


def test_scatter(run, tmp_path):
    figure = run.plot.scatter("speed", frame=1, groups="right", path=tmp_path / "a.png")
    dots = figure.axes[0].collections[0]
    mask = run.group("right")
    assert np.allclose(dots.get_offsets(), run.field("position")[1][mask] * 1e6)
    assert np.allclose(dots.get_array(), 2 * run.field("position")[1][mask, 1])
    assert figure.axes[0].get_title() == "t = 1 ms"
    assert figure.axes[0].child_axes[0].get_ylabel() == "speed [m/s]"
    assert (tmp_path / "a.png").stat().st_size > 1000
    signed = run.plot("velocity", 1, component="x").axes[0].collections[0].get_array()
    assert np.allclose(signed, -2 * run.field("position")[1][:, 1])
    own = run.plot.scatter(np.arange(64.0), label="number").axes[0]
    assert np.array_equal(own.collections[0].get_array(), np.arange(64))
    assert own.child_axes[0].get_ylabel() == "number"
    masses = run.plot.scatter("mass", limits=(0, 3)).axes[0].collections[0]
    assert masses.get_clim() == (0, 3)


def test_scatter_in_1d_and_3d():
    line = a_run(1).plot.scatter("concentration/L", 2).axes[0].lines[0]
    assert np.allclose(line.get_ydata(), 3e-6 * line.get_xdata())
    dots = a_run(3).plot.scatter("concentration/L").axes[0].collections[0]
    assert np.allclose(dots.get_array(), 4e-6 * dots.get_offsets()[:, 0])


def test_3d_is_seen_in_three_planes_through_the_middle(tmp_path):
    """One layer each, never all particles on top of each other."""
    z = a_run(3).field("position")[0][:, 2]
    figure = a_run(3).plot.scatter(z, path=tmp_path / "a.png")
    named = [(a.get_xlabel(), a.get_ylabel(), a.get_title()) for a in figure.axes]
    assert named == [
        ("x [µm]", "y [µm]", "z = 2 µm"),
        ("x [µm]", "z [µm]", "y = 2 µm"),
        ("y [µm]", "z [µm]", "x = 2 µm"),
    ]
    for axes in figure.axes:
        assert len(axes.collections[0].get_offsets()) == SIDE**2
    (level,) = np.unique(figure.axes[0].collections[0].get_array())
    assert abs(level - 2e-6) < 0.3e-6
    maps = a_run(3).plot.map("speed", cells=4, path=tmp_path / "b.png").axes
    assert [len(axes.images) for axes in maps] == [1, 1, 1]
    assert np.allclose(maps[0].images[0].get_array(), 4 * 2e-6)  # 4 times z
    assert maps[0].images[0].get_clim() == maps[2].images[0].get_clim()


def test_map(run):
    figure = run.plot.map("concentration/L", frame=1, cells=(10, 5))
    image = figure.axes[0].images[0]
    centres = (np.arange(10) + 0.5) * 4e-7
    assert np.allclose(image.get_array(), np.tile(2 * centres, (5, 1)))
    assert np.allclose(image.get_extent(), (0, 4, 0, 4))
    assert figure.axes[0].child_axes[0].get_ylabel() == "concentration of L [mol/m³]"
    half = run.plot.map("speed", cells=8, groups=["left"], support=4e-7, order=0)
    shown = half.axes[0].images[0].get_array()
    assert np.isfinite(shown[:, :4]).all()
    assert np.ma.getmaskarray(shown)[:, 5:].all() or np.isnan(shown[:, 5:]).all()


def test_map_across_3d():
    run = a_run(3)
    figure = run.plot.map("speed", 0, across="x", at=1e-6, cells=6)
    image, centres = figure.axes[0].images[0], (np.arange(6) + 0.5) * 4e-6 / 6
    assert figure.axes[0].get_xlabel() == "y [µm]"
    assert figure.axes[0].get_ylabel() == "z [µm]"
    assert np.allclose(image.get_array(), np.tile(centres[:, None], (1, 6)))
    at = run.plot.map("concentration/L", 0, across="x", at=1e-6, cells=4).axes[0].images[0]
    assert np.allclose(at.get_array(), 1e-6)
    beyond = {"across": "x", "at": 1.0}
    for options in ({"across": "u"}, {"at": 1e-6}, beyond, {"cells": (2, 2)}):
        with pytest.raises(InputError):
            run.plot.map("speed", **options)


def test_line(run):
    figure = run.plot.line(
        "velocity",
        start=(1e-6, 0),
        end=(1e-6, 4e-6),
        frames=[0, -1],
        points=9,
        component="x",
        reference={"exact": lambda y: -4 * y},
    )
    first, last, exact = figure.axes[0].lines
    assert np.allclose(first.get_xdata(), np.linspace(0, 4, 9))
    assert np.allclose(first.get_ydata(), -1e-6 * first.get_xdata())
    assert np.allclose(last.get_ydata(), exact.get_ydata())
    assert [line.get_label() for line in (first, last, exact)] == ["t = 0 ms", "t = 3 ms", "exact"]
    assert figure.axes[0].get_xlabel() == "y [µm]"
    slanted = run.plot.line("speed", start=(0, 0), end=(3e-6, 4e-6), points=5).axes[0]
    assert slanted.get_xlabel() == "distance [µm]"
    assert np.allclose(slanted.lines[0].get_xdata(), np.linspace(0, 5, 5))
    whole = a_run(1).plot.line("concentration/L", points=4).axes[0].lines[0]
    assert np.allclose(whole.get_ydata(), 4e-6 * whole.get_xdata())


def test_series(run):
    figure = run.plot.series()
    labels = {axes.get_ylabel(): axes for axes in figure.axes}
    # A is an amount in mol, L is counted: they do not share an axis
    assert set(labels) == {
        "kinetic energy [J]",
        "amount [mol]",
        "amount [molecules]",
        "momentum [kg m/s]",
        "",  # of a panel that is left empty
    }
    energy = labels["kinetic energy [J]"].lines[0]
    assert np.allclose(energy.get_xdata(), [0, 1, 2, 3])
    assert energy.get_ydata().tolist() == [0, 2, 4, 6]
    one = run.plot.series("amount_L", reference={"none": 0.0}).axes[0]
    assert [line.get_ydata()[-1] for line in one.lines] == [2, 0]


def test_histogram(run):
    figure = run.plot.histogram("count/L", reference={"Poisson": poisson(1.0)})
    (bars,) = figure.axes[0].patches
    shares = np.bincount(run.field("count/L")[-1]) / 64
    assert np.allclose(bars.get_data().values, shares)
    assert np.allclose(bars.get_data().edges, [-0.5, 0.5, 1.5, 2.5])
    assert np.allclose(figure.axes[0].lines[0].get_ydata(), poisson.pmf([0, 1, 2], 1.0))
    bars = run.plot.histogram("concentration/L", bins=5).axes[0].patches[0].get_data()
    assert np.sum(bars.values * np.diff(bars.edges)) == pytest.approx(1)
    # two whole numbers a bin: the mean probability, so that it can be compared
    wide = run.plot.histogram(np.arange(64), bins=32).axes[0].patches[0].get_data()
    assert np.allclose(wide.values, 1 / 64)


def test_gif(run, tmp_path):
    made = run.plot.animation("speed", tmp_path / "a.gif", fps=20, dpi=50, progress=False)
    with Image.open(made) as file:
        pictures = [np.asarray(f.convert("RGB"), int) for f in ImageSequence.Iterator(file)]
        assert file.info["duration"] == 50
    assert len(pictures) == len(TIMES)
    # frame by frame it is the picture of that frame on the scale of all
    last = run.plot.scatter("speed", -1, limits=(0.25e-6, 15e-6))
    last.set_dpi(50)
    last.canvas.draw()
    expected = np.asarray(last.canvas.buffer_rgba())[..., :3].astype(int)
    assert np.abs(pictures[-1] - expected).mean() < 3
    assert np.abs(pictures[0] - expected).mean() > 10
    assert "data:image/gif;base64," in made._repr_html_()


@pytest.mark.parametrize("kind", ["map", "line"])
def test_other_animations_move(run, tmp_path, kind):
    options = {"cells": 4} if kind == "map" else {"start": (0, 0), "end": (0, 4e-6), "points": 5}
    path = tmp_path / "a.gif"
    run.plot.animation("speed", path, kind=kind, frames=[0, 3], dpi=40, progress=False, **options)
    with Image.open(path) as file:
        assert file.n_frames == 2


@pytest.mark.skipif(movie.ffmpeg() is None, reason="there is no ffmpeg here")
def test_mp4(run, tmp_path):
    made = run.plot.animation("speed", tmp_path / "a.mp4", dpi=50, progress=False)
    assert b"ftyp" in made.path.read_bytes()[:16]
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    assert "video/mp4" in made._repr_html_()


def test_without_ffmpeg(run, tmp_path, monkeypatch):
    monkeypatch.setattr(movie.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"ffmpeg is missing .*particell\[viz\]"):
        run.plot.animation("speed", tmp_path / "a.mp4")


def test_refusals(run, tmp_path):
    plot, gif = run.plot, tmp_path / "a.gif"
    for call, words in (
        (lambda: plot("velocty"), "did you mean 'velocity'"),
        (lambda: plot.scatter("density"), "field = 'density'"),
        (lambda: plot.scatter("velocity", component="z"), "'x', 'y'"),
        (lambda: plot.scatter("count/L", component="x"), "no vector"),
        (lambda: plot.scatter("velocity", frame=4), "between -4 and 3"),
        (lambda: plot.scatter("velocity", groups="rihgt"), "did you mean 'right'"),
        (lambda: plot.scatter(np.zeros(3)), "of shape"),
        (lambda: plot.map("mass"), "field = 'mass'"),
        (lambda: plot.map("speed", across="z"), "left out in 2D"),
        (lambda: a_run(1).plot.map("speed"), "plot.line"),
        (lambda: plot.line("speed"), "2 numbers each"),
        (lambda: plot.line(start=(0, 0), end=(1e-6, 0)), "fields"),
        (lambda: plot.line("speed", start=(0, 0), end=(0, 0)), "another point"),
        (lambda: plot.line("speed", "count/L", start=(0, 0), end=(1e-6, 0)), "of one unit"),
        (lambda: plot.series("amount_X"), "amount_X"),
        (lambda: plot.series(reference={"a": 1.0}), "several panels"),
        (lambda: plot.histogram("count/L", bins=0), "bins = 0"),
        (lambda: plot.histogram("count/L", reference={"a": 3}), "pmf"),
        (lambda: plot.animation("speed", gif, kind="sctter"), "did you mean 'scatter'"),
        (lambda: plot.animation("speed", tmp_path / "a.avi"), r"\.gif or \.mp4"),
        (lambda: plot.animation("speed", gif, fps=0), "fps"),
        (lambda: plot.animation("speed", gif, frames=[]), "at least one"),
        (lambda: plot.animation("speed", gif, shades=1), "shades"),
    ):
        with pytest.raises(InputError, match=words) as error:
            call()
        assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_a_picture_reads_one_frame_only(run, monkeypatch):
    asked = []
    read = run.source.read
    monkeypatch.setattr(run.source, "read", lambda n, k: asked.append((n, k)) or read(n, k))
    run.plot.scatter("speed", -1)
    assert sorted(asked) == [("position", 3), ("velocity", 3)]


def test_no_frames():
    run = Run.from_memory(Domain((0,), (1,)), ["a"], {"group": np.zeros(1)}, [], [], [])
    with pytest.raises(InputError, match="at least one frame"):
        run.plot.series()
    assert "none yet" in run._repr_html_()


def test_notebooks_show_figures(run):
    data, size = run.plot("speed")._repr_png_()
    assert data[:4] == b"\x89PNG"
    assert size["width"] > 100
    assert "scatter" in repr(run.plot)
