"""Species that are molecules or amounts, by their number."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import Reservoir
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.kernels import WENDLAND_C2, normalisation, shape_f
from particell.materials import AVOGADRO
from particell.particles import Group

KAPPA = 1e-10
# false-alarm rate of each comparison with a mean: 5.5 sigma, 4e-8
SIGMAS = 5.5


def switching(kappa=KAPPA, above=100, below=50, name="S"):
    return Species(name, kappa, molecules=True, switch_above=above, switch_below=below)


def worth(chem):
    """Molecules in each particle, remainders included."""
    p = chem.particles
    return p.host("count")[:, 0] + p.host("amount")[:, 0] * chem.depth * AVOGADRO


def volume_of(chem):
    p = chem.particles
    return p.host("mass") / p.host("density") * chem.depth * AVOGADRO


def jump_rates(chem, length):
    p = chem.particles
    x, h = p.host("x"), p.host("support")[0]
    d = x[:, None] - x[None]
    d -= length * np.rint(d / length)
    q = np.sqrt((d**2).sum(-1)) / h
    f = normalisation(WENDLAND_C2, 2) / h**4 * np.vectorize(shape_f)(q, WENDLAND_C2)
    k = 2 * KAPPA * (p.host("mass") / p.host("density"))[None, :] * f
    np.fill_diagonal(k, 0.0)
    return k


@pytest.mark.parametrize("cost", [0.0, np.inf])
def test_mean_of_a_step_across_the_front(lattice, cost):
    """Amounts on the left, molecules on the right: the mean is (1 + τ K_aa) exp(τ K_m)."""
    box = lattice(disturb=0.2)
    chem = box.chemistry([switching()], seed=2)
    chem.binomial_cost = cost
    k = jump_rates(chem, box.length)
    left = chem.particles.host("x")[:, 0] < 5e-6
    start = np.where(left, 180.6, 12.0) / volume_of(chem)
    tau = 0.6 / k.sum(axis=1).max()
    repeats = 500
    got = np.empty((repeats, len(k)))
    for r in range(repeats):
        chem.set_concentration("S", start)
        begin = worth(chem)
        amounts = chem.particles.host("continuous")[:, 0] == 1
        assert (amounts == left).all()
        chem.step(r, tau)
        assert worth(chem).sum() == pytest.approx(begin.sum(), rel=1e-13)
        got[r] = worth(chem)
    both = left[:, None] & left[None, :]
    within, jumps = np.where(both, k, 0.0), np.where(both, 0.0, k)
    walked = begin @ expm(tau * (jumps - np.diag(jumps.sum(axis=1))))
    expected = walked + tau * (walked @ within - walked * within.sum(axis=1))
    deviation = (got.mean(0) - expected) / (got.std(0) / np.sqrt(repeats) + 1e-9)
    # 36 means: 6 sigma, false-alarm rate 7e-8
    assert np.abs(deviation).max() < 6.0


def test_conversion_is_unbiased_and_conserves(lattice):
    chem = lattice(side=40).chemistry([switching(kappa=0.0)])
    volume = volume_of(chem)
    chem.set_concentration("S", 120.3 / volume)
    assert (chem.particles.host("continuous") == 1).all()
    np.testing.assert_allclose(chem.concentration("S") * volume, 120.3, rtol=1e-12)
    # 30.3 molecules' worth are fewer than switch_below
    chem.particles.set("amount", 30.3 / 120.3 * chem.particles.host("amount"))
    chem.step(0, 1.0)
    count = chem.particles.host("count")[:, 0]
    assert (chem.particles.host("continuous") == 0).all()
    assert set(count) == {30, 31}
    assert abs(count.mean() - 30.3) < SIGMAS * np.sqrt(0.21 / 1600)
    np.testing.assert_allclose(worth(chem), 30.3, rtol=1e-12)
    # and back: the remainder comes along
    chem.particles.set("count", chem.particles.host("count") + 90)
    chem.step(1, 1.0)
    assert (chem.particles.host("count") == 0).all()
    np.testing.assert_allclose(chem.concentration("S") * volume, 120.3, rtol=1e-12)


def test_decay_through_the_threshold(lattice):
    chem = lattice(side=60).chemistry([switching(kappa=0.0)], [Reaction("S -> 0", forward=1.0)])
    chem.set_concentration("S", 160.0 / volume_of(chem))
    for step in range(24):
        chem.step(step, 0.1)
    expected = 160.0 * np.exp(-2.4)
    got = chem.particles.host("count")[:, 0]
    assert (chem.particles.host("continuous") == 0).all()
    # no noise above the lower threshold: the variance is less than that of molecules throughout
    assert abs(got.mean() - expected) < SIGMAS * np.sqrt(expected / len(got))
    assert chem.events > 0


def test_reacting_spreading_pulse_conserves(lattice):
    """Particles change kind both ways, bind concentrations and molecules, and nothing is lost."""
    species = [
        switching(),
        switching(kappa=0.5 * KAPPA, name="T"),
        Species("A", KAPPA),
        Species("M", KAPPA, molecules=True),
    ]
    reactions = [
        Reaction("S <-> T", forward=60.0, backward=40.0),
        Reaction("S + A <-> T", forward=100.0, backward=3.0),
        Reaction("S + M <-> T", forward=100.0, backward=3.0),
    ]
    chem = lattice(side=10, disturb=0.2).chemistry(species, reactions, seed=4)
    volume = volume_of(chem)

    def pulse(x):
        r2 = ((x - 5e-6) ** 2).sum(axis=1)
        return 1500 * np.exp(-r2 / 2e-12) / volume.mean()

    chem.set_concentration("S", pulse)
    chem.set_concentration("A", 30.0 / volume)
    chem.set_concentration("M", 5.0 / volume)
    totals = chem.totals()

    def conserved(t):
        # A and M are bound in T: A is not conserved apart, as T comes from S alone too
        scale = chem.depth * AVOGADRO
        return t["S"][0] + t["T"][0], t["A"][0] * scale, t["M"][0]

    start = conserved(totals)[0]
    kinds = [chem.particles.host("continuous").copy()]
    for step in range(60):
        chem.step(step, 0.5 * chem.limits()["diffusion of molecules"])
        kinds.append(chem.particles.host("continuous").copy())
        assert (chem.particles.host("count") >= 0).all()
        assert (chem.concentration("A") >= 0).all()
        assert (chem.concentration("S") >= 0).all()
    assert conserved(chem.totals())[0] == pytest.approx(start, rel=1e-12)
    change = np.diff(np.array(kinds, dtype=int), axis=0)
    assert (change > 0).any()
    assert (change < 0).any()


@pytest.mark.parametrize(
    "options",
    [
        {"switch_above": 10.0},
        {"switch_above": 10.0, "switch_below": 10.0},
        {"switch_above": 10.0, "switch_below": 0.5},
        {"switch_above": 10.0, "switch_below": 5.0, "molecules": False},
    ],
)
def test_thresholds_are_checked(options):
    with pytest.raises(InputError):
        Species("S", **{"molecules": True, **options})


def test_restart_is_bit_for_bit():
    """With everything that chemistry can do: the state of a simulation holds all of it."""
    import particell as pc

    def simulation():
        domain = pc.Domain((0, 0), (8e-6, 8e-6), periodic="y", depth=1e-6)
        water = pc.Fluid(density=1000, viscosity=1e-3)
        walls = pc.channel_walls(domain, water, 1e-6, axis=0)
        names = [w.name for w in walls]
        made = pc.Simulation(
            domain,
            [pc.fluid(domain, water, 1e-6), *walls],
            pc.Static(support=2.5),
            [switching(), Species("M", KAPPA, molecules=True), Species("A", KAPPA)],
            [Reaction("S + A <-> M", forward=3.0, backward=2.0)],
            [pc.FluxWall(names[0], flux={"S": 2e-5, "A": 1e-5}, transfer={"M": (1e-5, 1e-4)})],
            seed=8,
            splitting="strang",
        )
        scale = 1 / (1e-18 * AVOGADRO)
        made.chemistry.set_concentration("S", lambda x: (30 + 120 * (x[:, 0] < 4e-6)) * scale)
        made.chemistry.set_concentration("A", 40 * scale)
        made.chemistry.set_concentration("M", 20 * scale)
        return made

    first = simulation()
    first.advance(6)
    state = first.state()
    first.advance(6)
    second = simulation()
    second.restore(state)
    second.advance(6)
    for field in first.particles:
        np.testing.assert_array_equal(first.particles.host(field), second.particles.host(field))
    assert first.chemistry.events == second.chemistry.events > 0
    kinds = first.particles.host("continuous")
    assert kinds.any()
    assert abs(first.conservation()["amount S + M"]) < 1e-12


def test_reservoir_above_the_threshold_feeds_as_an_amount_would(lattice):
    """A reservoir worth 500 molecules stays molecules; neighbours turn into amounts."""
    source = 500 / ((1e-5 / 12) ** 2 * 1e-6 * AVOGADRO)
    groups = (Group("fluid", "fluid", 0), Group("source", "fluid", 0))
    box = lattice(side=12, groups=groups, group_of=lambda x: x[:, 0] < 2.5e-6)
    species = [switching(), Species("A", KAPPA)]
    chem = box.chemistry(species, [], [Reservoir("source", {"S": source, "A": source})])
    for step in range(60):
        chem.step(step, 0.5 * chem.limits()["diffusion of concentrations"])
    fluid = chem.particles.host("group") == 0
    volume = volume_of(chem)[fluid]
    switched = (chem.concentration("S")[fluid] * volume).sum()
    amount = (chem.concentration("A")[fluid] * volume).sum()
    assert chem.particles.host("continuous")[fluid].any()
    assert amount > 10_000
    # what comes in is less scattered than a Poisson number
    assert abs(switched - amount) < SIGMAS * np.sqrt(amount)
    total, booked = chem.totals()["S"]
    assert total - booked == pytest.approx(0.0, abs=1e-9 * total)
