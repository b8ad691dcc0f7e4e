"""Quantities with units at the edge: ``"347 um^2/s"`` in, plain SI numbers inside.

A parameter of a case is declared with the unit it is kept in::

    diffusivity: Annotated[float, Quantity("m^2/s")] = 1e-9
    radius: Length = 2.5e-6

and accepts a number in that unit, or text with any unit of the same dimension. Amounts of
substance become numbers of molecules where the unit calls for it: ``"10 nM"`` is a valid
``Quantity("1/m^3")``.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from particell.checks import plain
from particell.errors import InputError

if TYPE_CHECKING:
    from pint import UnitRegistry
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue
    from pydantic_core import CoreSchema

#: Longest text of a quantity. Pint works powers of numbers out however large they are, so text
#: holds powers of units only, with one digit, and few of brackets.
LONGEST = 100
_POWER_OF_NUMBER = re.compile(r"[\d.]\s*(?:\*\*|\^)")
_POWER_OF_BRACKET = re.compile(r"\)\s*(?:\*\*|\^)")
_LARGE_POWER = re.compile(r"(?:\*\*|\^)[\s(+-]*(?:\d{2}|[^\d\s(+-])")
#: What much of the world writes within a number, and pint drops or takes for a product: a comma,
#: an apostrophe or a raised point between digits, or a number that stands beside another (but for
#: the 1 of a unit such as 1/s).
_BROKEN_NUMBER = re.compile(
    r",|\d\s*['’·⋅]\s*\d|[^\s*/^(+-]\s+(?!1\s*/\s*(?:\(|[^\W\d]))[+-]?[\d.]"
)

#: Units that need no registry: SI's, divided and multiplied.
_SYMBOL = r"(?:m|kg|s|K|mol|N|Pa|J|W)(?:[²³]|(?:\^|\*\*)[2-9])?"
_PLAIN = re.compile(rf"(?:1/)?{_SYMBOL}(?:[*/]{_SYMBOL})*")

#: Units by which a misspelt one is guessed.
USUAL = (
    *("m", "mm", "um", "nm", "cm", "s", "ms", "us", "ns", "min", "hour", "kg", "g", "mg", "ug"),
    *("Pa", "kPa", "MPa", "bar", "N", "J", "W", "K", "degC", "Hz", "kDa", "Da", "molecules"),
    *("mol", "mmol", "umol", "nmol", "M", "mM", "uM", "nM", "pM", "L", "mL", "uL"),
)


@functools.cache
def registry() -> UnitRegistry:
    """The one registry of units (loading it takes a moment, so only when it is needed)."""
    import pint

    # Offset units such as degC are converted rather than refused.
    units: UnitRegistry = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    units.define("molecule = count = molecules")
    return units


@dataclass(frozen=True)
class Quantity:
    """The unit of a parameter, as metadata of an annotated type.

    Parameters
    ----------
    unit
        An SI unit in pint's notation; empty for a plain number.
    infinite
        Whether infinite numbers are allowed.
    """

    unit: str
    infinite: bool = False

    def convert(self, value: Any) -> float:
        """A number, text with a unit, or one of pint's quantities, as a number in this unit.

        Raises
        ------
        ValueError
            Says what is allowed, as a phrase.
        """
        value = plain(value)
        if hasattr(value, "dimensionality"):
            number = self._parse(value)
        elif isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(self.allowed)
        else:
            try:
                number = float(value)
            except ValueError:
                number = self._parse(str(value))
            except OverflowError:
                raise ValueError(self.allowed) from None
        if math.isnan(number) or (math.isinf(number) and not self.infinite):
            raise ValueError(self.allowed)
        return number

    @property
    def allowed(self) -> str:
        """What is allowed, as a phrase."""
        if not self.unit:
            return "a number"
        return f"a number in {self.unit}, or text with a unit of that dimension"

    def _parse(self, given: Any) -> float:
        import pint

        units = registry()
        if isinstance(given, str):
            _refuse_broken_number(given)
            if not _harmless(given):
                raise ValueError(self.allowed)
        try:
            target = units.Unit(self.unit)
            quantity: Any = units.Quantity(given)
            moles = quantity.dimensionality.get("[substance]", 0)
            if moles and "[substance]" not in target.dimensionality:
                quantity = quantity * units.Quantity("avogadro_constant") ** moles
            return float(quantity.to(target).magnitude)
        except pint.UndefinedUnitError as error:
            raise ValueError(f"{self.allowed} ({unknown_units(error)})") from None
        except pint.DimensionalityError as error:
            found = str(error.units1)
            raise ValueError(f"{self.allowed} ('{found}' is of another)") from None
        except (pint.PintError, ArithmeticError, AttributeError, ValueError, TypeError):
            raise ValueError(self.allowed) from None
        except Exception as error:  # pint lets errors of Python's tokenizer through
            raise ValueError(self.allowed) from error

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.convert, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        number = handler.resolve_ref_schema(handler(schema))
        return {"anyOf": [number, {"type": "string"}], "x-unit": self.unit}


def _harmless(text: str) -> bool:
    """Whether pint needs no time to speak of for a text."""
    return (
        len(text) <= LONGEST
        and not _POWER_OF_NUMBER.search(text)
        and not _LARGE_POWER.search(text)
        and len(_POWER_OF_BRACKET.findall(text)) <= 2
    )


def _refuse_broken_number(text: str) -> None:
    """Refuse ``"1,5 um"``, ``"12 500 um"`` and the like, which pint would read as other numbers."""
    if _BROKEN_NUMBER.search(text):
        raise ValueError("one number, with a decimal point and nothing between its digits")


def unknown_units(error: Any) -> str:
    """The words of a text that are no units, with the nearest that are."""
    names = error.unit_names
    words = [names] if isinstance(names, str) else list(names)
    near = [difflib.get_close_matches(word, USUAL, n=1, cutoff=0.5) for word in words]
    said = [
        f"'{w}' is no unit" + (f"; did you mean '{n[0]}'?" if n else "")
        for w, n in zip(words, near, strict=True)
    ]
    return ", ".join(said)


def quantity(text: str) -> Any:
    """Text with a unit as one of pint's quantities, in base units.

    Raises
    ------
    ValueError
        Where it is no finite quantity.
    """
    import pint

    words = "a number, or text with a unit"
    _refuse_broken_number(text)
    if not _harmless(text):
        raise ValueError(words)
    try:
        found: Any = registry().Quantity(text).to_base_units()
        good = math.isfinite(found.magnitude)
    except pint.UndefinedUnitError as error:
        raise ValueError(f"{words} ({unknown_units(error)})") from None
    except (pint.PintError, ArithmeticError, AttributeError, ValueError, TypeError):
        raise ValueError(words) from None
    except Exception as error:  # pint lets errors of Python's tokenizer through
        raise ValueError(words) from error
    if not good:
        raise ValueError(words)
    return registry().Quantity(float(found.magnitude), found.units)


def parse(key: str, value: float | str, unit: str) -> float:
    """A number, or text with a unit, as a number in ``unit``.

    Raises
    ------
    InputError
        Naming ``key``, where the text is no quantity or of another dimension.
    """
    try:
        return Quantity(unit).convert(value)
    except ValueError as error:
        raise InputError(key, value, str(error)) from None


@functools.cache
def check_unit(name: str, unit: str) -> None:
    """Refuse text that is no unit.

    Raises
    ------
    InputError
        Naming ``name``.
    """
    if not unit or _PLAIN.fullmatch(unit):
        return
    import pint

    allowed = "a unit, such as 'K' or 'kg/m^3'"
    try:
        if not _harmless(unit):
            raise ValueError(unit)
        registry().Unit(unit)
    except pint.UndefinedUnitError as error:
        raise InputError(name, unit, f"{allowed} ({unknown_units(error)})") from None
    except Exception:  # of pint's many, and of Python's tokenizer
        raise InputError(name, unit, allowed) from None


Number = Annotated[float, Quantity("")]
Length = Annotated[float, Quantity("m")]
Time = Annotated[float, Quantity("s")]
Velocity = Annotated[float, Quantity("m/s")]
Mass = Annotated[float, Quantity("kg")]
Density = Annotated[float, Quantity("kg/m^3")]
Pressure = Annotated[float, Quantity("Pa")]
Viscosity = Annotated[float, Quantity("Pa*s")]
Acceleration = Annotated[float, Quantity("m/s^2")]
Diffusivity = Annotated[float, Quantity("m^2/s")]
Temperature = Annotated[float, Quantity("K")]
Rate = Annotated[float, Quantity("1/s")]
Concentration = Annotated[float, Quantity("mol/m^3")]

# Units of the recorded fields.
FIELD_UNITS = {
    "position": "m",
    "velocity": "m/s",
    "density": "kg/m^3",
    "pressure": "Pa",
    "mass": "kg",
    "support": "m",
    "temperature": "K",
    "time": "s",
}


def field_unit(name: str) -> str:
    """SI unit of a recorded field by its name; empty for numbers and for what is unknown.

    (``inflow/NAME`` is in mol or in molecules: it depends on the species.)
    """
    if name.startswith("concentration/"):
        return "mol/m^3"
    return FIELD_UNITS.get(name, "")


#: Units of recorded scalars, by how their names begin.
OBSERVABLE_UNITS = {"kinetic_energy": "J", "momentum_": "kg*m/s", "largest_speed": "m/s"}


def observable_unit(name: str, fields: Collection[str]) -> str:
    """Unit of a recorded scalar by its name; empty for what is unknown.

    Parameters
    ----------
    name
        ``"kinetic_energy"``, ``"amount_L"``, …
    fields
        The fields of the run: a species with a field ``count/NAME`` is counted in molecules.
    """
    kind, _, species = name.partition("_")
    if kind in ("amount", "inflow"):
        return "molecules" if f"count/{species}" in fields else "mol"
    return next((unit for start, unit in OBSERVABLE_UNITS.items() if name.startswith(start)), "")


# Units in which lengths and times read well.
_LENGTHS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
_TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"), (1e-12, "ps"))


def length_scale(extent: float) -> tuple[float, str]:
    """Factor and name of the unit in which a length in m reads well: (1e-6, "µm")."""
    return _readable(extent, _LENGTHS)


def place(point: Iterable[float]) -> str:
    """``"(2.5, 52.5) µm"``: a point in m, in a unit that suits it."""
    numbers = [float(x) for x in point]
    factor, unit = length_scale(max(map(abs, numbers), default=0.0))
    return f"({', '.join(f'{x / factor:.6g}' for x in numbers)}) {unit}"


def time_scale(extent: float) -> tuple[float, str]:
    """Factor and name of the unit in which a time in s reads well."""
    return _readable(extent, _TIMES)


def _readable(extent: float, units: Sequence[tuple[float, str]]) -> tuple[float, str]:
    for factor, name in units:
        if abs(extent) >= factor * 0.999:
            return factor, name
    return units[-1] if extent else units[0]
