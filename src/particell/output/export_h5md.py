"""Export of a run for programs of molecular dynamics: H5MD with three components, in nm and s.

A run's own file is H5MD too, with as many components as the domain has and SI units. Programs that
were made for molecules know space and their own units alone: MDAnalysis refuses planes, and lengths
in m. Here what a plane lacks is 0, and the box is as deep there as the domain.

References
----------
P. de Buyl, P. H. Colberg, F. Höfling: H5MD, a structured, efficient, and portable file format for
molecular data. Comput. Phys. Commun. 185 (2014) 1546; nongnu.org/h5md/h5md.html.
"""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np

from particell.output.export import exported, three_columns
from particell.output.files import SLACK
from particell.output.recorded import Recorded

#: Lengths in the file, in m.
NANOMETRE = 1e-9
#: Of H5MD.
VERSION = (1, 1)


def export_h5md(run: Recorded, path: str | Path) -> Path:
    """Write positions and velocities of all frames to an H5MD file with three components.

    Positions are in nm, velocities in m/s, times in s, all of which MDAnalysis converts to its own
    units: ``MDAnalysis.Universe.empty(n).load_new("run.h5md", format="H5MD")``.

    Parameters
    ----------
    run
        The run.
    path
        The file; its name should end in ``.h5md``.

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
    with exported(run, path, 2 * 3 * 8 * frames * n + 2 * SLACK) as file:
        _write_head(file)
        particles = file.create_group("particles/trajectory")
        _write_box(particles, run, frames)
        _write_series(particles, run, "position", "nm", NANOMETRE, frames, n)
        if "velocity" in run.field_names:
            _write_series(particles, run, "velocity", "m s-1", 1.0, frames, n)
    return Path(path)


def _write_head(file: h5py.File) -> None:
    head = file.create_group("h5md")
    head.attrs["version"] = np.array(VERSION, np.int64)
    creator = {"name": "Particell", "version": version("particell")}
    head.create_group("creator").attrs.update(creator)
    head.create_group("author").attrs["name"] = "unknown"


def _write_box(particles: h5py.Group, run: Recorded, frames: int) -> None:
    """Edges in each frame, as MDAnalysis asks for, though they are the same in all."""
    domain = run.domain
    lengths = np.array([*domain.lengths, *[domain.depth] * (3 - domain.dim)]) / NANOMETRE
    periodic = [*domain.periodic, *[False] * (3 - domain.dim)]
    box = particles.create_group("box")
    box.attrs["dimension"] = 3
    box.attrs["boundary"] = ["periodic" if p else "none" for p in periodic]
    edges = box.create_group("edges")
    edges["value"] = np.tile(lengths, (frames, 1))
    edges["value"].attrs["unit"] = "nm"
    edges["step"] = np.arange(frames)
    edges["time"] = np.asarray(run.times[:frames], np.float64)
    edges["time"].attrs["unit"] = "s"


def _write_series(
    particles: h5py.Group,
    run: Recorded,
    name: str,
    unit: str,
    scale: float,
    frames: int,
    n: int,
) -> None:
    """A field of all frames, in ``unit``, of which one is ``scale`` in SI units."""
    group = particles.create_group(name)
    group["step"], group["time"] = (particles[f"box/edges/{key}"] for key in ("step", "time"))
    values = group.create_dataset("value", (frames, n, 3), np.float64, chunks=(1, n, 3))
    values.attrs["unit"] = unit
    for k in range(frames):
        values[k] = three_columns(run.source.read(name, k)) / scale
