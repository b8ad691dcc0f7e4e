"""Any case file, however wrong: a report, or one line and exit status 2; never a traceback."""

from __future__ import annotations

import copy
import importlib.util
from pathlib import Path

import pytest
from case_files import document, small, toml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from particell.casefile import scope
from particell.casefile.case import UNIONS, FileCase
from particell.casefile.messages import kinds
from particell.casefile.starting import starting_text
from particell.cli import call

FUZZ = settings(
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
TEXTS = st.sampled_from(
    [
        *("", "x", "y", "fluid", "wall", "water", "dye", "upper_half", "lattice", "Ball", "auto"),
        *(
            "1 um",
            "-1 um",
            "0 m",
            "1e-30 m",
            "1e30 m",
            "3 kg",
            "1 1/s",
            "nan m",
            "2 dye -> dye_bound",
        ),
        *(
            "= height",
            "= speed",
            "= -height",
            "= y / height",
            "= 1 / 0",
            "= height**0.5",
            "= x + y",
        ),
        *("/dev/zero", "/dev/null", ".", "jittered", "packed", "= t", "A", "fluid", "min", "S"),
        *("= 9**9**9**9", "= exp(1e5)", "= where(x > y, 1, 0)", "= (((", "= y * speed / height"),
        *(
            "9**9**9 m",
            "\u0000",
            "\u2028",
            "m^99",
            "dye + dye_bound -> 0",
            "<->",
            "../x",
            "0 -> dye",
        ),
    ]
)
NUMBERS = st.one_of(
    st.integers(-5, 40),
    st.integers(-(10**25), 10**25),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -0.0, 1e-6, 1e-5, 1e-3, 0.5, 1e-300, 1e300, 5e-324, 10**400]),
)
PLAIN = st.one_of(NUMBERS, TEXTS, st.booleans(), st.text(max_size=8))
VALUES = st.recursive(
    PLAIN,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.one_of(
                st.sampled_from(["type", "x", "dye", "fluid", "path", "of", "A"]),
                st.text(max_size=4),
            ),
            inner,
        ),
    ),
    max_leaves=5,
)


def places(value, path=()):
    """Paths to everything in a file."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        yield (*path, key)
        if isinstance(inner, dict | list):
            yield from places(inner, (*path, key))


LIBSBML = importlib.util.find_spec("libsbml") is not None
ENZYME = Path(__file__).parents[2] / "examples" / "enzyme.xml"


def rich() -> dict:
    """Flow, shapes, and most of what acts on it."""
    content = small()
    content["shapes"] |= {
        "cell": {"type": "Circle", "center": [5e-5, 5e-5], "radius": "10 um"},
        "outside": {"type": "complement", "of": "cell"},
        "plane": {"type": "HalfSpace", "point": [0, 0], "normal": [0, 1]},
        "rest": {"type": "intersection", "of": ["outside", "upper_half"]},
    }
    fluid = content["phases"][0]
    content["phases"][0] = {
        "type": "Phase",
        "name": "fluid",
        "material": "water",
        "velocity": fluid["velocity"],
        "fill": {"type": "arranged", "spacing": "= spacing", "kind": "jittered", "seed": 2},
    }
    content["boundaries"] += [
        {"type": "Reflection", "body": "plane"},
        {"type": "MeanVelocity", "velocity": "1 mm/s"},
        {
            "type": "Sponge",
            "start": 0,
            "end": "10 um",
            "time": 1,
            "velocity": ["= speed * y / height", 0],
            "species": {"dye": 1},
        },
        {"type": "FluxWall", "group": "wall-lower", "transfer": {"dye": [1e-6, 1]}},
    ]
    content["forces"] = [
        {"type": "Buoyancy", "species": "dye", "expansion": 1e-3, "gravity": [0, -9.81]}
    ]
    content["simulation"] = {"dt": "auto", "splitting": "strang"}
    content["averages"] = [
        {"fields": ["velocity", "concentration/dye"], "grid": [3, 2], "samples": 2},
        {"line": {"start": [0, 0], "end": [0, "= height"], "points": 3}, "name": "line"},
    ]
    content["stop"] = {"observable": "kinetic_energy", "interval": 1}
    return content


def still() -> dict:
    """Arrangements, molecules, a network and walls of species, at rest."""
    grid = {"type": "lattice", "spacing": "= spacing", "shape": "room", "kind": "hexagonal"}
    moved = {"type": "jittered", "of": grid, "amplitude": "0.2 um", "seed": 3}
    packed = {"type": "packed", "of": moved, "spacing": "= spacing", "fixed": ["post"]}
    packed |= {"keep_inside": "room", "iterations": 3, "tolerance": 0.1}
    ring = {"type": "rings", "ball": "post", "inner": 0, "outer": "10 um", "spacing": "4 um"}
    dots = {"type": "points", "points": [["80 um", "80 um"]], "spacing": "5 um"}
    wall = {"type": "Phase", "material": "water", "kind": "wall"}
    network = {"path": str(ENZYME), "molecules": ["E"], "only_in": {"cell": ["fluid"]}}
    network |= {"diffusivity": {"S": "1 um^2/s", "P": {"fluid": 0}}, "units": {"time": "min"}}
    return {
        "constants": {"height": "100 um", "spacing": "= height / 8", "rate": "1 1/s"},
        "domain": {"lower": [0, 0], "upper": ["= height", "= height"], "depth": "1 um"},
        "materials": {"water": {"density": 1000, "viscosity": "1 mPa*s", "temperature": 300}},
        "shapes": {
            "post": {"type": "Ball", "center": ["20 um", "20 um"], "radius": "10 um"},
            "dot": {"type": "Box", "lower": ["70 um", "70 um"], "upper": ["90 um", "90 um"]},
            "half": {"type": "Box", "lower": ["50 um", 0], "upper": ["100 um", "100 um"]},
            "room": {"type": "difference", "of": ["half", "dot"]},
            "all": {"type": "union", "of": ["room", "dot"]},
        },
        "phases": [
            {"type": "Phase", "name": "fluid", "material": "water", "fill": packed},
            {**wall, "name": "post", "fill": ring, "surface": "post", "spacing": "4 um"},
            {**wall, "name": "dot", "fill": dots, "volume": ["= spacing**2"]},
            {"type": "box_walls", "name": "w", "material": "water", "spacing": "= spacing"},
        ],
        "scheme": {"type": "Static", "kernel": "lucy", "support": 2.5},
        "species": [
            {"name": "A", "molecules": True, "diffusivity": {"fluid": "1 um^2/s", "dot": 0}},
            {"name": "C", "molecules": True},
            {"name": "B", "molecules": True, "switch_above": 100, "switch_below": 50},
        ],
        "reactions": [
            {"equation": "2 A -> C", "forward": 0.1, "units": "molecules", "only_in": "fluid"},
            {"equation": "A -> 0", "rate_law": "rate * A", "forward": {"fluid": 1}},
            {"equation": "C <-> B", "forward": 1, "backward": "1 1/s"},
        ],
        "sbml": [network] if LIBSBML else [],
        "initial": [{"species": "A", "count": "= where(x < y, 4, 1)", "group": "fluid"}],
        "boundaries": [
            {"type": "Reservoir", "group": "dot", "values": {"A": "1 uM"}},
            {"type": "FixedValueWall", "group": "post", "values": {"A": "1 uM"}},
            {"type": "FluxWall", "group": "w-x-upper", "flux": {"A": 1e-9}, "area": 1e-10},
        ],
        "simulation": {"dt": "1 ms", "normalise_diffusion": True},
        "run": {"until": 0.01},
    }


def folded() -> dict:
    """Half of a channel in front of a mirror."""
    return {
        "constants": {"height": "40 um", "spacing": "= height / 8"},
        "domain": {"lower": [0, 0], "upper": ["= height", "= height"], "periodic": "x"},
        "materials": {"water": {"density": 1000, "viscosity": "1 mPa*s"}},
        "shapes": {"top": {"type": "HalfSpace", "point": [0, "= height"], "normal": [0, -1]},
                   "floor": {"type": "HalfSpace", "point": [0, 0], "normal": [0, 1]}},
        "phases": [{"type": "Phase", "name": "fluid", "material": "water",
                    "fill": {"type": "lattice", "spacing": "= spacing"}}],
        "scheme": {"type": "SDPD", "gravity": [0.1, 0], "reference_speed": "1 mm/s"},
        "boundaries": [
            {"type": "Mirror", "body": "top"},
            {"type": "Mirror", "body": "floor", "slip": False, "velocity": [1e-4, 0]},
        ],
        "run": {"until": 1e-5},
    }  # fmt: skip


def stirred() -> dict:
    """A body that moves in a cavity, by the other scheme."""
    around = {"type": "around", "ball": "post", "spacing": "= spacing", "reach": 6}
    around["fixed"] = ["post", "w-x-lower", "w-x-upper", "w-y-lower", "w-y-upper"]
    ring = {"type": "rings", "ball": "post", "inner": 0, "outer": "20 um", "spacing": "10 um"}
    post = {"type": "Phase", "name": "post", "kind": "wall", "fill": ring, "surface": "post"}
    walls = {"type": "box_walls", "name": "w", "spacing": "= spacing", "layers": 2}
    motion = {"type": "WallMotion", "group": "post", "angle": "= pulse * t", "centre": [5e-5, 5e-5]}
    return {
        "constants": {"height": "100 um", "spacing": "= height / 10", "pulse": "300 rad/s"},
        "domain": {"lower": [0, 0], "upper": ["= height", "= height"]},
        "materials": {"water": {"density": 1000, "viscosity": "1 mPa*s"}},
        "shapes": {"post": {"type": "Circle", "center": [5e-5, 5e-5], "radius": "20 um"}},
        "phases": [
            {"type": "Phase", "name": "fluid", "material": "water", "fill": around},
            {**post, "material": "water", "spacing": "= spacing"},
            {**walls, "material": "water", "sliding": {"y-upper": ["1 mm/s", 0]}},
        ],
        "scheme": {
            "type": "TransportVelocity",
            "reference_speed": "1 mm/s",
            "gravity": [0, -9.81],
            "pressure_force": "difference",
            "fixed_volume": True,
        },
        "boundaries": [motion | {"displacement": [0, "= 1e-6 * height * sin(pulse * t)"]}],
        "run": {"until": "1 ms", "every": "0.5 ms", "checkpoint_every": 10},
    }


def solid() -> dict:
    """A ball in three dimensions, by the scheme for noise."""
    edge = ["= edge"] * 3
    grid = {"type": "lattice", "spacing": "= spacing", "shape": "room"}
    layers = {"type": "shells", "ball": "ball", "inner": 0, "outer": "4 um", "spacing": "2 um"}
    return {
        "constants": {"edge": "16 um", "spacing": "2 um"},
        "domain": {"lower": [0, 0, 0], "upper": edge, "periodic": "xyz"},
        "materials": {"water": {"density": 1000, "viscosity": "1 mPa*s"}},
        "shapes": {
            "all": {"type": "Box", "lower": [0, 0, 0], "upper": edge},
            "ball": {"type": "Ball", "center": ["8 um"] * 3, "radius": "4 um"},
            "room": {"type": "difference", "of": ["all", "ball"]},
        },
        "phases": [
            {"type": "Phase", "name": "fluid", "material": "water", "fill": grid},
            {
                "type": "Phase",
                "name": "ball",
                "material": "water",
                "kind": "wall",
                "fill": layers,
                "surface": "ball",
                "spacing": "2 um",
            },
        ],
        "scheme": {"type": "SDPD", "support": 2.5, "reference_speed": "1 mm/s"},
        "run": {"until": "1 us"},
    }


FILES = [rich, still, stirred, solid, small, folded]


def types(value) -> set[str]:
    """All values of keys named "type"."""
    if isinstance(value, list):
        return set().union(*map(types, value))
    if not isinstance(value, dict):
        return set()
    found = {value["type"]} if isinstance(value.get("type"), str) else set()
    return found.union(*map(types, value.values()))


@st.composite
def broken_files(draw):
    """The file with a few things in it changed, left out, put in, or given another name."""
    content = copy.deepcopy(draw(st.sampled_from(FILES))())
    for _ in range(draw(st.integers(1, 3))):
        paths = sorted(places(content), key=str)
        if not paths:
            break
        *tables, last = draw(st.sampled_from(paths))
        inner = content
        for key in tables:
            inner = inner[key]
        act = draw(st.sampled_from(["change", "change", "change", "remove", "rename", "copy"]))
        if act == "remove":
            del inner[last]
        elif act == "rename" and isinstance(inner, dict):
            inner[draw(st.sampled_from([last[:-1], last + "s", draw(st.text(max_size=3))]))] = (
                inner.pop(last)
            )
        elif act == "copy":
            *from_tables, from_last = draw(st.sampled_from(paths))
            source = content
            try:
                for key in [*from_tables, from_last]:
                    source = source[key]
                inner[last] = copy.deepcopy(source)
            except (KeyError, IndexError):
                continue
        else:
            inner[last] = draw(VALUES)
    return document(content)


@pytest.fixture
def checked(tmp_path, monkeypatch, capsys):
    """Checks a file's text: the status has to be 0, or 2 with one line."""
    monkeypatch.setattr(scope, "memory", lambda: 5000 * scope.BYTES_A_PARTICLE)
    path = tmp_path / "fuzz.toml"

    def check(text: str) -> int:
        path.write_text(text, encoding="utf-8")
        capsys.readouterr()
        status = call(["check", str(path), "--no-timing", "--threads", "1"])
        error = capsys.readouterr().err
        assert status in (0, 2)
        assert error.count("\n") == (status == 2) and len(error) < 2000
        return status

    return check


@pytest.mark.parametrize("make", FILES)
def test_the_files_that_are_changed_are_right(checked, make):
    assert checked(document(make())) == 0


def test_every_kind_of_table_is_changed():
    contents = [make() for make in FILES]
    alike = {"Ball", "Circle", "Sphere", "intersection", "union"}  # of one table
    assert {kind for union in UNIONS.values() for kind in kinds(union)} <= alike.union(
        *map(types, contents)
    )
    tables = {key for content in contents for key in content} | {"name", "sbml"}
    assert tables == set(FileCase.model_fields)


def test_toml_of_a_table():
    assert toml({"a b": [1, "x", True]}) == '{"a b" = [1, "x", true]}'


@settings(FUZZ, max_examples=300)
@given(text=broken_files())
def test_changed_files(checked, text):
    checked(text)


@settings(FUZZ, max_examples=100)
@given(
    cut=st.integers(0, len(starting_text())),
    length=st.integers(0, 60),
    put=st.text(max_size=10),
)
def test_damaged_text(checked, cut, length, put):
    text = starting_text().replace("height / 20", "height / 8")
    checked(text[:cut] + put.encode("utf-8", "ignore").decode() + text[cut + length :])


@settings(FUZZ, max_examples=100)
@given(
    text=st.one_of(st.text(max_size=50), st.dictionaries(st.text(max_size=5), VALUES).map(document))
)
def test_any_text(checked, text):
    checked(text.encode("utf-8", "ignore").decode())
