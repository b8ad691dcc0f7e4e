"""Reactions between molecules and concentrations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from particell.chemistry.invariants import conserved_totals
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.materials import AVOGADRO

VOLUME = (1e-5 / 100) ** 2 * 1e-6  # of each of 10⁴ particles, in m³
# false-alarm rate of each comparison with a mean: 5.5 sigma, 4e-8
SIGMAS = 5.5


def mixture(lattice, reactions, molecules, worth, names="MPA", side=100, **options):
    """Molecules M and P, and an amount A worth ``worth`` molecules in each particle."""
    species = [Species(n, molecules=n != "A") for n in names]
    chem = lattice(side=side).chemistry(species, reactions, **options)
    chem.set_count("M", molecules)
    volume = (1e-5 / side) ** 2 * 1e-6
    chem.set_concentration("A", worth / (volume * AVOGADRO))
    return chem


def worth_of(chem):
    return chem.particles.host("amount")[:, 0] * chem.depth * AVOGADRO


def test_catalyst_makes_a_binomial(lattice):
    """A is not used up: molecules decay independently, at the rate k C_A."""
    k, tau, worth = 2.0, 0.4, 3.7
    catalysed = Reaction("M + A -> A", forward=k * VOLUME * AVOGADRO / worth)
    chem = mixture(lattice, [catalysed], 12, worth, names="MA")
    chem.step(0, tau)
    got = np.bincount(chem.count("M"), minlength=13)
    expected = 10_000 * stats.binom(12, np.exp(-k * tau)).pmf(np.arange(13))
    few = expected < 10
    got, expected = (
        np.append(got[~few], got[few].sum()),
        np.append(expected[~few], expected[few].sum()),
    )
    assert stats.chisquare(got, expected).pvalue > 1e-7
    np.testing.assert_array_equal(worth_of(chem), worth_of(chem)[0])


def test_consumption_against_the_master_equation(lattice):
    """M + A -> P: each event takes one molecule's worth of A, so the number of M is a death
    process whose law is a matrix exponential."""
    k, tau, start, worth = 0.02, 0.8, 30, 41.6
    chem = mixture(lattice, [Reaction("M + A -> P", forward=k * VOLUME * AVOGADRO)], start, worth)
    before = conserved_totals(chem)
    for step in range(2):
        chem.step(step, tau / 2)
    n = np.arange(start + 1)
    rate = k * n * (worth - start + n)
    generator = np.diag(-rate) + np.diag(rate[1:], -1)
    law = expm(tau * generator)[start]
    mean = (law * n).sum()
    variance = (law * n**2).sum() - mean**2
    got = chem.count("M")
    assert abs(got.mean() - mean) < SIGMAS * np.sqrt(variance / len(got))
    centred = (got - mean) ** 2
    assert abs(centred.mean() - variance) < SIGMAS * centred.std() / np.sqrt(len(got))
    np.testing.assert_allclose(worth_of(chem), worth - (start - got), rtol=1e-13)
    after = conserved_totals(chem)
    assert len(after) == 2
    for name, (value, size) in after.items():
        assert value == pytest.approx(before[name][0], abs=1e-13 * size)


def test_mean_is_deterministic_for_many(lattice):
    """1/X corrections vanish: the mean of 10⁴ particles follows dM/dt = -k M A."""
    k, tau, start, worth = 1e-4, 1.0, 5000, 8000.5
    reaction = Reaction("M + A -> P", forward=k * (1e-5 / 20) ** 2 * 1e-6 * AVOGADRO)
    chem = mixture(lattice, [reaction], start, worth, side=20)
    chem.step(0, tau)
    excess = worth - start
    ratio = start / worth * np.exp(-k * excess * tau)
    expected = excess * ratio / (1 - ratio)
    assert chem.count("M").mean() == pytest.approx(expected, rel=2e-3)


def test_less_than_one_molecule_is_left_alone(lattice):
    reactions = [Reaction("M + 2 A -> P", forward=1e9), Reaction("A -> P", forward=1e4)]
    chem = mixture(lattice, reactions, 50, 8.25, side=20)
    for step in range(3):
        chem.step(step, 1.0)
    np.testing.assert_allclose(worth_of(chem), 0.25, rtol=1e-10)
    assert (worth_of(chem) >= 0).all()
    total = chem.count("M") + chem.count("P")
    assert (total >= 50).all()


def test_way_back_makes_an_amount(lattice):
    pair = Reaction("A <-> M", forward=3.0, backward=3.0)
    chem = mixture(lattice, [pair], 40, 0.0, names="MA")
    chem.step(0, 4.0)
    np.testing.assert_allclose(worth_of(chem) + chem.count("M"), 40, rtol=1e-12)
    got = chem.count("M")
    assert abs(got.mean() - 20) < SIGMAS * np.sqrt(10 / len(got))


def test_units_of_molecules(lattice):
    """The same random numbers and the same propensities: the same molecules."""
    found = []
    for scale, units in ((1.0, "molecules"), (VOLUME * AVOGADRO, "concentration")):
        reaction = Reaction("M + A -> P", forward=0.02 * scale, units=units)
        chem = mixture(lattice, [reaction], 30, 41.6)
        chem.step(0, 0.5)
        found.append(chem.count("M"))
    np.testing.assert_array_equal(*found)


def test_refusals(lattice):
    both = [Species("A"), Species("M", molecules=True)]
    with pytest.raises(InputError, match="mass action"):
        lattice().chemistry(both, [Reaction("A + M -> A", propensity=lambda N, V, k: k)])
    with pytest.raises(InputError, match="not a rate_law"):
        lattice().chemistry(both, [Reaction("A + M -> A", rate_law=lambda C, k: k)])
