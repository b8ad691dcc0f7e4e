"""``result.plot``: pictures of an ensemble."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell import plots
from particell.errors import InputError, unknown_name
from particell.output.pictures import Limits, line_of
from particell.plots.distributions import Expected, bin_edges, drawn
from particell.units import observable_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from particell.analysis.statistics import Moments
    from particell.ensemble.realisations import Realisations

#: Most observables that one picture shows.
MOST = 12


def band(axes: Axes, x: np.ndarray, values: Moments, *, scale: float = 1.0, **style: Any) -> None:
    """A mean as a line, and mean ± deviation as a band around it."""
    mean, deviation = values.mean * scale, values.deviation * scale
    (line,) = axes.plot(x, mean, **style)
    axes.fill_between(
        x, mean - deviation, mean + deviation, color=line.get_color(), alpha=0.25, linewidth=0
    )


class EnsemblePlots:
    """Pictures of an ensemble: ``result.plot("amount_A")``, ``result.plot.histogram(...)``, ….

    All give a :class:`matplotlib.figure.Figure`, which notebooks display, and write it to a file
    where they are given a ``path``. Called itself, it is :meth:`series`. Wrong names are an
    :class:`~particell.errors.InputError`.
    """

    def __init__(self, ensemble: Realisations):
        self.ensemble = ensemble

    def __call__(self, *names: str, **options: Any) -> Figure:
        """As :meth:`series`."""
        return self.series(*names, **options)

    @plots.styled
    def series(self, *names: str, path: str | Path | None = None) -> Figure:
        """Mean ± deviation of observables in time, one panel each.

        Parameters
        ----------
        names
            Which observables; by default all that vary in time or between realisations (at most
            12).
        path
            Also write it to this file.
        """
        ensemble = self.ensemble
        for name in names:
            if name not in ensemble.observable_names:
                raise unknown_name("observable", name, ensemble.observable_names)
        found = {n: ensemble.moments(n, None) for n in names or ensemble.observable_names}
        if not names:
            varying = {n: m for n, m in found.items() if np.ptp(m.mean) or m.deviation.any()}
            found = dict(list((varying or found).items())[:MOST])
        if not found:
            raise InputError("observables", [], "at least one that was recorded")
        figure, panels = plots.new_panels(len(found))
        factor, unit = plots.time_scale(float(ensemble.times[-1]))
        for axes, (name, values) in zip(panels, found.items(), strict=True):
            band(axes, ensemble.times / factor, values)
            axes.set(xlabel=f"t [{unit}]", ylabel=self._label(name))
        figure.suptitle(f"mean ± deviation of {len(ensemble)} realisations")
        return _kept(figure, path)

    @plots.styled
    def line(
        self,
        what: str,
        start: Sequence[float] | None = None,
        end: Sequence[float] | None = None,
        *,
        frame: int = -1,
        points: int = 101,
        component: int | str | None = None,
        reference: Mapping[str, Any] | None = None,
        limits: Limits = None,
        path: str | Path | None = None,
        **options: Any,
    ) -> Figure:
        """Mean ± deviation of a field along a straight line.

        Parameters
        ----------
        what
            The field; of a vector a component is needed.
        start, end, points, reference, limits
            As for :meth:`particell.output.run_plots.RunPlots.line`.
        frame
            Which frame.
        component
            Of a vector: 0, 1, 2 or ``"x"``, ``"y"``, ``"z"``.
        **options
            ``groups``, and those of :meth:`particell.output.run.Run.on_points`.
        path
            Also write it to this file.
        """
        first = self.ensemble.first
        shown, places, coordinate, axis = line_of(first, what, start, end, points, component)
        found = self.ensemble.moments(
            lambda run: shown.scalar(
                run.on_points(shown.name, places, self.ensemble.same_time(run, frame), **options)
            )
        )
        factor, unit = plots.length_scale(float(np.abs(coordinate).max()))
        figure = plots.curves(
            coordinate / factor,
            {},
            reference=plots.expected_on(coordinate, reference),
            xlabel=f"{axis} [{unit}]",
            ylabel=shown.label,
            title=f"{first.title(frame)}: mean ± deviation of {len(self.ensemble)} realisations",
        )
        (axes,) = figure.axes
        band(axes, coordinate / factor, found, label="mean")
        if limits:
            axes.set_ylim(*limits)
        if reference:
            plots.legend(axes)
        return _kept(figure, path)

    def histogram(
        self,
        what: str | Callable[..., Any],
        frame: int = -1,
        *,
        bins: int | Sequence[float] | None = None,
        reference: Mapping[str, Expected] | None = None,
        label: str | None = None,
        path: str | Path | None = None,
        **where: Any,
    ) -> Figure:
        """How values are distributed over realisations (of a field, over its particles too).

        Parameters
        ----------
        what
            A field, an observable, or a function of a run.
        frame
            Which frame; a function has none.
        bins, reference, label
            As for :meth:`particell.output.run_plots.RunPlots.histogram`.
        path
            Also write it to this file.
        **where
            Of a field: as for :meth:`particell.ensemble.results.EnsembleRun.histogram`.
        """
        low, high, total, whole = self._range(what, frame, where)
        edges = bin_edges(low, high, whole, bins)
        counts, _ = self.ensemble.histogram(what, edges, frame, **where)
        title = f"{len(self.ensemble)} realisations"
        if not callable(what):
            title = f"{self.ensemble.first.title(self.ensemble.first.checked(frame))}, {title}"
        shown = self._label(what) if label is None else label
        return _kept(drawn(counts, edges, total, whole, reference, shown, title), path)

    def _range(
        self, what: str | Callable[..., Any], frame: int, where: dict[str, Any]
    ) -> tuple[float, float, int, bool]:
        """Least, greatest and number of all finite values, and whether they are whole numbers."""
        low, high, total, whole = np.inf, -np.inf, 0, True
        for values in self.ensemble.values(what, frame, **where):
            flat = values[np.isfinite(values)]
            if flat.size:
                low, high = min(low, float(flat.min())), max(high, float(flat.max()))
                total += flat.size
                whole = whole and bool(np.all(flat == np.rint(flat)))
        if not total:
            raise InputError("values", "none", "some that are finite")
        return low, high, total, whole

    def _label(self, what: str | Callable[..., Any]) -> str:
        if callable(what):
            return str(getattr(what, "__name__", "")).replace("<lambda>", "").replace("_", " ")
        if what in self.ensemble.field_names:
            return plots.field_label(what)
        unit = observable_unit(what, self.ensemble.field_names)
        return plots.label(what.replace("_", " "), unit)


def _kept(figure: Figure, path: str | Path | None) -> Figure:
    if path is not None:
        plots.save(figure, path)
    return figure
