"""Errors of pydantic in one line of our own words, with the place in the file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from pydantic import ValidationError

from particell.casefile.typed import typed_at
from particell.errors import InputError, MissingExtra, unknown_name

_PYDANTIC = re.compile(r"^(?:\w+ should (?:be |have )?)")
_TABLES = ("dict_type", "model_type", "model_attributes_type", "mapping_type")


def input_error(
    error: ValidationError, data: Mapping[str, Any], unions: Mapping[str, Any]
) -> InputError:
    """The first error of a validation of ``data``; ``unions`` are types by the key they are at."""
    first = error.errors(include_url=False)[0]
    location = list(first["loc"])
    kind, context = first["type"], first.get("ctx", {})
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        location.append("type")
    typed = typed_at(location, data, first["input"])
    place = _place(location, data, kind == "missing" or location[-1:] == ["type"])
    cause = context.get("error")
    if isinstance(cause, InputError):
        return located(InputError(cause.key, shown(cause.value), cause.allowed), place)
    if kind == "union_tag_invalid":
        return unknown_name(place, str(context["tag"]), _tags(context))
    if kind == "union_tag_not_found":
        keys = [part for part in location[:-1] if isinstance(part, str) and part in unions]
        return InputError(place, None, f"one of {', '.join(kinds(unions[keys[-1]]))}")
    if kind == "missing":
        return InputError(place, None, "given")
    if kind in _TABLES:
        return InputError(place, shown(typed), "a table")
    if kind in ("list_type", "tuple_type"):
        return InputError(place, shown(typed), "a list")
    allowed = str(cause) if cause else _PYDANTIC.sub("", first["msg"])
    return InputError(place, shown(typed), allowed)


def located(error: InputError, place: str) -> InputError:
    """The error with its place in the file, such as ``"reactions 'A -> B'"``.

    What the classes say of themselves, for scripts, is said by the place already: it is left out.
    """
    if not place or isinstance(error, MissingExtra):
        return error
    key, item = error.key, re.search(r"^(\w+) '(.*)'$", place)
    if item and error.value == item[2] and item[1].startswith(key):
        return InputError(item[1], error.value, error.allowed)
    if item:
        kind, name = item[1].removesuffix("s"), re.escape(item[2])
        key = re.sub(rf" (?:of|in)(?: {kind}\w*)? '?{name}'?(?= in |$)", "", key)
    return InputError(f"{key} in {place}", error.value, error.allowed)


def shown(value: Any) -> Any:
    """A value as messages show it: quantities with their unit, nothing longer than a line."""
    if hasattr(value, "dimensionality"):
        value = f"{value:~}"
    text = repr(value)
    return value if len(text) <= 100 else text[:97] + "..."


def kinds(union: Any) -> list[str]:
    """The values of ``type`` of the tables of a discriminated union."""
    tables = get_args(get_args(union)[0])
    return [kind for table in tables for kind in get_args(table.model_fields["type"].annotation)]


def _tags(context: Mapping[str, Any]) -> list[str]:
    """The kinds that there are, from a list such as ``'A', 'B'``."""
    return [tag.strip().strip("'") for tag in str(context["expected_tags"]).split(",")]


def _place(location: Sequence[Any], data: Any, lacks_last: bool) -> str:
    """Where in the file it is; what pydantic adds (kinds, names of validators) is left out."""
    words: list[str] = []
    for k, part in enumerate(location):
        last = lacks_last and k == len(location) - 1
        if isinstance(part, int) and isinstance(data, Sequence) and part < len(data):
            data = data[part]
            name = data.get("name", data.get("equation")) if isinstance(data, Mapping) else None
            item = f"'{name}'" if isinstance(name, str) else f"#{part + 1}"
            words.append(item)
        elif isinstance(data, Mapping) and part in data:
            data = data[part]
            words.append(str(part))
        elif isinstance(data, Mapping) and last:
            words.append(str(part))
            data = None
    return ".".join(words).replace(".#", " #").replace(".'", " '")
