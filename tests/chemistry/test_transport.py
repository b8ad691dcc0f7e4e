"""Diffusion of concentrations and of molecules, and their boundaries."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import FixedValueWall, Reservoir
from particell.chemistry.species import Species
from particell.compute.threads import set_threads
from particell.errors import RunError
from particell.kernels import LUCY, normalisation, shape_f
from particell.materials import AVOGADRO
from particell.particles import Group

KAPPA = 1e-10
#: Walkers one by one, whole groups at a time, and the choice by cost.
REGIMES = {"walkers": np.inf, "groups": 0.0, "cost": None}
LEVEL = 1e-7  # false-alarm rate of each chi-square test

FLUID = Group("fluid", "fluid", 0)
SOURCE = Group("source", "fluid", 0)


def make(lattice, species, reactions=(), boundaries=(), regime="cost", seed=1, **options):
    chem = lattice.chemistry(species, reactions, boundaries, kernel="lucy", seed=seed, **options)
    if REGIMES[regime] is not None:
        chem.binomial_cost = REGIMES[regime]
    return chem


def rate_matrix(chem, kappa=KAPPA):
    """Jump rates i -> j of the definition, by rows, straight from the positions."""
    p = chem.particles
    x, h = p.host("x"), p.host("support")[0]
    volume = p.host("mass") / p.host("density")
    period = chem.neighbours.period
    d = x[:, None] - x[None]
    d -= np.where(period > 0, period, 0) * np.rint(d * chem.neighbours.inverse_period)
    q = np.sqrt((d**2).sum(-1)) / h
    f = normalisation(LUCY, p.dim) / h ** (p.dim + 2) * np.vectorize(shape_f)(q, LUCY)
    k = 2 * kappa * volume[None, :] * f
    np.fill_diagonal(k, 0.0)
    return k


def generator(k):
    return k - np.diag(k.sum(axis=1))


@pytest.mark.parametrize("regime", REGIMES)
def test_walkers_have_the_law_exp_tau_k(lattice, regime):
    chem = make(lattice(disturb=0.2), [Species("M", KAPPA, molecules=True)], regime=regime)
    k = rate_matrix(chem)
    tau = 1.7 / k.sum(axis=1).max()
    number = 400_000 if regime != "walkers" else 100_000
    start = np.zeros(36)
    start[8] = number
    chem.set_count("M", start)
    chem.step(3, tau)
    expected = number * expm(tau * generator(k))[8]
    assert expected.min() > 10
    got = chem.particles.host("count")[:, 0]
    assert got.sum() == number
    assert stats.chisquare(got, expected).pvalue > LEVEL
    # nearly homogeneous, so the number of jumps is near that of the mean rate
    mean = number * k.sum(axis=1).mean() * tau
    assert abs(chem.jumps - mean) < 0.1 * mean


@pytest.mark.usefixtures("always_shared")
@pytest.mark.parametrize("regime", REGIMES)
def test_same_molecules_for_any_threads_and_order_in_memory(lattice, regime):
    """Residents and those that come from a reservoir."""
    found = []
    box = lattice(side=8, disturb=0.2, groups=(FLUID, SOURCE), group_of=in_source)
    given = np.random.default_rng(1).integers(0, 400, 64)
    volume = (1e-5 / 8) ** 2 * 1e-6 * AVOGADRO
    for threads in range(1, min(3, numba.config.NUMBA_NUM_THREADS) + 1):
        set_threads(threads)
        boundaries = [Reservoir("source", {"M": 200 / volume})]
        species = [Species("M", KAPPA, molecules=True)]
        chem = make(box, species, boundaries=boundaries, regime=regime)
        chem.particles.permute(np.random.default_rng(threads).permutation(64))
        chem.neighbours.build(chem.particles)
        chem.set_count("M", given, by_id=True)
        for step in range(3):
            chem.step(step, 1.5 / rate_matrix(chem).sum(axis=1).max())
        found.append((chem.jumps, chem.particles.by_id("count").tolist()))
    assert found[0][0] > 10_000
    assert all(each == found[0] for each in found)


@pytest.mark.parametrize("regime", REGIMES)
def test_many_molecules_are_multinomial(lattice, regime):
    """Covariance N (δ p - p p) of molecules that start together."""
    chem = make(lattice(disturb=0.2), [Species("M", KAPPA, molecules=True)], regime=regime)
    k = rate_matrix(chem)
    tau = 0.8 / k.sum(axis=1).max()
    number, repeats = 120, 800
    start = np.zeros(36)
    start[14] = number
    got = np.empty((repeats, 36))
    for r in range(repeats):
        chem.set_count("M", start)
        chem.step(r, tau)
        got[r] = chem.particles.host("count")[:, 0]
    p = expm(tau * generator(k))[14]
    expected = number * (np.diag(p) - np.outer(p, p))
    centred = got - number * p
    products = centred[:, :, None] * centred[:, None, :]
    deviation = (products.mean(0) - expected) / (products.std(0) / np.sqrt(repeats))
    # 666 independent entries: 6.5 sigma have a false-alarm rate below 1e-7 (heavier tails included)
    assert np.abs(deviation).max() < 6.5
    mean = centred.mean(0) / np.sqrt(np.diag(expected) / repeats)
    assert np.abs(mean).max() < 6.0


def in_source(x):
    return (x[:, 0] < 2.5e-6).astype(int)


def assert_poisson(got, expected):
    """Independent Poisson numbers (repeats, cells): means, and the sum of squares."""
    repeats = len(got)
    assert np.abs((got.mean(0) - expected) / np.sqrt(expected / repeats)).max() < 6.0
    squares = ((got - expected) ** 2 / expected).sum()
    variance = repeats * (2 + 1 / expected).sum()
    assert abs(squares - got.size) < 6.0 * np.sqrt(variance)
    neighbours = ((got[:, 1:] - expected[1:]) * (got[:, :-1] - expected[:-1])).sum()
    variance = repeats * (expected[1:] * expected[:-1]).sum()
    assert abs(neighbours) < 6.0 * np.sqrt(variance)


@pytest.mark.parametrize("regime", REGIMES)
def test_reservoir_makes_poisson_numbers(lattice, regime):
    box = lattice(side=8, groups=(FLUID, SOURCE), group_of=in_source)
    held = 6.3 if regime != "groups" else 100.3
    volume = (1e-5 / 8) ** 2 * 1e-6 * AVOGADRO
    chem = make(
        box,
        [Species("M", KAPPA, molecules=True)],
        boundaries=[Reservoir("source", {"M": held / volume})],
        regime=regime,
    )
    source = chem.particles.select("source")
    k = rate_matrix(chem)
    steps, tau = 3, 0.4 / k.sum(axis=1).max()
    k[source] = 0.0  # nothing happens to molecules that have entered
    full = rate_matrix(chem)
    inner = generator(k)[np.ix_(~source, ~source)]
    stream = held * full[np.ix_(source, ~source)].sum(axis=0)
    size = len(inner)
    matrix = np.zeros((size + 1, size + 1))
    matrix[:size, :size] = inner
    matrix[size, :size] = stream
    expected = expm(steps * tau * matrix)[size, :size]
    got = np.empty((150, size))
    for r in range(len(got)):
        chem.set_count("M", 0)
        before = chem.totals()["M"]
        for s in range(steps):
            chem.step(steps * r + s, tau)
        count = chem.particles.host("count")[:, 0]
        assert set(count[source]) <= {int(held), int(held) + 1}
        after = chem.totals()["M"]
        assert after[0] - after[1] == -before[1]
        got[r] = count[~source]
    assert_poisson(got, expected)


def test_reservoirs_hold_a_fraction_of_a_molecule(lattice):
    """0.3 molecules: 1 in 30 % of steps and particles, and Poisson numbers of that mean outside.

    The thresholds are missed by a correct program with a probability below 1e-6 in all.
    """
    box = lattice(side=8, groups=(FLUID, SOURCE), group_of=in_source)
    volume = (1e-5 / 8) ** 2 * 1e-6 * AVOGADRO
    held = {"M": 0.3, "N": 1.7}
    chem = make(
        box,
        [Species(name, KAPPA, molecules=True) for name in held],
        boundaries=[Reservoir("source", {k: v / volume for k, v in held.items()})],
    )
    source = chem.particles.select("source")
    for name, number in held.items():
        chem.set_concentration(name, number / volume)
    # the numbers outside are correlated for about seven steps
    tau = 2.5 / rate_matrix(chem).sum(axis=1).max()
    steps = 4000
    inside, kept = np.empty((steps, 2)), np.empty((steps, source.sum(), 2))
    for step in range(steps + 50):
        chem.step(step, tau)
        if step >= 50:
            count = chem.particles.host("count")
            kept[step - 50], inside[step - 50] = count[source], count[~source].sum(axis=0)
    cells = (~source).sum()
    for s, number in enumerate(held.values()):
        f = number % 1
        assert set(np.unique(kept[:, :, s])) == {np.floor(number), np.floor(number) + 1}
        mean = kept[:, :, s].mean(axis=0)  # of each particle: the numbers are drawn anew
        assert np.abs(mean - number).max() < 5.8 * np.sqrt(f * (1 - f) / steps)
        whole = kept[:, :, s].mean() - number
        assert abs(whole) < 5.2 * np.sqrt(f * (1 - f) / kept[:, :, s].size)
        # rows of 50 steps are nearly independent: the error of the mean from their spread
        rows = inside[:, s].reshape(-1, 50).mean(axis=1)
        error = rows.std(ddof=1) / np.sqrt(len(rows))
        assert abs(rows.mean() - number * cells) < 6.5 * error  # Student's t, 79 degrees
        assert error < 0.02 * number * cells


def test_linear_profile_between_walls_is_steady(wall_lattice):
    """Both walls' values are extrapolated exactly, so a linear profile does not change."""
    boundaries = [FixedValueWall("left", {"A": 1.0}), FixedValueWall("right", {"A": 3.0})]
    chem = make(wall_lattice(), [Species("A", KAPPA)], boundaries=boundaries)

    def line(x):
        return 1.0 + 2.0 * (x[:, 0] / 1e-5 - 6 / 16) / (10 / 16)

    chem.set_concentration("A", line)
    fluid = chem.particles.select("fluid")
    for step in range(50):
        chem.step(step, 0.4 * chem.limits()["diffusion of concentrations"])
    expected = line(chem.particles.host("x"))
    np.testing.assert_allclose(chem.concentration("A")[fluid], expected[fluid], rtol=1e-12)
    assert (chem.particles.host("amount")[~fluid] == 0).all()


def test_molecules_at_walls_follow_the_concentrations(wall_lattice):
    """From empty: independent Poisson numbers around the mean of the concentrations' equation."""
    scale = 1e-3
    boundaries = [
        FixedValueWall("left", {"A": 1.0, "M": scale}),
        FixedValueWall("right", {"A": 0.0, "M": 0.0}),
    ]
    species = [Species("A", KAPPA), Species("M", KAPPA, molecules=True)]
    box = wall_lattice()
    chem = make(
        box, species, boundaries=[boundaries[0], FixedValueWall("right", {"A": 0.0, "M": 0})]
    )
    fluid = chem.particles.select("fluid")
    limit = chem.limits()["diffusion of concentrations"]
    parts, tau = 200, 0.5 * limit
    for step in range(parts):
        chem.step(step, tau / parts)
    # Richardson's extrapolation of two Euler solutions
    fine = chem.concentration("A")[fluid]
    chem.set_concentration("A", 0.0)
    for step in range(parts // 2):
        chem.step(step, 2 * tau / parts)
    mean = 2 * fine - chem.concentration("A")[fluid]
    volume = (box.length / box.side) ** 2 * box.depth
    expected = mean * scale * volume * AVOGADRO
    got = np.empty((150, fluid.sum()))
    for r in range(len(got)):
        chem.set_count("M", 0)
        zero = chem.totals()["M"]
        for s in range(2):
            chem.step(1000 + 2 * r + s, tau / 2)
        after = chem.totals()["M"]
        assert after[0] - after[1] == -zero[1]
        got[r] = chem.particles.host("count")[fluid, 0]
    near = expected > 0.02
    assert near.sum() > 60
    assert_poisson(got[:, near], expected[near])


def test_everything_is_conserved(lattice):
    species = [
        Species("A", KAPPA),
        Species("B", {"fluid": KAPPA, "source": 0.3 * KAPPA}),
        Species("C", 2 * KAPPA, only_in="source"),
        Species("M", KAPPA, molecules=True),
        Species("N", {"fluid": KAPPA, "source": 0.3 * KAPPA}, molecules=True),
    ]
    box = lattice(side=10, disturb=0.2, groups=(FLUID, SOURCE), group_of=in_source)
    reactions = [
        Reaction("A <-> B", forward=20.0, backward=30.0),
        Reaction("M <-> N", forward=20.0, backward=30.0),
    ]
    chem = make(box, species, reactions, normalise=True)
    for name in "ABC":
        chem.set_concentration(name, lambda x: 1 + np.sin(x[:, 0] * 7e5))
    chem.set_concentration("M", 2e-4)
    chem.set_concentration("N", 1e-6, "fluid")
    before = chem.totals()
    outside = ~chem.particles.select("source")
    tau = 0.5 * min(chem.limits().values())
    for step in range(20):
        chem.step(step, tau)
    after = chem.totals()
    pair = before["A"][0] + before["B"][0]
    assert after["A"][0] + after["B"][0] == pytest.approx(pair, rel=1e-12)
    assert after["C"][0] == pytest.approx(before["C"][0], rel=1e-12)
    assert after["M"][0] + after["N"][0] == before["M"][0] + before["N"][0]
    assert (chem.concentration("C")[outside] == 0).all()
    assert chem.jumps > 0
    assert chem.events > 0
    assert chem.concentration("A").std() < 0.7


def test_reservoir_of_concentrations_is_booked(lattice):
    box = lattice(side=8, groups=(FLUID, SOURCE), group_of=in_source)
    chem = make(box, [Species("A", KAPPA)], boundaries=[Reservoir("source", {"A": 2.0})])
    for step in range(400):
        chem.step(step, 0.5 * chem.limits()["diffusion of concentrations"])
    total, booked = chem.totals()["A"]
    assert total == pytest.approx(booked, rel=1e-12)
    np.testing.assert_allclose(chem.concentration("A"), 2.0, rtol=1e-3)


def test_sponge(lattice):
    species = [Species("A", KAPPA), Species("M", molecules=True)]
    chem = make(lattice(side=40), species)
    chem.set_concentration("A", 1.0)
    chem.set_count("M", 3)
    chem.particles.set("count", np.full((1600, 1), 3))
    volume = (1e-5 / 40) ** 2 * 1e-6 * AVOGADRO
    fraction, target = np.full(1600, 0.25), np.full(1600, 5.0)
    chem.relax("A", fraction, target, 0)
    np.testing.assert_allclose(chem.concentration("A"), 2.0, rtol=1e-12)
    chem.relax("M", fraction, np.full(1600, 5.0 / volume), 0)
    count = chem.particles.host("count")[:, 0]
    assert set(count) == {3, 4}  # 3.5 on average
    assert abs(count.mean() - 3.5) < 5.5 * 0.5 / 40  # false-alarm rate 4e-8
    for name, before in (("A", 1e-10), ("M", 4800)):
        total, booked = chem.totals()[name]
        assert total - booked == pytest.approx(before, rel=1e-12)


def test_sponges_have_random_numbers_of_their_own(lattice):
    """Two that overlap add to the same particles, each with probability 1/2: one in all to half."""
    chem = make(lattice(side=40), [Species("M", molecules=True)])
    volume = (1e-5 / 40) ** 2 * 1e-6 * AVOGADRO
    fraction, target = np.full(1600, 0.5e-9), np.full(1600, 1e9 / volume)
    for which in range(2):
        chem.relax("M", fraction, target, 0, which)
    once = (chem.particles.host("count")[:, 0] == 1).mean()
    assert abs(once - 0.5) < 5.5 * 0.5 / 40  # false-alarm rate 4e-8


def test_initial_molecules_are_rounded_without_bias(lattice):
    chem = make(lattice(side=40), [Species("M", molecules=True)])
    volume = (1e-5 / 40) ** 2 * 1e-6 * AVOGADRO
    chem.set_concentration("M", 7.3 / volume)
    count = chem.particles.host("count")[:, 0]
    assert set(count) == {7, 8}
    assert abs(count.mean() - 7.3) < 5.5 * np.sqrt(0.21 / 1600)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_results_do_not_depend_on_threads(lattice):
    species = [Species(n, KAPPA, molecules=n in "MN") for n in "ABMN"]
    reactions = [
        Reaction("A + B <-> 0", forward=20.0, backward=30.0),
        Reaction("M + N <-> 0", forward=1e5, backward=1e-3),
    ]
    box = lattice(side=10, disturb=0.2, groups=(FLUID, SOURCE), group_of=in_source)
    results = []
    for threads in (1, 2):
        set_threads(threads)
        held = [Reservoir("source", {"A": 2.0, "M": 3e-3})]
        chem = make(box, species, reactions, held, normalise=True)
        chem.set_concentration("B", lambda x: 1 + np.sin(x[:, 0] * 7e5))
        chem.set_concentration("N", 2e-4)
        for step in range(5):
            chem.step(step, 0.3 * chem.limits()["diffusion of concentrations"])
        fields = ("amount", "count", "amount_booked", "count_booked")
        state = b"".join(chem.particles.host(f).tobytes() for f in fields)
        results.append((state, chem.jumps, chem.events, chem.substeps))
    assert results[0] == results[1]
    assert results[0][1] > 0
    assert results[0][2] > 0


@pytest.mark.parametrize("normalise", [False, True])
def test_particles_at_rest_need_their_weights_once(lattice, normalise):
    box = lattice(side=10, disturb=0.2, groups=(FLUID, SOURCE), group_of=in_source)
    held = [Reservoir("source", {"A": 2.0, "M": 3e-3})]
    found = []
    for at_rest in (False, True):
        species = [Species("A", KAPPA), Species("M", KAPPA, molecules=True)]
        chem = box.chemistry(species, [], held, normalise=normalise, at_rest=at_rest)
        for step in range(5):
            chem.step(step, 0.3 * chem.limits()["diffusion of concentrations"])
        found.append((chem.concentration("A"), chem.particles.host("count")))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12)
    assert np.array_equal(found[0][1], found[1][1])
    assert found[0][1].sum() > 0


@pytest.mark.parametrize("normalise", [False, True])
@pytest.mark.parametrize("molecules", [False, True])
def test_the_particle_that_spoils_the_exchange_is_named(lattice, molecules, normalise):
    """Not a neighbour whose rate it spoils, and not particle 0 for another species' weights."""
    groups = (Group("fluid", "fluid", 0), Group("film", "fluid", 0))
    for field, value, named in (("density", np.nan, "density"), ("density", 0.0, "volume")):
        film = lattice(side=12, groups=groups, group_of=lambda x: x[:, 0] > 9e-6)
        species = [
            Species("A", 1e-10, molecules=molecules, only_in="fluid"),
            Species("B", 1e-12, molecules=molecules, only_in="film"),
        ]
        chem = film.chemistry(species, normalise=normalise)
        values = chem.particles.host(field)
        row = int(np.flatnonzero(chem.particles.host("id") == 50)[0])
        values[row] = value
        chem.particles.set(field, values)
        with pytest.raises(RunError, match=f"not finite: field '{named}' of particle 50 "):
            chem.step(0, 1e-6)
