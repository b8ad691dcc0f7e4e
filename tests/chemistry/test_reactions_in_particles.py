"""Deterministic and stochastic reactions in particles that do not exchange anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import solve_ivp

from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.materials import AVOGADRO

DATA = Path(__file__).parents[1] / "data" / "cme_reference.csv"
# false-alarm rate of each comparison with a mean or a variance: 5.5 sigma, 4e-8
SIGMAS = 5.5


def amounts(lattice, names, reactions, start, tau, steps=1):
    chem = lattice(side=6).chemistry([Species(n) for n in names], reactions)
    for name, value in zip(names, start, strict=True):
        chem.set_concentration(name, value)
    for step in range(steps):
        chem.step(step, tau)
    return np.array([chem.concentration(n)[0] for n in names]), chem


def exact(rates, start, tau):
    result = solve_ivp(rates, (0, tau), start, method="Radau", rtol=1e-10, atol=1e-13)
    return result.y[:, -1]


def test_mass_action_of_orders_0_to_3(lattice):
    reactions = [
        Reaction("0 -> A", forward=0.7),
        Reaction("A <-> B", forward=1.3, backward=0.4),
        Reaction("A + B -> C", forward=0.9),
        Reaction("2 C -> A", forward=0.5),
        Reaction("2 A + B -> 3 C", forward=0.3),
    ]

    def rates(t, y):
        a, b, c = y
        r = [0.7, 1.3 * a, 0.4 * b, 0.9 * a * b, 0.5 * c * c, 0.3 * a * a * b]
        return [
            r[0] - r[1] + r[2] - r[3] + r[4] - 2 * r[5],
            r[1] - r[2] - r[3] - r[5],
            r[3] - 2 * r[4] + 3 * r[5],
        ]

    start = [1.0, 0.5, 0.0]
    got, _ = amounts(lattice, "ABC", reactions, start, 2.0)
    np.testing.assert_allclose(got, exact(rates, start, 2.0), rtol=2e-5)


def test_two_a_takes_two_for_each_event(lattice):
    got, _ = amounts(lattice, "A", [Reaction("2 A -> 0", forward=3.0)], [2.0], 0.5)
    assert got[0] == pytest.approx(2 / (1 + 2 * 3 * 2 * 0.5), rel=1e-5)


def test_slow_kinetics_take_one_explicit_step(lattice):
    """A + B -> 0 at k C dt = 0.1; the error of a step is far below its tolerance of 1e-6."""
    k, a, b, tau = 0.1, 1.0, 0.4, 1.0
    growth = np.exp(k * (a - b) * tau)
    left = (a - b) * b / (a * growth - b)
    got, chem = amounts(lattice, "AB", [Reaction("A + B -> 0", forward=k)], [a, b], tau)
    assert chem.substeps == 1
    np.testing.assert_allclose(got, [a - b + left, left], rtol=1e-8)
    _, chem = amounts(lattice, "AB", [Reaction("A + B -> 0", forward=100 * k)], [a, b], tau)
    assert chem.substeps > 1


def test_stiff_kinetics(lattice):
    """Robertson's problem (1966)."""
    reactions = [
        Reaction("A -> B", forward=0.04),
        Reaction("2 B -> B + C", forward=3e7),
        Reaction("B + C -> A + C", forward=1e4),
    ]

    def rates(t, y):
        r = [0.04 * y[0], 3e7 * y[1] ** 2, 1e4 * y[1] * y[2]]
        return [r[2] - r[0], r[0] - r[1] - r[2], r[1]]

    start = [1.0, 0.0, 0.0]
    got, chem = amounts(lattice, "ABC", reactions, start, 40.0)
    np.testing.assert_allclose(got, exact(rates, start, 40.0), rtol=1e-4)
    assert got.sum() == pytest.approx(1.0, rel=1e-12)
    assert 1 < chem.substeps < 2000


def test_fast_decay_never_goes_negative(lattice):
    reactions = [Reaction("A -> B", forward=1e6), Reaction("A + B -> 0", forward=1e5)]
    got, chem = amounts(lattice, "AB", reactions, [1.0, 0.3], 0.1, steps=3)
    assert (chem.particles.host("amount") >= 0).all()
    assert got[0] < 1e-12


def test_user_rate_law(lattice):
    def michaelis_menten(C, k):
        return k * C[0] / (0.5 + C[0])

    law = Reaction("S -> P", forward=2.0, rate_law=michaelis_menten)
    got, _ = amounts(lattice, "SP", [law], [1.0, 0.0], 0.7)
    expected = exact(lambda t, y: [-2 * y[0] / (0.5 + y[0]), 2 * y[0] / (0.5 + y[0])], [1, 0], 0.7)
    np.testing.assert_allclose(got, expected, rtol=2e-5)


def counts(lattice, names, reactions, start, tau, steps=1, seed=1, side=100):
    """One particle is one realisation."""
    species = [Species(n, molecules=True) for n in names]
    chem = lattice(side=side).chemistry(species, reactions, seed=seed)
    for name, value in zip(names, start, strict=True):
        chem.set_count(name, value)
    for step in range(steps):
        chem.step(step, tau / steps)
    return chem.particles.host("count").copy(), chem


def assert_moments(values, mean, variance):
    n = len(values)
    assert abs(values.mean() - mean) < SIGMAS * np.sqrt(variance / n)
    centred = (values - mean) ** 2
    assert abs(centred.mean() - variance) < SIGMAS * centred.std() / np.sqrt(n)


def test_birth_and_death_is_poisson(lattice):
    reactions = [
        Reaction("0 -> A", forward=5.0, units="molecules"),
        Reaction("A -> 0", forward=0.5),
    ]
    values, _ = counts(lattice, "A", reactions, [0], 45.0)
    law = stats.poisson(10)
    observed = np.bincount(np.clip(values[:, 0], 2, 22), minlength=23)[2:]
    k = np.arange(2, 23)
    expected = law.pmf(k)
    expected[0], expected[-1] = law.cdf(2), law.sf(21)
    # false-alarm rate 1e-7
    assert stats.chisquare(observed, len(values) * expected).pvalue > 1e-7


def reference_rows():
    for line in DATA.read_text().splitlines()[2:]:
        name, a, b, c, t, mean, variance = line.split(",")[:7]
        if t in ("1", "5"):
            yield name[:2], int(a), int(b or 0), float(c), float(t), float(mean), float(variance)


@pytest.mark.parametrize(("kind", "a", "b", "c", "t", "mean", "variance"), list(reference_rows()))
def test_annihilation_against_the_master_equation(lattice, kind, a, b, c, t, mean, variance):
    if kind == "A+":
        names, start = "AB", [a, b]
        reaction = Reaction("A + B -> 0", forward=c, units="molecules")
    else:  # the reference counts pairs, c n (n - 1) / 2
        names, start = "A", [a]
        reaction = Reaction("2 A -> 0", forward=c / 2, units="molecules")
    values, chem = counts(lattice, names, [reaction], start, t)
    assert_moments(values[:, 0], mean, variance)
    taken = a * len(values) - values[:, 0].sum()
    assert taken == chem.events * (1 if kind == "A+" else 2)


def test_stationary_dimerisation(lattice):
    reactions = [
        Reaction("0 -> A", forward=5.0, units="molecules"),
        Reaction("2 A -> 0", forward=0.05, units="molecules"),
    ]
    values, _ = counts(lattice, "A", reactions, [7], 15.0)
    assert_moments(values[:, 0], 7.19950536, 5.36662795)


def test_rates_per_molecule_and_per_concentration_agree(lattice):
    """The same stream of random numbers, so the same molecules exactly."""
    volume = (1e-5 / 20) ** 2 * 1e-6 * AVOGADRO
    both = []
    for scale, units in ((1.0, "molecules"), (volume, "concentration")):
        reactions = [
            Reaction("0 -> B", forward=4.0 / scale, units=units),
            Reaction("A + B -> 0", forward=0.02 * scale, units=units),
            Reaction("2 A -> B", forward=0.01 * scale, units=units),
            Reaction("2 A + B -> 0", forward=0.001 * scale**2, units=units),
        ]
        both.append(counts(lattice, "AB", reactions, [30, 20], 1.0, side=20)[0])
    np.testing.assert_array_equal(*both)


def test_isomerisation_sits_at_one_half(lattice):
    reaction = Reaction("A <-> B", forward=2.0, backward=2.0)
    values, chem = counts(lattice, "AB", [reaction], [40, 0], 10.0, steps=4)
    assert (values.sum(axis=1) == 40).all()
    assert_moments(values[:, 0], 20.0, 10.0)
    assert chem.events > 0


def test_user_propensity(lattice):
    """The law of "A -> 0" written by hand: binomial survival."""

    def decay(N, V, k):
        return k * N[0]

    reaction = Reaction("A -> 0", forward=0.8, propensity=decay)
    values, _ = counts(lattice, "A", [reaction], [50], 1.0)
    p = np.exp(-0.8)
    assert_moments(values[:, 0], 50 * p, 50 * p * (1 - p))


def test_splitting_a_step_changes_nothing_in_law(lattice):
    reaction = Reaction("A + B -> 0", forward=0.1, units="molecules")
    values, _ = counts(lattice, "AB", [reaction], [10, 10], 1.0, steps=5, seed=9)
    assert_moments(values[:, 0], 4.913835929, 1.510225263)
