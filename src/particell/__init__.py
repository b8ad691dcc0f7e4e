"""Particell: particle-based multiphysics for cells and other mesoscale systems.

Everything a script needs is here, loaded when it is first used:

>>> import particell as pc
>>> box = pc.Domain(lower=(0, 0), upper=(1e-4, 1e-4), periodic="xy")
"""

from __future__ import annotations

import difflib
import importlib
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

try:
    __version__ = version("particell")
except PackageNotFoundError:  # a source tree that is not installed
    __version__ = "0+unknown"

if TYPE_CHECKING:
    from particell.averages import TimeAverage
    from particell.boundaries.mean_velocity import MeanVelocity
    from particell.boundaries.mirror import Mirror
    from particell.boundaries.moving import WallMotion
    from particell.boundaries.reflection import Reflection
    from particell.boundaries.sponge import Sponge
    from particell.chemistry.reactions import Reaction
    from particell.chemistry.reservoirs import FixedValueWall, FluxWall, Reservoir
    from particell.chemistry.sbml import SBMLModel, read_sbml
    from particell.chemistry.species import Species
    from particell.compute.device import Device
    from particell.compute.loop import particle_loop
    from particell.ensemble import Ensemble, EnsembleInterrupted, EnsembleRun
    from particell.equilibrated import equilibrated
    from particell.errors import InputError, Interrupted, LawWarning, RunError
    from particell.fields import Field
    from particell.geometry.domain import Domain
    from particell.geometry.fill import jittered, lattice, packed, rings, shells
    from particell.geometry.shapes import Ball, Box, Circle, HalfSpace, Sphere
    from particell.laws.body_force import BodyForce
    from particell.laws.buoyancy import Buoyancy
    from particell.laws.law import Law
    from particell.materials import Fluid
    from particell.observers import SteadyState
    from particell.operations.every import Every
    from particell.operations.operation import Operation, When
    from particell.output.export import export_vtkhdf
    from particell.output.export_h5md import export_h5md
    from particell.output.run import Run
    from particell.phases import Phase, box_walls, channel_walls, fluid
    from particell.schemes.sdpd import SDPD
    from particell.schemes.static import Static
    from particell.schemes.transport_velocity import TransportVelocity
    from particell.simulation import Simulation
    from particell.state import State

_HOME = {
    "Ball": "geometry.shapes",
    "BodyForce": "laws.body_force",
    "Box": "geometry.shapes",
    "Buoyancy": "laws.buoyancy",
    "Circle": "geometry.shapes",
    "Device": "compute.device",
    "Domain": "geometry.domain",
    "Ensemble": "ensemble",
    "EnsembleInterrupted": "ensemble",
    "EnsembleRun": "ensemble",
    "Every": "operations.every",
    "Field": "fields",
    "FixedValueWall": "chemistry.reservoirs",
    "FluxWall": "chemistry.reservoirs",
    "Fluid": "materials",
    "HalfSpace": "geometry.shapes",
    "InputError": "errors",
    "Interrupted": "errors",
    "Law": "laws.law",
    "LawWarning": "errors",
    "Operation": "operations.operation",
    "Phase": "phases",
    "Reaction": "chemistry.reactions",
    "Mirror": "boundaries.mirror",
    "Reflection": "boundaries.reflection",
    "WallMotion": "boundaries.moving",
    "When": "operations.operation",
    "Reservoir": "chemistry.reservoirs",
    "Run": "output.run",
    "RunError": "errors",
    "SBMLModel": "chemistry.sbml",
    "SDPD": "schemes.sdpd",
    "Simulation": "simulation",
    "Species": "chemistry.species",
    "Sphere": "geometry.shapes",
    "MeanVelocity": "boundaries.mean_velocity",
    "Sponge": "boundaries.sponge",
    "State": "state",
    "Static": "schemes.static",
    "SteadyState": "observers",
    "TimeAverage": "averages",
    "TransportVelocity": "schemes.transport_velocity",
    "box_walls": "phases",
    "channel_walls": "phases",
    "equilibrated": "equilibrated",
    "export_h5md": "output.export_h5md",
    "export_vtkhdf": "output.export",
    "fluid": "phases",
    "jittered": "geometry.fill",
    "lattice": "geometry.fill",
    "packed": "geometry.fill",
    "particle_loop": "compute.loop",
    "read_sbml": "chemistry.sbml",
    "rings": "geometry.fill",
    "shells": "geometry.fill",
}

__all__ = [
    "SDPD",
    "Ball",
    "BodyForce",
    "Box",
    "Buoyancy",
    "Circle",
    "Device",
    "Domain",
    "Ensemble",
    "EnsembleInterrupted",
    "EnsembleRun",
    "Every",
    "Field",
    "FixedValueWall",
    "Fluid",
    "FluxWall",
    "HalfSpace",
    "InputError",
    "Interrupted",
    "Law",
    "LawWarning",
    "MeanVelocity",
    "Mirror",
    "Operation",
    "Phase",
    "Reaction",
    "Reflection",
    "Reservoir",
    "Run",
    "RunError",
    "SBMLModel",
    "Simulation",
    "Species",
    "Sphere",
    "Sponge",
    "State",
    "Static",
    "SteadyState",
    "TimeAverage",
    "TransportVelocity",
    "WallMotion",
    "When",
    "box_walls",
    "channel_walls",
    "equilibrated",
    "export_h5md",
    "export_vtkhdf",
    "fluid",
    "jittered",
    "lattice",
    "packed",
    "particle_loop",
    "read_sbml",
    "rings",
    "shells",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        near = difflib.get_close_matches(name, __all__, n=1)
        hint = f" (did you mean '{near[0]}'?)" if near else ""
        raise AttributeError(f"module 'particell' has no attribute '{name}'{hint}")
    return getattr(importlib.import_module(f"particell.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
