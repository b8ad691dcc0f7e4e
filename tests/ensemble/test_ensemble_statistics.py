from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

import ensemble_system as system
from particell import Ensemble, EnsembleRun
from particell.errors import InputError

#: False-alarm rate of the statistical tests.
ALARM = 1e-6
RUNS = 24


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> EnsembleRun:
    make = Ensemble(system.build, RUNS, 3, until=system.UNTIL, every=system.EVERY)
    return make.run(tmp_path_factory.mktemp("ensemble"), processes=1, progress=False)


def stacked(result: EnsembleRun, name: str) -> np.ndarray:
    """All values, (realisations, frames, n)."""
    return np.stack([np.asarray(run.field(name)) for run in result.runs]).astype(float)


def test_mean_and_deviation_are_numpys(result):
    values = stacked(result, "count/A")
    for frame in (0, 2, -1):
        found = result.moments("count/A", frame)
        assert found.samples == RUNS
        np.testing.assert_allclose(found.mean, values[:, frame].mean(axis=0), rtol=1e-13)
        np.testing.assert_allclose(
            found.deviation, values[:, frame].std(axis=0, ddof=1), rtol=1e-12
        )
        np.testing.assert_allclose(found.error, found.deviation / np.sqrt(RUNS), rtol=1e-13)
    np.testing.assert_allclose(result.mean("count/A", None), values.mean(axis=0), rtol=1e-13)
    np.testing.assert_array_equal(result.deviation("position"), 0.0)


def test_quantiles_are_numpys(result, monkeypatch):
    values = stacked(result, "count/B")
    probabilities = [0.1, 0.5, 0.9]
    expected = np.quantile(values[:, -1], probabilities, axis=0)
    np.testing.assert_allclose(result.quantile("count/B", probabilities), expected)
    np.testing.assert_allclose(result.quantile("count/B", 0.5), expected[1])
    every = result.quantile("count/B", probabilities, None)
    np.testing.assert_allclose(every, np.quantile(values, probabilities, axis=0))
    monkeypatch.setattr("particell.ensemble.realisations.QUANTILE_BYTES", 8 * RUNS * 5)
    np.testing.assert_allclose(result.quantile("count/B", probabilities), expected)


def test_histograms_are_numpys(result):
    values = stacked(result, "count/A")
    counts, edges = result.histogram("count/A", 12, 3)
    expected, ends = np.histogram(values[:, 3], 12)
    np.testing.assert_array_equal(counts, expected)
    np.testing.assert_allclose(edges, ends)
    counts, _ = result.histogram("count/A", [0, 200, 500, 10000], None)
    np.testing.assert_array_equal(counts, np.histogram(values, [0, 200, 500, 10000])[0])
    assert result.histogram("count/A", 4, limits=(0, 1))[0].sum() <= counts.sum()


def test_observables_and_functions(result):
    amounts = np.stack([run.observable("amount_A") for run in result.runs])
    np.testing.assert_allclose(result.mean("amount_A", None), amounts.mean(axis=0))
    assert result.deviation("amount_A") == pytest.approx(amounts[:, -1].std(ddof=1))

    def share(run):
        return run.observable("amount_A") / (
            run.observable("amount_A") + run.observable("amount_B")
        )

    np.testing.assert_allclose(result.mean(share), np.mean([share(r) for r in result.runs], axis=0))


def test_on_places(result):
    points = np.array([[2.5], [7.5]])
    at = [run.on_points("concentration/A", points, 1) for run in result.runs]
    np.testing.assert_allclose(
        result.mean("concentration/A", 1, points=points), np.mean(at, axis=0)
    )
    assert result.mean("concentration/A", grid=6).shape == (6,)
    assert result.mean("count/A", groups="fluid").shape == (system.NUMBER,)


def test_mean_is_the_deterministic_limit(result):
    """Independent Poisson numbers: Σ (N̄ - λ)² R/λ is chi-square distributed, and so is the rest."""
    x = result.runs[0].field("position")[-1][:, 0]
    for frame in (1, len(result.times) - 1):
        means = np.concatenate(system.exact(x, result.times[frame]))
        found = [result.moments(f"count/{name}", frame) for name in "AB"]
        mean = np.concatenate([m.mean for m in found])
        square = ((mean - means) ** 2 * RUNS / means).sum()
        assert chi2.isf(1 - ALARM, means.size) < square < chi2.isf(ALARM, means.size)
        variance = np.concatenate([m.deviation for m in found]) ** 2
        freedom = means.size * (RUNS - 1)
        spread = (variance / means).sum() * (RUNS - 1)
        assert chi2.isf(1 - ALARM, freedom) < spread < chi2.isf(ALARM, freedom)


def test_wrong_rate_would_be_seen(result):
    """The test above has the power to see a rate that is 10 % off."""
    x = result.runs[0].field("position")[-1][:, 0]
    good, _ = system.exact(x, result.times[2])
    bad, _ = system.exact(x, result.times[2] * 1.1)
    mean = result.mean("count/A", 2)
    assert ((mean - bad) ** 2 * RUNS / bad).sum() > chi2.isf(ALARM, bad.size)
    assert ((mean - good) ** 2 * RUNS / good).sum() < chi2.isf(ALARM, good.size)


def test_particles_elsewhere_are_refused_but_places_are_not(tmp_path):
    make = Ensemble(system.elsewhere, 2, until=0.5)
    result = make.run(tmp_path, processes=1, progress=False)
    with pytest.raises(InputError, match=r"elsewhere in realisation 1.*grid="):
        result.mean("count/A")
    with pytest.raises(InputError, match="elsewhere"):
        result.quantile("count/A", 0.5, None)
    assert np.isfinite(result.mean("concentration/A", grid=6)).all()
    assert result.histogram("count/A")[0].sum() == 2 * system.NUMBER
    assert result.mean("amount_A").shape == ()


def test_wrong_input_to_statistics(result, tmp_path):
    for call, words in (
        (lambda: result.mean("count/C"), "count/C"),
        (lambda: result.mean("count/A", 9), "frame = 9"),
        (lambda: result.mean("amount_A", groups="fluid"), "groups"),
        (lambda: result.mean("count/A", places=3), "places"),
        (lambda: result.mean("count/A", grid=3, points=[[1.0]]), "points"),
        (lambda: result.quantile("count/A", 1.5), "q = 1.5"),
        (lambda: result.plot("amount_C"), "amount_C"),
        (lambda: result.mean(lambda run: np.zeros(run.summary["seed"] % 1000)), "one shape"),
    ):
        with pytest.raises(InputError, match=words):
            call()
    single = Ensemble(system.build, 1, until=0.5).run(tmp_path, processes=1, progress=False)
    with pytest.raises(InputError, match="at least two"):
        single.mean("count/A")


def test_plot(result, tmp_path):
    result.plot(path=tmp_path / "all.png")
    figure = result.plot.series("amount_A", path=tmp_path / "one.png")
    assert (tmp_path / "all.png").stat().st_size > 0
    assert (tmp_path / "one.png").stat().st_size > 0
    (line,) = figure.axes[0].lines
    assert np.allclose(line.get_ydata(), result.mean("amount_A", None))
    assert figure.axes[0].get_ylabel() == "amount A [molecules]"


def test_plot_histogram(result):
    figure = result.plot.histogram("amount_A", reference={"flat": lambda n: 0 * n + 0.1})
    (bars,) = figure.axes[0].patches
    totals = [run.observable("amount_A")[-1] for run in result.runs]
    shares, edges = bars.get_data().values, bars.get_data().edges
    assert np.allclose(shares * np.diff(edges) * len(totals), np.histogram(totals, edges)[0])
    assert np.all(edges % 1 == 0.5)
    assert figure.axes[0].get_xlabel() == "amount A [molecules]"
    assert np.allclose(figure.axes[0].lines[0].get_ydata(), 0.1)
    by_particle = result.plot.histogram("count/A", frame=0).axes[0].patches[0].get_data()
    assert np.sum(by_particle.values * np.diff(by_particle.edges)) == pytest.approx(1)
    with pytest.raises(InputError, match="count/A"):
        result.plot.histogram("count/a")


def test_plot_line(result):
    options = {"points": [[3.2], [5.7]], "frame": -1}
    expected = result.moments("count/A", **options)
    figure = result.plot.line("count/A", (3.2,), (5.7,), points=2)
    (line,) = figure.axes[0].lines
    assert np.allclose(line.get_ydata(), expected.mean)
    (band,) = figure.axes[0].collections
    corners = band.get_paths()[0].vertices[:, 1]
    assert corners.max() == pytest.approx((expected.mean + expected.deviation).max())


def test_table(result):
    text = result._repr_html_()
    assert f"{len(result)} of" in text
    assert "count/A" in text
