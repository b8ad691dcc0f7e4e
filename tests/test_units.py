from __future__ import annotations

import pytest

from particell.errors import InputError
from particell.units import parse


@pytest.mark.parametrize(
    "text, unit, expected",
    [
        ("347 um^2/s", "m^2/s", 347e-12),
        ("347 µm²/s", "m^2/s", 347e-12),
        (2, "m", 2.0),
        ("2.5e-3", "m", 2.5e-3),
        ("25 degC", "K", 298.15),
        ("300 K", "K", 300.0),
        ("1 cP", "Pa*s", 1e-3),
        ("5 molecules / um^3", "1/m^3", 5e18),
        ("10 nM", "1/m^3", 10e-6 * 6.02214076e23),
        ("1 / (M s)", "m^3/s", 1e-3 / 6.02214076e23),
        ("3 mol", "mol", 3.0),
        ("50 %", "", 0.5),
        ("2 pi", "", 6.283185307179586),
    ],
)
def test_parse(text, unit, expected):
    assert parse("x", text, unit) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "3 s",
        "um",
        "3 furlongz",
        "3 m +",
        "__import__('os')",
        "1/0 m",
        "9**9**9**9 m",
        "2^99999999 m",
        "m^(9^9^9)",
        "(((9 m)^9)^9)^9",
        10**400,
    ],
)
def test_refuses(text):
    with pytest.raises(InputError, match="x = "):
        assert parse("x", text, "m^2")
