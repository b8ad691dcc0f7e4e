"""The view in 3D. pyvista is no part of the tests' extra: with VTK it is some hundred MB."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from PIL import Image
from test_run_plots import a_run

from particell.errors import InputError


def test_without_pyvista(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(InputError, match=r"pyvista, which is not installed.*particell\[viz\]"):
        a_run().view()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("arrows", [False, True])
def test_view(tmp_path, arrows):
    pytest.importorskip("pyvista", reason="pyvista is not installed (extra 'viz')")
    run = a_run(3)
    path = tmp_path / "a.png"
    plotter = run.view("speed", frame=1, groups="right", arrows=arrows, path=path)
    glyphs = plotter.renderer.actors[next(iter(plotter.renderer.actors))].mapper.dataset
    speed = 2 * run.field("position")[1][run.group("right"), 2]
    assert np.allclose(np.unique(glyphs["speed [m/s]"]), np.unique(speed))
    centre = np.asarray(glyphs.bounds).reshape(3, 2).mean(axis=1)
    assert np.allclose(centre[1:], 2.0, atol=0.6)  # in µm
    with Image.open(path) as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 20
    plotter.close()


@pytest.mark.filterwarnings("ignore")
def test_refusals():
    pytest.importorskip("pyvista", reason="pyvista is not installed (extra 'viz')")
    with pytest.raises(InputError, match="did you mean 'velocity'"):
        a_run().view("velocty")
