from __future__ import annotations

import numpy as np
import pytest

from particell.cases.base import Context
from particell.cases.taylor_green import FROM, LATE, TaylorGreen


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
    assert abs(metrics["volume_put_right_rate"].value) < 0.01
    assert metrics["momentum_drift"].passed
    assert metrics["largest_speed_error"].passed


def test_a_square_lattice_melts_and_the_metrics_say_so():
    """What the papers call standard SPH is shown without limits."""
    _, _, metrics = result(resolution=32, end=0.5, arrangement="square", shifting=0.0)
    assert metrics["decay_rate_error"].limit is None
    assert metrics["decay_rate_error"].value > 0.5


def test_the_largest_speed_is_looked_at_between_the_times_of_a_coarser_run(short):
    """A peak of one frame counts from 0.05 L/U on, and not before, where the lattice hides it."""
    case, run, metrics = short
    assert np.diff(run.times).max() * case.speed / case.length < 0.026
    errors = np.zeros(len(run.times))
    for star, counts in ((0.025, False), (0.05, True), (0.1, True)):
        errors[:] = 0.0
        errors[run.at(star)] = 0.03
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(TaylorGreen, "speed_errors", lambda *_, e=errors: e)
            assert case.largest_error(run, FROM) == (0.03 if counts else 0.0)
            assert case.largest_error(run, LATE) == 0.0
    assert metrics["largest_speed_error"].value >= metrics["largest_speed_error_late"].value


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
