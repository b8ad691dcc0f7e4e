"""Drag and flow rate at small sizes, and what the exact values are made of."""

from __future__ import annotations

import math

import numpy as np
import pytest

from particell.cases.base import Context
from particell.cases.drag_array import CYLINDERS, SPHERES, DragArray
from particell.errors import InputError


def result(**parameters):
    case = DragArray(**parameters)
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    return case, run, case.analyse(run, simulation)


def test_tabulated_drag_follows_the_series():
    """Sangani & Acrivos' expansions for dilute arrays; for spheres Hasimoto's."""
    for c, k in CYLINDERS.items():
        if c <= 0.1:
            series = -0.5 * math.log(c) - 0.738 + c - 0.887 * c**2 + 2.038 * c**3
            assert k == pytest.approx(4 * math.pi / series, rel=2e-3)
    for c, k in SPHERES.items():
        if c <= 0.03:
            x = c ** (1 / 3)
            assert k == pytest.approx(1 / (1 - 1.7601 * x + x**3 - 1.5593 * x**6), rel=5e-3)


def test_flow_rate_of_a_square_duct():
    """Against the solution of its Poisson equation by sines in both directions."""
    m, n = np.meshgrid(np.arange(1, 400, 2), np.arange(1, 400, 2))
    total = (64 / (math.pi**6 * m**2 * n**2 * (m**2 + n**2))).sum()
    assert DragArray(shape="duct").exact == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize(
    "parameters",
    [
        {"scheme": "sdpd"},
        {"scheme": "transport-velocity"},
        {"scheme": "sdpd", "body": "lattice"},
        {"shape": "sphere", "resolution": 3, "scheme": "transport-velocity"},
    ],
    ids=lambda p: " ".join(map(str, p.values())),
)
def test_drag_is_right(parameters, tmp_path):
    """1 % (cylinders of 5 spacings' radius) and 2 % (spheres of 3); without a wall's curvature in
    the friction it is 4 and 10 %."""
    case, run, found = result(**parameters)
    for name in ("drag_error", "last_change", "inside_walls", "bounces"):
        assert found[name].passed, name
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_fractions_without_an_exact_value_are_refused():
    with pytest.raises(InputError, match="one of"):
        DragArray(shape="sphere", fraction=0.2).build(Context())
