from __future__ import annotations

import h5py
import numpy as np
import pytest
import sample_run as sample

from particell.errors import InputError
from particell.output.export import export_vtkhdf
from particell.output.run import Run


def a_run(frames: int = 3) -> Run:
    return Run.from_memory(
        sample.domain(),
        sample.GROUPS,
        sample.static(),
        [10 * k for k in range(frames)],
        [0.5 * k for k in range(frames)],
        [sample.frame(k) for k in range(frames)],
    )


def test_layout(tmp_path):
    path = export_vtkhdf(a_run(), tmp_path / "run.vtkhdf")
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"PolyData"
        assert root.attrs["Version"].tolist() == [2, 0]
        assert root["Steps"].attrs["NSteps"] == 3
        assert root["Steps/Values"][:].tolist() == [0.0, 0.5, 1.0]
        assert root["Steps/PointOffsets"][:].tolist() == [0, 5, 10]
        assert root["Steps/CellOffsets"].shape == (3, 4)
        assert root["Steps/PointDataOffsets/mass"][:].tolist() == [0, 0, 0]
        assert root["Steps/PointDataOffsets/velocity"][:].tolist() == [0, 5, 10]
        assert root["Points"].shape == (15, 3)
        assert root["PointData/velocity"].shape == (15, 3)
        assert np.array_equal(root["PointData/count_R"][10:], sample.frame(2)["count/R"])
        for kind in ("Vertices", "Lines", "Polygons", "Strips"):
            cells = root[kind]["NumberOfCells"][0]
            assert cells == (5 if kind == "Vertices" else 0)
            assert len(root[kind]["Offsets"]) == cells + 1


def test_no_frames(tmp_path):
    with pytest.raises(InputError, match="at least one frame"):
        export_vtkhdf(a_run(0), tmp_path / "run.vtkhdf")


@pytest.mark.filterwarnings("ignore")
def test_vtk_reads_it(tmp_path):
    reader_module = pytest.importorskip("vtkmodules.vtkIOHDF")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = reader_module.vtkHDFReader()
    reader.SetFileName(str(export_vtkhdf(a_run(), tmp_path / "run.vtkhdf")))
    reader.UpdateInformation()
    assert reader.GetHasTemporalData()
    assert reader.GetNumberOfSteps() == 3
    for k in (0, 2, 1):
        reader.SetStep(k)
        reader.Modified()
        reader.Update()
        data, expected = reader.GetOutput(), sample.frame(k)
        assert reader.GetTimeValue() == 0.5 * k
        assert data.GetClassName() == "vtkPolyData"
        assert data.GetNumberOfVerts() == data.GetNumberOfPoints() == sample.N
        position = vtk_to_numpy(data.GetPoints().GetData())
        assert np.array_equal(position[:, :2], expected["position"])
        assert np.all(position[:, 2] == 0)
        points = data.GetPointData()
        found = {
            points.GetArrayName(a): vtk_to_numpy(points.GetArray(a))
            for a in range(points.GetNumberOfArrays())
        }
        assert np.array_equal(found["velocity"][:, :2], expected["velocity"])
        assert np.array_equal(found["concentration_L"], expected["concentration/L"])
        assert np.array_equal(found["mass"], sample.static()["mass"])
        assert np.array_equal(found["group"], sample.static()["group"])
