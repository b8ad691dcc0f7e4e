"""Export of a run for ParaView: one VTKHDF file with all its frames.

The particles are the points of a VTK polygonal data set with one vertex cell each. In the format's
``Steps`` group every frame says where its points and values begin in the arrays of all frames; the
cells, and the fields that do not change, are stored once and shared by all frames.

References
----------
VTKHDF format specification, docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from particell.errors import InputError
from particell.output.files import SLACK, SLACK_EACH, OutputError, reason, replacing, reserve
from particell.output.recorded import Recorded

# Everything used here is in version 2.0, which ParaView reads from 5.12 on.
VERSION = (2, 0)
CELL_KINDS = ("Vertices", "Lines", "Polygons", "Strips")


def export_vtkhdf(run: Recorded, path: str | Path) -> Path:
    """Write all frames of a run to a VTKHDF file.

    Parameters
    ----------
    run
        The run.
    path
        The file; its name should end in ``.vtkhdf``.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    InputError
        Where the run has no frame.
    OutputError
        Where the file cannot be written.
    """
    frames, n = len(run), len(run.static["group"])
    # vectors get three components
    stored = map(run.source.shape, run.field_names)
    sizes = [3 * int(np.prod(shape)) * dtype.itemsize for shape, dtype in stored]
    sizes += [values.nbytes for values in run.static.values()]
    needed = sum(sizes) + 16 * n + SLACK_EACH * len(sizes) + 2 * SLACK
    with exported(run, path, needed) as file:
        root = file.create_group("VTKHDF", track_order=True)
        root.attrs["Version"] = np.array(VERSION, np.int64)
        # The reader wants a string of fixed length in ASCII.
        root.attrs.create("Type", np.bytes_("PolyData"), dtype="S8")
        _write_cells(root, n)
        _write_fields(root, run, frames, n)
        _write_steps(root, run.times[:frames], n)
    return Path(path)


@contextmanager
def exported(run: Recorded, path: str | Path, needed: int) -> Iterator[h5py.File]:
    """An HDF5 file of ``needed`` bytes to write a run to, which is there when it is whole.

    Raises
    ------
    InputError
        Where the run has no frame.
    OutputError
        Where the file cannot be written.
    """
    if not len(run):
        raise InputError("run", str(run.directory), "a run with at least one frame")
    path = Path(path)
    reserve(path, needed)
    with replacing(path) as partial:
        try:
            with h5py.File(partial, "w") as file:
                yield file
        except (OSError, RuntimeError) as error:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error


def _write_cells(root: h5py.Group, n: int) -> None:
    """One vertex cell a particle; the other kinds of cells have to be there, but are empty."""
    for kind in CELL_KINDS:
        cells = n if kind == "Vertices" else 0
        group = root.create_group(kind)
        group["NumberOfCells"] = np.array([cells], np.int64)
        group["NumberOfConnectivityIds"] = np.array([cells], np.int64)
        group["Offsets"] = np.arange(cells + 1, dtype=np.int64)
        group["Connectivity"] = np.arange(cells, dtype=np.int64)


def _write_fields(root: h5py.Group, run: Recorded, frames: int, n: int) -> None:
    root["NumberOfPoints"] = np.full(frames, n, np.int64)
    points = root.create_dataset("Points", (frames * n, 3), np.float64)
    data = root.create_group("PointData")
    for name, values in run.static.items():
        if values.ndim == 1:
            data[vtk_name(name)] = values
    names = [name for name in run.field_names if name != "position"]
    for name in names:
        shape, dtype = run.source.shape(name)
        # Vectors get three components, or ParaView does not take them for vectors.
        tail = (3,) if len(shape) == 3 else ()
        data.create_dataset(vtk_name(name), (frames * n, *tail), dtype)
    for k in range(frames):
        rows = slice(k * n, (k + 1) * n)
        points[rows] = three_columns(run.source.read("position", k))
        for name in names:
            data[vtk_name(name)][rows] = three_columns(run.source.read(name, k))


def _write_steps(root: h5py.Group, times: np.ndarray, n: int) -> None:
    frames = len(times)
    begin = np.arange(frames, dtype=np.int64) * n
    zeros = np.zeros((frames, len(CELL_KINDS)), np.int64)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(frames)
    steps["Values"] = np.asarray(times, np.float64)
    steps["NumberOfParts"] = np.ones(frames, np.int64)
    # Every frame has the same one part, so that all share the cells of part 0.
    steps["PartOffsets"] = np.zeros(frames, np.int64)
    steps["PointOffsets"] = begin
    steps["CellOffsets"] = zeros
    steps["ConnectivityIdOffsets"] = zeros
    offsets = steps.create_group("PointDataOffsets")
    for name, dataset in root["PointData"].items():
        offsets[name] = begin if len(dataset) == frames * n else np.zeros(frames, np.int64)


def vtk_name(name: str) -> str:
    """Name of a field in VTK, where a slash would make an HDF5 group."""
    return name.replace("/", "_")


def three_columns(values: np.ndarray) -> np.ndarray:
    """Vectors of a line or a plane as vectors in space; numbers as they are."""
    if values.ndim == 1:
        return values
    padded = np.zeros((len(values), 3), values.dtype)
    padded[:, : values.shape[1]] = values
    return padded
