from __future__ import annotations

import pytest

from particell.cases.base import Context
from particell.cases.taylor_green import TaylorGreen


def result(**parameters):
    case = TaylorGreen(**parameters)
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    return case, run, case.analyse(run, simulation)


@pytest.fixture(scope="module")
def short():
    return result(resolution=32, end=0.5)


def test_energy_decays_at_the_exact_rate_from_a_disordered_start(short):
    _, _, metrics = short
    assert metrics["decay_rate_error"].passed
    assert metrics["density_drift"].passed
    assert metrics["momentum_drift"].passed
    assert abs(metrics["largest_speed_error"].value) < 0.1  # 50² is within 5 %


def test_a_square_lattice_melts_and_the_metrics_say_so():
    _, _, metrics = result(resolution=32, end=0.5, arrangement="square", shifting=0.0)
    assert not metrics["decay_rate_error"].passed


@pytest.mark.parametrize(
    ("arrangement", "force", "rate", "speed"),
    [
        ("square", "symmetric", 0.06, 0.05),
        ("packed", "symmetric", 0.01, 0.02),
        ("packed", "difference", 0.02, 0.02),
    ],
)
def test_a_transport_velocity_bears_a_square_lattice(arrangement, force, rate, speed):
    """Where plain SPH loses most of the energy (above); 32² is coarser than the case's 50²."""
    case, _, metrics = result(
        resolution=32,
        end=0.5,
        scheme="transport-velocity",
        arrangement=arrangement,
        pressure_force=force,
    )
    assert abs(metrics["decay_rate_error"].value) < rate
    assert abs(metrics["largest_speed_error"].value) < speed
    assert metrics["density_drift"].passed
    assert not case.conserves_momentum
    assert metrics["momentum_drift"].value < 5e-3


def test_figures_are_drawn(short, tmp_path):
    case, run, _ = short
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))
