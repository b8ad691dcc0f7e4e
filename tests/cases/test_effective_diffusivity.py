from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from particell.cases.base import Context
from particell.cases.effective_diffusivity import EffectiveDiffusivity, on_lattice
from particell.errors import InputError

SUMS = Path(__file__).parent.parent / "data" / "lucy_lattice_sums.csv"


def test_lattice_sum_agrees_with_the_table():
    table = np.genfromtxt(SUMS, delimiter=",", skip_header=3)
    for row in table[::4]:
        assert on_lattice("lucy", row[1], int(row[0])) == pytest.approx(row[5], abs=2e-6)


def measured(**parameters):
    case = EffectiveDiffusivity(**parameters)
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    return case, run, case.analyse(run, simulation)


@pytest.mark.parametrize(
    ("dimensions", "arrangement", "support"),
    [
        (1, "square", 1.8),
        (1, "square", 3.0),
        (2, "square", 2.4),
        (2, "hexagonal", 1.8),
        (2, "jittered", 3.0),
        (2, "packed", 2.4),
        (3, "square", 1.8),
    ],
)
def test_normalised_diffusivity_is_right_on_every_arrangement(dimensions, arrangement, support):
    wavelength = 32 if dimensions == 3 else 64
    _, _, metrics = measured(
        dimensions=dimensions, arrangement=arrangement, support=support, wavelength=wavelength
    )
    assert metrics["diffusivity_error"].limit == 1e-2
    assert all(metric.passed for metric in metrics.values()), metrics


def test_without_normalisation_it_is_the_lattice_sum(tmp_path):
    case, run, metrics = measured(arrangement="square", support=2.4, normalise=False)
    expected = on_lattice("lucy", 2.4, 2) - 1
    assert metrics["diffusivity_error"].value == pytest.approx(expected, abs=2e-3)
    assert metrics["diffusivity_error"].limit is None
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_hexagonal_lines_are_refused():
    with pytest.raises(InputError, match="arrangement"):
        EffectiveDiffusivity(dimensions=1, arrangement="hexagonal").build(Context())
