"""Scripts in ``references/`` make the data that cases are compared with, coarsely where they last.

What takes minutes is made by hand: ``python references/compare.py`` tells the differences.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

REFERENCES = Path(__file__).parents[1] / "references"


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    monkeypatch.syspath_prepend(str(REFERENCES))
    yield
    for path in REFERENCES.glob("*.py"):
        sys.modules.pop(path.stem, None)


def stored(name: str) -> np.ndarray:
    import compare

    return compare.load(compare.STORED / name)


def test_the_plate(tmp_path, monkeypatch, capsys):
    import compare
    import plate_diffusion_series

    monkeypatch.setattr(sys, "argv", ["script", "--out", str(tmp_path)])
    plate_diffusion_series.main()
    assert compare.difference(tmp_path / "plate_diffusion_centrelines.csv") < 2e-12
    (tmp_path / "other.csv").write_text("# a\n1,2\n")
    monkeypatch.setattr(sys, "argv", ["script", str(tmp_path)])
    compare.main()
    assert "other.csv: not stored" in capsys.readouterr().out


def test_annihilation_on_coarse_grids():
    import annihilation_1d_fd

    table, error = annihilation_1d_fd.solve(1, (16, 32), (250, 500))
    assert error < 1e-3
    assert np.abs(table - stored("annihilation_Da1.csv"))[:, 1:].max() < 1e-3


@pytest.mark.parametrize("damkohler", [16_000, 640_000])
def test_annihilation_in_the_steady_state(damkohler):
    import annihilation_1d_fd

    number = len(annihilation_1d_fd.PLACES) - 1
    grids = (annihilation_1d_fd.steady(damkohler, n * number, 0)[1] for n in (16, 32))
    a = annihilation_1d_fd.extrapolated(*grids)[::16]
    assert a == pytest.approx(stored(f"annihilation_Da{damkohler}.csv")[:, -2], abs=1e-6)


def test_natural_convection_on_a_coarse_mesh():
    pytest.importorskip("skfem")
    import natural_convection_fem

    problem = natural_convection_fem.Problem(6)
    cylinder, wall = problem.solve(1e4)
    assert cylinder / 2 == pytest.approx(2.06945, abs=2e-5)
    assert wall == pytest.approx(cylinder, rel=1e-5)
    table = stored("natural_convection_Ra1e4.csv")
    assert np.abs(np.array(problem.centreline()).T - table[:, 1:]).max() < 2e-4
