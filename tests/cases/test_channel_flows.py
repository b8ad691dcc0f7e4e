"""Flows between plates at small sizes, and their series against what is known of them."""

from __future__ import annotations

import numpy as np
import pytest

from particell.cases.base import Context
from particell.cases.couette import Couette
from particell.cases.poiseuille import Poiseuille


def result(case):
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    return run, case.analyse(run, simulation)


@pytest.mark.parametrize("kind", [Poiseuille, Couette])
def test_series_start_at_rest_and_obey_the_diffusion_equation(kind):
    case = kind()
    y = np.linspace(0.1, 0.9, 9)
    force = 8.0 if kind is Poiseuille else 0.0
    # so early that no plate is felt here
    assert case.exact(y, 1e-4) == pytest.approx(force * 1e-4, abs=1e-9)
    step, time = 1e-3, 0.05
    change = (case.exact(y, time + step) - case.exact(y, time - step)) / (2 * step)
    bend = (
        case.exact(y + step, time) - 2 * case.exact(y, time) + case.exact(y - step, time)
    ) / step**2
    assert change == pytest.approx(bend + force, abs=2e-3)


def test_poiseuille_known_values():
    """The middle's share of its last velocity after 0.2 and 0.5 H²/ν."""
    case = Poiseuille()
    middle = np.array([0.5])
    assert case.exact(middle, 0.2)[0] == pytest.approx(0.856637, abs=1e-6)
    assert case.exact(middle, 0.5)[0] == pytest.approx(0.992578, abs=1e-6)


def test_poiseuille_on_the_resting_lattice():
    """Limits of second order from 1.3e-3 at 40 particles across; 4.2e-3 at 20 here."""
    _, found = result(Poiseuille(resolution=20, lattice="resting", columns=8, end=1.2))
    assert found["profile_error"].passed
    assert found["transient_error"].passed
    assert found["order"].value > 1.9


def test_running_poiseuille(tmp_path):
    case = Poiseuille(columns=12)
    run, found = result(case)
    for name in ("profile_error", "inside_walls"):
        assert found[name].passed
    assert found["transient_error"].value < 6e-3
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


@pytest.mark.parametrize("scheme", ["transport-velocity", "sdpd"])
def test_couette(scheme):
    _, found = result(Couette(scheme=scheme, columns=8, end=0.6, averaging=0.1))
    assert found["profile_error"].passed
    assert found["transient_error"].passed
