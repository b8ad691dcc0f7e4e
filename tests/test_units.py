from __future__ import annotations

import pytest

from particell.errors import InputError
from particell.units import parse, quantity


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


@pytest.mark.parametrize(
    "text",
    [
        "1,5 um",
        "1 000 um",
        "12\u00a0500 um",
        "12\u202f500 um",
        "1.000,5 um",
        "1'000 um",
        "1’000 um",
        "1·5 um",
        "1,000 um",
        "2 5 mm",
        "1e-3,5 m",
        "1, mm",
        ",5 mm",
        "3 m 5",
        "1,5",
    ],
)
@pytest.mark.parametrize("read", [lambda text: parse("x", text, "m"), quantity])
def test_a_number_is_never_another_one(text, read):
    """Decimal commas and digits in groups: pint drops commas and multiplies what stands apart."""
    with pytest.raises(ValueError, match="decimal point"):
        read(text)


@pytest.mark.parametrize(
    "text", ["5 m / 2", "5 m * 2", "5 / 2 m", "-5 m", "1e-3 m", "1 m^-1 * 2 m^2"]
)
def test_numbers_with_an_operator_between_them(text):
    assert parse("x", text, "m") == pytest.approx(quantity(text).magnitude)
