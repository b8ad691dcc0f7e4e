from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.boundaries.sponge import Sponge, relax_velocity, share_of_target
from particell.errors import InputError

OPEN = (0.0, 2.0, 0.0)  # where the period begins, its length, 1/length: none
X = np.stack([np.linspace(-0.5, 1.5, 41), np.zeros(41)], -1)


def relax(steps, time=1.0):
    v = np.random.default_rng(1).normal(size=X.shape)
    target = np.zeros_like(X)
    target[:, 0] = 2.0
    walls = np.zeros(len(X), np.uint8)
    walls[20] = 1
    run = relax_velocity.specialise(DIM=2, AXIS=0)
    for _ in range(steps):
        run(len(X), X, v, walls, 0.0, 1.0, 3.0, *OPEN, time / steps, target)
    return v


def test_strength_does_not_depend_on_the_step():
    coarse, fine = relax(1), relax(10)
    assert fine == pytest.approx(coarse, abs=1e-13)
    before = np.random.default_rng(1).normal(size=X.shape)
    sponge = Sponge(0.0, 1.0, time=1.0)
    share = sponge.strength(X)
    share[20] = 0  # a wall particle keeps its velocity
    assert coarse == pytest.approx(before - share[:, None] * (before - [2.0, 0.0]), abs=1e-13)


def test_profile():
    strength = Sponge(0.0, 1.0, time=1.0).strength(X)
    s = X[:, 0]
    assert strength == pytest.approx(np.where((s > 0) & (s <= 1), s**3, 0))
    backwards = Sponge(1.0, 0.0, time=1.0, exponent=1.0).strength(X)
    assert backwards == pytest.approx(np.where((s >= 0) & (s < 1), 1 - s, 0), abs=1e-12)


def test_share_for_species_is_the_same():
    share = np.zeros(len(X))
    share_of_target.specialise(AXIS=0)(len(X), X, 0.0, 1.0, 3.0, *OPEN, 0.1, share)
    phi = Sponge(0.0, 1.0, time=1.0).strength(X)
    assert share == pytest.approx(1 - (1 - phi) ** 0.1, abs=1e-14)


def test_refused():
    with pytest.raises(InputError, match="time"):
        Sponge(0.0, 1.0, time=0.0)
    with pytest.raises(InputError, match="end"):
        Sponge(1.0, 1.0, time=1.0)


def plug_flow(sponge, length=1.0, **species):
    """A uniform stream of speed 1 through a periodic box of 20 x 5 spacings."""
    domain = pc.Domain((0, 0), (length, 0.25 * length), periodic="xy")
    filled = pc.fluid(
        domain, pc.Fluid(1.0, 1e-3, sound_speed=10.0), length / 20, velocity=(1.0, 0.0)
    )
    made = [pc.Species(name, 0.0) for name in sponge.species]
    scheme = pc.SDPD(support=2.0)
    return pc.Simulation(domain, filled, scheme, made, boundaries=[sponge], seed=1)


@pytest.mark.parametrize("zone", [(0.8, 1.0), (0.9, 1.1), (-0.1, 0.1), (0.1, -0.1)])
def test_every_particle_that_passes_the_zone_feels_it(zone):
    """At the periodic face and across it, though lists, and with them places, are old."""
    sponge = Sponge(*zone, time=2e-3, species={"C": 1.0})
    simulation = plug_flow(sponge)
    run = simulation.run(until=1.2, every=1.2, progress=False)
    assert simulation.neighbours.builds < 0.1 * simulation.step
    assert run.field("concentration/C")[-1].min() > 0.95


def test_targets_are_those_of_the_present_place():
    """The target 1 - cos 2πx is held everywhere; a stream takes nobody's target along."""

    def target(x):
        assert (x >= 0).all() and (x[:, 0] < 1).all()
        return 1 - np.cos(2 * np.pi * x[:, 0])

    sponge = Sponge(-1e-3, 0.999, time=1e-6, species={"C": target}, exponent=1e-3)
    run = plug_flow(sponge).run(until=1.7, every=0.1, progress=False)
    for k in range(1, len(run)):
        x, c = run.field("position")[k], run.field("concentration/C")[k]
        # 2π times a tenth of the support, 0.1 long
        assert c == pytest.approx(target(x), abs=0.07)


def test_a_continuation_has_the_same_targets():
    def made():
        sponge = Sponge(
            0.5,
            1.0,
            time=0.05,
            velocity=lambda x: np.stack([1 + 0.1 * x[:, 1], 0 * x[:, 1]], 1),
            species={"C": lambda x: 1 + x[:, 0]},
        )
        return plug_flow(sponge)

    whole, first = made(), made()
    whole.advance(150)
    first.advance(73)
    second = made()
    second.restore(first.state())
    second.advance(77)
    for name in whole.particles:
        assert np.array_equal(whole.particles.host(name), second.particles.host(name)), name
