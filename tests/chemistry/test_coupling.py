"""Molecules that react with concentrations which move: exact between and at events."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from particell.chemistry.engine import MOST_PARTS, PART_OF_LIMIT
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import Reservoir
from particell.chemistry.species import Species
from particell.compute.threads import set_threads
from particell.errors import InputError
from particell.materials import AVOGADRO
from particell.particles import Group

# false-alarm rate of each comparison: 5.5 sigma, 4e-8
SIGMAS = 5.5
LEVEL = 4e-8
WORTH = 1 / ((1e-5 / 100) ** 2 * 1e-6 * AVOGADRO)  # one molecule in mol/m³, of 10⁴ particles


def mixture(lattice, amounts, molecules, reactions, **options):
    species = [Species(name) for name in amounts]
    species += [Species(name, molecules=True) for name in molecules]
    chem = lattice(side=100).chemistry(species, reactions, seed=6, **options)
    for name, worth in amounts.items():
        chem.set_concentration(name, worth * WORTH)
    for name, number in molecules.items():
        chem.set_count(name, number)
    return chem


def worth_of(chem, column=0):
    return chem.particles.host("amount")[:, column] * chem.depth * AVOGADRO


def check_mean_and_variance(got, mean, variance):
    n = len(got)
    assert abs(got.mean() - mean) < SIGMAS * np.sqrt(variance / n)
    centred = (got - mean) ** 2
    assert abs(centred.mean() - variance) < SIGMAS * centred.std() / np.sqrt(n)


@pytest.mark.parametrize("steps", [1, 7, 40])
def test_survival_beside_what_decays_is_the_same_for_every_step(lattice, steps):
    """The hazard is 20 exp(-10 t): what is left is exp(-2 (1 - exp(-10 t))), nothing else."""
    worth = 5.0
    reactions = [
        Reaction("C -> 0", 10.0),
        Reaction("M + C -> N + C", 20.0 / (worth * WORTH)),
    ]
    chem = mixture(lattice, {"C": worth}, {"M": 10, "N": 0}, reactions)
    for step in range(steps):
        chem.step(step, 2.0 / steps)
    left = np.exp(-2.0 * (1.0 - np.exp(-20.0)))
    check_mean_and_variance(chem.count("M"), 10 * left, 10 * left * (1 - left))
    np.testing.assert_allclose(worth_of(chem), worth * np.exp(-20.0), atol=1e-8 * worth)


def test_births_driven_by_an_oscillation_are_poisson(lattice):
    """The rate of births is an amount that goes round a ring of five: immigration and death from
    nothing is Poisson, with the mean of the linear equations."""
    ring, turn, birth, death, until = "ABCDE", 8.0, 1.5, 1.3, 1.1
    reactions = [
        Reaction(f"{one} -> {other}", turn)
        for one, other in zip(ring, ring[1:] + ring[0], strict=True)
    ]
    reactions += [Reaction("A -> A + M", birth), Reaction("M -> 0", death)]
    amounts = {"A": 9.5, "B": 0.0, "C": 0.0, "D": 0.0, "E": 0.0}
    chem = mixture(lattice, amounts, {"M": 0}, reactions)
    for step in range(3):
        chem.step(step, until / 3)
    law = np.diag([-turn] * 5 + [-death])
    for one in range(5):
        law[(one + 1) % 5, one] = turn
    law[5, 0] = birth
    *expected, mean = expm(until * law) @ [9.5, 0, 0, 0, 0, 0]
    np.testing.assert_allclose([worth_of(chem, s)[0] for s in range(5)], expected, rtol=5e-6)
    got = np.bincount(chem.count("M"), minlength=30)
    expected = 10_000 * stats.poisson(mean).pmf(np.arange(len(got)))
    many = expected > 10
    got, expected = np.append(got[many], got[~many].sum()), np.append(expected[many], 0.0)
    expected[-1] = 10_000 - expected.sum()
    assert stats.chisquare(got, expected).pvalue > LEVEL


def test_amounts_feel_events(lattice):
    """C turns into D at once (an amount) and into M one by one: moments of the linear process."""
    k, d, start, until = 1.0, 2.0, 150.5, 0.6
    reactions = [Reaction("C -> D", d), Reaction("C -> M", k)]
    chem = mixture(lattice, {"C": start, "D": 0.0}, {"M": 0}, reactions)
    chem.step(0, until)
    # means of C and M, then Var C, Cov(C, M), Var M
    law = np.zeros((5, 5))
    law[0, 0], law[1, 0] = -(k + d), k
    law[2, 0], law[2, 2] = k, -2 * (k + d)
    law[3, 0], law[3, 2], law[3, 3] = -k, k, -(k + d)
    law[4, 0], law[4, 3] = k, 2 * k
    c, m, variance_c, covariance, variance = expm(until * law) @ [start, 0, 0, 0, 0]
    got = chem.count("M")
    check_mean_and_variance(got, m, variance)
    check_mean_and_variance(worth_of(chem), c, variance_c)
    products = (got - m) * (worth_of(chem) - c)
    assert abs(products.mean() - covariance) < SIGMAS * products.std() / 100
    total = worth_of(chem) + worth_of(chem, 1) + got
    np.testing.assert_allclose(total, start, rtol=1e-13)
    assert chem.events == got.sum()


def test_event_waits_for_a_whole_molecule(lattice):
    """What is made at a constant rate is taken as soon as it is worth one molecule."""
    reactions = [Reaction("0 -> C", WORTH), Reaction("M + C -> N", 1e12)]
    chem = mixture(lattice, {"C": 0.25}, {"M": 8, "N": 0}, reactions)
    for step, (worth, made) in enumerate([(0.95, 0), (0.65, 1), (0.35, 2), (0.05, 3)]):
        chem.step(step, 0.7)
        assert (chem.count("N") == made).all()
        np.testing.assert_allclose(worth_of(chem), worth, atol=1e-5)
    chem.step(9, 100.0)  # until there is no M
    assert (chem.count("N") == 8).all()
    np.testing.assert_allclose(worth_of(chem), 0.25 + 102.8 - 8, rtol=1e-6)


def test_stiff_partner_costs_no_sub_steps(lattice):
    """C and D change into each other 10⁶ times a second; molecules see the equilibrium."""
    worth, k, until = 3.0, 2.0, 0.5
    reactions = [
        Reaction("C <-> D", 2e6, 1e6),
        Reaction("M + C -> N + C", k / (worth * WORTH)),
    ]
    chem = mixture(lattice, {"C": 3 * worth, "D": 0.0}, {"M": 6, "N": 0}, reactions)
    chem.step(0, until)
    left = np.exp(-k * until)
    check_mean_and_variance(chem.count("M"), 6 * left, 6 * left * (1 - left))
    np.testing.assert_allclose(worth_of(chem), worth, rtol=2e-6)
    assert chem.substeps < 1000


@pytest.mark.parametrize(("dim", "mobile"), [(1, "M"), (1, "C"), (3, "MC")])
def test_step_does_not_show_where_both_diffuse(lattice, dim, mobile):
    """A source of C beside one of M: the largest step against one of a thirtieth, to 1 %.

    Worst where the reaction is as fast as jumps are, and where one of the two stands still.
    """
    kappa = 1e-10
    amounts = {"C": kappa * ("C" in mobile)}
    molecules = dict.fromkeys("MN", kappa * ("M" in mobile))
    species = [Species(n, k) for n, k in amounts.items()]
    species += [Species(n, k, molecules=True) for n, k in molecules.items()]
    side = 16 if dim == 1 else 6
    number, left = 1_000_000, {}
    for parts in (1, 30):
        box = lattice(side=side, dim=dim, length=1.6e-5)
        dx = box.length / side
        fast = 0.25 / (0.05 * (box.support * dx) ** 2 / kappa)
        reactions = [Reaction("M + C -> N + C", fast * 10.0)]
        chem = box.chemistry(species, reactions, seed=parts, normalise=True)
        assert chem.splitting == "strang"
        chem.set_concentration("C", lambda x, dx=dx: (x[:, 0] < dx) * 1.0)
        at = chem.particles.host("x")[:, 0]
        chem.set_count("M", np.where((at > dx) & (at < 2 * dx), number // side ** (dim - 1), 0))
        largest = min(chem.limits().values())
        for step in range(4 * parts):
            chem.step(step, largest / parts)
        left[parts] = chem.count("M").sum() / number
    reacted = 1 - left[30]
    assert 0.05 < reacted < 0.95
    noise = SIGMAS * np.sqrt(2 * reacted * left[30] / number)
    assert abs(left[1] - left[30]) < 0.01 * reacted + noise


def test_same_bits_for_any_number_of_threads(lattice):
    reactions = [Reaction("C -> D", 1.0), Reaction("M + C <-> N", 0.01 / WORTH, 3.0)]
    found = []
    for threads in (1, min(3, numba.config.NUMBA_NUM_THREADS)):
        set_threads(threads)
        chem = mixture(lattice, {"C": 30.0, "D": 0.0}, {"M": 20, "N": 0}, reactions)
        chem.step(3, 0.7)
        found.append((chem.count("M"), worth_of(chem), chem.pace, chem.events))
    set_threads(1)
    for first, other in zip(*found, strict=True):
        np.testing.assert_array_equal(first, other)


def test_steps_that_would_be_divided_too_often_are_refused(lattice):
    species = [Species("C", 1e-10), Species("M", 1e-10, molecules=True)]
    chem = lattice().chemistry(species, [Reaction("M + C -> C", 1.0)])
    limit = min(chem.limits().values())
    chem.set_concentration("C", 1e3 / limit)
    with pytest.raises(InputError, match="at most"):
        chem.step(0, 1e4 * limit)


@pytest.mark.parametrize("held", [False, True])
def test_first_step_is_divided_by_the_rates_that_there_are(lattice, held):
    """As the second one is: by what is there, or what a reservoir will bring in the step."""
    groups = (Group("fluid", "fluid", 0), Group("bath", "fluid", 0))
    half = lattice(side=8, groups=groups, group_of=lambda x: x[:, 0] < 5e-6)
    species = [Species("C", 1e-10), Species("M", 1e-10, molecules=True)]
    walls = [Reservoir("bath", {"C": 3.0})] if held else []
    found = []
    for pace in (None, 6.0):  # M meets C at 2 · 3 a second
        chem = half.chemistry(species, [Reaction("M + C -> C", 2.0)], walls, seed=3)
        chem.pace = pace or chem.pace
        if not held:
            chem.set_concentration("C", 3.0)
        chem.set_count("M", 5)
        limit = min(chem.limits().values())
        chem.step(0, 100 * limit)  # too much for the shortest parts
        assert MOST_PARTS * PART_OF_LIMIT < 100
        found.append((chem.count("M"), worth_of(chem), chem.events))
    for first, other in zip(*found, strict=True):
        np.testing.assert_array_equal(first, other)


def test_splitting_is_lies_where_nothing_couples_or_nothing_diffuses(lattice):
    both = [Reaction("M + C -> M", 1.0)]
    still = [Species("C"), Species("M", molecules=True)]
    assert lattice().chemistry(still, both).splitting == "lie"
    moving = [Species("C", 1e-10), Species("M", molecules=True)]
    assert lattice().chemistry(moving, [Reaction("C -> 0", 1.0)]).splitting == "lie"
    assert lattice().chemistry(moving, both).splitting == "strang"
    assert lattice().chemistry(moving, both, splitting="lie").splitting == "lie"
