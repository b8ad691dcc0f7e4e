"""Rows of a validation: which cases, with which parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from particell import cases
from particell.cases.base import Case

#: Named groups of cases; a case that this version does not have is left out.
GROUPS = {
    "sdpd-ssa": (
        "diffusion-1d",
        "diffusion-2d",
        "annihilation-1d",
        "natural-convection",
        "yeast-channel",
        "equilibrium-2d",
        "equilibrium-3d",
        "thermal-modes",
        "effective-diffusivity",
        "drag-array",
        "taylor-green",
    ),
    "stochastic": ("birth-death", "isomerisation", "turing", "min-oscillation"),
    "transport-velocity": (
        "poiseuille",
        "couette",
        "lid-driven-cavity",
        "rotating-cylinder",
        "drag-array",
        "taylor-green",
        "natural-convection",
    ),
}
#: What a group wants of cases that have such parameters: other rows of these are left out.
GROUP_PARAMETERS: dict[str, Mapping[str, Any]] = {
    "sdpd-ssa": {"scheme": "sdpd"},
    "transport-velocity": {"scheme": "transport-velocity"},
}


@dataclass(frozen=True)
class Row:
    """One run of the validation.

    Attributes
    ----------
    kind
        The case.
    parameters
        Those that are not the default.
    """

    kind: type[Case]
    parameters: Mapping[str, Any]

    @property
    def settings(self) -> str:
        """The parameters as text, ``key=value`` separated by spaces."""
        return " ".join(f"{key}={toml(value)}" for key, value in self.parameters.items())

    @property
    def slug(self) -> str:
        """Name of the row's directory and of its figures."""
        return self.settings.replace(" ", "_").replace("=", "-").replace('"', "") or "default"

    @property
    def command(self) -> str:
        """The command that makes the same run."""
        settings = "".join(f" --set {part}" for part in self.settings.split())
        return f"particell run {self.kind.name}{settings}"


def toml(value: Any) -> str:
    """A parameter as it is written on the command line."""
    return str(value).lower() if isinstance(value, bool) else f"{value}"


def select(names: Sequence[str], full: bool) -> list[Row]:
    """The rows of cases and groups (default: every case once).

    Raises
    ------
    InputError
        Where a name is neither a case nor a group.
    """
    found: list[Row] = []
    for name in names or cases.names():
        wanted = GROUP_PARAMETERS.get(name, {})
        known = [n for n in GROUPS.get(name, ()) if n in cases.CASES] or [name]
        for kind in map(cases.load, known):
            rows = [Row(kind, parameters) for parameters in sizes(kind, full, wanted)]
            found += [row for row in rows if row not in found]
    # the rows of a case one after another, for the page
    kinds = list(dict.fromkeys(row.kind for row in found))
    return sorted(found, key=lambda row: kinds.index(row.kind))


def sizes(kind: type[Case], full: bool, wanted: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Parameters of a case's rows, the default ones or those of the papers, with those wanted."""
    defaults = {k: info.get_default() for k, info in kind.model_fields.items()}
    wanted = {k: v for k, v in wanted.items() if k in defaults}
    if not full:
        return [{k: v for k, v in wanted.items() if defaults[k] != v}]
    given = [kind.full] if isinstance(kind.full, Mapping) else list(kind.full)
    return [row for row in given if all({**defaults, **row}[k] == v for k, v in wanted.items())]
