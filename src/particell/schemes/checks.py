"""Checks of input that schemes share."""

from __future__ import annotations

from collections.abc import Collection

from particell.errors import InputError
from particell.kernels import kernel_code


def check_kernel(kernel: str, support: float) -> None:
    """Refuse an unknown kernel, and a support that holds too few or too many neighbours."""
    kernel_code(kernel)
    if not 1.2 <= support <= 10:
        raise InputError("support", support, "between 1.2 and 10 particle spacings")


def check_choice(name: str, value: str, allowed: Collection[str]) -> None:
    """Refuse what is none of the names ``allowed``."""
    if value not in allowed:
        raise InputError(name, value, f"one of {', '.join(allowed)}")
