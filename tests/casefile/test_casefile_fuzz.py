"""Any case file, however wrong: a report, or one line and exit status 2; never a traceback."""

from __future__ import annotations

import copy

import pytest
from case_files import document, small, toml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from particell.casefile import scope
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
            st.one_of(st.sampled_from(["type", "x", "dye"]), st.text(max_size=4)), inner
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


def rich() -> dict:
    """A file in which most kinds of tables occur."""
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
        "fill": {"type": "lattice", "spacing": "= spacing", "shape": "outside"},
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


@st.composite
def broken_files(draw):
    """The file with a few things in it changed, left out, put in, or given another name."""
    content = copy.deepcopy(rich())
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


def test_the_file_that_is_changed_is_right(checked):
    assert checked(document(rich())) == 0
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
