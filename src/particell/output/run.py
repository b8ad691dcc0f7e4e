"""What a simulation left behind: its frames, time series and summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.geometry.domain import Domain
from particell.health.finding import Finding
from particell.output.field import Field
from particell.output.files import read_json
from particell.output.recorded import Recorded
from particell.output.sources import FileSource, MemorySource, known
from particell.representation import block, shown, table
from particell.roles import Role
from particell.units import length_scale, observable_unit

if TYPE_CHECKING:
    import pyvista
    import xarray as xr

    from particell.output.run_plots import RunPlots

TRAJECTORY = "run.h5"
CHECKPOINT = "checkpoint.h5"
PREVIOUS = "checkpoint-previous.h5"
SUMMARY = "summary.json"
CASE = "case.json"
STATUS = "status.json"
#: What a run leaves, figures apart.
OWN_FILES = (TRAJECTORY, CHECKPOINT, PREVIOUS, SUMMARY, CASE, STATUS)


class Run(Recorded):
    """A finished, running or broken-off simulation, as it was recorded.

    Parameters
    ----------
    directory
        The directory a run was written to, or its trajectory file.

    Raises
    ------
    InputError
        Where there is no trajectory.
    """

    def __init__(self, directory: str | Path):
        path = Path(directory)
        within = path.is_dir()
        source = FileSource(path / TRAJECTORY if within else path)
        super().__init__(source, path if within else path.parent)

    @classmethod
    def from_memory(
        cls,
        domain: Domain,
        groups: Sequence[str],
        static: Mapping[str, np.ndarray],
        steps: Sequence[int],
        times: Sequence[float],
        frames: Sequence[Mapping[str, np.ndarray]],
        observables: Sequence[Mapping[str, Any]] = (),
        summary: Mapping[str, Any] | None = None,
        points: Mapping[str, np.ndarray] | None = None,
        units: Mapping[str, str] | None = None,
        roles: Sequence[Role] | None = None,
    ) -> Run:
        """A run that was not written to a directory.

        Parameters
        ----------
        domain, groups, static
            As for :class:`~particell.output.trajectory.TrajectoryWriter`.
        steps, times, frames, observables
            One entry a frame.
        summary
            What ``summary.json`` would hold.
        points
            Where time averages were taken, by name.
        units
            Of fields that have none by their names.
        roles
            What the groups are to fields, in their order.
        """
        run = cls.__new__(cls)
        series = (steps, times, frames, observables)
        source = MemorySource(domain, groups, static, *series, points, units, roles)
        Recorded.__init__(run, source)
        run.__dict__["summary"] = dict(summary or {})
        return run

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The contents of ``summary.json``; empty while there is none."""
        path = self.directory / SUMMARY if self.directory else None
        return read_json(path, "summary") if path and path.exists() else {}

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """What ``run.h5`` says of itself: settings, and kind, material and body of each group."""
        return self.source.parameters()

    @cached_property
    def health(self) -> list[Finding]:
        """What :meth:`.Simulation.run` found, or ``summary.json`` says; empty without either."""
        found = self.summary.get("health", {})
        return [
            Finding(name, f["value"], f["limit"], f.get("sentence", ""), f["kind"] == "least")
            for name, f in found.items()
        ]

    def __repr__(self) -> str:
        times = self.times
        span = f", t = {times[0]:g} … {times[-1]:g} s" if len(times) else ""
        return f"Run({len(times)} frames{span}; fields: {', '.join(self.field_names)})"

    def _repr_html_(self) -> str:
        fields = [(n, self.source.unit(n), self.source.shape(n)[0][1:]) for n in self.field_names]
        observables = [(n, observable_unit(n, self.field_names)) for n in self.observable_names]
        times, lengths = self.times, self.domain.lengths
        factor, unit = length_scale(float(lengths.max()))
        span = f"{times[0]:.6g} … {times[-1]:.6g} s" if len(times) else "none yet"
        return block(
            f"Run {self.directory or 'in memory'}",
            table(
                [
                    ("case", self.summary.get("case")),
                    ("frames", len(times)),
                    ("times", span),
                    ("box", f"{' × '.join(shown(x / factor) for x in lengths)} {unit}"),
                    ("groups", self.group_names),
                ]
            ),
            table(fields, ("field", "unit", "shape")),
            table(observables, ("observable", "unit")),
        )

    def field(self, name: str) -> Field:
        """One field over all frames, read as needed."""
        return Field(self, known("field", name, self.field_names))

    @property
    def plot(self) -> RunPlots:
        """Pictures and animations: ``run.plot("velocity")``, ``run.plot.map("velocity")``, …."""
        from particell.output.run_plots import RunPlots

        return RunPlots(self)

    def to_xarray(
        self,
        *names: str,
        frames: slice | Sequence[int] | None = None,
        groups: str | Sequence[str] | None = None,
        grid: int | Sequence[int] | None = None,
        line: tuple[Sequence[float], Sequence[float]] | None = None,
        points: int = 101,
        **options: Any,
    ) -> xr.Dataset:
        """Fields and observables as an xarray Dataset (extra ``xarray``).

        Fields are read, or interpolated, when their values are asked for and not kept: select
        first, then ``load()``. The units are in the variables' attributes; the slash of
        ``"concentration/L"`` becomes an underscore.

        Parameters
        ----------
        names
            The fields (default: all).
        frames
            Numbers, or a slice; by default all that there are now.
        groups
            A group of particles or several.
        grid
            Cells along each axis: dimensions (time, x, y, …) instead of (time, particle).
        line
            Its two ends in m: dimensions (time, distance), with ``points`` equally spaced ones.
        **options
            Of the interpolation, as for :meth:`on_points`.

        Raises
        ------
        InputError
            For unknown names, and where xarray is missing.
        """
        from particell.output.dataset import dataset

        return dataset(self, names, frames, groups, grid, line, points, options)

    def view(
        self,
        what: str | np.ndarray = "group",
        frame: int = -1,
        *,
        groups: str | Sequence[str] | None = None,
        component: int | str | None = None,
        arrows: bool = False,
        limits: tuple[float, float] | None = None,
        colours: str = "viridis",
        path: str | Path | None = None,
        off_screen: bool | None = None,
    ) -> pyvista.Plotter:
        """The particles in 3D as spheres, or arrows along their velocities (extra ``viz``).

        Parameters
        ----------
        what, groups, component, limits, colours
            As for :class:`~particell.output.run_plots.RunPlots`.
        frame
            Which frame.
        arrows
            Whether to show velocities.
        path
            Write the picture to this PNG file.
        off_screen
            Whether no window is to be used (default: where there is a ``path``).

        Returns
        -------
        pyvista.Plotter
            Its ``show()`` opens a window, or the view in a notebook.

        Raises
        ------
        InputError
            For unknown names, and where pyvista is missing.
        """
        from particell.output.view import view

        return view(self, what, frame, groups, component, arrows, limits, colours, path, off_screen)
