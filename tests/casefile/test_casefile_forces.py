"""Body forces of place and time as formulas in case files."""

from __future__ import annotations

import pytest
from case_files import case

import particell as pc
from particell.cases.base import Context
from particell.laws import cos, tanh, where
from systems import same_bits

FILE = {"scheme__reference_speed": "1 mm/s", "boundaries": []}


def test_formulas_are_the_same_force():
    """Bit for bit, with constants, comparisons and functions of both."""
    text = "= strength * where(y < 0.5 * height, 1.0, tanh(x / height)) * cos(t / period)"
    force = {"type": "BodyForce", "acceleration": [text, "0.5 m/s^2"]}
    constants = {"constants__strength": "2 m/s^2", "constants__period": "1 ms"}
    one = case(**FILE, **constants, forces=[force])
    simulation = one.build(Context())
    height = 1e-4

    def function(x, y, t):
        half = where(y < 0.5 * height, 1.0, tanh(x / height))
        return 2.0 * half * cos(t / 1e-3), 0.5

    again = pc.Simulation(
        simulation.domain,
        simulation.phases,
        simulation.scheme,
        forces=[pc.BodyForce(function)],
        dt=simulation.dt,
    )
    assert same_bits(again, simulation) == []


@pytest.mark.parametrize(
    ("acceleration", "words"),
    [
        (["= t", 0], "units|dimension"),
        (["= floor(x / height) * 1 ", 0], "floor|dimension"),
        (["= 2 * strangth", 0], "strangth"),
        ([0], "2 numbers"),
    ],
)
def test_wrong_formulas_are_refused_in_one_line(acceleration, words):
    force = {"type": "BodyForce", "acceleration": acceleration}
    with pytest.raises(pc.InputError, match=words) as error:
        case(**FILE, forces=[force]).build(Context())
    assert "\n" not in str(error.value)
