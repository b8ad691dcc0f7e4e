"""What every law claims of itself, and all laws that there are.

A law that is in the program, in docs/ or in examples/ and not in :data:`CLAIMS` fails the tests.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from particell.laws import Law
from particell.laws.continuity import HeadOfRest
from particell.laws.fluctuations import ThermalNoise
from particell.laws.viscosity import Viscosity

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src"

#: What else laws of the documentation read.
FIELDS = {"temperature": "K"}


@dataclass(frozen=True)
class Claim:
    """What a law is said to be; each of it is tested, and so is that it is no more.

    Attributes
    ----------
    make
        The law, from its class.
    units
        What it adds, and the unit of that in three dimensions.
    exchanged
        What one particle gains the other one loses, by name: multiplied by the ``"mass"``, the
        ``"volume"``, or as it is (``""``).
    galilean
        The same for particles that all move faster by one velocity.
    anywhere
        The same for particles that all stand elsewhere.
    numbers
        Units of the law's own numbers.
    repels
        What is exchanged is so where conditions hold (the first value of each ``where``).
    balance
        For forces that depend on velocity: the noise that balances them, or why there is none.
    dims
        Dimensions in which it can be.
    """

    make: Callable[[type[Law]], Law]
    units: Mapping[str, str]
    exchanged: Mapping[str, str] = field(default_factory=dict)
    galilean: bool = True
    anywhere: bool = True
    numbers: Mapping[str, str] = field(default_factory=dict)
    repels: bool = False
    balance: Law | str = ""
    dims: tuple[int, ...] = (1, 2, 3)


FORCE, RATE = {"a": "m/s^2"}, {"density_rate": "kg/m^3/s"}
MOMENTUM = {"a": "mass"}
HEAD = HeadOfRest((True, False), buoyancy=True)
PLAIN, RADIAL, NORMALISED = Viscosity(False), Viscosity(True), Viscosity(True, normalised=True)
HELD = {"a": "m/s^2", "wall_friction": "1/s"}
EXACT = "refused with noise: what is exact beside walls has no fluctuation"
CARRIED = "refused with noise: a flux of momentum by the shift, no friction"


def _plain(law: type[Law]) -> Law:
    return law()


#: By the name of the class.
CLAIMS: dict[str, list[Claim]] = {
    "PressureForce": [
        Claim(_plain, FORCE, MOMENTUM),
        Claim(lambda law: law(contrast=True), FORCE, MOMENTUM),
        Claim(lambda law: law("difference"), FORCE),
        Claim(lambda law: law("switched"), FORCE, MOMENTUM, repels=True),
    ],
    "Viscosity": [
        Claim(lambda law: PLAIN, FORCE, MOMENTUM, balance=ThermalNoise(PLAIN)),
        Claim(lambda law: RADIAL, FORCE, MOMENTUM, balance=ThermalNoise(RADIAL)),
        Claim(lambda law: NORMALISED, FORCE, MOMENTUM, balance=ThermalNoise(NORMALISED)),
        Claim(
            lambda law: law(True, walls=True),
            HELD,
            MOMENTUM,
            balance=ThermalNoise(RADIAL, gaussian=True),
        ),
        Claim(lambda law: law(True, exact_at_walls=True, walls=True), HELD, balance=EXACT),
    ],
    "ThermalNoise": [
        Claim(lambda law: law(PLAIN), FORCE, MOMENTUM),
        Claim(lambda law: law(RADIAL), FORCE, MOMENTUM),
        Claim(lambda law: law(NORMALISED, gaussian=True), FORCE, MOMENTUM),
    ],
    "Continuity": [Claim(_plain, RATE)],
    "DensityDiffusion": [
        Claim(_plain, RATE, {"density_rate": "volume"}),
        Claim(lambda law: law(jumps=True), RATE, {"density_rate": "volume"}),
        Claim(lambda law: law(HEAD), RATE),
    ],
    "ConsistentContinuity": [Claim(_plain, RATE)],
    "TransportContinuity": [Claim(_plain, RATE)],
    "MomentumFlux": [
        Claim(lambda law: law("uniform"), {"flux": "m/s^2"}, balance=CARRIED),
        Claim(
            lambda law: law("conserving"),
            {"flux": "m/s^2"},
            {"flux": "mass"},
            galilean=False,
            balance=CARRIED,
        ),
        Claim(lambda law: law("none"), {"flux": ""}, {"flux": "mass"}),
    ],
    "Crowding": [Claim(_plain, {"shift": "m^2"}, {"shift": ""})],
    "PairShifts": [Claim(_plain, {"own_shift": "m^3/s", "its_shift": "m^3/s"})],
    "PairSlope": [Claim(_plain, {"exchange": "1/m^5"})],
    "KernelSum": [Claim(_plain, {"kernel_sum": ""})],
    "SummedDensity": [
        Claim(_plain, {"density": "kg/m^3"}),
        Claim(lambda law: law(contrast=True), {"density": "kg/m^3"}),
    ],
    "DensityFilter": [
        Claim(lambda law: law(False), {"density_half": "kg/m^3"}),
        Claim(lambda law: law(True, HEAD), {"density_half": "kg/m^3"}),
    ],
    "WallPressure": [
        Claim(
            lambda law, moving=moving: law(moving, buoyancy=moving),
            {"pressure": "Pa", "pressure_term": "Pa/(kg/m^3)^2"},
        )
        for moving in (False, True)
    ],
    "WallMeasure": [
        Claim(_plain, {"wall_fraction": "", "wall_distance": "m", "wall_direction": ""})
    ],
    "BodyForce": [
        Claim(
            lambda law: law(lambda *given: [x / (given[-1] * given[-1]) for x in given[:-1]]),
            FORCE,
            anywhere=False,
        )
    ],
    "Weight": [Claim(_plain, FORCE), Claim(lambda law: law(buoyancy=True), FORCE)],
    # docs/
    "Cohesion": [Claim(lambda law: law(1.5), FORCE, MOMENTUM, numbers={"strength": "N/m^6"})],
    "Inwards": [Claim(lambda law: law(1.5), FORCE, anywhere=False, numbers={"strength": "1/s^2"})],
    "Pulse": [
        Claim(
            lambda law: law(0.3, 0.7),
            FORCE,
            numbers={"amplitude": "N/m^3", "frequency": "1/s"},
            dims=(2,),
        )
    ],
    "Rolls": [
        Claim(
            lambda law: law(0.3, 5.0),
            FORCE,
            anywhere=False,
            numbers={"amplitude": "m/s^2", "length": "m"},
            dims=(2,),
        )
    ],
    "Tabulated": [Claim(lambda law: law(1.5), FORCE, MOMENTUM, numbers={"strength": "N"})],
    "Spring": [Claim(lambda law: law(1.5), FORCE, MOMENTUM, numbers={"stiffness": "N/m^7"})],
    "Conduction": [
        Claim(
            lambda law: law(1.5),
            {"temperature_rate": "K/s"},
            {"temperature_rate": "volume"},
            numbers={"diffusivity": "m^2/s"},
        )
    ],
}
#: Laws in docs/ that are wrong on purpose.
WRONG = {"Misspelt"}


def _is_law(node: ast.AST, known: set[str]) -> bool:
    return isinstance(node, ast.ClassDef) and any(
        ast.unparse(base).split(".")[-1] in known for base in node.bases
    )


def _in_program() -> Iterator[type[Law]]:
    """Classes in the sources that derive from Law, or from one that does."""
    known, before = {"Law"}, 0
    places: dict[str, Path] = {}
    trees = {f: ast.parse(f.read_text(encoding="utf-8")) for f in sorted(SOURCE.rglob("*.py"))}
    while len(known) > before:
        before = len(known)
        for file, tree in trees.items():
            for node in ast.walk(tree):
                if _is_law(node, known):
                    known.add(node.name)
                    places[node.name] = file
    for name, file in places.items():
        parts = file.relative_to(SOURCE).with_suffix("").parts
        yield getattr(importlib.import_module(".".join(parts)), name)


def _names(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}


def _defined(node: ast.stmt) -> set[str]:
    """Names that a statement defines."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        return {(a.asname or a.name).split(".")[0] for a in node.names}
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else []
    return {name for target in targets for name in _names(target)}


def _on_page(text: str) -> Iterator[type[Law]]:
    """Laws of a script, with what they refer to and nothing else."""
    body = ast.parse(text).body
    laws = [node for node in body if _is_law(node, {"Law"})]
    needed = {node.name for node in laws}
    chosen: list[ast.stmt] = []
    for node in reversed(body):
        if _defined(node) & needed:
            chosen.insert(0, node)
            needed |= _names(node)
    scope: dict[str, Any] = {"__name__": "page"}
    module = ast.Module(body=[n for n in chosen if _defined(n)], type_ignores=[])
    exec(compile(module, "<page>", "exec"), scope)
    for node in laws:
        yield scope[node.name]


def _elsewhere() -> Iterator[type[Law]]:
    for page in sorted((ROOT / "docs").rglob("*.md")):
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        laws = [block for block in blocks if re.search(r"class \w+\((pc\.)?Law\)", block)]
        if laws:
            yield from _on_page("\n".join(blocks))
    for script in sorted((ROOT / "examples").glob("*.py")):
        yield from _on_page(script.read_text(encoding="utf-8"))


#: Laws of species sum along rows with kept weights; whole systems are compared by hand there.
ELSEWHERE = {
    "Carried": "tests/laws/test_species_flux.py",
    "CarrierWeights": "tests/chemistry/test_exchange.py",
    "Diffusion": "tests/chemistry/test_exchange.py",
    "FacingArea": "tests/chemistry/test_flux_walls.py",
    "JumpRates": "tests/chemistry/test_exchange.py",
}


def all_laws() -> dict[str, type[Law]]:
    """Every class of a law in the program, in docs/ and in examples/, by name."""
    found = {law.__name__: law for law in (*_in_program(), *_elsewhere())}
    return {name: law for name, law in found.items() if name not in WRONG}


LAWS = all_laws()
#: All laws with their claims, and a name for each.
EVERY = [(claim.make(LAWS[n]), claim) for n in LAWS for claim in CLAIMS.get(n, [])]
IDS = [f"{n}{k}" for n in LAWS for k in range(len(CLAIMS.get(n, [])))]
