"""Particles at rest: for reaction and diffusion without flow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from particell.checks import checked
from particell.errors import InputError
from particell.fields import Field
from particell.laws.law import Law
from particell.operations.operation import When
from particell.schemes.checks import check_kernel
from particell.schemes.solver import Stage
from particell.schemes.stages import At, BuildList


@checked
@dataclass(frozen=True)
class Static:
    """No flow: particles keep their places and densities.

    Parameters
    ----------
    kernel, support
        As for :class:`~particell.schemes.sdpd.SDPD`; they serve the species' diffusion.
    """

    kernel: str = "lucy"
    support: float = 2.0
    skin: float = 1e-9
    density: str = "continuity"
    fluctuations: bool = False
    gravity: None = None

    at_rest: ClassVar[bool] = True
    impenetrable: ClassVar[bool] = False
    species_flux: ClassVar[bool] = False
    fields: ClassVar[tuple[Field, ...]] = ()
    more: ClassVar[tuple[Law, ...]] = ()

    def __post_init__(self) -> None:
        check_kernel(self.kernel, self.support)
        if not 0 < self.skin <= 1:
            raise InputError("skin", self.skin, "between 0 and 1 supports")

    def first_stages(self) -> list[Stage]:
        """The neighbour list."""
        return [BuildList(), At(When.START), At(When.BEGUN)]

    def stages(self) -> list[Stage]:
        """Nothing moves."""
        return [At(When.END)]
