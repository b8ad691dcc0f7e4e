"""What the user wrote, for messages: the key's place in the file and the value as it was typed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from particell.casefile.constants import Constants
from particell.casefile.formula import is_formula
from particell.errors import InputError
from particell.units import quantity


def as_typed(error: InputError, given: Mapping[str, Any]) -> InputError:
    """The error with the key and the value that a file has, where it is one of its numbers.

    Parameters
    ----------
    error
        Of what the file describes, in SI units.
    given
        The file's tables, as they stand in it.
    """
    wanted = numbers_of(error.value)
    if wanted is None:
        return error
    key = error.key.split(" ")[0].rsplit(".", 1)[-1]
    constants = given.get("constants", {})
    found = [
        (place, typed)
        for place, typed in _leaves(given)
        if place.rsplit(".", 1)[-1] == key and _same(_value(typed, constants), wanted)
    ]
    if not found:
        return error
    place, typed = found[0]
    alone = error.key == key and len({p for p, _ in found}) == 1
    return InputError(place if alone else error.key, typed, error.allowed)


def typed_at(location: Sequence[Any], given: Any, otherwise: Any) -> Any:
    """What stands at a place of a file; names of validators within it are passed over."""
    for part in location:
        listed = isinstance(given, list | tuple) and isinstance(part, int) and part < len(given)
        if listed or (isinstance(given, Mapping) and part in given):
            given = given[part]
    # of a formula what came of it tells more
    plain = isinstance(given, str | int | float) and not is_formula(given)
    return given if plain else otherwise


def numbers_of(value: Any) -> list[float] | None:
    """A number, or a list of numbers, as floats; None for all else."""
    if isinstance(value, bool | str) or value is None:
        return None
    many = value if isinstance(value, list | tuple) else [value]
    try:
        return [float(one) for one in many]
    except (TypeError, ValueError, OverflowError):
        return None


def _leaves(given: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Numbers, texts and lists of them with their keys' places."""
    if isinstance(given, Mapping):
        for key, value in given.items():
            yield from _leaves(value, f"{place}.{key}".lstrip("."))
    elif isinstance(given, list | tuple):
        if given and not any(isinstance(one, Mapping) for one in given):
            yield place, given
        else:
            for k, one in enumerate(given):
                name = one.get("name") if isinstance(one, Mapping) else None
                item = f" '{name}'" if isinstance(name, str) else f" #{k + 1}"
                yield from _leaves(one, place + item)
    else:
        yield place, given


def _value(typed: Any, constants: Mapping[str, Any]) -> list[float]:
    """What was typed in SI units; NaN where it is no number."""
    many = typed if isinstance(typed, list | tuple) else [typed]
    return [_number(one, constants) for one in many]


def _number(typed: Any, constants: Mapping[str, Any]) -> float:
    try:
        if is_formula(typed):
            typed = Constants(constants).replace(typed)
            return float(typed.to_base_units().magnitude)
        if isinstance(typed, str):
            return float(quantity(typed).magnitude)
        return float(typed)
    except (InputError, ValueError, TypeError, AttributeError, OverflowError):
        return math.nan


def _same(one: list[float], other: list[float]) -> bool:
    return len(one) == len(other) and all(
        math.isclose(a, b, rel_tol=1e-9) for a, b in zip(one, other, strict=True)
    )
