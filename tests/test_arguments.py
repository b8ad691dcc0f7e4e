"""Arguments of everything public: what is wrong is refused in one line, new parameters included.

The tests go by the signatures. A public name without an example here, or a parameter without one,
fails; and a new number has to refuse what is negative, zero or not finite, or to be listed.
"""

from __future__ import annotations

import inspect
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import particell as pc
from particell.cases import load as case_class
from particell.checks import checked
from particell.errors import LONGEST_VALUE, InputError, shown
from particell.geometry.fill import around, arranged
from particell.laws.shifting import Crowding
from particell.units import parse
from systems import unit_fluid

BOX = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
ROOM = pc.Domain((0, 0), (8, 8))
WATER = unit_fluid()
POINTS = np.array([[1.0, 1.0], [2.0, 2.0], [4.0, 4.0]])
BALL = pc.Circle((4.0, 4.0), 2.0)
FLOOR = pc.HalfSpace((0.0, 0.0), (0.0, 1.0))


def still(points):
    return 0.0 * points


FLOW = {"kernel": "lucy", "gravity": (0.0, 1.0), "reference_speed": 1.0, "pressure_drop": 1.0}
FILL = {"domain": BOX, "spacing": 1.0}
MADE = {**FILL, "material": WATER, "name": "a"}
#: Right arguments of everything that is public.
EXAMPLES = {
    pc.Ball: {"center": (0.0, 0.0), "radius": 1.0},
    pc.Box: {"lower": (0.0, 0.0), "upper": (1.0, 1.0)},
    pc.Buoyancy: {"species": "A", "expansion": 1.0, "gravity": (0.0, 1.0), "reference": 0.5},
    pc.Device: {"backend": "cpu", "precision": "float64", "form": "gather"},
    pc.Domain: {"lower": (0.0, 0.0), "upper": (1.0, 1.0), "periodic": "x", "depth": 1.0},
    pc.FixedValueWall: {"group": "wall", "values": {"A": 1.0}},
    pc.Fluid: {
        "density": 1.0,
        "viscosity": 1.0,
        "bulk_viscosity": 1.0,
        "temperature": 1.0,
        "sound_speed": 1.0,
        "exponent": 7.0,
        "background_pressure": 1.0,
    },
    pc.FluxWall: {"group": "w", "flux": {"A": 1.0}, "transfer": {"B": (1.0, 1.0)}, "area": 1.0},
    pc.HalfSpace: {"point": (0.0, 0.0), "normal": (0.0, 1.0)},
    pc.MeanVelocity: {"velocity": 1.0, "axis": 0},
    pc.Phase: {
        "name": "a",
        "material": WATER,
        "points": POINTS,
        "volume": 1.0,
        "kind": "wall",
        "velocity": (0.0, 1.0),
        "spacing": 1.0,
        "surface": BALL,
        "slides": True,
    },
    pc.Reaction: {
        "equation": "A -> B",
        "forward": 1.0,
        "backward": None,
        "only_in": "a",
        "units": "concentration",
        "rate_law": lambda C, k: k * C[0],
        "propensity": None,
        "reactants": None,
        "products": None,
    },
    pc.Mirror: {"body": FLOOR, "slip": False, "velocity": (1.0, 0.0)},
    pc.Reflection: {"body": BALL, "inside": True},
    pc.Reservoir: {"group": "a", "values": {"A": 1.0}},
    pc.SDPD: {
        **FLOW,
        "support": 3.0,
        "density": "continuity",
        "integrator": "velocity-verlet",
        "fluctuations": False,
        "noise": "bounded",
        "density_diffusion": 0.1,
        "shifting": 0.1,
        "skin": 0.1,
        "impenetrable": True,
        "more": [Crowding()],
        "fields": [pc.Field("T")],
    },
    pc.Simulation: {
        "domain": BOX,
        "phases": [pc.fluid(BOX, WATER, 1.0)],
        "scheme": pc.SDPD(),
        "species": [pc.Species("A"), pc.Species("B")],
        "reactions": [pc.Reaction("A -> B", 1.0)],
        "boundaries": [pc.MeanVelocity(1.0)],
        "forces": [pc.Buoyancy("A", 1.0, (0.0, 1.0))],
        "seed": 1,
        "dt": 0.01,
        "device": pc.Device(),
        "normalise_diffusion": True,
        "splitting": "lie",
        "operations": [pc.Every(print, steps=3)],
        "observables": {"a": still},
    },
    pc.Field: {
        "name": "T",
        "initial": 1.0,
        "unit": "K",
        "components": 2,
        "role": "state",
        "kind": np.float32,
        "part_of": "v",
    },
    pc.Every: {
        "function": still,
        "steps": 2,
        "interval": None,
        "when": pc.When.END,
        "name": "still",
    },
    pc.BodyForce: {"acceleration": lambda x, y, t: (x, y)},
    pc.Species: {
        "name": "A",
        "diffusivity": 1.0,
        "molecules": True,
        "only_in": "a",
        "switch_above": 20.0,
        "switch_below": 10.0,
    },
    pc.Sponge: {
        "start": 3.0,
        "end": 4.0,
        "time": 1.0,
        "velocity": still,
        "species": {"A": 1.0},
        "axis": 0,
        "exponent": 3.0,
    },
    pc.Static: {
        "kernel": "lucy",
        "support": 2.0,
        "skin": 0.1,
        "density": "continuity",
        "fluctuations": False,
        "gravity": None,
    },
    pc.SteadyState: {
        "observable": "kinetic_energy",
        "tolerance": 1.0,
        "interval": 1.0,
        "after": 1.0,
    },
    pc.TimeAverage: {
        "points": np.zeros((1, 2)),
        "fields": ["velocity"],
        "samples": 2,
        "after": 1.0,
        "groups": ["fluid"],
        "name": "mean",
        "kernel": "lucy",
    },
    pc.TransportVelocity: {
        **FLOW,
        "support": 2.6,
        "background": 1.0,
        "momentum_flux": "uniform",
        "renormalise": True,
        "pressure_switch": False,
        "pressure_force": "symmetric",
        "fixed_volume": True,
        "filter_every": 20,
        "density_diffusion": 0.1,
        "impenetrable": True,
        "normalise_viscosity": True,
        "species_flux": False,
        "skin": 0.1,
        "more": [Crowding()],
        "fields": [pc.Field("T")],
    },
    pc.WallMotion: {
        "group": "w",
        "velocity": (1.0, 0.0),
        "angular_velocity": 1.0,
        "centre": (0.0, 0.0),
        "axis": (0.0, 0.0, 1.0),
        "displacement": np.zeros_like,
        "angle": abs,
    },
    pc.box_walls: {**MADE, "domain": ROOM, "layers": 3, "sliding": {"y-upper": (1.0, 0.0)}},
    pc.channel_walls: {**MADE, "axis": 1, "layers": 3, "velocity": ((0.0, 0.0), None)},
    pc.fluid: {**MADE, "shape": BALL, "velocity": still, "kind": "square"},
    pc.jittered: {"points": POINTS, "amplitude": 0.1, "seed": 1},
    pc.lattice: {**FILL, "shape": BALL, "kind": "square"},
    pc.packed: {
        **FILL,
        "points": POINTS,
        "fixed": POINTS + 1,
        "keep_inside": None,
        "tolerance": 0.1,
        "iterations": 2,
    },
    pc.rings: {"ball": BALL, "inner": 1.0, "outer": 2.0, "spacing": 0.5},
    pc.shells: {"ball": pc.Ball((0, 0, 0), 2.0), "inner": 1.0, "outer": 2.0, "spacing": 0.5},
    around: {**FILL, "ball": BALL, "fixed": None, "reach": 1.0},
    arranged: {**FILL, "kind": "jittered", "seed": 1, "fixed": None},
}
EXAMPLES |= {pc.Circle: EXAMPLES[pc.Ball], pc.Sphere: EXAMPLES[pc.Ball]}
#: What others have tests of: errors, and what is made from files and functions.
ELSEWHERE = {
    "equilibrated",  # it runs a fluid
    "InputError",
    "Interrupted",
    "Law",
    "LawWarning",
    "Operation",
    "State",
    "When",
    "particle_loop",
    "RunError",
    "Run",
    "SBMLModel",
    "read_sbml",
}
ELSEWHERE |= {"Ensemble", "EnsembleInterrupted", "EnsembleRun"}
ELSEWHERE |= {"export_h5md", "export_vtkhdf"}

#: Numbers that may be negative (and zero), and that may be zero.
COORDINATES = {"start", "end", "lower", "upper", "center", "point", "normal", "points", "fixed"}
COMPONENTS = {"gravity", "velocity", "angular_velocity", "centre", "axis of WallMotion"}
SIGNED = (
    COORDINATES | COMPONENTS | {"initial", "background_pressure", "expansion", "reference", "after"}
)
ZERO = {"viscosity", "bulk_viscosity", "diffusivity", "forward", "density_diffusion", "shifting"}
ZERO |= {"reference_speed", "pressure_drop", "axis", "inner", "reach", "amplitude", "seed"}
ZERO |= {"components", "tolerance", "filter_every", "values", "flux", "transfer", "species"}

NOT_FINITE = (math.nan, math.inf, -math.inf, 10**400)
NO_NUMBERS = ("some text", b"bytes", 1j, object(), [object()], {"A": "b"})
EVERY = [(make, name) for make, arguments in EXAMPLES.items() for name in arguments]
NUMBERS = [
    (make, name)
    for make, name in EVERY
    if isinstance(EXAMPLES[make][name], int | float) and not isinstance(EXAMPLES[make][name], bool)
]


def identifier(value):
    return getattr(value, "__name__", value)


def refused(make, name: str, value: object) -> None:
    with pytest.raises(InputError) as error:
        make(**{**EXAMPLES[make], name: value})
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 700


def within(value, number):
    """A number in the place of every number of an example."""
    if isinstance(value, dict):
        return {key: within(item, number) for key, item in value.items()}
    return tuple(within(v, number) for v in value) if isinstance(value, tuple) else number


def test_all_that_is_public_has_an_example():
    names = {make.__name__ for make in EXAMPLES}
    assert set(pc.__all__) - ELSEWHERE <= names
    for make, arguments in EXAMPLES.items():
        assert list(inspect.signature(make).parameters) and make(**arguments) is not None
        assert set(arguments) == set(inspect.signature(make).parameters), make


@pytest.mark.parametrize(("make", "name"), EVERY, ids=identifier)
def test_what_is_of_another_kind_is_refused(make, name):
    example = EXAMPLES[make][name]
    refused(make, name, object())
    if isinstance(example, str):
        for value in (1, math.nan, b"bytes"):
            refused(make, name, value)
    if isinstance(example, bool):
        for value in ("no", 1, math.nan):
            refused(make, name, value)
    if isinstance(example, pc.Domain | pc.Fluid | pc.Ball | pc.Device | list):
        for value in (3, "text", math.nan, {}):
            refused(make, name, value)


@pytest.mark.parametrize(("make", "name"), NUMBERS, ids=identifier)
def test_what_is_no_number_is_refused(make, name):
    for value in (*NOT_FINITE[:3], *NO_NUMBERS):
        if not (name == "dt" and value == "auto"):
            refused(make, name, value)
    if isinstance(EXAMPLES[make][name], float):
        refused(make, name, 10**400)


@pytest.mark.parametrize(
    ("make", "name"),
    [(m, n) for m, n in EVERY if isinstance(EXAMPLES[m][n], tuple | dict)],
    ids=identifier,
)
def test_numbers_in_lists_and_tables_are_looked_at(make, name):
    example = EXAMPLES[make][name]
    for number in (*NOT_FINITE, "text", object()):
        if make is pc.Box and number in (-math.inf, math.inf, 10**400):
            continue  # slabs
        refused(make, name, within(example, number))
    refused(make, name, "text")
    if isinstance(example, dict) and name != "sliding":  # velocities have signs
        refused(make, name, within(example, -1.0))


@pytest.mark.parametrize(("make", "name"), NUMBERS, ids=identifier)
def test_signs(make, name):
    if name in SIGNED or f"{name} of {make.__name__}" in SIGNED:
        return
    whole = isinstance(EXAMPLES[make][name], int)
    refused(make, name, -1 if whole else -1.0)
    if name not in ZERO:
        refused(make, name, 0 if whole else 0.0)


@pytest.mark.parametrize("make", EXAMPLES, ids=identifier)
def test_misspelt_and_missing_names(make):
    arguments = EXAMPLES[make]
    name = max(arguments, key=len)
    with pytest.raises(InputError, match=f"did you mean '{name}'"):
        make(**{**arguments, f"{name[:-1]}": arguments[name]})
    for key, parameter in inspect.signature(make).parameters.items():
        if parameter.default is inspect.Parameter.empty:
            with pytest.raises(InputError, match=f"{key} = None .* given"):
                make(**{k: v for k, v in arguments.items() if k != key})


def test_misspelt_public_names():
    with pytest.raises(AttributeError, match="did you mean 'Simulation'"):
        pc.Simulaton  # noqa: B018


#: Kinds that numbers come in out of arrays, tables and exact arithmetic, by Python's own kind.
OTHER_KINDS = {
    bool: (np.bool_, np.array),
    int: (np.int64, np.int32, np.uint8, np.array),
    float: (np.float64, np.float32, np.float16, np.longdouble, np.array, Fraction, Decimal),
}


def of_kind(value, which: int):
    """An example with its numbers of another kind; those in lists and tables too."""
    if isinstance(value, dict):
        return {key: of_kind(item, which) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return type(value)(of_kind(item, which) for item in value)
    kinds = OTHER_KINDS.get(type(value), ())
    if not kinds or (isinstance(value, float) and float(np.float16(value)) != value):
        return value
    return kinds[which % len(kinds)](value)


def kept(thing):
    """What a thing is made of, with the kinds of its numbers."""
    if isinstance(thing, np.ndarray):
        return thing.dtype.str, thing.tolist()
    if isinstance(thing, list | tuple):
        return [kept(item) for item in thing]
    if isinstance(thing, dict):
        return {key: kept(item) for key, item in thing.items()}
    if type(thing).__module__.startswith("particell") and hasattr(thing, "__dict__"):
        return type(thing).__name__, {k: kept(v) for k, v in vars(thing).items()}
    return type(thing).__name__, thing if isinstance(thing, int | float | str) else repr(
        type(thing)
    )


@pytest.mark.parametrize(
    ("make", "name"),
    [(m, n) for m, n in EVERY if of_kind(EXAMPLES[m][n], 0) is not EXAMPLES[m][n]],
    ids=identifier,
)
def test_numbers_of_any_kind_are_pythons(make, name):
    """The same thing comes out, with Python's numbers in it: the same bits from there on."""
    if make is pc.Simulation:  # one argument tells as much as another, and each takes a while
        choices = range(3) if name in ("dt", "seed") else range(1)
    else:
        choices = range(len(OTHER_KINDS[float]))
    example = EXAMPLES[make][name]
    for which in choices:
        other = make(**{**EXAMPLES[make], name: of_kind(example, which)})
        if make is not pc.Simulation:
            assert kept(other) == kept(make(**EXAMPLES[make]))
        else:
            mine = make(**EXAMPLES[make])
            assert (kept(mine.dt), kept(mine.seed)) == (kept(other.dt), kept(other.seed))


def test_numbers_of_other_kinds_that_are_none_are_refused():
    for value in (np.array([1.0]), np.complex128(1.0), Decimal("nan"), Decimal("1e999"), 1j):
        refused(pc.Ball, "radius", value)
    for value in (1.0, np.float64(2.0), Fraction(1, 2), np.bool_(True)):
        refused(pc.MeanVelocity, "axis", value)
    assert parse("time", np.float32(2.0), "s") == 2.0
    assert case_class("couette")(resolution=np.int64(24)).resolution == 24


def test_values_are_shown_in_one_line():
    class Odd:
        def __repr__(self):
            raise RuntimeError

    assert shown(Odd()) == "<Odd>"
    assert shown(10**5000) == "<int>"
    assert len(shown(np.zeros((100, 100)))) == LONGEST_VALUE
    assert "\n" not in shown(np.zeros((9, 9)))


def test_annotations_are_what_is_checked():
    @checked
    def function(a: float, b: tuple[int, int] = (1, 2), *, c: str | None = None, d=None) -> tuple:
        return a, b, c, d

    assert function(1, [3, 4], d=object) == (1, [3, 4], None, object)
    for wrong in ({"a": "x"}, {"b": (1,)}, {"b": (1, 2.0)}, {"c": 3}, {"e": 1}):
        with pytest.raises(InputError):
            function(**{"a": 1.0, **wrong})
