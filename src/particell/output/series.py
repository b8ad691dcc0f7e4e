"""Which observables share a panel."""

from __future__ import annotations

from collections.abc import Sequence

from particell.errors import InputError, unknown_name
from particell.plots.style import label
from particell.units import observable_unit

#: Kinds of observables of which there are several.
KINDS = ("amount", "inflow", "momentum")


def panels_of(
    names: Sequence[str], known: Sequence[str], fields: Sequence[str]
) -> list[tuple[str, dict[str, str]]]:
    """Labels of the panels, and for each the observables with their names in its legend.

    Observables of the same kind and unit share a panel.

    Parameters
    ----------
    names
        The observables; none means all.
    known, fields
        The observables and fields of the run.

    Raises
    ------
    InputError
        For an unknown name, and where nothing was recorded.
    """
    for name in names:
        if name not in known:
            raise unknown_name("observable", name, known)
    panels: dict[str, dict[str, str]] = {}
    for name in names or known:
        kind, _, member = name.partition("_")
        shared = kind in KINDS and bool(member)
        words = kind if shared else name.replace("_", " ")
        text = label(words, observable_unit(name, fields))
        panels.setdefault(text, {})[name] = member if shared else words
    if not panels:
        raise InputError("observables", [], "at least one that was recorded")
    return list(panels.items())
