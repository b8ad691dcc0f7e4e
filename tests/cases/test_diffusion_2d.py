from __future__ import annotations

import numpy as np
import pytest

from particell.cases import reference
from particell.cases.base import Context
from particell.cases.diffusion_2d import Diffusion2D, plate, steady_plate


def test_steady_series_has_the_committed_values():
    table = reference.load("plate_diffusion_centrelines")
    inner = slice(1, -1)
    half = np.full(len(table["s"]) - 2, 0.5)
    across = steady_plate(np.stack([table["s"][inner], half], -1))
    assert across == pytest.approx(table["along_x"][inner], abs=1e-9)
    up = steady_plate(np.stack([half, table["s"][inner]], -1))
    assert up == pytest.approx(table["along_y"][inner], abs=1e-9)
    assert steady_plate(np.array([[0.5, 0.5]])) == pytest.approx(0.25, abs=1e-12)


def test_transient_series_obeys_the_equation_and_its_limits():
    x = np.array([[0.3, 0.4], [0.5, 0.7], [0.8, 0.2]])
    assert np.abs(plate(x, 1e-3)).max() < 1e-10
    assert plate(x, 3.0) == pytest.approx(steady_plate(x), abs=1e-12)
    step, tau = 1e-3, 0.05
    rate = (plate(x, tau + 1e-6) - plate(x, tau - 1e-6)) / 2e-6
    laplacian = -4 * plate(x, tau)
    for shift in ((step, 0), (-step, 0), (0, step), (0, -step)):
        laplacian += plate(x + shift, tau)
    assert laplacian / step**2 == pytest.approx(rate, rel=1e-4)


@pytest.fixture(scope="module")
def coarse():
    case = Diffusion2D(resolution=17)
    simulation = case.build(Context(seed=1))
    return case, simulation, simulation.run(case.until, case.every, progress=False)


def test_coarse_plate_is_within_the_papers_errors(coarse):
    case, simulation, run = coarse
    metrics = case.analyse(run, simulation)
    assert metrics["eps"].paper == 2.337e-4
    assert metrics["eps_molecules"].paper == 2.902e-4
    assert {name for name, metric in metrics.items() if not metric.passed} == set()
    assert metrics["l2_steady"].value == pytest.approx(0.00455, abs=3e-4)


def test_figures_are_drawn(coarse, tmp_path):
    case, _, run = coarse
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


@pytest.mark.parametrize("arrangement", ["hexagonal", "packed"])
def test_walls_complete_every_arrangement(arrangement):
    """A uniform concentration between walls of that value stays as it is."""
    case = Diffusion2D(resolution=12, arrangement=arrangement)
    simulation = case.build(Context(seed=1))
    x = simulation.particles.host("x")
    plate_ = simulation.particles.select("plate")
    assert (np.abs(x[plate_] - 0.5) < 0.5).all()
    assert (np.abs(x[~plate_] - 0.5).max(axis=1) > 0.5).all()
    volume = simulation.particles.host("mass")[plate_].sum() / 1000
    assert volume == pytest.approx(1.0)
