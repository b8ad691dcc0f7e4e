from __future__ import annotations

import json

import numpy as np
import pytest
import sample_run as sample

from particell.errors import InputError
from particell.output.run import Run
from particell.output.trajectory import TrajectoryWriter


@pytest.fixture(params=["file", "memory"])
def run(request, tmp_path) -> Run:
    frames = [sample.frame(k) for k in range(4)]
    scalars = [sample.observables(k) for k in range(4)]
    steps, times = [0, 10, 20, 30], [0.0, 0.5, 1.0, 1.5]
    if request.param == "memory":
        return Run.from_memory(
            sample.domain(), sample.GROUPS, sample.static(), steps, times, frames, scalars, {"a": 1}
        )
    with TrajectoryWriter(
        tmp_path / "run.h5", sample.domain(), sample.static(), sample.GROUPS
    ) as writer:
        for step, time, frame, scalar in zip(steps, times, frames, scalars, strict=True):
            writer.append(step, time, frame, scalar)
    (tmp_path / "summary.json").write_text(json.dumps({"a": 1}))
    return Run(tmp_path)


def test_contents(run):
    assert len(run) == 4
    assert run.steps.tolist() == [0, 10, 20, 30]
    assert run.times.tolist() == [0.0, 0.5, 1.0, 1.5]
    assert run.field_names == sorted(sample.frame(0))
    assert run.observable_names == ["amount_L", "kinetic_energy"]
    assert run.observable("kinetic_energy").tolist() == [0.0, 0.5, 1.0, 1.5]
    assert run.group("membrane").tolist() == [False, True, False, False, True]
    assert run.group("membrane", "fluid").all()
    assert run.group_names == sample.GROUPS
    assert run.summary == {"a": 1}
    assert run.static["mass"][-1] == 2.0
    assert run.domain.periodic.tolist() == [True, False]
    assert run.domain.lower.tolist() == [-1.0, 0.0]
    assert run.domain.depth == 0.1
    assert "4 frames" in repr(run)


def test_field_is_an_array(run):
    field = run.field("velocity")
    whole = np.stack([sample.frame(k)["velocity"] for k in range(4)])
    assert field.shape == (4, 5, 2)
    assert field.ndim == 3
    assert len(field) == 4
    assert field.dtype == float
    assert np.array_equal(np.asarray(field), whole)
    mask = run.group("membrane")
    for index in (
        -1,
        slice(None),
        slice(1, None, 2),
        slice(2, 2),
        [3, 0],
        (slice(1, 3), mask),
        (2, mask, 0),
        (slice(None), 3, 1),
        np.array([True, False, True, False]),
    ):
        assert np.array_equal(field[index], whole[index])
    assert np.array_equal(run.frame(2)["count/R"], sample.frame(2)["count/R"])
    with pytest.raises(IndexError):
        field[4]


def test_at(run):
    assert run.at(0.0) == 0
    assert run.at(0.6) == 1
    assert run.at(1.5) == 3
    with pytest.raises(InputError, match=r"between 0 and 1\.5 s"):
        run.at(1.6)


def test_refusals(run):
    with pytest.raises(InputError, match="did you mean 'velocity'"):
        run.field("velocty")
    with pytest.raises(InputError, match="membrane"):
        run.group("membran")
    with pytest.raises(InputError, match="kinetic_energy"):
        run.observable("energy")
    with pytest.raises(InputError, match="between -4 and 3"):
        run.frame(4)


def test_plot(run, tmp_path):
    figure = run.plot("velocity", component=1, path=tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 1000
    (scale,) = figure.axes[0].child_axes
    assert scale.get_ylabel() == "velocity y [m/s]"
    run.field("density").plot()


def test_interpolation_uses_group_and_frame(run):
    line = run.on_line("density", (0, 0.5), (1, 0.5), points=7, frame=2, order=0, support=3.0)
    assert line == pytest.approx(np.full(7, 1002.0))
    grid = run.field("velocity").on_grid((4, 3), frame=1, groups=["fluid"], support=4.0)
    assert grid.shape == (4, 3, 2)
    assert np.isfinite(grid).all()
    assert run.field("density").on_line((0, 0.5), (1, 0.5), support=3.0).shape == (101,)


def test_particles_at_rest_have_no_density():
    frame = {"position": sample.frame(0)["position"], "count/R": np.full(sample.N, 3.0)}
    run = Run.from_memory(sample.domain(), sample.GROUPS, sample.static(), [0], [0.0], [frame])
    assert np.allclose(run.on_grid("count/R", (2, 2), support=4.0), 3.0)
