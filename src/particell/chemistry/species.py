"""What diffuses and reacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from particell.checks import checked, is_number
from particell.errors import InputError
from particell.representation import block, brief


def group_names(key: str, only_in: str | Sequence[str] | None) -> tuple[str, ...] | None:
    """``only_in`` as a tuple of names (None: everywhere)."""
    if only_in is None:
        return None
    names = (only_in,) if isinstance(only_in, str) else tuple(only_in)
    if not names or not all(isinstance(name, str) and name for name in names):
        raise InputError(f"only_in of {key}", only_in, "the name of a group or a list of names")
    return names


def checked_rate(key: str, value: object) -> float:
    """A number that is finite and not negative."""
    if not is_number(value) or not value >= 0:  # type: ignore[operator]
        raise InputError(key, value, "a finite number >= 0")
    return float(value)  # type: ignore[arg-type]


@checked
@dataclass(frozen=True, repr=False)
class Species:
    """A chemical species, as a concentration or as whole numbers of molecules.

    Parameters
    ----------
    name
        Unique name; letters, digits and underscores, as it is written in reactions.
    diffusivity
        In m²/s: one number, or one for each group by name (a group that is not named has 0).
    molecules
        False: an amount in mol a particle, deterministic. True: a whole number of molecules a
        particle, diffusion and reactions sampled exactly (the reaction-diffusion master equation).
    only_in
        The group or groups that hold the species; it does not diffuse across to others. By
        default all groups of kind fluid. A group of kind wall (a membrane of fixed particles)
        holds the species only where it is named here or in ``diffusivity``.
    switch_above, switch_below
        For molecules: a particle with more than ``switch_above`` of them goes over to an amount
        that is diffused and reacts deterministically, and back to molecules where that is worth
        fewer than ``switch_below``; see :mod:`particell.chemistry.switching`. By default molecules
        stay molecules.

    Raises
    ------
    InputError
        For a name that cannot stand in a reaction, a negative diffusivity, and thresholds that
        leave no room between them.
    """

    name: str
    diffusivity: float | Mapping[str, float] = 0.0
    molecules: bool = False
    only_in: str | Sequence[str] | None = None
    switch_above: float | None = None
    switch_below: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise InputError("species name", self.name, "letters, digits and underscores")
        key = f"diffusivity of {self.name}"
        if isinstance(self.diffusivity, Mapping):
            table = {g: checked_rate(f"{key} in {g}", k) for g, k in self.diffusivity.items()}
            object.__setattr__(self, "diffusivity", table)
        else:
            object.__setattr__(self, "diffusivity", checked_rate(key, self.diffusivity))
        if not isinstance(self.molecules, bool):
            raise InputError(f"molecules of {self.name}", self.molecules, "True or False")
        object.__setattr__(self, "only_in", group_names(self.name, self.only_in))
        self._check_switch()

    def __repr__(self) -> str:
        return brief(self, unnamed=2)

    def _repr_html_(self) -> str:
        from particell.chemistry.listing import species_table

        return block(f"Species {self.name}", species_table([self]))

    @property
    def switches(self) -> bool:
        """Whether particles may hold the species as molecules or as an amount."""
        return self.switch_above is not None

    def _check_switch(self) -> None:
        above, below = self.switch_above, self.switch_below
        if above is None and below is None:
            return
        if above is None or below is None:
            raise InputError(f"switch of {self.name}", (above, below), "both thresholds")
        above = checked_rate(f"switch_above of {self.name}", above)
        below = checked_rate(f"switch_below of {self.name}", below)
        if not self.molecules:
            raise InputError(f"switch_above of {self.name}", above, "set with molecules=True only")
        if not 1 <= below < above:
            raise InputError(
                f"switch_below of {self.name}",
                below,
                f"at least 1 and below switch_above ({above:g})",
            )

    def is_in(self, group: str, kind: str) -> bool:
        """Whether a group (of kind ``"fluid"`` or ``"wall"``) holds the species."""
        if self.only_in is not None:
            return group in self.only_in
        if kind == "fluid":
            return True
        return isinstance(self.diffusivity, Mapping) and group in self.diffusivity

    def diffusivity_in(self, group: str) -> float:
        """Diffusivity in a group that holds the species, in m²/s."""
        if isinstance(self.diffusivity, Mapping):
            return self.diffusivity.get(group, 0.0)
        return self.diffusivity
