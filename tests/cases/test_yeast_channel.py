"""The yeast channel at a coarse resolution, and the Stokes similarity that its default uses."""

import numpy as np
import pytest

from particell import plots, snapshot
from particell.cases import reference, yeast_channel_ensemble
from particell.cases import yeast_channel_results as results
from particell.cases.base import Context
from particell.cases.yeast_channel import YeastChannel
from particell.ensemble import EnsembleRun
from particell.errors import LawWarning
from particell.output.run import Run


def run_case(reynolds: float, chemistry: str, end: float):
    case = YeastChannel(resolution=40, reynolds=reynolds, chemistry=chemistry, end=end, frames=4)
    simulation = case.build(Context(seed=1))
    return case, simulation, simulation.run(case.until, case.every, progress=False)


@pytest.fixture(scope="module")
def both_ways():
    return run_case(1.0, "both", 1.0)


def test_metrics_are_within_their_limits_even_at_this_resolution(both_ways):
    case, _, run = both_ways
    metrics = results.metrics(case, run)
    assert {name for name, metric in metrics.items() if not metric.passed} <= {"u_centreline"}
    assert metrics["L_centreline_concentrations_t1"].limit == 0.05
    assert metrics["RL_membrane_concentrations_t1"].limit == 0.05


def test_at_the_default_resolution_nothing_is_missing_outside_the_cell(both_ways):
    """Points of the reference that lie in the membrane may be in what the particles call inside."""
    case = YeastChannel()
    simulation = case.build(Context(seed=1))
    run = simulation.run(2 * simulation.dt, 2 * simulation.dt, progress=False)
    table = reference.load("yeast_channel_centreline")
    x, ligand = results.centreline(case, run, "concentration/L", 1)
    apart = np.abs(x - case.position / case.height) - case.radius / case.height
    assert np.isfinite(ligand[apart > 0]).all()
    lost = np.isfinite(table["L_t0.5"]) & ~np.isfinite(ligand)
    assert lost.sum() <= 2 and (apart[lost] > -1 / case.resolution).all()


def test_what_no_reaction_changes_is_conserved(both_ways):
    _, simulation, _ = both_ways
    for name, drift in simulation.conservation().items():
        if name.startswith("amount"):
            assert abs(drift) == 0 if "molecules" in name else abs(drift) < 1e-12, name


def test_summary_of_an_ensemble(both_ways, tmp_path):
    case, _, run = both_ways
    ensemble = EnsembleRun.__new__(EnsembleRun)  # of twice the same realisation
    ensemble.directory, ensemble.indices, ensemble.runs = tmp_path, [0, 1], [run, run]
    metrics = yeast_channel_ensemble.metrics(case, ensemble)
    single = results.metrics(case, run)
    error = metrics["RL_membrane_mean_of_molecules_t1"].value
    assert error == pytest.approx(single["RL_membrane_molecules_t1"].value)
    made = yeast_channel_ensemble.figures(case, ensemble, tmp_path)
    assert [path.name for path in made] == ["membrane_mean.png", "binding_mean.png"]


def test_the_map_stands_beside_that_of_the_finite_elements(both_ways, tmp_path, monkeypatch):
    case, _, run = both_ways
    monkeypatch.setattr(results, "MAP_TIME", case.end)
    names = [path.name for path in results.figures(case, run, tmp_path)]
    assert "map.png" in names
    monkeypatch.setattr(results, "MAP_TIME", 2 * case.end)
    assert "map.png" not in [path.name for path in results.figures(case, run, tmp_path)]


def test_the_committed_map_is_the_one_on_the_centreline():
    table = reference.load("yeast_channel_map")
    line = reference.load("yeast_channel_centreline")
    x = np.array([float(name[3:]) / 1000 for name in table if name != "y_star"])
    middle = np.abs(table["y_star"] - 0.5) < 0.013  # one row on each side
    found = np.array([table[name][middle].mean() for name in table if name != "y_star"])
    away = np.abs(x - 0.25) > 0.05
    assert found[away] == pytest.approx(
        np.interp(x, line["x_star"], line["L_t2.0"])[away], abs=2e-3
    )


def test_as_many_particles_as_the_papers_are_let_through_with_a_warning():
    case = YeastChannel(resolution=25, chemistry="concentrations")
    with pytest.warns(LawWarning, match=r"the cell is 1\.3 spacings wide"):
        simulation = case.build(Context(seed=1))
    inside = simulation.particles.host("x")[:, 0] > 0
    fluid = simulation.particles.host("is_wall") == 0
    assert np.count_nonzero(inside & fluid) == pytest.approx(1250, abs=5)


def test_no_particle_is_inside_the_cell(both_ways):
    case, _, run = both_ways
    fluid = run.field("position")[-1][run.group("fluid")]
    distance = np.linalg.norm(fluid - np.array(case.centre), axis=1)
    assert distance.min() > case.radius


def test_a_smaller_reynolds_number_changes_little():
    """Stokes similarity: Re = 1 (the default) and Re = 0.25 agree within 2 % at t* = 0.5."""
    case, _, run = run_case(1.0, "concentrations", 0.5)
    _, _, slower = run_case(0.25, "concentrations", 0.5)
    for measure, field in (
        (results.centreline, "concentration/L"),
        (results.around_membrane, "concentration/RL"),
    ):
        one, other = (measure(case, r, field, -1)[1] for r in (run, slower))
        good = np.isfinite(one) & np.isfinite(other)
        assert results.relative_l2(one[good], other[good]) < 0.02


def test_another_cell_is_not_held_against_the_reference(both_ways):
    """The reference is for the defaults alone; Stokes similarity lets Re be another."""
    case, run = both_ways[0], both_ways[-1]
    assert case.model_copy(update={"reynolds": 0.5}).as_reference
    other = case.model_copy(update={"mean_velocity": 3e-4})
    assert not other.as_reference
    compared = {name: m for name, m in results.metrics(other, run).items() if "chi2" not in name}
    assert compared and all(m.limit is None for m in compared.values())


def test_figures_of_a_run_of_a_few_milliseconds(tmp_path):
    """Before the times of the reference: no warning; walls, receptors and sponge are to be seen."""
    case = YeastChannel(resolution=40, chemistry="both")
    simulation = case.build(Context(seed=1))
    roles = snapshot.roles_of(simulation)
    head = (simulation.domain, simulation.group_names, simulation.static_frame())
    frames = [simulation.frame(), simulation.frame()]
    run = Run.from_memory(*head, [0, 1], [0.0, 3e-3], frames, roles=roles)
    drawn = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "save", lambda figure, path: drawn.setdefault(path.stem, figure))
        results.figures(case, run, tmp_path)
    assert {"particles", "receptors", "speed", "ligand_molecules", "centreline"} <= set(drawn)
    for name in ("particles", "speed", "ligand_concentrations"):
        axes = drawn[name].axes[0]
        assert "sponge" in [text.get_text() for text in axes.texts]
        low, high = axes.get_ylim()
        assert low < -0.05 * case.height * 1e6 and high > 1.05 * case.height * 1e6  # with walls
    grey = drawn["speed"].axes[0].collections[-1].get_offsets()
    assert len(grey) == (~run.group("fluid")).sum()
    receptors = drawn["receptors"].axes[0].collections[-1]
    assert len(receptors.get_offsets()) == run.group("membrane").sum()
    assert plots.save(drawn["receptors"], tmp_path / "a.png").stat().st_size > 1000
