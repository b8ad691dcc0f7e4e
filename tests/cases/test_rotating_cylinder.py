"""Flow between cylinders at a small size, and the exact solution's walls and balance."""

from __future__ import annotations

import numpy as np
import pytest

from particell.cases.base import Context
from particell.cases.rotating_cylinder import RotatingCylinder
from particell.errors import InputError


@pytest.mark.parametrize("turns", ["inner", "outer"])
def test_exact_solution(turns):
    case = RotatingCylinder(turns=turns)
    ends = np.array([case.inner_radius, case.outer_radius])
    expected = (1.0, 0.0) if turns == "inner" else (0.0, 1.0)
    assert case.exact(ends)[0] == pytest.approx(expected, abs=1e-12)
    r, step = np.linspace(0.6, 0.9, 4), 1e-5
    slope = (case.exact(r + step)[1] - case.exact(r - step)[1]) / (2 * step)
    assert slope == pytest.approx(case.exact(r)[0] ** 2 / r, rel=1e-6)


def test_coarse_flow(tmp_path):
    case = RotatingCylinder(resolution=8, reynolds=5, end=0.6, averaging=0.1)
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    found = case.analyse(run, simulation)
    assert found["velocity_error"].value < 0.03
    for name in ("radial_velocity", "largest_void", "crowding", "inside_walls"):
        assert found[name].passed
    body = run.group("inner")
    assert np.array_equal(run.field("position")[0][body], run.field("position")[-1][body])
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_radii_the_wrong_way_round_are_refused():
    with pytest.raises(InputError, match="outer_radius"):
        RotatingCylinder(outer_radius=0.4).build(Context())
