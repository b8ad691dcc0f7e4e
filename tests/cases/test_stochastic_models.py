"""Birth and death, isomerisation, Turing pattern and Min oscillation at small sizes."""

from __future__ import annotations

import numpy as np
import pytest

from particell.cases.base import Context
from particell.cases.birth_death import BirthDeath
from particell.cases.isomerisation import Isomerisation
from particell.cases.min_oscillation import MinOscillation
from particell.cases.turing import Turing
from particell.output.run import Run


def result(case, seed=1):
    simulation = case.build(Context(seed=seed))
    run = simulation.run(case.until, case.every, progress=False)
    return simulation, run, case.analyse(run, simulation)


def test_birth_and_death_are_poisson(tmp_path):
    case = BirthDeath(resolution=32, frames=40)
    _, run, metrics = result(case)
    assert all(metric.passed for metric in metrics.values()), metrics
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_poisson_test_can_fail():
    case = BirthDeath(resolution=32)
    counts = np.random.default_rng(1).binomial(40, 0.25, 1024)  # the right mean, less variance
    statistic, freedom = case.chi_square(counts, 10.0)
    assert statistic / freedom > 3
    counts = np.random.default_rng(1).poisson(10.0, 1024)
    statistic, freedom = case.chi_square(counts, 10.0)
    assert statistic / freedom < 2


@pytest.mark.parametrize("jumps", [0.0, 100.0])
def test_isomers_are_half_and_half(jumps, tmp_path):
    case = Isomerisation(jumps=jumps, steps=200)
    _, run, metrics = result(case)
    if jumps == 0:  # nobody moves: every particle keeps its own molecules
        metrics.pop("spread_score")
    assert all(metric.passed for metric in metrics.values()), metrics
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_fastest_wave_grows_at_the_linear_rate(tmp_path):
    case = Turing(resolution=20, end=12.0, molecules=20)
    assert case.growth(0.0) < 0 < case.growth(case.fastest())
    _, run, metrics = result(case)
    assert metrics["growth_error"].passed, metrics["growth_error"]
    assert all(path.stat().st_size > 0 for path in case.figures(run, tmp_path))


def test_wavelength_of_a_made_up_pattern():
    case = Turing(resolution=32)
    n, dx = case.resolution, case.spacing
    x = (np.stack(np.meshgrid(*[np.arange(n)] * 2, indexing="ij"), -1).reshape(-1, 2) + 0.5) * dx
    wave = 1 + 0.5 * np.cos(2 * np.pi * 4 * x[:, 0] / case.edge)
    frame = {"position": x, "concentration/U": wave * case.concentration}
    run = made_up(case, x, [0.0], [frame])
    assert case.wavelength(run, 0, "U") == pytest.approx(case.edge / 4)


def made_up(case, x, times, frames):
    from particell.geometry.domain import Domain

    domain = Domain(np.zeros(x.shape[1]) - 1e-5, np.ones(x.shape[1]))
    static = {"id": np.arange(len(x)), "group": np.zeros(len(x), np.int32)}
    observables = [{}] * len(times)
    return Run.from_memory(domain, ["all"], static, range(len(times)), times, frames, observables)


def test_period_of_a_made_up_oscillation():
    case = MinOscillation()
    x = (np.arange(40)[:, None] + 0.5) * np.array([[case.spacing, 0, 0]])
    random = np.random.default_rng(1)
    times = np.arange(161.0)
    frames = []
    for t in times:
        side = np.sign(np.sin(2 * np.pi * t / 37.0))
        weight = np.exp(side * 2 * np.linspace(-1, 1, 40))
        counts = random.poisson(30 * weight)
        frames.append({"position": x, "count/d": counts, "count/de": 0 * counts})
    run = made_up(case, x, times, frames)
    assert case.period(run) == pytest.approx(37.0, abs=1.0)


def test_min_molecules_bind_at_the_rate_per_area_and_none_is_lost():
    # no help from bound MinD, no release: D_ATP disappears into the membrane
    case = MinOscillation(
        recruiting=0.0, capture=0.0, exchange=50.0, until=1.5, every=0.5, min_d=20_000, dt=5e-3
    )
    _, run, metrics = result(case)
    assert np.isnan(metrics["period"].value) and not metrics["period_error"].passed
    assert metrics["MinD_lost"].passed and metrics["MinE_lost"].passed
    radius, length = case.radius, case.length
    per_volume = 2 * (1 / radius + 1 / length)
    bound = run.observable("amount_d")
    # binding is slow against diffusion across (0.025 µm/s · 0.5 µm ≪ 2.5 µm²/s): well mixed
    rate = -np.log(1 - bound[-1] / case.min_d) / (case.until - 1 / case.exchange)
    assert rate == pytest.approx(case.binding * per_volume, rel=0.05)  # 6 sigma are 4 %
