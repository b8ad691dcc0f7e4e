from __future__ import annotations

import pytest

import particell as pc
from particell import units
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


@pytest.mark.parametrize("unit", ["", "K", "kg/m³", "1/s", "W/m^2", "µm/s", "molecules", "%", "cd"])
def test_fields_of_one_s_own_have_units(unit):
    assert pc.Field("mine", unit=unit).rate.unit == (f"{unit}/s" if unit else "")


def test_units_of_si_need_no_registry(monkeypatch):
    """Each of the program's own fields would wait for it."""
    monkeypatch.setattr(units, "registry", None)
    units.check_unit.cache_clear()
    for unit in ("m", "m/s", "m/s²", "kg/m³", "kg/m³/s", "Pa", "K", "J/kg/K", "mol/m^3"):
        units.check_unit("unit", unit)


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("foo", "'foo' is no unit"),
        ("Kelvinn", "'Kelvinn' is no unit"),
        ("kg/", "a unit, such as"),
        ("3 m", "a unit, such as"),
        ("m^9999999", "a unit, such as"),
        ("K" * 200, "a unit, such as"),
        ("-", "a unit, such as"),
    ],
)
def test_what_is_no_unit_of_a_field(unit, words):
    with pytest.raises(InputError) as error:
        pc.Field("mine", unit=unit)
    assert str(error.value).startswith("unit = ") and words in str(error.value)
    assert "\n" not in str(error.value)
