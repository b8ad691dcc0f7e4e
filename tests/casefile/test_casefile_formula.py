"""Formulas of case files: right, in Python's order of operations, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from particell.casefile.constants import Constants
from particell.casefile.formula import Formula
from particell.casefile.scope import Scope
from particell.errors import InputError
from particell.geometry.domain import Domain

GIVEN = {"H": "100e-6 m", "v": "1 mm/s", "n": 7, "area": "= H**2", "c": "10 nM", "warm": "25 degC"}


def scope() -> Scope:
    return Scope(Constants(GIVEN), Domain((0, 0), (1, 1)))


def test_formulas_of_constants_have_the_bits_of_python():
    constants = Constants(GIVEN)
    H, v, n = 100e-6, constants.values["v"], 7
    for text, expected in {
        "12 * v / H**2": 12 * v / H**2,
        "-v + v * (1 - n) / 3": -v + v * (1 - n) / 3,
        "sqrt(maximum((1.65 * v)**2, 3 * v**2))": math.sqrt(max((1.65 * v) ** 2, 3 * v**2)),
        "round(0.2 * n) * H": round(0.2 * n) * H,
        "area / H": H**2 / H,
        "exp(-n / 3) * pi": math.exp(-n / 3) * math.pi,
    }.items():
        assert constants.evaluate(Formula("f", "= " + text)).magnitude == expected, text
    assert constants.values["warm"] == pytest.approx(298.15)
    assert constants.values["c"] == pytest.approx(1e-5)


def test_profiles_have_the_bits_of_numpy():
    points = np.random.default_rng(1).random((50, 2))
    x, y = points.T
    H, v = 100e-6, Constants(GIVEN).values["v"]
    found = scope().profile("f", "= 4 * v * clip(y / H, 0, 1) * (1 - x / H) / n**2", "m/s")(points)
    assert np.array_equal(found, 4 * v * np.clip(y / H, 0, 1) * (1 - x / H) / 7**2)
    found = scope().profile("f", "= where(x > 0.5 * H and not y < H, c, 0)", "mol/m^3")(points)
    assert np.array_equal(
        found, np.where((x > 0.5 * H) & ~(y < H), Constants(GIVEN).values["c"], 0)
    )


@pytest.mark.parametrize(
    "text, words",
    [
        ("H + v", "units go together"),
        ("H * v", "another dimension"),
        ("v * exp(H)", "units go together"),
        ("where(x > v, v, 0)", "units go together"),
        ("round(H) * v / H", "without unit in round"),
        ("w", "one of .*H"),
        ("sqr(H)", "did you mean 'sqrt'"),
        ("sqrt", "written with arguments"),
        ("sqrt(1, 2)", "1 argument of sqrt"),
        ("H^2", r"powers written as \*\*"),
        ("1 if x else 2", "a formula of numbers"),
        ("__import__('os').system('true')", "a formula of numbers"),
        ("x.real", "a formula of numbers"),
        ("[v for v in (1,)]", "a formula of numbers"),
        ("(lambda: 1)()", "a formula of numbers"),
        ("'a'", "a formula of numbers"),
        ("1j", "a formula of numbers"),
        ("x[0]", "a formula of numbers"),
        ("sqrt(*x)", "argument"),
        ("0 < x < H", "one comparison at a time"),
        ("1e999", "finite"),
        ("v * " + "9" * 400, "finite"),
        ("-" * 500 + "v", "nested"),
        ("v + " * 500 + "v", "characters long"),
        ("(" * 300, "a formula of numbers"),
        ("", "a formula of numbers"),
        ("v \0", "a formula of numbers"),
        ("z * v", "one of"),
        ("t * v", "one of"),
    ],
)
def test_refuses(text, words):
    with pytest.raises(InputError, match=words) as error:
        scope().profile("f", "= " + text, "m/s")
    assert "\n" not in str(error.value)


def test_large_powers_take_no_time():
    constants = Constants({"n": 9})
    for text in ("9**9**9**9", "n**n**n**n", "(-8)**(1/3)", "1/(n - n)"):
        with pytest.raises(InputError, match="result"):
            constants.evaluate(Formula("f", "= " + text))


@pytest.mark.parametrize(
    "given, words",
    [
        ({"a": "= b", "b": "= a"}, "without themselves"),
        ({"x": 1}, "another name"),
        ({"sqrt": 1}, "another name"),
        ({"a b": 1}, "letters"),
        ({"a": "= bb", "bbb": 1}, "did you mean 'bbb'"),
        ({"a": [1]}, "a number"),
        ({"a": True}, "a number"),
        ({"a": "soon"}, "text with a unit"),
        ({"a": math.inf}, "finite"),
        ({"a": 10**400}, "finite"),
    ],
)
def test_constants_refuse(given, words):
    with pytest.raises(InputError, match=words):
        Constants(given)
