"""Arguments of public functions and classes, checked against their annotations.

:func:`checked` refuses misspelt names, numbers that are none or not finite, and things of another
kind, in one line each; what is allowed beyond that (signs, ranges) each function says itself. As it
reads annotations, a new parameter is checked as soon as it has one.
"""

from __future__ import annotations

import functools
import inspect
import math
import types
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Real
from typing import Any, TypeVar, Union, get_args, get_origin

import numpy as np

from particell.errors import InputError, unknown_name

_T = TypeVar("_T", bound=Callable[..., Any])

NUMBER = "a finite number, in SI units"
#: Lists and tables of more are arrays, as which they are read anyway.
SHORT = 100


def checked(target: _T) -> _T:
    """Check the arguments of a function, or of a class's constructor, at every call.

    Numbers of other kinds are made Python's before: see :func:`plain`.

    Raises
    ------
    InputError
        From the call: for names that are no parameters (with the nearest right one), missing
        ones, and values that do not fit their annotation. An annotation ``float`` means a finite
        number; ``np.ndarray`` anything that can be made an array of numbers, finite or not.
    """
    if isinstance(target, type):
        constructor = _checking(target.__init__, target.__name__)  # type: ignore[misc]
        target.__init__ = constructor  # type: ignore[misc]
        return target
    return _checking(target, target.__name__)


def _checking(function: Callable[..., Any], name: str) -> Any:
    signature = inspect.signature(function)
    parameters = [p for p in signature.parameters if p != "self"]

    @functools.wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        for key in options:
            if key not in parameters:
                raise unknown_name(f"argument of {name}", key, parameters)
        bound = signature.bind_partial(*args, **options)
        given = bound.arguments
        for key, parameter in signature.parameters.items():
            if key in given:
                given[key] = plain(given[key])
                fault = _fault(_hint(function, key), given[key])
                if fault and given[key] is not parameter.default:
                    raise InputError(key, given[key], fault)
            elif parameter.default is inspect.Parameter.empty:
                raise InputError(key, None, f"given, to {name}")
        return function(*bound.args, **bound.kwargs)

    return call


@functools.cache
def _hint(function: Callable[..., Any], key: str) -> Any:
    """The annotation of a parameter; ``Any`` where there is none or its names are unknown here."""
    text = function.__annotations__.get(key, Any)
    try:
        return eval(text, function.__globals__) if isinstance(text, str) else text
    except NameError:  # imported for type checkers only
        return Any


def _fault(hint: Any, value: Any) -> str:
    """What is allowed, as a phrase; empty where the value is."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return _none_of(arguments, value)
    if origin is not None:
        return _fault_of_many(origin, arguments, value)
    if hint is Any or getattr(hint, "_is_protocol", False):
        return ""
    if hint in _SIMPLE:
        good, phrase = _SIMPLE[hint]
        return "" if good(value) else phrase
    if isinstance(hint, type):
        name = hint.__name__
        return "" if isinstance(value, hint) else f"a{'n' * (name[0] in 'AEIO')} {name}"
    return ""


def _none_of(hints: Sequence[Any], value: Any) -> str:
    faults = [_fault(hint, value) for hint in hints]
    return "" if "" in faults else ", or ".join(dict.fromkeys(faults))


def _fault_of_many(origin: Any, arguments: tuple[Any, ...], value: Any) -> str:
    """As :func:`_fault`, of functions, tables and lists."""
    if origin is Callable or origin is type:
        return "" if callable(value) else "a function"
    if issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            return "a table"
        faults = [_fault(arguments[1], item) for item in value.values()]
        return next((f"a table, each value {fault}" for fault in faults if fault), "")
    many = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes)
    if origin is tuple and arguments[-1] is not Ellipsis:
        if not many or len(value) != len(arguments):
            return f"{len(arguments)} values"
        faults = [_fault(hint, item) for hint, item in zip(arguments, value, strict=True)]
    else:
        faults = [_fault(arguments[0], item) for item in value] if many else [""]
        if not many:
            return f"a list, each item {_fault(arguments[0], object()) or 'of any kind'}"
    return next((f"a list, each item {fault}" for fault in faults if fault), "")


def takes(key: str, function: Any, given: str) -> None:
    """Refuse a function that cannot be called with the arguments named, as :func:`positive` does.

    Parameters
    ----------
    key, function
        Its name in messages, and itself.
    given
        What it is called with, as ``"state"`` or ``"x, y, t"``.
    """
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # of functions that do not tell
        return
    try:
        signature.bind(*given.split(", "))
    except TypeError as error:
        allowed = f"a function that is called with ({given})"
        raise InputError(key, f"{function!r}: {error}", allowed) from None


def plain(value: Any) -> Any:
    """Numbers of other kinds as Python's, alone or in short lists and tables.

    Those are NumPy's scalars of any size and arrays without axes, fractions and decimals: what
    comes out of arrays, tables and exact arithmetic then gives the same bits. Everything else is
    returned as it is.
    """
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        number = {"f": float, "i": int, "u": int, "b": bool, "U": str}.get(value.dtype.kind)
        return number(value[()]) if number else value  # type: ignore[index]
    if isinstance(value, Fraction | Decimal):
        try:
            return float(value)
        except (OverflowError, ValueError):  # beyond all floats, or a signalling NaN
            return value
    if type(value) in (list, tuple) and len(value) <= SHORT:
        items = [plain(item) for item in value]
        changed = any(a is not b for a, b in zip(items, value, strict=True))
        return type(value)(items) if changed else value
    if type(value) is dict and len(value) <= SHORT:
        table = {key: plain(item) for key, item in value.items()}
        return table if any(table[key] is not value[key] for key in value) else value
    return value


def is_number(value: Any) -> bool:
    """Whether a value is a finite real number (no text, no truth value)."""
    value = plain(value)
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _is_array(value: Any) -> bool:
    if isinstance(value, str | bytes):
        return False
    try:
        return np.asarray(value, dtype=float).dtype.kind == "f" and value is not None
    except (TypeError, ValueError, OverflowError):
        return False


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


_SIMPLE: dict[Any, tuple[Callable[[Any], bool], str]] = {
    float: (is_number, NUMBER),
    int: (_is_whole, "a whole number"),
    bool: (lambda value: isinstance(value, bool | np.bool_), "True or False"),
    str: (lambda value: isinstance(value, str), "text"),
    type(None): (lambda value: value is None, "None"),
    None: (lambda value: value is None, "None"),
    np.ndarray: (_is_array, "an array of numbers"),
}


def positive(key: str, value: Any) -> None:
    """Refuse a number that is not above zero.

    Raises
    ------
    InputError
        Naming ``key``.
    """
    if not (is_number(value) and value > 0):
        raise InputError(key, value, "a positive number")


def not_negative(key: str, value: Any) -> None:
    """Refuse a number below zero, as :func:`positive` does."""
    if not (is_number(value) and value >= 0):
        raise InputError(key, value, "zero or a positive number")


def finite(key: str, values: Any) -> np.ndarray:
    """Numbers as a new array of floats; refuses what is not finite, as :func:`positive` does."""
    array = np.array(values, dtype=float)
    if not np.all(np.isfinite(array)):
        raise InputError(key, values, "finite numbers")
    return array
