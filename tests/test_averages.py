"""Time averages: exact where they must be, the same bits after a restart, read back as written."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import particell as pc
from particell import observers
from particell.analysis.fields import grid, interpolate
from particell.compute.threads import available_threads, get_threads, set_threads
from particell.errors import Interrupted
from particell.output.checkpoint import read_checkpoint

SPACING = 0.05


def flow(seed: int = 1, periodic: str = "xy", velocity=(1.0, 0.5)) -> pc.Simulation:
    """A fluid at uniform velocity in a periodic box: it goes through the box and round."""
    domain = pc.Domain((-1.0, 2.0), (0.0, 3.0), periodic)
    water = pc.Fluid(density=1.0, viscosity=0.1, sound_speed=10.0, exponent=1.0)
    filled = pc.fluid(domain, water, SPACING, velocity=velocity)
    return pc.Simulation(domain, [filled], pc.TransportVelocity(), seed=seed)


def still(domain: pc.Domain, concentration, spacing=SPACING, reactions=()) -> pc.Simulation:
    """Particles at rest that hold a given field C."""
    water = pc.Fluid(density=1.0, viscosity=0.1)
    filled = pc.fluid(domain, water, spacing)
    held = [pc.Species("C", 0.0)]
    simulation = pc.Simulation(domain, [filled], pc.Static(), held, reactions, dt=0.1)
    x = simulation.particles.host("x")
    simulation.chemistry.set_concentration("C", concentration(x))
    return simulation


def test_uniform_flow_to_round_off_wherever_the_particles_are():
    simulation = flow()
    points = grid(simulation.domain, (7, 5))
    mean = pc.TimeAverage(points, ("velocity", "density"), samples=7)
    run = simulation.run(2.0, 1.0, progress=False, averages=mean)
    velocity = run.average("velocity")
    assert velocity.shape == (7, 5, 2)
    assert np.abs(velocity - [1.0, 0.5]).max() < 1e-12
    assert run.average("density").shape == (7, 5)
    assert run.average_names == {"mean": ["density", "velocity"]}
    assert np.array_equal(run.average_points["mean"], points)
    assert "kinetic_energy" in run.observable_names
    assert not [name for name in run.observable_names if "mean" in name]


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("periodic", [False, True])
def test_one_sample_is_the_interpolation_of_the_state(dim, periodic):
    """A steady field, at corners, edges and beyond a periodic edge, in every dimension."""
    domain = pc.Domain((-1.0,) * dim, (0.5, 1.0, 0.2)[:dim], "xyz"[:dim] if periodic else "")
    wave = 2 * np.pi / domain.lengths[0]
    simulation = still(domain, lambda x: 2.0 + np.sin(wave * (x[:, 0] + 1.0)), spacing=0.1)
    random = np.random.default_rng(3)
    points = domain.lower + random.random((40, dim)) * domain.lengths
    points = np.concatenate([points, [domain.lower, domain.upper], points[:5] + domain.lengths])
    mean = pc.TimeAverage(points, ("concentration/C",), samples=3)
    run = simulation.run(0.6, 0.6, progress=False, averages=mean)
    p = simulation.particles
    expected = interpolate(
        points,
        p.host("x"),
        simulation.chemistry.concentration("C"),
        volume=p.host("mass") / p.host("density"),
        support=p.host("support"),
        domain=domain,
    )
    if not periodic:  # nothing is out there
        assert np.isnan(expected[-5:]).all() == np.isnan(run.average("concentration/C")[-5:]).all()
    assert run.average("concentration/C") == pytest.approx(expected, rel=1e-11, nan_ok=True)


def test_linear_fields_are_exact_up_to_the_boundary():
    domain = pc.Domain((0, 0), (1, 2))
    simulation = still(domain, lambda x: 1.0 + 2.0 * x[:, 0] + 3.0 * x[:, 1])
    points = np.array([(0.0, 0.0), (1.0, 2.0), (0.0, 1.3), (0.4, 0.7)])
    mean = pc.TimeAverage(points, ["concentration/C"], samples=2)
    run = simulation.run(1.0, 0.5, progress=False, averages=[mean])
    expected = 1.0 + points @ [2.0, 3.0]
    assert run.average("concentration/C") == pytest.approx(expected, rel=1e-12)


def test_the_mean_is_that_of_the_samples():
    """Between two frames of n steps, samples = n: the mean over all of them, of what decays."""
    domain = pc.Domain((0.0,), (1.0,))
    loss = pc.Reaction("C -> 0", 1.0)
    simulation = still(domain, lambda x: 1.0 + x[:, 0], reactions=[loss])
    mean = pc.TimeAverage(np.array([[0.5]]), ("concentration/C",), samples=10)
    run = simulation.run(2.0, 1.0, progress=False, averages=mean)
    times = simulation.dt * np.arange(1, 11)
    for frame in (1, 2):
        exact = 1.5 * np.exp(-(times + frame - 1)).mean()
        assert run.average("concentration/C", frames=[frame])[0] == pytest.approx(exact, rel=1e-6)
    assert run.average("concentration/C", frames=[0])[0] == pytest.approx(1.5, rel=1e-12)
    both = run.average("concentration/C", frames=slice(1, None))
    each = [run.average("concentration/C", frames=[k])[0] for k in (1, 2)]
    assert both[0] == pytest.approx(np.mean(each), rel=1e-14)


def test_groups_do_not_mix():
    domain = pc.Domain((0, 0), (1, 1))
    water = pc.Fluid(density=1.0, viscosity=0.1, sound_speed=10.0)
    walls = pc.box_walls(domain, water, SPACING, layers=3, sliding={"y-upper": (1.0, 0.0)})
    filled = pc.fluid(domain, water, SPACING)
    simulation = pc.Simulation(domain, [filled, *walls], pc.TransportVelocity(reference_speed=1.0))
    top = np.array([(0.5, 1.0 - 0.1 * SPACING)])
    averages = [
        pc.TimeAverage(top, groups=("fluid",), name="fluid"),
        pc.TimeAverage(top, groups=[walls[-1].name], name="lid"),
    ]
    run = simulation.run(1e-4, progress=False, averages=averages)
    assert abs(run.average(name="fluid", frames=[0])).max() == 0.0
    assert np.linalg.norm(run.average(name="lid", frames=[0])) > 0.5


def test_an_interrupted_run_has_the_same_bits(tmp_path, monkeypatch):
    """Broken off between two frames, with samples in hand."""
    points = grid(flow().domain, 4)

    def mean():
        return pc.TimeAverage(points, ("velocity", "pressure"), samples=30)

    def start():
        return flow(velocity=lambda x: np.stack([np.sin(6 * x[:, 1]), 0 * x[:, 0]], 1))

    whole = start().run(0.2, 0.1, tmp_path / "whole", progress=False, averages=mean())
    samples = []
    original = observers.RunningAverage.sample

    def counted(self):
        original(self)
        samples.append(1)
        if len(samples) == 40:  # asks to stop, as Ctrl-C does, within the second interval
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(observers.RunningAverage, "sample", counted)
    with pytest.raises(Interrupted):
        start().run(0.2, 0.1, tmp_path / "broken", progress=False, averages=mean())
    monkeypatch.undo()
    state, _ = read_checkpoint(tmp_path / "broken" / "checkpoint.h5")
    assert state["averages"]["mean"].any()
    again = start()
    again.restore(state)
    with pytest.raises(pc.InputError, match="averages"):
        again.run(0.2, 0.1, tmp_path / "broken", progress=False)
    run = again.run(0.2, 0.1, tmp_path / "broken", progress=False, averages=mean())
    for field in ("velocity", "pressure"):
        for frame in (0, 1, 2):
            ours, theirs = (r.average(field, frames=[frame]) for r in (run, whole))
            assert np.array_equal(ours, theirs)


def test_threads_do_not_matter():
    if available_threads() < 2:
        pytest.skip("one thread only")
    before, found = get_threads(), []
    try:
        for threads in (1, 2):
            set_threads(threads)
            simulation = flow(velocity=lambda x: np.stack([np.sin(6 * x[:, 1]), 0 * x[:, 0]], 1))
            mean = pc.TimeAverage(grid(simulation.domain, 9), samples=5)
            found.append(simulation.run(0.05, progress=False, averages=mean).average())
    finally:
        set_threads(before)
    assert np.array_equal(*found)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"points": np.zeros((3, 3))}, "points"),
        ({"points": np.zeros(3)}, "points"),
        ({"points": np.full((1, 2), np.nan)}, "points"),
        ({"fields": ("velocty",)}, "did you mean 'velocity'"),
        ({"fields": ()}, "fields"),
        ({"groups": ("water",)}, "group"),
        ({"samples": 0}, "samples"),
        ({"name": "a/b"}, "name"),
        ({"kernel": "gauss"}, "kernel"),
    ],
)
def test_wrong_averages_are_refused_in_one_line(options, words):
    with pytest.raises(pc.InputError, match=words):
        mean = pc.TimeAverage(**{"points": np.zeros((1, 2)), **options})
        flow().run(0.1, progress=False, averages=mean)


def test_two_of_the_same_name_are_refused():
    points = np.zeros((1, 2))
    with pytest.raises(pc.InputError, match="a name each"):
        flow().run(0.1, progress=False, averages=[pc.TimeAverage(points)] * 2)


def test_what_was_not_averaged_cannot_be_read(tmp_path):
    plain = flow().run(0.01, progress=False, out=tmp_path)
    with pytest.raises(pc.InputError, match="averages"):
        plain.average()
    mean = pc.TimeAverage(np.zeros((1, 2)) + 2.5)
    run = flow().run(0.01, progress=False, averages=mean)
    with pytest.raises(pc.InputError, match="field"):
        run.average("pressure")
    with pytest.raises(pc.InputError, match="average"):
        run.average(name="other")
    with pytest.raises(pc.InputError, match="frames"):
        run.average(frames=slice(99, None))
