"""What an ensemble of a case comes to: metrics, figures and ``summary.json``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from particell.cases import execution
from particell.cases.base import Case, Metric
from particell.ensemble.ensemble import Ensemble
from particell.ensemble.results import EnsembleRun
from particell.output.files import write_json
from particell.output.run import SUMMARY
from particell.output.summary import versions


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
    """The mean over realisations of each of the case's metrics, held against the same limit."""
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


def finish(case: Case, ensemble: Ensemble, result: EnsembleRun) -> int:
    """Write summary and figures of an ensemble of a case, and print its metrics.

    Returns
    -------
    int
        3 where a realisation failed, else 1 where a metric of the ensemble is beyond its limit,
        else 0.
    """
    metrics = case.ensemble_metrics(result) if len(result) else {}
    _write_summary(case, ensemble, result, metrics)
    if len(result):
        case.ensemble_figures(result, result.directory)
        execution.print_report(case, metrics, result.directory)
    for name, metric in member_metrics(result).items():
        if metric["beyond"]:
            print(f"{name}: beyond its limit in {metric['beyond']} of {len(result)} realisations")
    print(f"{len(result)} of {ensemble.runs} realisations done")
    if len(result) < ensemble.runs:
        return 3
    return 0 if all(metric.passed for metric in metrics.values()) else 1


def _write_summary(
    case: Case, ensemble: Ensemble, result: EnsembleRun, metrics: Mapping[str, Metric]
) -> None:
    runs = [run.summary["performance"] for run in result.runs]
    last = {}
    if len(result) > 1:
        for name in result.observable_names:
            values = result.moments(name)
            last[name] = {"mean": float(values.mean), "deviation": float(values.deviation)}
    write_json(
        result.directory / SUMMARY,
        {
            "case": case.name,
            "version": version("particell"),
            "parameters": case.parameters(),
            "seed": ensemble.seed,
            "runs": ensemble.runs,
            "finished": result.indices,
            "failed": [
                {"run": k, "seed": ensemble.seeds[k], "error": error}
                for k, error in result.failed.items()
            ],
            "metrics": {name: metric.as_dict() for name, metric in metrics.items()},
            "members": member_metrics(result),
            "observables_at_the_end": last,
            "performance": {
                key: sum(run[key] for run in runs)
                for key in ("steps", "wall_seconds", "ssa_events", "diffusion_jumps")
                if runs and all(key in run for run in runs)
            },
            "settings": {**result.settings, "versions": versions()},
        },
    )
