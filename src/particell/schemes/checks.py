"""Checks of input that schemes share."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields
from typing import Any

from particell.errors import InputError
from particell.kernels import kernel_code


def check_described(scheme: Any) -> None:
    """Refuse a derived scheme whose values are not its own: it lacks a decorator or an annotation.

    Python would take the values of the scheme that it is derived from, without a word.
    """
    known = {field.name for field in fields(scheme)}
    for kind in type(scheme).__mro__:
        annotated = vars(kind).get("__annotations__", {})
        for name in known & set(vars(kind)):
            if "__dataclass_fields__" not in vars(kind) or name not in annotated:
                allowed = f"'{name}: TYPE = VALUE' below @dataclass(frozen=True)"
                raise InputError(f"{name} of {kind.__name__}", vars(kind)[name], allowed)


def check_kernel(kernel: str, support: float) -> None:
    """Refuse an unknown kernel, and a support that holds too few or too many neighbours."""
    kernel_code(kernel)
    if not 1.2 <= support <= 10:
        raise InputError("support", support, "between 1.2 and 10 particle spacings")


def check_choice(name: str, value: str, allowed: Collection[str]) -> None:
    """Refuse what is none of the names ``allowed``."""
    if value not in allowed:
        raise InputError(name, value, f"one of {', '.join(allowed)}")
