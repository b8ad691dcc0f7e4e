"""Input of species and reactions, and the tables made of them."""

from __future__ import annotations

import numpy as np
import pytest

from particell.chemistry.network import build_tables
from particell.chemistry.reactions import Reaction, parse_reaction
from particell.chemistry.reservoirs import FixedValueWall, Reservoir
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.particles import Group

GROUPS = [Group("fluid", "fluid", 0), Group("cell", "fluid", 0), Group("membrane", "wall", 0)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("R + L <-> RL", ({"R": 1, "L": 1}, {"RL": 1}, True)),
        ("2 A -> B", ({"A": 2}, {"B": 1}, False)),
        ("2A + B -> 3*C", ({"A": 2, "B": 1}, {"C": 3}, False)),
        ("0 -> A", ({}, {"A": 1}, False)),
        ("A -> ∅", ({"A": 1}, {}, False)),
        ("A + A -> A", ({"A": 2}, {"A": 1}, False)),
    ],
)
def test_parsing(text, expected):
    assert parse_reaction(text) == expected


@pytest.mark.parametrize(
    "text",
    ["A", "A -> B -> C", "A <-> B <-> C", "0.5 A -> B", "A B -> C", "0 A -> B", "A - B -> C"],
)
def test_wrong_equations_are_refused(text):
    with pytest.raises(InputError):
        Reaction(text, forward=1.0)


@pytest.mark.parametrize(
    "options",
    [
        {"forward": -1.0},
        {"forward": float("nan")},
        {"forward": 1.0, "backward": 1.0},
        {},
        {"forward": 1.0, "units": "litres"},
        {"forward": 1.0, "only_in": []},
    ],
)
def test_wrong_options_are_refused(options):
    with pytest.raises(InputError):
        Reaction("A -> B", **options)


def test_more_refusals():
    with pytest.raises(InputError, match="order"):
        Reaction("4 A -> B", forward=1.0)
    with pytest.raises(InputError, match="given"):
        Reaction("A <-> B", forward=1.0)
    with pytest.raises(InputError):
        Species("A", diffusivity=-1.0)
    with pytest.raises(InputError):
        Species("2A")
    with pytest.raises(InputError):
        Reservoir("fluid", {"A": -1.0})
    with pytest.raises(InputError):
        FixedValueWall("fluid", {})


def test_tables_of_coefficients_give_the_same_as_text():
    text = Reaction("R + 2 L <-> RL", forward=2.0, backward=3.0)
    table = Reaction(reactants={"R": 1, "L": 2}, products={"RL": 1}, forward=2.0, backward=3.0)
    assert text.reactants == table.reactants
    assert text.products == table.products
    assert table.reversible
    assert table.label == "R + 2 L -> RL"


def build(species, reactions=(), boundaries=()):
    return build_tables(species, reactions, boundaries, GROUPS)


def test_names_and_kinds_are_checked():
    a, m = Species("A"), Species("M", molecules=True)
    law = Reaction("A + M -> A", propensity=lambda N, V, k: k * N[0])
    with pytest.raises(InputError, match="mass action"):
        build([a, m], [law])
    with pytest.raises(InputError, match="'A'"):
        build([a], [Reaction("AA -> 0", forward=1.0)])
    with pytest.raises(InputError, match="membrane"):
        build([Species("A", only_in="membran")])
    with pytest.raises(InputError):
        build([a, a])
    with pytest.raises(InputError):
        build([a], [Reaction("A -> 0", forward=1.0, units="molecules")])
    with pytest.raises(InputError, match="cannot be there"):
        build([a], [Reaction("A -> 0", forward=1.0, only_in="membrane")])
    with pytest.raises(InputError):
        build([a], [], [Reservoir("fluid", {"A": 1.0}), Reservoir("fluid", {"A": 2.0})])


def test_numbers_of_species_and_reactions_are_limited():
    species = [Species(f"A{k}") for k in range(1001)]
    with pytest.raises(InputError, match=r"number of species = 1001.*at most 1000"):
        build(species)
    reactions = [Reaction("A0 -> 0", forward=1.0)] * 10_001
    with pytest.raises(InputError, match=r"number of reactions = 10001.*at most 10000"):
        build(species[:1000], reactions)


def test_tables():
    species = [
        Species("L", {"fluid": 2.0, "membrane": 1.0}),
        Species("R", only_in="membrane"),
        Species("B", 3.0, only_in=["fluid"]),
    ]
    binding = Reaction("R + 2 L <-> R", forward={"membrane": 4.0}, backward=5.0)
    t, none = build(species, [binding], [FixedValueWall("membrane", {"B": 1.0})])
    assert none.names == []
    np.testing.assert_array_equal(t.rate, [[0, 0], [0, 0], [4, 5]])
    np.testing.assert_array_equal(t.net, [[-2, 0, 0], [2, 0, 0]])
    np.testing.assert_array_equal(t.reactants, [[1, 0, 0], [1, -1, -1]])
    np.testing.assert_array_equal(t.repeats, [[0, 0, 1], [0, 0, 0]])
    np.testing.assert_array_equal(t.volume_power, [-2, 0])
    # harmonic mean between fluid and membrane, blocked by the cell; the wall takes the fluid's
    assert t.pair_diffusivity[0, 2, 0] == pytest.approx(4 / 3)
    assert t.pair_diffusivity[0, 1, 0] == 0
    assert t.pair_diffusivity[0, 2, 2] == 3
    assert t.pair_diffusivity[2, 0, 2] == 0
    np.testing.assert_array_equal(t.diffusing, [0, 2])
