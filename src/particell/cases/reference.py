"""Reference data that ship with the cases: CSV files whose header says what and whence they are."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np


@cache
def load(name: str) -> dict[str, np.ndarray]:
    """Columns by name; the names are in the last line of the header.

    Parameters
    ----------
    name
        File name without its ending.
    """
    text = (files("particell.cases") / "data" / f"{name}.csv").read_text(encoding="utf-8")
    lines = text.splitlines()
    header = [line for line in lines if line.startswith("#")]
    names = [column.strip() for column in header[-1].lstrip("# ").split(",")]
    rows = [line for line in lines if line and not line.startswith("#")]
    values = np.loadtxt(rows, delimiter=",", ndmin=2)
    return {column: values[:, k] for k, column in enumerate(names)}
