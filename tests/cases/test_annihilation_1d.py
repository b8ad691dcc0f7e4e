from __future__ import annotations

import numpy as np
import pytest

from particell.cases import reference
from particell.cases.annihilation_1d import (
    COMMITTED,
    Annihilation1D,
    reference_profiles,
    steady_profile,
)
from particell.cases.base import Context
from particell.cases.diffusion_1d import slab
from particell.errors import InputError


def test_computed_profiles_agree_with_the_committed_ones():
    table, computed = reference.load("annihilation_Da1"), reference_profiles(1.0, 128)
    for name, values in computed.items():
        assert values == pytest.approx(table[name], abs=2e-4)


@pytest.mark.parametrize("damkohler", [1, 16_000, 640_000])
def test_committed_difference_is_the_exact_one(damkohler):
    table = reference.load(f"annihilation_Da{damkohler}")
    for t in (0.2, 1.0):
        exact = slab(table["x"], 0.1 * t) - slab(1 - table["x"], 0.1 * t)
        assert table[f"A_t{t}"] - table[f"B_t{t}"] == pytest.approx(exact, abs=5e-8)


@pytest.mark.parametrize("damkohler", COMMITTED)
def test_the_steady_state(damkohler):
    """Against the committed columns, of another discretisation."""
    table = reference.load(f"annihilation_Da{damkohler}")
    for found, name in zip(steady_profile(damkohler, table["x"]), "AB", strict=True):
        assert found == pytest.approx(table[f"{name}_tinf"], abs=3e-8)


def test_the_steady_state_of_large_damkohler_numbers():
    a, _ = steady_profile(1e7, np.array([0.5]))
    assert a[0] == pytest.approx(0.8656956670 * 1e7 ** (-1 / 3), rel=1e-5)


def test_a_run_to_the_steady_state_is_compared_with_it():
    case = Annihilation1D(resolution=16, realisations=2, steps=200, end=1.5)
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    metrics = case.analyse(run, simulation)
    assert metrics["eps"].limit == 1.856e-4 and metrics["eps"].passed
    assert metrics["eps_molecules"].limit is None  # of two realisations, not the papers' hundred
    assert metrics["l2_steady"].value < 1e-3
    # 200 steps: 0.226/16² − 0.12/200 = 2.8e-4
    assert metrics["difference_l2"].passed and metrics["difference_l2"].limit < 1.7e-3
    assert metrics["difference_l2_steady"].passed


def test_too_long_steps_are_refused():
    with pytest.raises(InputError, match="steps = 100"):
        Annihilation1D(resolution=64, steps=100).build(Context())


@pytest.fixture(scope="module", params=[1.0, 1.6e4])
def coarse(request):
    case = Annihilation1D(resolution=16, damkohler=request.param, realisations=8, steps=1000)
    simulation = case.build(Context(seed=1))
    return case, simulation, simulation.run(case.until, case.every, progress=False)


def test_coarse_slabs_agree_with_the_reference(coarse, tmp_path):
    case, simulation, run = coarse
    metrics = case.analyse(run, simulation)
    # the layer of Da = 1.6e4, 0.04 L, is narrower than a particle
    late = {f"l2_t{t}" for t in ("0.2", "0.4", "0.6", "0.8", "1")}
    allowed = late | {"molecules_bias"} if case.damkohler > 1 else set()
    assert {name for name, metric in metrics.items() if not metric.passed} <= allowed
    assert 5e-4 < metrics["difference_l2"].value < metrics["difference_l2"].limit < 1.2e-3
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_slabs_do_not_know_of_each_other(coarse):
    case, _, run = coarse
    _, counted = case.profiles(run, -1)
    numbers = np.rint(counted[0] * case.molecules)
    assert len(np.unique(numbers, axis=0)) == case.realisations
    # nothing of a wall's stream goes into the slab behind it
    assert counted[0, :, -1].max() < 0.1
