"""Files for programs of molecular dynamics, as H5MD says and as MDAnalysis reads them."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import particell as pc
from particell.errors import InputError
from particell.output.run import Run

DEPTH = 2e-7


def a_run(dim: int, frames: int = 3) -> Run:
    """Three particles that move at uniform velocities."""
    domain = pc.Domain((0,) * dim, (1e-6, 2e-6, 3e-6)[:dim], periodic="x", depth=DEPTH)
    start = 1e-7 * np.arange(1.0, 3 * dim + 1).reshape(3, dim)
    velocity = 1e-3 * np.linspace(-1.0, 1.0, 3 * dim).reshape(3, dim)
    times = [1e-5 * k for k in range(frames)]
    kept = [{"position": start + velocity * t, "velocity": velocity} for t in times]
    static = {"group": np.zeros(3, np.int64), "mass": np.ones(3), "support": np.full(3, 3e-7)}
    groups = [{"name": "fluid", "kind": "fluid"}]
    return Run.from_memory(domain, groups, static, list(range(frames)), times, kept)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_three_components_and_units(dim, tmp_path):
    run = a_run(dim)
    path = pc.export_h5md(run, tmp_path / "run.h5md")
    with h5py.File(path) as file:
        assert file["h5md"].attrs["version"].tolist() == [1, 1]
        particles = file["particles/trajectory"]
        box = [1000.0, 2000.0, 3000.0][:dim] + [DEPTH / 1e-9] * (3 - dim)
        assert particles["box/edges/value"][2] == pytest.approx(box)
        assert particles["box"].attrs["boundary"].tolist() == ["periodic", "none", "none"]
        for name, unit, scale in (("position", "nm", 1e-9), ("velocity", "m s-1", 1.0)):
            series = particles[name]
            assert series["value"].attrs["unit"] == unit and series["time"].attrs["unit"] == "s"
            assert series["time"][:].tolist() == run.times.tolist()
            assert series["value"][..., :dim] * scale == pytest.approx(np.array(run.field(name)))
            assert not series["value"][..., dim:].any()


def test_no_frames(tmp_path):
    with pytest.raises(InputError, match="at least one frame"):
        pc.export_h5md(a_run(2, frames=0), tmp_path / "run.h5md")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("dim", [2, 3])
def test_mdanalysis_reads_it(dim, tmp_path):
    """In its units, Å and ps; it keeps positions in single precision."""
    analysis = pytest.importorskip("MDAnalysis")
    run = a_run(dim)
    path = pc.export_h5md(run, tmp_path / "run.h5md")
    universe = analysis.Universe.empty(3).load_new(str(path), format="H5MD")
    assert universe.trajectory.n_frames == 3
    for k, step in enumerate(universe.trajectory):
        assert step.time == pytest.approx(1e12 * run.times[k])
        assert step.positions[:, :dim] == pytest.approx(1e10 * run.field("position")[k], rel=1e-6)
        assert step.velocities[:, :dim] == pytest.approx(1e-2 * run.field("velocity")[k], rel=1e-6)
        box = [1e4, 2e4, 3e4][:dim] + [1e10 * DEPTH] * (3 - dim)
        assert step.dimensions[:3] == pytest.approx(box)
