"""``summary.json``: what a run was, how good it is, and how fast it went."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from particell.health.finding import Finding
from particell.output.files import write_json

LIBRARIES = ("numpy", "numba", "scipy", "h5py")


@cache
def commit() -> str | None:
    """The commit of the sources, where they are a working copy; ``-dirty`` where they differ."""
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return None
    ask = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=10", "--exclude=*"]
    try:
        done = subprocess.run(ask, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None


def versions() -> dict[str, str]:
    """Versions of Python, of the libraries that results may depend on, and the commit if known."""
    found = {"python": platform.python_version()}
    if commit() is not None:
        found["commit"] = str(commit())
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def write_summary(
    path: str | Path,
    *,
    case: str,
    parameters: Mapping[str, Any],
    seed: int,
    metrics: Mapping[str, Mapping[str, Any]],
    health: Iterable[Finding],
    conservation: Mapping[str, float],
    performance: Mapping[str, Any],
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    """Write a summary atomically.

    Parameters
    ----------
    path
        The file.
    case
        Name of the case.
    parameters
        All of them: ``{name: {"value": …, "unit": …}}``.
    seed
        Of the random numbers.
    metrics
        ``{name: {"value": …, "paper": …, "limit": …, "unit": …}}``.
    health
        What was found, as :meth:`.Simulation.health` gives it.
    conservation
        By how much momentum and amounts drifted.
    performance
        Particles, steps, seconds, speed, events.
    settings
        Backend, precision, threads, kernel, support, skin, time step, depth.

    Returns
    -------
    dict
        What was written.
    """
    summary = {
        "case": case,
        "version": version("particell"),
        "parameters": dict(parameters),
        "seed": seed,
        "metrics": {name: dict(metric) for name, metric in metrics.items()},
        "health": {finding.name: finding.as_dict() for finding in health},
        "conservation": dict(conservation),
        "performance": dict(performance),
        "settings": {**settings, "versions": versions()},
    }
    write_json(path, summary)
    return summary
