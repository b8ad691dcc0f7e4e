from __future__ import annotations

import sys

import numpy as np
import pytest
from test_run_plots import TIMES, a_run

from particell.errors import InputError


def test_without_xarray(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"xarray, which is not installed.*particell\[xarray\]"):
        a_run().to_xarray()


def test_by_particle():
    pytest.importorskip("xarray")
    run = a_run()
    data = run.to_xarray()
    assert data.velocity.dims == ("time", "particle", "axis")
    assert data.concentration_L.dims == ("time", "particle")
    assert data.concentration_L.attrs["units"] == "mol/m^3"
    assert data.concentration_L.attrs["field"] == "concentration/L"
    assert data.velocity.attrs["units"] == "m/s"
    assert data.time.values.tolist() == TIMES
    assert data.amount_L.attrs["units"] == "molecules"
    assert np.array_equal(data.velocity.sel(axis="x").isel(time=2), run.field("velocity")[2][:, 0])
    assert np.array_equal(data.velocity, run.field("velocity")[:])
    right = data.where(data.group == "right", drop=True)
    assert right.sizes["particle"] == run.group("right").sum()
    assert data.attrs["depth"] == 1e-6
    some = run.to_xarray("count/L", frames=[-1, 0], groups="left")
    assert some.count_L.dtype == int
    assert some.time.values.tolist() == [TIMES[-1], TIMES[0]]
    assert np.array_equal(some.count_L[0], run.field("count/L")[-1][run.group("left")])
    assert np.array_equal(some.count_L[::-1, 2:5:2], some.count_L.values[::-1, 2:5:2])


def test_read_as_needed(monkeypatch):
    pytest.importorskip("xarray")
    run, asked = a_run(), []
    read = run.source.read
    monkeypatch.setattr(run.source, "read", lambda n, k: asked.append((n, k)) or read(n, k))
    data = run.to_xarray()
    repr(data)
    data._repr_html_()
    assert not asked
    data.velocity.isel(time=1).load()
    assert asked == [("velocity", 1)]


def test_on_a_grid_and_a_line():
    pytest.importorskip("xarray")
    run = a_run()
    data = run.to_xarray("concentration/L", "velocity", grid=(4, 2), frames=slice(1, 3))
    assert data.velocity.dims == ("time", "x", "y", "axis")
    assert data.velocity.shape == (2, 4, 2, 2)
    assert data.x.attrs["units"] == "m"
    assert np.allclose(data.concentration_L.isel(time=1), 3 * data.x.values[:, None])
    assert np.allclose(data.x, [0.5e-6, 1.5e-6, 2.5e-6, 3.5e-6])
    line = run.to_xarray("concentration/L", line=((0, 0), (3e-6, 4e-6)), points=3)
    assert np.allclose(line.distance, [0, 2.5e-6, 5e-6])
    assert np.allclose(line.concentration_L.isel(time=0), line.x)


def test_refusals():
    pytest.importorskip("xarray")
    run = a_run()
    for call, words in (
        (lambda: run.to_xarray("velocty"), "did you mean 'velocity'"),
        (lambda: run.to_xarray(frames=[9]), "between -4 and 3"),
        (lambda: run.to_xarray(order=0), "order"),
        (lambda: run.to_xarray(grid=3, line=((0, 0), (1, 1))), "left out"),
        (lambda: run.to_xarray(line=3), "two points"),
    ):
        with pytest.raises(InputError, match=words):
            call()
