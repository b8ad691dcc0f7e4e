"""The script that measures a GPU runs: with a few particles, on Numba's CUDA simulator."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from simulated_gpu import lines_on_simulator

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "gpu.py"


def test_the_benchmark_runs(tmp_path):
    pytest.importorskip("numba.cuda", reason="numba.cuda is missing")
    path = tmp_path / "gpu.json"
    lines = lines_on_simulator(str(SCRIPT), "--dry", "--json", str(path))
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["device"] == "simulator"
    (rows,) = found["agreement"].values()
    assert {"sweep forces", "sweep density_rates", "1 steps"} <= set(rows)
    # pressures are c₀² = 100 times what is left of 1 + ε: 1e-14 of 0.1 from a density's last bit
    steps, _ = rows.pop("1 steps")
    assert steps < 1e-11
    assert all(gap < 1e-13 for gap, _ in rows.values())
    (row,) = found["speed"]
    assert all(row[part] > 0 for part in ("sweep", "decision", "sort", "list", "step"))
    assert len(lines) == 3
