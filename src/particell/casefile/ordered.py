"""The order in which things that need each other by name are made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter

from particell.errors import InputError


def resolve_all(what: str, needs: Mapping[str, Iterable[str]]) -> list[str]:
    """All names, each after those that it needs.

    Raises
    ------
    InputError
        Where one needs itself.
    """
    try:
        return list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        cycle = " -> ".join(str(name) for name in error.args[1])
        raise InputError(what, cycle, "described without themselves") from None
