"""The Python on the pages of docs/ runs, as it stands there, block after block."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser, SkipParser

DOCS = Path(__file__).parent.parent / "docs"
PAGES = [
    *sorted((DOCS / "guide").glob("*.md")),
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
