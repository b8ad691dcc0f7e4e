"""What many realisations come to, whatever they are of: means of their metrics, a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from particell.ensemble.results import EnsembleRun
from particell.recipe import Metric


def member_metrics(ensemble: EnsembleRun) -> dict[str, dict[str, Any]]:
    """Each metric of the realisations: mean, deviation, extremes, how many are beyond the limit."""
    every = [run.summary.get("metrics", {}) for run in ensemble.runs]
    found: dict[str, dict[str, Any]] = {}
    for name in every[0] if every else ():
        rows = [metrics[name] for metrics in every if name in metrics]
        values = np.array([np.nan if r["value"] is None else r["value"] for r in rows], float)
        limit = rows[0]["limit"]
        beyond = 0 if limit is None else int((~(np.abs(values) <= limit)).sum())
        found[name] = {
            "mean": float(values.mean()),
            "deviation": float(values.std(ddof=1)) if len(values) > 1 else None,
            "least": float(values.min()),
            "greatest": float(values.max()),
            "limit": limit,
            "beyond": beyond,
            "unit": rows[0]["unit"],
        }
    return found


def mean_metrics(ensemble: EnsembleRun) -> dict[str, Metric]:
    """The mean over realisations of each of the runs' metrics, held against the same limit."""
    found = {}
    for name, metric in member_metrics(ensemble).items():
        found[f"mean {name}"] = Metric(metric["mean"], None, metric["limit"], metric["unit"])
    return found


def observables_figure(ensemble: EnsembleRun, directory: Path) -> list[Path]:
    """Mean ± deviation of the observables in ``observables.png``; none for a single realisation."""
    if len(ensemble) < 2 or not ensemble.observable_names:
        return []
    path = directory / "observables.png"
    ensemble.plot.series(path=path)
    return [path]
