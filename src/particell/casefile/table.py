"""What the tables of a case file have in common."""

from __future__ import annotations

import copy
import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    create_model,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import core_schema

from particell.casefile.formula import is_formula
from particell.casefile.messages import located
from particell.errors import InputError, unknown_name
from particell.units import Length, Quantity

_Model = TypeVar("_Model", bound=BaseModel)
_ENTRY = re.compile(r"^(\w[\w, ]*)\n((?: {4}.*\n?|\n)+)", re.MULTILINE)

#: A position, D numbers.
Position = Annotated[tuple[Length, ...], Field(min_length=1, max_length=3)]
#: The name of something that the file describes elsewhere.
Name = Annotated[str, Field(min_length=1, max_length=100)]
Axis = Annotated[int, Field(ge=0, le=2)]


class Table(BaseModel):
    """Base class of all tables: keys that do not exist are refused with the nearest right one."""

    model_config = ConfigDict(
        extra="forbid",
        validate_default=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            raise InputError("table", data, "a table with " + ", ".join(cls.model_fields))
        for key in data:
            if key not in cls.model_fields:
                raise unknown_name("key", str(key), cls.model_fields)
        return data

    def given(self, *without: str) -> dict[str, Any]:
        """The values by name, for a constructor with the same names."""
        names = type(self).model_fields
        return {name: getattr(self, name) for name in names if name not in ("type", *without)}


def describes(
    constructor: Callable[..., Any], *also: Callable[..., Any]
) -> Callable[[type[_Model]], type[_Model]]:
    """Give a table the defaults and the descriptions of a constructor's parameters.

    Parameters
    ----------
    constructor
        What the table is turned into. A field of the table that is no parameter of it keeps what it
        has.
    *also
        Others whose docstrings describe parameters.
    """

    def decorate(table: type[_Model]) -> type[_Model]:
        parameters = inspect.signature(constructor).parameters
        words: dict[str, str] = {}
        for source in (*reversed(also), constructor):
            found = described(inspect.getdoc(source) or "")
            words |= {k: v for k, v in found.items() if not v.startswith(("As for", "See "))}
        fields: dict[str, Any] = {}
        for name, info in table.model_fields.items():
            new = copy.copy(info)
            parameter = parameters.get(name)
            if parameter and new.is_required() and _has_default(parameter, info.annotation):
                new.default = parameter.default
            new.description = info.description or words.get(name)
            fields[name] = (info.annotation, new)
        made = create_model(
            table.__name__,
            __base__=table,
            __module__=table.__module__,
            __doc__=table.__doc__,
            **fields,
        )
        made.__qualname__ = table.__qualname__
        return made

    return decorate


def _has_default(parameter: inspect.Parameter, annotation: Any) -> bool:
    """Whether a parameter has a default that a file may have too."""
    if parameter.default is None:
        return annotation not in (str, int, float)
    return parameter.default is not parameter.empty


def described(docstring: str) -> dict[str, str]:
    """Descriptions by name of the section "Parameters" of a numpydoc docstring."""
    found = re.search(r"^Parameters\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", docstring, re.M | re.S)
    words: dict[str, str] = {}
    for names, text in _ENTRY.findall(found[1] if found else ""):
        plain = re.sub(r":\w+:`~?\.?(?:[\w.]*\.)?([^`]+)`", r"\1", " ".join(text.split()))
        words |= {name.strip(): plain for name in names.split(",")}
    return words


@dataclass(frozen=True)
class _Converted:
    """A value with a unit, as metadata of ``Annotated[Any, …]``."""

    unit: str

    def convert(self, value: Any) -> Any:
        """The value in SI units."""
        return Quantity(self.unit).convert(value)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.convert)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": "number"}, {"type": "string"}], "x-unit": self.unit}


class Profile(_Converted):
    """A number with a unit that may be a formula of x, y, z, or of t where it says so."""

    def convert(self, value: Any) -> Any:
        """The number in SI units, or the formula as it is."""
        return value.strip() if is_formula(value) else super().convert(value)


class ByGroup(_Converted):
    """A number with a unit, or one for each group by name."""

    def convert(self, value: Any) -> Any:
        """The same in SI units."""
        if isinstance(value, Mapping):
            return {str(group): super(ByGroup, self).convert(v) for group, v in value.items()}
        return super().convert(value)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        one = super().__get_pydantic_json_schema__(schema, handler)
        table = {"type": "object", "additionalProperties": one}
        return {"anyOf": [*one["anyOf"], table], "x-unit": self.unit}


def as_text(value: Any) -> Any:
    """Quantities whose unit is known later only as text, which a run's description can hold."""
    if isinstance(value, list | tuple):
        return [as_text(one) for one in value]
    if hasattr(value, "to_base_units"):
        base = value.to_base_units()
        return f"{float(base.magnitude)!r} {base.units}"
    return value


@contextmanager
def within(place: str) -> Iterator[None]:
    """Say in errors where in the file they are."""
    try:
        yield
    except InputError as error:
        if place in error.key:
            raise
        raise located(error, place) from None


def place_of(kind: str, number: int, name: str | None = None) -> str:
    """What messages call the item of a list: by its name, or counted from 1."""
    return f"{kind} '{name}'" if name else f"{kind} #{number + 1}"
