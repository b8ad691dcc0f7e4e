"""One field of a run over all its frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from particell.output.recorded import Recorded
from particell.output.sources import Index

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Field:
    """One field over all frames: an array (frames, n) or (frames, n, D) that is read as needed.

    ``run.field("velocity")[-1]`` reads the last frame, ``field[10:, mask]`` some particles of
    some frames, ``numpy.asarray(field)`` everything.
    """

    def __init__(self, run: Recorded, name: str):
        self.run, self.name = run, name

    @property
    def shape(self) -> tuple[int, ...]:
        """(frames, n) or (frames, n, D)."""
        return self.run.source.shape(self.name)[0]

    @property
    def dtype(self) -> np.dtype:
        """Type of the values."""
        return self.run.source.shape(self.name)[1]

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Index) -> np.ndarray:
        return self.run.source.read(self.name, index)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[:], dtype)

    def __repr__(self) -> str:
        return f"Field({self.name!r}, shape={self.shape}, dtype={self.dtype})"

    def on_line(self, start, end, points: int = 101, frame: int = -1, **options: Any) -> np.ndarray:
        """As :meth:`.Run.on_line`."""
        return self.run.on_line(self.name, start, end, points, frame, **options)

    def on_grid(self, shape, frame: int = -1, **options: Any) -> np.ndarray:
        """As :meth:`.Run.on_grid`."""
        return self.run.on_grid(self.name, shape, frame, **options)

    def plot(self, frame: int = -1, **options: Any) -> Figure:
        """As :meth:`.RunPlots.scatter`."""
        from particell.output.run_plots import RunPlots

        return RunPlots(self.run).scatter(self.name, frame, **options)
