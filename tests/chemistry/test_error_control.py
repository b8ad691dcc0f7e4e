"""Rate equations to 10⁻⁶ of each species, whatever else is there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from particell.chemistry.rates import rate_slope, reaction_rate
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species

WATER = 5.5e4  # mol/m³


def chemistry(lattice, start, reactions):
    chem = lattice(side=3, support=1.5).chemistry([Species(name) for name in start], reactions)
    for name, value in start.items():
        chem.set_concentration(name, value)
    return chem


def values(chem, names):
    return np.array([chem.concentration(name)[0] for name in names])


@pytest.mark.parametrize("water", [0.0, 1.0, WATER])
@pytest.mark.parametrize("dt", [1.0, 3.0, 4.0, 5.0, 6.0, 10.0])
def test_nothing_is_judged_by_what_is_more_abundant(lattice, water, dt):
    """A nanomolar relaxes beside water, in steps inside and outside of explicit stability."""
    reactions = [Reaction("0 -> A", 1e-6), Reaction("A -> 0", 1.0)]
    chem = chemistry(lattice, {"A": 2e-6, "W": water}, reactions)
    for step in range(round(60 / dt)):
        chem.step(step, dt)
        exact = 1e-6 + 1e-6 * np.exp(-dt * (step + 1))
        assert chem.concentration("A")[0] == pytest.approx(exact, rel=1e-6)


def test_water_that_reacts(lattice):
    """Hydration A + W <-> B of a picomolar, a part in 10¹⁴ of the water."""
    on, off = 2.0 / WATER, 0.5
    reactions = [Reaction("A + W <-> B", on, off)]
    chem = chemistry(lattice, {"A": 1e-9, "B": 0.0, "W": WATER}, reactions)
    for step, t in enumerate((0.01, 0.3, 2.0)):
        chem.step(step, t - (0.0, 0.01, 0.3)[step])
        part = 0.8 * (1 - np.exp(-2.5 * t))
        np.testing.assert_allclose(values(chem, "AB"), [1e-9 * (1 - part), 1e-9 * part], rtol=2e-6)


def test_robertson_beside_water(lattice):
    """Stiff by 11 decades, with a species of 10⁻⁸ of the others."""
    reactions = [
        Reaction("A -> B", 0.04),
        Reaction("2 B -> B + C", 3e7),
        Reaction("B + C -> A + C", 1e4),
    ]

    def slope(t, y):
        a, b, c = 0.04 * y[0], 3e7 * y[1] ** 2, 1e4 * y[1] * y[2]
        return [c - a, a - b - c, b]

    times = [0.4, 4.0, 40.0, 4e3, 4e5]
    exact = solve_ivp(slope, (0, 4e5), [1, 0, 0], "Radau", times, rtol=1e-10, atol=1e-20).y.T
    chem = chemistry(lattice, {"A": 1.0, "B": 0.0, "C": 0.0, "W": WATER}, reactions)
    for step, (before, t) in enumerate(zip([0, *times[:-1]], times, strict=True)):
        chem.step(step, t - before)
        found = values(chem, "ABC")
        np.testing.assert_allclose(found, exact[step], rtol=3e-6)
        assert found.sum() == pytest.approx(1.0, rel=1e-14)
        assert chem.substeps < 400


def test_what_begins_at_zero(lattice):
    """A chain of six from its first member: the last one grows with the fifth power of time."""
    names = "ABCDEF"
    reactions = [Reaction(f"{a} -> {b}", 1.0) for a, b in pairwise(names)]
    law = np.diag([-1.0] * 5 + [0.0]) + np.diag([1.0] * 5, -1)
    start = dict.fromkeys(names, 0.0) | {"A": 1.0}
    for t in (0.1, 1.0, 8.0):
        chem = chemistry(lattice, start, reactions)
        chem.step(0, t)
        np.testing.assert_allclose(values(chem, names), expm(t * law)[:, 0], rtol=3e-6)
        assert chem.substeps < 200


@pytest.mark.parametrize("members", [6, 8, 12])
def test_what_begins_at_zero_beside_what_is_fast(lattice, members):
    """A chain from its first member, by the implicit method from the first sub-step on.

    Its sixth member begins with -h⁵/48 in a step of h, for every h.
    """
    names = "ABCDEFGHIJKL"[:members]
    reactions = [Reaction(f"{a} -> {b}", 1.0) for a, b in pairwise(names)]
    reactions.append(Reaction("X <-> Y", 1e5, 1e5))
    law = np.diag([-1.0] * (members - 1) + [0.0]) + np.diag([1.0] * (members - 1), -1)
    chem = chemistry(lattice, dict.fromkeys(names + "Y", 0.0) | {"A": 1.0, "X": 1.0}, reactions)
    chem.step(0, 1.0)
    found = values(chem, names)
    np.testing.assert_allclose(found, expm(law)[:, 0], rtol=3e-6)
    assert found.sum() == pytest.approx(1.0, rel=1e-14)
    assert chem.substeps < 3000  # the last one is followed from 10⁻²⁰ on


def test_association_from_nothing(lattice):
    """Ligands bind one after the other: the equations of a receptor, stiff, and nothing bound."""
    on, off, close, rest = 3e5, 8e3, 3e4, 20.0
    reactions = [
        Reaction("R + L <-> RL", on, off),
        Reaction("RL + L <-> RLL", on, off),
        Reaction("RLL <-> O", close, rest),
        Reaction("O <-> I", rest, rest),
        Reaction("I <-> D", 0.05, 1e-3),
    ]
    start = {"R": 1e-3, "L": 1e-2} | dict.fromkeys(["RL", "RLL", "O", "I", "D"], 0.0)

    def slope(t, y):
        r, ligand, one, two, o, i, d = y
        a, b = on * r * ligand - off * one, on * one * ligand - off * two
        c, e, f = close * two - rest * o, rest * (o - i), 0.05 * i - 1e-3 * d
        return [-a, -a - b, a - b, b - c, c - e, e - f, f]

    options = {"method": "Radau", "rtol": 1e-11, "atol": 1e-22}
    for t in (0.01, 5.0):
        exact = solve_ivp(slope, (0, t), list(start.values()), **options).y[:, -1]
        chem = chemistry(lattice, start, reactions)
        chem.step(0, t)
        np.testing.assert_allclose(values(chem, start), exact, rtol=3e-6)


def test_what_has_gone_costs_nothing(lattice):
    """Down to nothing, without small steps on the way or when it is there."""
    reactions = [Reaction("A -> 0", 40.0), Reaction("B -> 0", 1e-2)]
    for start in ({"A": 1.0}, {"A": 1.0, "B": 1.0}):
        chem = chemistry(lattice, start, reactions[: len(start)])
        for step in range(30):
            chem.step(step, 1.0)
            assert chem.substeps < 200
        assert (chem.concentration("A") == 0).all()
        assert chem.substeps == len(start) - 1
    np.testing.assert_allclose(chem.concentration("B"), np.exp(-0.3), rtol=1e-6)


@pytest.mark.parametrize("law", [0, 1])
def test_slopes_of_rates_are_their_derivatives(law):
    """Against central differences; of rate laws also where what they take nearly runs out.

    A wrong slope would only show in the number of sub-steps.
    """
    edge, k = 1e-3, 2.0
    w = edge * np.array([0.3, 2.0, 5.0])
    reactants, net = np.array([[0, 0, 1]]), np.array([[-2.0, -1.0, 1.0]])
    given = reactants, net, np.array([law]), lambda which, c, k: k * (1 + 300 * c[0] * c[1])

    def rate(c):
        return reaction_rate.py_func(0, c, 0, 3, k, edge, *given)

    for s in range(3):
        step = np.eye(3)[s] * 1e-4 * edge
        expected = (rate(w + step) - rate(w - step)) / (2e-4 * edge)
        slope = rate_slope.py_func(0, s, np.array(w), 3, k, edge, 1e-6 * edge, *given)
        assert slope == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert (slope != 0) == (s < 2)
