"""What case files run: the same as Python, resumable, and described before it runs."""

from __future__ import annotations

import inspect
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from case_files import case, changed, document, small

import particell as pc
from particell.analysis import fields
from particell.casefile import boundaries, chemistry, domain, fills, phases, schemes, shapes
from particell.casefile.case import FileCase
from particell.casefile.running import AverageTable, RunTable, SimulationTable, StopTable
from particell.cases.base import Context
from particell.cases.yeast_channel import YeastChannel
from particell.cli import call, described_case
from particell.geometry.fill import around, arranged
from particell.output.run import Run
from particell.simulation import Simulation

YEAST = Path(__file__).parents[2] / "examples" / "yeast_channel.toml"
#: Tables, what they are turned into, and which of its parameters a file cannot have.
PAIRS = [
    (domain.DomainTable, pc.Domain, ()),
    (domain.FluidTable, pc.Fluid, ()),
    (shapes.BoxTable, pc.Box, ()),
    (shapes.BallTable, pc.Ball, ()),
    (shapes.HalfSpaceTable, pc.HalfSpace, ()),
    (fills.LatticeFill, pc.lattice, ("domain",)),
    (fills.ArrangedFill, arranged, ("domain",)),
    (fills.AroundFill, around, ("domain", "reach")),
    (fills.RingsFill, pc.rings, ()),
    (phases.FilledPhase, pc.fluid, ("domain",)),
    (phases.ParticlesPhase, pc.Phase, ("points",)),
    (phases.ChannelWalls, pc.channel_walls, ("domain",)),
    (phases.BoxWalls, pc.box_walls, ("domain",)),
    (schemes.SDPDTable, pc.SDPD, ()),
    (schemes.TransportVelocityTable, pc.TransportVelocity, ()),
    # of Static the others say that it does not move
    (schemes.StaticTable, pc.Static, ("skin", "density", "fluctuations", "gravity")),
    (chemistry.SpeciesTable, pc.Species, ()),
    # reactants and products are the equation's, propensities the rate law's
    (chemistry.ReactionTable, pc.Reaction, ("reactants", "products", "propensity")),
    (boundaries.ReflectionTable, pc.Reflection, ()),
    (boundaries.SpongeTable, pc.Sponge, ()),
    (boundaries.WallMotionTable, pc.WallMotion, ()),
    (boundaries.MeanVelocityTable, pc.MeanVelocity, ()),
    (boundaries.ReservoirTable, pc.Reservoir, ()),
    (boundaries.FixedValueWallTable, pc.FixedValueWall, ()),
    (boundaries.FluxWallTable, pc.FluxWall, ()),
    (boundaries.BuoyancyTable, pc.Buoyancy, ()),
    (StopTable, pc.SteadyState, ()),
    (AverageTable, pc.TimeAverage, ()),
]


@pytest.mark.parametrize("table, made, without", PAIRS, ids=[t.__name__ for t, _, _ in PAIRS])
def test_tables_have_the_parameters_of_what_they_make(table, made, without):
    parameters = inspect.signature(made).parameters
    assert set(parameters) - set(without) <= set(table.model_fields)
    for name, info in table.model_fields.items():
        assert info.description, name
        other = ("velocity", "fixed", "seed", "volume", "points")  # made of something else
        if name in parameters and name not in other:
            default = parameters[name].default
            factory = info.default_factory is not None or name == "equation"
            assert factory or info.is_required() or info.default == default, name


def test_tables_of_the_simulation():
    whole = set(SimulationTable.model_fields) | {"seed", "device"}
    tables = set(FileCase.model_fields) - {"simulation", "stop", "run", "constants"}
    assert set(inspect.signature(Simulation).parameters) <= whole | tables
    options = set(RunTable.model_fields) | {"self", "out", "progress", "overwrite"}
    options |= set(FileCase.model_fields) & {"stop", "averages"}
    assert set(inspect.signature(Simulation.run).parameters) <= options


def state_after(simulation: Simulation, every: float, steps: int) -> dict[str, np.ndarray]:
    simulation.plan(every)
    simulation.advance(steps)
    return simulation.state()["fields"]


def test_the_yeast_channel_has_the_same_bits():
    python = YeastChannel(resolution=40)
    file = described_case(str(YEAST), ["constants.resolution=40"])
    assert (python.until, python.every) == (file.until, file.every)
    one, two = python.build(Context(seed=3)), file.build(Context(seed=3))
    assert one.depth == two.depth and one.settings == two.settings
    first, second = (state_after(s, python.every, 40) for s in (one, two))
    assert first.keys() == second.keys()
    assert one.chemistry_every < 40 and one.settings == two.settings
    for name, values in first.items():
        assert np.array_equal(values, second[name]), name


def test_the_small_file_has_the_bits_of_python():
    file = case(species=[], reactions=[], initial=[], boundaries=[])
    height, speed = file.domain.upper[1], file.scope().constants.values["speed"]
    water = pc.Fluid(density=1000.0, viscosity=file.materials["water"].viscosity)
    box = pc.Domain((0, 0), (height, height), "x")

    def velocity(points):
        y = points[:, 1]
        return np.stack([4 * speed * y * (height - y) / height**2, 0 * y], axis=-1)

    dx = height / 8
    gravity = (8 * water.viscosity / water.density * speed / height**2, 0.0)
    filled = pc.fluid(box, water, dx, velocity=velocity)
    walls = pc.channel_walls(box, water, dx, axis=1)
    python = pc.Simulation(box, [filled, *walls], pc.SDPD(gravity=gravity), seed=1)
    first = state_after(python, file.every, 20)
    second = state_after(file.build(Context()), file.every, 20)
    for name, values in first.items():
        assert np.array_equal(values, second[name]), name


def test_new_check_run_resume_plot_export(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert call(["new"]) == 0
    capsys.readouterr()
    assert call(["check", "case.toml", "--no-timing"]) == 0
    words = capsys.readouterr().out
    assert "particles: 520 (fluid 400, wall-lower 60, wall-upper 60)" in words
    assert "limited by viscosity" in words and "memory:" in words and "time:" not in words
    short = ["--set", "run.until=1 ms", "--set", "run.every=0.5 ms", "--no-progress"]
    assert call(["run", "case.toml", *short]) == 0
    out = tmp_path / "out" / "case"
    made = {"run.h5", "checkpoint.h5", "summary.json", "case.json", "velocity.png"}
    assert made | {"concentration_dye.png", "amounts.png"} <= {p.name for p in out.iterdir()}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["metrics"]["amount dye + dye_bound"]["limit"] == 1e-9
    assert summary["parameters"]["domain"]["value"]["periodic"] == "x"
    (tmp_path / "case.toml").unlink()  # the directory holds all that is needed
    assert call(["resume", "out/case", "--no-progress"]) == 0
    assert call(["plot", "out/case"]) == 0
    assert call(["export", "out/case"]) == 0


def test_resumed_bits(tmp_path, monkeypatch):
    """What is read from the run's directory is the case that was written there."""
    file = case()
    again = FileCase(**json.loads(json.dumps(file.model_dump(mode="json"))))
    assert again == file
    first = state_after(file.build(Context()), file.every, 10)
    second = state_after(again.build(Context()), again.every, 10)
    for name, values in first.items():
        assert np.array_equal(values, second[name]), name


def test_check_times_and_counts(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("particell.casefile.report.TIMED", 0.01)
    path = tmp_path / "my-channel.toml"
    path.write_text(document(small()))
    assert call(["check", str(path)]) == 0
    words = capsys.readouterr().out
    assert words.startswith("my-channel: Water") and "time:      about" in words
    content = changed(constants__dye="1e6 mol/m^3")  # 1e15 events a step: not waited for
    for species in content["species"]:
        species["molecules"] = True
    path.write_text(document(content))
    assert call(["check", str(path)]) == 0
    assert " days" in capsys.readouterr().out
    monkeypatch.setattr("particell.casefile.report.MOST_BUILT", 50)
    assert call(["check", str(path)]) == 0
    words = capsys.readouterr().out
    assert "about 112 (fluid 64, wall 48)" in words and "not built" in words


def test_schema(capsys):
    assert call(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    spacing = schema["$defs"]["FilledPhase"]["properties"]["spacing"]
    assert spacing["x-unit"] == "m" and {"type": "string"} in spacing["anyOf"]
    assert tomllib.loads(YEAST.read_text(encoding="utf-8")).keys() <= schema["properties"].keys()


def test_rate_laws():
    """Michaelis–Menten, in particles at rest: against the equation's own integral."""
    species = [{"name": "dye"}, {"name": "dye_bound"}]
    law = {"equation": "dye -> dye_bound", "rate_law": "= fastest * dye / (half + dye)"}
    file = FileCase(
        **changed(
            scheme={"type": "Static"},
            species=species,
            reactions=[law],
            initial=[{"species": "dye", "concentration": 2.0}],
            boundaries=[],
            constants__fastest="3 mol/m^3/s",
            constants__half="1 mol/m^3",
            simulation={"dt": 0.002},
        )
    )
    simulation = file.build(Context())
    simulation.advance(200)
    fluid = simulation.particles.select("fluid")
    found = simulation.chemistry.concentration("dye")[fluid]
    # C + K ln C falls by V t
    assert np.allclose(found + np.log(found), 2 + np.log(2) - 3 * 0.4, rtol=1e-4)


def test_molecules_walls_and_fills():
    """Kinds of tables that the other files do not have."""
    water = {"material": "water"}
    walls = [f"w-{axis}-{side}" for axis in "xy" for side in ("lower", "upper")]
    ring = {"type": "rings", "ball": "cell", "inner": 0, "outer": "20 um", "spacing": "5 um"}
    around_cell = {
        "type": "around",
        "ball": "cell",
        "spacing": "5 um",
        "fixed": ["cell", *walls],
    }
    file = FileCase(
        **changed(
            domain={"lower": [0, 0], "upper": ["100 um", "100 um"], "depth": "1 um"},
            shapes={"cell": {"type": "Circle", "center": ["50 um", "50 um"], "radius": "20 um"}},
            phases=[
                {"type": "Phase", "name": "fluid", "fill": around_cell, **water},
                {"type": "Phase", "name": "cell", "kind": "wall", "fill": ring, **water}
                | {"surface": "cell", "spacing": "5 um"},
                {"type": "box_walls", "name": "w", "spacing": "5 um", **water},
            ],
            scheme={"type": "TransportVelocity", "reference_speed": "1 mm/s"},
            species=[{"name": "A", "molecules": True, "diffusivity": {"fluid": "1e-9 m^2/s"}}],
            reactions=[{"equation": "2 A -> 0", "forward": 0.1, "units": "molecules"}],
            initial=[{"species": "A", "count": "= where(x < 50 * 1e-6 * metre, 4, 1)"}],
            constants__metre="1 m",
            boundaries=[
                {"type": "Reflection", "body": "cell"},
                {"type": "Sponge", "start": 0, "end": 1e-5, "time": 1, "velocity": [1e-3, 0]},
            ],
        )
    )
    simulation = file.build(Context())
    of_walls = sum("w-" in simulation.group_names[g] for g in simulation.particles.host("group"))
    assert file.estimates(file.scope())["w"] == pytest.approx(of_walls)
    assert simulation.group_names == ["fluid", "cell", *walls]
    fluid = simulation.particles.select("fluid")
    x = simulation.particles.host("x")[fluid]
    assert fluid.sum() == 400 - round(np.pi * 16)
    assert np.linalg.norm(x - 5e-5, axis=1).min() > 2e-5
    counts = simulation.chemistry.count("A")[fluid]
    assert np.array_equal(counts, np.where(x[:, 0] < 50 * 1e-6, 4, 1))


def test_walls_move():
    """A wall that swings: its particles are where the formula of time says."""
    swing = {"type": "WallMotion", "group": "wall-upper"}
    swing |= {"displacement": ["= 1e-2 * height * sin(pulse * t)", 0]}
    rates = {"type": "TransportVelocity", "reference_speed": "1 mm/s", "fixed_volume": True}
    rest = {"species": [], "reactions": [], "initial": []}
    file = case(boundaries=[swing], scheme=rates, constants__pulse="300 rad/s", **rest)
    simulation = file.build(Context())
    wall = simulation.particles.by_id("group") == simulation.group_names.index("wall-upper")
    before = simulation.particles.by_id("x")[wall]
    simulation.advance(20)
    moved = simulation.particles.by_id("x")[wall] - before
    height = file.domain.upper[1]
    expected = 1e-2 * height * np.sin(300 * simulation.time)
    assert np.allclose(moved[:, 0], expected, rtol=1e-9) and not moved[:, 1].any()


def test_stop(tmp_path):
    file = case(
        scheme={"type": "SDPD", "reference_speed": 1e-3},
        phases__1__velocity=[0, 0],
        stop={"observable": "amount_dye", "tolerance": 1e9, "interval": 1},
        run={"until": "0.4 ms", "every": "0.1 ms", "checkpoint_every": 5},
    )
    path = tmp_path / "stops.toml"
    path.write_text(document(file.model_dump(mode="json", exclude_none=True)))
    assert call(["run", str(path), "--out", str(tmp_path / "o"), "--no-progress"]) == 0
    assert len(Run(tmp_path / "o")) == 3  # a change is between two frames


def test_averages(tmp_path):
    """The bits of Python's, on a grid, a line and at points."""
    line = {"start": [1e-5, 0], "end": [1e-5, "= height"], "points": 5}
    file = case(
        run={"until": "0.4 ms", "every": "0.2 ms", "checkpoint_every": 5},
        averages=[
            {"grid": [3, 2], "fields": ["velocity", "concentration/dye"], "samples": 3},
            {"line": line, "name": "line", "groups": ["fluid"], "after": "0.2 ms"},
            {"points": [[0, "= height / 2"]], "name": "one", "kernel": "lucy"},
        ],
    )
    path = tmp_path / "averages.toml"
    path.write_text(document(file.model_dump(mode="json", exclude_none=True)))
    assert call(["run", str(path), "--out", str(tmp_path / "o"), "--no-progress"]) == 0
    run = Run(tmp_path / "o")
    assert run.average("concentration/dye", "mean").shape == (3, 2)
    simulation = file.build(Context())
    height = simulation.domain.upper[1]
    averages = [
        pc.TimeAverage(
            fields.grid(simulation.domain, (3, 2)), ["velocity", "concentration/dye"], samples=3
        ),
        pc.TimeAverage(
            fields.line((1e-5, 0), (1e-5, height), 5), name="line", groups=["fluid"], after=2e-4
        ),
        pc.TimeAverage(np.array([[0.0, height / 2]]), name="one", kernel="lucy"),
    ]
    ours = simulation.run(file.until, file.every, progress=False, averages=averages)
    for name, names in run.average_names.items():
        for field in names:
            assert np.array_equal(run.average(field, name), ours.average(field, name)), name
