"""What ``particell check`` says of set-ups that are wrong: the user's own keys and values."""

from __future__ import annotations

import re

import numpy as np
import pytest

import particell as pc
from particell.casefile.starting import starting_text
from particell.cases.base import Context
from particell.cli import call
from particell.errors import InputError, RunError, shown
from particell.monitor import Monitor
from particell.settings import described_case
from particell.units import parse

NO_WALLS = (r"\[\[phases\]\]\ntype = \"channel_walls\".*?(?=\[scheme\])", "")
UNHELD = (r"\[\[boundaries\]\].*?(?=\[run\])", "")
#: What is changed in the file that ``particell new`` writes, and what has to be said.
WRONG = {
    "unit": (
        (('height = "100 um"', 'height = "100 umm"'),),
        "constants.height = '100 umm'.*'umm' is no unit.*'um'",
    ),
    "unit of a key": (((r'"500 um\^2/s"', '"500 um^2/sec2"'),), "species 'dye'.*'sec2' is no unit"),
    "walls": ((NO_WALLS,), "'wall-upper'.*no phase is a wall .channel_walls makes two"),
    "names": ((('"dye_bound"', '"dye"'),), "^error: species = 'dye' .*a name used once"),
    "dt": (
        ((r"\[run\]", '[simulation]\ndt = "1 ms"\n[run]'),),
        r"simulation.dt = '1 ms' is not allowed: it must be below",
    ),
    "fluid in fluid": (
        (
            (
                r"\[scheme\]",
                '[[phases]]\ntype = "fluid"\nname = "again"\nmaterial = "water"\n'
                'spacing = "= spacing"\nshape = "upper_half"\n[scheme]',
            ),
        ),
        r"phases = 'again and fluid'.*at \(2.5, 52.5\) µm",
    ),
    "overlap by a part": (
        (
            (
                r"\[scheme\]",
                '[shapes.drop]\ntype = "Circle"\ncenter = ["52.5 um", "52.5 um"]\n'
                'radius = "14 um"\n[[phases]]\ntype = "Phase"\nname = "drop"\n'
                'material = "water"\nkind = "wall"\nfill = { type = "rings", '
                'ball = "drop", spacing = "5 um", inner = 0, outer = "14 um" }\n[scheme]',
            ),
        ),
        "phases = 'drop and fluid'",
    ),
    "every": ((('every = "2 ms"', 'every = "30 ms"'),), r"run.every|every in run"),
}


def file_with(directory, *changes):
    path = directory / "case.toml"
    text = starting_text()
    for old, new in changes:
        assert re.search(old, text, re.S), old
        text = re.sub(old, new, text, count=1, flags=re.S)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", WRONG)
def test_messages_name_what_was_written(name, tmp_path, capsys):
    changes, words = WRONG[name]
    assert call(["check", "--no-timing", str(file_with(tmp_path, *changes))]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(said) == 1 and re.search(words, said[0]), said


def test_what_is_hardly_meant_is_warned_of(tmp_path, capsys):
    path = file_with(tmp_path, NO_WALLS, UNHELD)
    assert call(["check", "--no-timing", str(path)]) == 0
    (warned,) = [w for w in capsys.readouterr().out.splitlines() if w.startswith("warning")]
    assert "through the lower y and the upper y side" in warned
    twice = (
        r"\[\[initial\]\]",
        '[[reactions]]\nequation = "dye  <-> dye_bound"\n'
        'forward = "1 1/s"\nbackward = "1 1/s"\n[[initial]]',
    )
    slow = (r"\[run\]", '[simulation]\ndt = "15 us"\n[run]')
    assert call(["check", "--no-timing", str(file_with(tmp_path, twice, slow))]) == 0
    warned = [w for w in capsys.readouterr().out.splitlines() if w.startswith("warning")]
    assert [w for w in warned if "stands 2 times" in w]
    assert [w for w in warned if "above the rule's" in w] and len(warned) == 2
    assert call(["check", "--no-timing", str(file_with(tmp_path))]) == 0
    assert "warning" not in capsys.readouterr().out


def test_walls_and_reflecting_surfaces_close_sides():
    from particell.enclosure import open_sides

    box = pc.Domain((0, 0), (1, 1))
    water = pc.Fluid(1.0, 0.1)
    filled = pc.fluid(box, water, 0.1)
    upper, lower = (pc.Reflection(pc.HalfSpace((0, y), (0, n))) for y, n in ((1, -1), (0, 1)))
    assert open_sides(box, [filled], []) == ["lower x", "upper x", "lower y", "upper y"]
    assert open_sides(box, [filled], [upper]) == ["lower x", "upper x", "lower y"]
    assert open_sides(box, [filled, *pc.box_walls(box, water, 0.1, layers=1)], []) == []
    walls = pc.channel_walls(box, water, 0.1, axis=0)
    assert open_sides(box, [filled, *walls], [upper, lower]) == []
    drop = pc.fluid(box, water, 0.1, shape=pc.Ball((0.5, 0.5), 0.3))
    assert open_sides(box, [drop], []) == []  # it does not touch them


def test_the_side_where_a_particle_left():
    box = pc.Domain((0, 0), (8e-6, 8e-6), periodic="x")
    water = pc.Fluid(1000.0, 1e-3)
    simulation = pc.Simulation(box, pc.fluid(box, water, 1e-6), pc.SDPD(reference_speed=1e-3))
    x = simulation.particles.host("x")
    x[37, 1] = -4e-6
    simulation.particles.set("x", x)
    monitor = Monitor(simulation.system, simulation.monitor._flow)
    with pytest.raises(RunError, match=r"through its lower y side, to \(.*, -4\) µm"):
        monitor.check()


def test_numbers_in_messages_are_as_they_were_given():
    assert shown(2.4999999999999998e-06) == "2.5e-06"
    assert shown([np.float64(0.1), 5.2499999999999995e-05]) == "[0.1, 5.25e-05]"
    assert shown(0.1 + 0.2) == "0.3" and shown(12) == "12"
    with pytest.raises(InputError, match=r"'mlimeters' is no unit|'mlimeter' is no unit"):
        parse("length", "3 mlimeter", "m")


def test_a_case_keeps_what_was_typed(tmp_path):
    case = described_case(str(file_with(tmp_path)), ["simulation.dt='1e9 s'"])
    with pytest.raises(InputError, match="'1e9 s'"):
        case.build(Context(seed=1))
