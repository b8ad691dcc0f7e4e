"""The gallery: every built-in case, by name.

The table names modules without importing them, so that listing the cases takes no time. A new
case is a module with a :class:`~particell.cases.base.Case` and one line here.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from particell.errors import InputError, unknown_name

if TYPE_CHECKING:
    from particell.cases.base import Case

# name: (module and class, what it is in one line)
CASES: dict[str, tuple[str, str]] = {
    "annihilation-1d": (
        "particell.cases.annihilation_1d:Annihilation1D",
        "Two species that meet and annihilate, with concentrations and with molecules",
    ),
    "birth-death": (
        "particell.cases.birth_death:BirthDeath",
        "Molecules that come out of nothing and die: Poisson numbers",
    ),
    "couette": (
        "particell.cases.couette:Couette",
        "Flow between two plates of which one moves",
    ),
    "diffusion-1d": (
        "particell.cases.diffusion_1d:Diffusion1D",
        "Diffusion across a slab, with concentrations and with molecules",
    ),
    "diffusion-2d": (
        "particell.cases.diffusion_2d:Diffusion2D",
        "Diffusion in a plate, with concentrations and with molecules",
    ),
    "drag-array": (
        "particell.cases.drag_array:DragArray",
        "Slow flow through an array of cylinders or spheres, or through a square duct",
    ),
    "effective-diffusivity": (
        "particell.cases.effective_diffusivity:EffectiveDiffusivity",
        "The diffusivity that a Fourier mode decays with, on any arrangement of particles",
    ),
    "equilibrium-2d": (
        "particell.cases.equilibrium:Equilibrium2D",
        "A fluctuating fluid at rest in two dimensions: temperature, Maxwell, density",
    ),
    "equilibrium-3d": (
        "particell.cases.equilibrium:Equilibrium3D",
        "A fluctuating fluid at rest in three dimensions: temperature, Maxwell, density",
    ),
    "isomerisation": (
        "particell.cases.isomerisation:Isomerisation",
        "A <-> B with equal rates under fast diffusion: half and half",
    ),
    "lid-driven-cavity": (
        "particell.cases.lid_driven_cavity:LidDrivenCavity",
        "Flow in a square cavity whose lid slides",
    ),
    "min-oscillation": (
        "particell.cases.min_oscillation:MinOscillation",
        "MinD and MinE oscillating from pole to pole of a bacterium, molecule by molecule",
    ),
    "natural-convection": (
        "particell.cases.natural_convection:NaturalConvection",
        "Natural convection around a cylinder in a square cavity, driven by a solute",
    ),
    "poiseuille": (
        "particell.cases.poiseuille:Poiseuille",
        "Flow between two plates, driven by a body force",
    ),
    "rotating-cylinder": (
        "particell.cases.rotating_cylinder:RotatingCylinder",
        "Flow between two cylinders of which one turns",
    ),
    "taylor-green": (
        "particell.cases.taylor_green:TaylorGreen",
        "Taylor–Green vortices decaying in a periodic square",
    ),
    "thermal-modes": (
        "particell.cases.thermal_modes:ThermalModes",
        "A fluctuating fluid at rest: pressure, compressibility, viscosity, sound",
    ),
    "turing": (
        "particell.cases.turing:Turing",
        "A Turing pattern of Schnakenberg's kinetics, with concentrations and with molecules",
    ),
    "yeast-channel": (
        "particell.cases.yeast_channel:YeastChannel",
        "Reactive flow past a yeast cell, with concentrations and with molecules",
    ),
}


#: What a whole simulation in TOML is a case of.
CASE_FILE = "particell.casefile.case:FileCase"


def names() -> list[str]:
    """Names of all built-in cases."""
    return list(CASES)


def title(name: str) -> str:
    """What a case is, in one line."""
    return _entry(name)[1]


def load(name: str) -> type[Case]:
    """The class of a case.

    Raises
    ------
    InputError
        Where there is no such case.
    """
    return _import(_entry(name)[0])


def recorded(name: str, reference: str | None, given: type[Case] | str | None = None) -> type[Case]:
    """The class of the case that a run's directory names.

    A directory is data, perhaps a stranger's: of what it names only the program's own cases are
    imported.

    Parameters
    ----------
    name, reference
        What the directory holds: the case's name, and ``"module:Class"`` or None.
    given
        The class itself, or its ``"module:Class"`` as the user has typed it, for a case that is
        not one of the program's.

    Raises
    ------
    InputError
        Where the directory names a case that is neither built in nor given.
    """
    if given is not None:
        kind = given_class(given) if isinstance(given, str) else given
        if getattr(kind, "name", None) != name:
            raise InputError("case", given, f"the case that the directory was made with, '{name}'")
        return kind
    if reference == CASE_FILE:
        return _import(CASE_FILE)
    if reference is None or (name in CASES and reference == CASES[name][0]):
        return load(name)
    allowed = "a built-in case; if you trust the directory, name the class: --case MODULE:CLASS"
    raise InputError(f"class of the case '{name}'", reference, allowed)


def given_class(reference: str) -> type[Case]:
    """The class of a case that the user names as ``"module:Class"``.

    Raises
    ------
    InputError
        Where it cannot be imported or is no case.
    """
    from particell.cases.base import Case

    try:
        kind = _import(reference)
    except Exception as error:  # a module that runs may raise anything
        allowed = f"MODULE:CLASS that can be imported ({type(error).__name__}: {error})"
        raise InputError("--case", reference, allowed) from None
    if not (isinstance(kind, type) and issubclass(kind, Case)):
        raise InputError("--case", reference, "MODULE:CLASS of a particell.cases.base.Case")
    return kind


def _import(reference: str) -> type[Case]:
    module, _, attribute = reference.partition(":")
    return getattr(importlib.import_module(module), attribute)


def _entry(name: str) -> tuple[str, str]:
    if name not in CASES:
        raise unknown_name("case", name, CASES)
    return CASES[name]
