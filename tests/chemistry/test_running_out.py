"""Laws that do not vanish where what they consume has run out, are negative, or no numbers."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import particell as pc
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.errors import LawWarning, RunError
from particell.materials import AVOGADRO

VOLUME = (1e-5 / 6) ** 2 * 1e-6  # of each of 36 particles, in m³


def constant(C, k):
    return k


def lines_of(caught):
    return [str(each.message) for each in caught if issubclass(each.category, LawWarning)]


def test_rate_laws_stop_where_nothing_is_left(lattice):
    """S falls linearly to 0 and stays; Q is then used up as fast as it comes; T is shared.

    All in one simulation, whose laws are compiled once.
    """
    names = "SPQRTUVXYZ"

    def michaelis(C, k):
        return k * C[7] / (1e-3 + C[7])

    def taken_back(C, k):
        return -k

    def broken(C, k):
        return k * C[10] / (1.0 - C[10]) ** 2

    reactions = [
        Reaction("S -> P", 1.0, rate_law=constant),
        Reaction("0 -> Q", 0.3),
        Reaction("Q -> R", 1.0, rate_law=constant),
        Reaction("T -> U", 1.0, rate_law=constant),
        Reaction("T -> V", 2.0, rate_law=constant),
        Reaction("X -> Y", 1.0, rate_law=michaelis),
        Reaction("0 -> Z", 0.5, rate_law=taken_back),
        Reaction("O -> 0", 1.0, rate_law=broken),
    ]
    start = {"S": 1.0, "Q": 0.35, "T": 0.9, "X": 0.2, "Z": 0.8, "W": 5.5e4}
    species = [Species(n, 1e-12 * (n in "SP")) for n in names + "OW"]
    chem = lattice(disturb=0.2).chemistry(species, reactions)
    for name, value in start.items():
        chem.set_concentration(name, value)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for step in range(8):
            chem.step(step, 0.25)
            t = 0.25 * (step + 1)
            c = {name: chem.concentration(name)[0] for name in names}
            expected = {
                "S": max(0.0, 1 - t),
                "P": min(1.0, t),
                "Q": max(0.0, 0.35 - 0.7 * t),
                "R": min(t, 0.35 + 0.3 * t),
                "T": max(0.0, 0.9 - 3 * t),
                "U": min(0.3, t),
                "V": min(0.6, 2 * t),
                "Z": max(0.0, 0.8 - 0.5 * t),
            }
            for name, value in expected.items():
                assert c[name] == pytest.approx(value, rel=1e-7, abs=1e-12), (name, t)
            assert c["X"] + c["Y"] == pytest.approx(0.2, rel=1e-14)
            assert min(c.values()) >= 0
    lines = lines_of(caught)
    assert len(lines) == 5  # once each, whatever the number of steps and particles
    for name, what in {"S -> P": "S", "Q -> R": "Q", "T -> U": "T", "T -> V": "T"}.items():
        assert any(
            f"rate_law of reaction '{name}'" in x and f"where {what} runs" in x for x in lines
        )
    assert any("'0 -> Z'" in line and "where Z runs" in line for line in lines)
    # from one particle to the next
    chem.set_concentration("S", lambda x: 2.0 * (x[:, 0] < 4e-6))
    before = chem.particles.host("amount")[:, :2].sum()
    for step in range(8):
        chem.step(8 + step, 0.3 * chem.limits()["diffusion of concentrations"])
        assert (chem.particles.host("amount") >= 0).all()
    assert chem.particles.host("amount")[:, :2].sum() == pytest.approx(before, rel=1e-13)
    chem.set_concentration("O", 1.0)
    with pytest.raises(RunError, match=r"not finite \('O -> 0'\).*'amount'"):
        chem.step(20, 1e-3)


def test_propensities_take_no_more_than_there_is(lattice):
    reactions = [
        Reaction("A -> 0", 3.0, propensity=lambda N, V, k: k),
        Reaction("2 B -> D", 3.0, propensity=lambda N, V, k: k * N[1] * N[1]),
        Reaction("E -> 0", 3.0, propensity=lambda N, V, k: k * (N[3] - 4)),
        Reaction("G -> 0", 3.0, propensity=lambda N, V, k: k * N[4] / (1 + N[4])),
        Reaction("H -> 0", 3.0, propensity=lambda N, V, k: k * N[5] / (N[5] - 5) ** 2),
    ]
    species = [Species(n, molecules=True) for n in "ABDEGH"]
    chem = lattice(side=20).chemistry(species, reactions, seed=4)
    for name, number in {"A": 3, "B": 7, "E": 2, "G": 3}.items():
        chem.set_count(name, number)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for step in range(4):
            chem.step(step, 10.0)
    assert (chem.count("A") == 0).all()
    assert (chem.count("B") == 1).all()
    assert (chem.count("D") == 3).all()
    assert (chem.count("E") == 2).all()
    assert (chem.count("G") == 0).all()
    lines = lines_of(caught)
    assert len(lines) == 3
    assert any("propensity of reaction 'A -> 0'" in x and "where A runs out" in x for x in lines)
    assert any("'2 B -> D'" in line and "where B runs out" in line for line in lines)
    assert any("'E -> 0'" in line and "negative" in line for line in lines)
    assert chem.remarks == lines
    chem.set_count("H", 5)
    with pytest.raises(RunError, match=r"not finite \('H -> 0'\).*'count'"):
        chem.step(4, 1.0)


def test_beside_concentrations_too(lattice):
    """The same laws in the loop of both kinds, and the concentration's own."""
    reactions = [
        Reaction("A -> 0", 3.0, propensity=lambda N, V, k: k),
        Reaction("A + C -> A", 1e-3 * VOLUME * AVOGADRO),
        Reaction("S -> 0", 1e-5, rate_law=constant),
    ]
    species = [Species("A", molecules=True), Species("C"), Species("S")]
    chem = lattice().chemistry(species, reactions)
    chem.set_count("A", 3)
    chem.set_concentration("C", 1e-4)
    chem.set_concentration("S", 1e-5)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for step in range(4):
            chem.step(step, 10.0)
    assert (chem.count("A") == 0).all()
    np.testing.assert_allclose(chem.concentration("S"), 0.0, atol=1e-20)
    lines = lines_of(caught)
    assert len(lines) == 2
    assert any("'A -> 0'" in line for line in lines)
    assert any("'S -> 0'" in line for line in lines)


@pytest.mark.parametrize("amounts", [False, True])
def test_more_events_than_anybody_waits_for(lattice, amounts):
    species = [Species("M", molecules=True), Species("C")]
    reaction = Reaction("M + C -> 2 M + C", 1e3) if amounts else Reaction("M -> 2 M", 1e3)
    chem = lattice().chemistry(species, [reaction])
    chem._fields["most_events"] = 5000
    chem.set_count("M", 10)
    chem.set_concentration("C", 1.0)
    with pytest.raises(RunError, match="more than 5e"):
        chem.step(0, 1.0)


def test_numbers_near_the_largest(lattice):
    """10¹⁵ molecules: propensities are right to round-off."""
    species = [Species("A", molecules=True), Species("B", molecules=True)]
    chem = lattice(side=40).chemistry(species, [Reaction("A -> B", 1e-13)], seed=3)
    chem.set_count("A", 10**15)
    chem.step(0, 1.0)
    got = chem.count("B")
    # Poisson of mean 100: 5.5 sigma, false-alarm rate 4e-8
    assert abs(got.mean() - 100) < 5.5 * np.sqrt(100 / len(got))
    assert (chem.count("A") + got == 10**15).all()


@pytest.mark.parametrize(
    ("start", "diffusivity", "every", "depth"),
    [(4.0, 0.0, 0.3, None), (5.0, 1e-12, 0.1, None), (5.0, 0.0, 0.3, 1e-6)],
)
def test_nothing_is_left_of_what_ran_out(start, diffusivity, every, depth):
    """Of a residue of 1e-41 a constant sink would take everything within 1e-41 s."""
    line = pc.Domain((0,), (1e-5,), periodic="x", depth=depth)
    simulation = pc.Simulation(
        line,
        pc.fluid(line, pc.Fluid(density=1000, viscosity=1e-3), 1e-6),
        pc.Static(),
        [pc.Species("B", diffusivity)],
        [pc.Reaction("B -> 0", 3.0, rate_law=lambda C, k: k)],
    )
    simulation.chemistry.set_concentration("B", start)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pc.LawWarning)
        run = simulation.run(until=3.0, every=every, progress=False)
    left = np.maximum(start - 3.0 * run.times, 0.0)
    assert run.field("concentration/B")[:].mean(axis=1) == pytest.approx(left, abs=1e-5 * start)
