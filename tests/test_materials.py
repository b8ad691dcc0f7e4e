from __future__ import annotations

import numpy as np
import pytest

from particell.errors import InputError
from particell.materials import Fluid, density_of, pressure_of


@pytest.mark.parametrize("exponent", [1.0, 7.0, 1.4])
@pytest.mark.parametrize("background", [0.0, 50.0])
def test_equation_of_state_and_its_inverse(exponent, background):
    reference, sound = 1000.0, 3.0
    for ratio in np.linspace(0.9, 1.1, 21):
        density = ratio * reference
        pressure = pressure_of(density, reference, sound, exponent, background)
        exact = reference * sound**2 / exponent * (ratio**exponent - 1) + background
        assert pressure == pytest.approx(exact, abs=1e-9)
        assert density_of(pressure, reference, sound, exponent, background) == pytest.approx(
            density, rel=1e-13
        )
    step = 1e-3
    slope = pressure_of(reference + step, reference, sound, exponent, 0.0)
    slope -= pressure_of(reference - step, reference, sound, exponent, 0.0)
    assert slope / (2 * step) == pytest.approx(sound**2, rel=1e-6)


def test_density_of_a_vacuum_stays_positive():
    assert density_of(-1e9, 1000.0, 1.0, 7.0, 0.0) >= 100
    assert density_of(-1e9, 1000.0, 1.0, 1.0, 0.0) >= 100


@pytest.mark.parametrize(
    "wrong",
    [
        {"density": 0.0},
        {"density": float("nan")},
        {"viscosity": -1.0},
        {"bulk_viscosity": -1.0},
        {"temperature": 0.0},
        {"sound_speed": -1.0},
        {"exponent": 0.0},
    ],
)
def test_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))) as error:
        Fluid(**{"density": 1.0, "viscosity": 1.0, **wrong})
    assert "\n" not in str(error.value)
