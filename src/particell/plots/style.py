"""What all pictures have in common: style, figures, labels.

Figures are made without pyplot, so that neither its state nor the user's backend is touched.
"""

from __future__ import annotations

import functools
import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import matplotlib  # alone, not its pyplot
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from particell.output.files import replacing
from particell.units import field_unit

# Okabe & Ito's colours, which people with any kind of colour vision can tell apart.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "osD^vP*"

STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.7,
    "axes.formatter.limits": (-2, 4),
    "axes.formatter.use_mathtext": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(color=COLOURS),
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "image.cmap": "viridis",
    "figure.dpi": 100,
    "savefig.dpi": 200,
}

#: Pixels of a notebook's picture per pixel of its place on the page.
SHARPER = 1.6

_F = TypeVar("_F", bound=Callable[..., Any])


def styled(function: _F) -> _F:
    """Run a function under :data:`STYLE`, whatever the user's own settings are."""

    @functools.wraps(function)
    def wrapper(*args: Any, **options: Any) -> Any:
        with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
            return function(*args, **options)

    return wrapper  # type: ignore[return-value]


class Picture(Figure):
    """A figure that notebooks display (matplotlib's own need pyplot for it)."""

    def savefig(self, *args: Any, **options: Any) -> None:
        """As matplotlib's, with labels and scales in their places.

        The room for them is found from where axes were before; where their sides have a given
        ratio it takes a second time, without which labels were cut.
        """
        for _ in range(2):
            self.draw_without_rendering()
        super().savefig(*args, **options)

    @styled
    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=SHARPER * self.dpi)
        width, height = self.get_size_inches() * self.dpi
        return file.getvalue(), {"width": round(width), "height": round(height)}


@styled
def new_figure(
    width: float = 4.2, height: float = 3.1, rows: int = 1, columns: int = 1
) -> tuple[Figure, Any]:
    """An empty figure (inches) and its axes, one or an array of them."""
    figure = Picture(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns)


def new_panels(count: int) -> tuple[Figure, list[Axes]]:
    """A figure of several panels, at most three beside each other."""
    columns = min(3, count)
    rows = math.ceil(count / columns)
    figure, grid = new_figure(3.4 * columns, 2.5 * rows, rows, columns)
    panels = list(np.atleast_1d(grid).ravel())
    for axes in panels[count:]:
        axes.set_axis_off()
    return figure, panels[:count]


def legend(axes: Axes, **options: Any) -> None:
    """A legend, where there is something to name: a short run may have reached nothing yet."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**options)


@styled
def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure to a file (its kind is the name's ending), atomically."""
    path = Path(path)
    with replacing(path) as partial:
        figure.savefig(partial)
    return path


def field_label(name: str, component: int | None = None, unit: str = "") -> str:
    """Axis label of a field: name and unit, by default that which fields of its name have."""
    what = name.split("/")
    words = f"{what[0]} of {what[1]}" if len(what) == 2 else name
    if component is not None:
        words += f" {'xyz'[component]}"
    return label(words, unit or field_unit(name))


def label(words: str, unit: str = "") -> str:
    """``"density [kg/m³]"``."""
    shown = unit.replace("^2", "²").replace("^3", "³").replace("*", " ")
    return f"{words} [{shown}]" if shown else words
