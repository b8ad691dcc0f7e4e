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
    """The kernel sum's 6e-4, and with that normalised what is left of the transient."""
    for normalise in (False, True):
        case = Poiseuille(
            resolution=20, lattice="resting", columns=8, end=1.5, normalise_viscosity=normalise
        )
        _, found = result(case)
        assert found["profile_error"].passed
        assert found["transient_error"].passed
        expected = 1e-6 if normalise else 1e-3
        assert abs(found["wall_shear_error"].value) < expected
    assert found["order_shortfall"].passed
    assert found["order"].value == pytest.approx(2.0, abs=0.1)


def test_cubic_spline_at_three_spacings():
    """The shift moves particles off the lattice and next to the plates; nothing is torn."""
    case = Poiseuille(
        resolution=20, kernel="cubic-spline", support=3.0, columns=8, end=0.6, averaging=0.1
    )
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    found = case.analyse(run, simulation)
    assert found["profile_error"].value < 3e-3
    assert found["bounces"].value == 0
    assert np.abs(run.field("velocity")[-1]).max() < 1.02


def test_all_of_the_papers_rows_are_there():
    rows = [r for r in Poiseuille.full if r.get("support") == 3.0]
    assert len(rows) == 15
    for row in rows:
        assert Poiseuille(**row).paper_error() is not None
    assert Poiseuille(kernel="cubic-spline", resolution=320).paper_error() == 6.62e-3


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
