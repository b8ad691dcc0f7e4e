"""The lid-driven cavity at a small size; its tables and its measure of corner vortices."""

from __future__ import annotations

import numpy as np
import pytest

from particell.cases import lid_driven_cavity_results as results
from particell.cases import reference
from particell.cases.base import Context
from particell.cases.lid_driven_cavity import LID, LidDrivenCavity


@pytest.fixture(scope="module")
def small():
    case = LidDrivenCavity(resolution=24, after=5, end=6, frames=2)
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False, **case.run_options())
    return case, simulation, run


def test_ghia_and_finite_elements_agree():
    """As far as Ghia's own errors: 0.009 at Re = 100, 0.019 at 1000, 0.04 at 10000."""
    solution = reference.load("lid_driven_cavity_fem")
    for number, limit in ((100, 0.01), (1000, 0.02), (10000, 0.041)):
        for name, along in (("u", "y"), ("v", "x")):
            table = reference.load(f"lid_driven_cavity_ghia_{name}")
            kept = (table[along] != results.MISPRINT[1]) | (number != results.MISPRINT[0])
            s, values = table[along][kept], table[f"{name}_{number}"][kept]
            away = values - np.interp(s, solution["s"], solution[f"{name}_{number}"])
            assert np.abs(away).max() < limit


def test_lid_keeps_its_place_and_drives_the_flow(small):
    case, _, run = small
    lid = run.group(f"wall-{LID}")
    assert np.array_equal(run.field("position")[0][lid], run.field("position")[-1][lid])
    assert np.all(run.field("velocity")[-1][lid] == (case.speed, 0.0))
    y = results.places(case)["vertical"][:, 1]
    u = results.mean_velocity(case, run, "vertical")[:, 0]
    assert np.interp(0.5, y, u) < -0.1 and np.interp(0.95, y, u) > 0.5


def test_metrics_and_figures(small, tmp_path):
    case, simulation, run = small
    found = case.analyse(run, simulation)
    assert found["ghia_rms"].value < 0.06  # 24² is coarse, and the flow not yet steady
    for name in ("largest_void", "crowding", "inside_walls", "largest_speed"):
        assert found[name].passed
    assert found["largest_compression"].passed
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_corner_vortex_of_a_given_flow(small, monkeypatch):
    """A shear that changes its sign at 0.2 on all walls is found there."""
    case, _, run = small

    def velocity(case, run, where):
        x, y = np.moveaxis(results.places(case)[where], -1, 0)
        away = np.minimum(x, 1 - x)
        return np.stack([y * (0.2 - away), away * (0.2 - y)], axis=-1)

    monkeypatch.setattr(results, "mean_velocity", velocity)
    for size in results.corner_sizes(case, run).values():
        assert size == pytest.approx(0.2, abs=1e-3)


def test_it_stops_when_it_is_steady():
    case = LidDrivenCavity(resolution=20, reynolds=5, after=1, end=20)
    run = case.build(Context()).run(case.until, case.every, progress=False, **case.run_options())
    assert run.times[-1] < case.until


def test_particles_stay_calm_at_a_high_reynolds_number():
    """Where viscosity does nothing between neighbours (UΔp/ν = 333), the filter keeps the peace.

    Filtered every 20 steps only, the same run had a speed of 14 U within these 5 L/U.
    """
    case = LidDrivenCavity(resolution=30, reynolds=1e4, after=5, end=5, frames=2)
    simulation = case.build(Context(seed=1))
    assert simulation.scheme.filter_every == 1
    run = simulation.run(case.until, case.every / 4, progress=False)
    found = results.outliers(case, run)
    assert found["largest_speed"].passed and found["largest_compression"].passed
    assert simulation.conservation()["inside walls"] == 0
