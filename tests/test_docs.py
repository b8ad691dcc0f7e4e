"""The Python on the pages of docs/ runs, as it stands there, block after block."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser, SkipParser

from particell import cases
from particell.cases.execution import execute

DOCS = Path(__file__).parent.parent / "docs"
PAGES = [
    DOCS / "first-run.md",
    *sorted((DOCS / "guide").glob("*.md")),
    DOCS / "howto/boundary.md",
    DOCS / "howto/field.md",
    DOCS / "howto/force.md",
    DOCS / "howto/law.md",
    DOCS / "howto/operation.md",
    DOCS / "howto/scheme.md",
    DOCS / "howto/species.md",
    DOCS / "howto/paraview.md",
]
# In a page ``<!-- skip: next -->`` stands before a block that is no program by itself.
SYBIL = Sybil([PythonCodeBlockParser(), SkipParser()])


def run_page(page: Path) -> dict:
    """Run the blocks of a page; gives the variables they leave."""
    document = SYBIL.parse(page)
    examples = list(document.examples())
    assert examples
    for example in examples:
        example.evaluate()
    return document.namespace


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_of_a_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_page(page)


def file_on_page(page: str, name: str, directory: Path) -> ModuleType:
    """The module that a how-to page prints as the file src/particell/NAME."""
    text = (DOCS / page).read_text(encoding="utf-8")
    code = re.search(rf"```python\n# src/particell/{name}\n(.*?)```", text, re.DOTALL).group(1)
    path = directory / Path(name).name
    path.write_text(code, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_how_to_add_a_case(tmp_path):
    page = file_on_page("howto/case.md", "cases/sliding_plate.py", tmp_path)
    case = page.SlidingPlate(resolution=10, speed="2 mm/s")
    assert execute(case, tmp_path / "out", threads=1, progress=False) == 0
    assert (tmp_path / "out/profile.png").stat().st_size > 0


@pytest.mark.parametrize("case", cases.names())
def test_every_case_is_in_the_gallery(case):
    page = (DOCS / f"gallery/{case}.md").read_text(encoding="utf-8")
    assert f"particell run {case} " in page
    figures = re.findall(r"!\[[^]]+\]\(\.\./images/([^)]+)\)", page)
    assert figures
    small = (DOCS / f"images/small/{case}.png").stat().st_size
    assert 0 < small < 30e3
    assert "| --- | --- |" in page  # numbers
    index = (DOCS / "gallery/index.md").read_text(encoding="utf-8")
    assert f"[{case}]({case}.md)" in index


@pytest.mark.filterwarnings("ignore")
def test_interpolators_of_paraview(tmp_path, monkeypatch):
    """What docs/howto/paraview.md says of them, with the same filters of VTK."""
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    monkeypatch.chdir(tmp_path)
    page = run_page(DOCS / "howto/paraview.md")
    run, spacing = page["run"], page["spacing"]
    reader = vtk.vtkHDFReader()
    reader.SetFileName("out/channel/run.vtkhdf")
    reader.UpdateInformation()
    reader.UpdateTimeStep(run.times[-1])
    y = np.linspace(0, page["height"], 9)[1:-1]
    places = np.stack([np.full_like(y, 0.5 * page["height"]), y, 0 * y], axis=1)
    points, probe = vtk.vtkPoints(), vtk.vtkPolyData()
    points.SetDataTypeToDouble()
    points.SetData(numpy_to_vtk(places, deep=True))
    probe.SetPoints(points)

    def interpolated(interpolator, kernel):
        interpolator.SetInputData(probe)
        interpolator.SetSourceConnection(reader.GetOutputPort())
        interpolator.SetKernel(kernel)
        interpolator.Update()
        found = interpolator.GetOutput().GetPointData()
        return lambda name: vtk_to_numpy(found.GetArray(name))

    ours = run.on_points("velocity", places[:, :2])[:, 0]
    gaussian = vtk.vtkGaussianKernel()
    gaussian.SetRadius(2 * spacing)
    pointwise = interpolated(vtk.vtkPointInterpolator(), gaussian)
    assert pointwise("velocity")[:, 0] == pytest.approx(ours, rel=6e-3)
    quintic = vtk.vtkSPHQuinticKernel()
    quintic.SetSpatialStep(spacing)
    quintic.SetDimension(2)
    interpolator = vtk.vtkSPHInterpolator()
    interpolator.SetDensityArrayName("density")
    without_mass = interpolated(interpolator, quintic)("velocity")[:, 0].copy()
    assert without_mass == pytest.approx(ours, rel=6e-3)
    interpolator.SetMassArrayName("mass")
    sums = interpolated(interpolator, quintic)
    shepard = sums("Shepard Summation")
    assert shepard == pytest.approx(np.full_like(y, spacing), rel=1e-2)  # the plane's depth
    assert sums("velocity")[:, 0] / shepard == pytest.approx(ours, rel=6e-3)


def test_parameters_in_one_entry_have_types_of_their_own(monkeypatch):
    """The reference's reader of docstrings would give all of them the first one's type."""
    pytest.importorskip("griffe")
    monkeypatch.syspath_prepend(str(DOCS))
    from rst_in_docstrings import markdown

    text = (
        "F.\n\nParameters\n----------\na, b\n    Both.\nc\n    C.\n\nReturns\n-------\nx, y\n    R."
    )
    one_by_one = text.replace("a, b\n    Both.", "a\n    Both.\nb\n    Both.")
    assert markdown(text) == one_by_one
