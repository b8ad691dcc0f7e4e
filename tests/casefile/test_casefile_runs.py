"""What case files run: the same as Python, resumable, and described before it runs."""

from __future__ import annotations

import inspect
import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from case_files import case, changed, document, small

import particell as pc
from particell.analysis import fields
from particell.casefile import (
    boundaries,
    chemistry,
    domain,
    fills,
    networks,
    phases,
    schemes,
    shapes,
)
from particell.casefile.case import FileCase
from particell.casefile.running import AverageTable, RunTable, SimulationTable, StopTable
from particell.cases.base import Context
from particell.cases.yeast_channel import YeastChannel
from particell.chemistry.engine import Chemistry
from particell.cli import call
from particell.cli import run as run_command
from particell.geometry.fill import around, arranged
from particell.output.run import Run
from particell.settings import described_case
from particell.simulation import Simulation

ENZYME = Path(__file__).parents[2] / "examples" / "enzyme.xml"
YEAST = Path(__file__).parents[2] / "examples" / "yeast_channel.toml"
DOMAIN = {"domain": "that of the file"}
OF = {"points": "those of another arrangement, 'of'"}
MOVES = "the other schemes have it, to say that this one does not move"
#: Tables, what they are turned into, and which of its parameters a file cannot have, and why.
PAIRS = [
    (domain.DomainTable, pc.Domain, {}),
    (domain.FluidTable, pc.Fluid, {}),
    (shapes.BoxTable, pc.Box, {}),
    (shapes.BallTable, pc.Ball, {}),
    (shapes.BallTable, pc.Circle, {}),
    (shapes.BallTable, pc.Sphere, {}),
    (shapes.HalfSpaceTable, pc.HalfSpace, {}),
    (fills.LatticeFill, pc.lattice, DOMAIN),
    (fills.ArrangedFill, arranged, DOMAIN),
    (fills.AroundFill, around, DOMAIN),
    (fills.RingsFill, pc.rings, {}),
    (fills.ShellsFill, pc.shells, {}),
    (fills.JitteredFill, pc.jittered, OF),
    (fills.PackedFill, pc.packed, DOMAIN | OF),
    (phases.FilledPhase, pc.fluid, DOMAIN),
    (phases.ParticlesPhase, pc.Phase, {"points": "those of 'fill', of type 'points' too"}),
    (phases.ChannelWalls, pc.channel_walls, DOMAIN),
    (phases.BoxWalls, pc.box_walls, DOMAIN),
    (schemes.SDPDTable, pc.SDPD, {"more": "code", "fields": "code"}),
    (schemes.TransportVelocityTable, pc.TransportVelocity, {"more": "code", "fields": "code"}),
    (
        schemes.StaticTable,
        pc.Static,
        dict.fromkeys(("skin", "density", "fluctuations", "gravity"), MOVES),
    ),
    (chemistry.SpeciesTable, pc.Species, {}),
    (
        chemistry.ReactionTable,
        pc.Reaction,
        dict.fromkeys(("reactants", "products"), "those of the equation")
        | {"propensity": "the rate law serves for molecules too"},
    ),
    (networks.SBMLTable, pc.read_sbml, {}),
    (
        chemistry.InitialTable,
        Chemistry.set_concentration,
        {"self": "", "name": "'species'", "values": "'concentration'", "by_id": "for arrays"},
    ),
    (
        chemistry.InitialTable,
        Chemistry.set_count,
        {"self": "", "name": "'species'", "values": "'count'", "by_id": "for arrays"},
    ),
    (boundaries.MirrorTable, pc.Mirror, {}),
    (boundaries.ReflectionTable, pc.Reflection, {}),
    (boundaries.SpongeTable, pc.Sponge, {}),
    (boundaries.WallMotionTable, pc.WallMotion, {}),
    (boundaries.MeanVelocityTable, pc.MeanVelocity, {}),
    (boundaries.ReservoirTable, pc.Reservoir, {}),
    (boundaries.FixedValueWallTable, pc.FixedValueWall, {}),
    (boundaries.FluxWallTable, pc.FluxWall, {}),
    (boundaries.BuoyancyTable, pc.Buoyancy, {}),
    (boundaries.BodyForceTable, pc.BodyForce, {}),
    (StopTable, pc.SteadyState, {}),
    (AverageTable, pc.TimeAverage, {}),
]
#: What else is public, and where a file's user has it.
ELSEWHERE = {
    "Simulation": "the file itself: test_tables_of_the_simulation",
    "Device": "options of the command line",
    "Ensemble": "particell ensemble",
    "export_h5md": "particell export",
    "export_vtkhdf": "particell export",
    **dict.fromkeys(("Run", "EnsembleRun"), "what is read afterwards"),
    "SBMLModel": "what read_sbml gives",
    "equilibrated": "it runs a fluid; its points go into a file",
    **dict.fromkeys(
        ("InputError", "Interrupted", "RunError", "EnsembleInterrupted"), "exit status"
    ),
    "LawWarning": "a line, and one in the summary",
    **dict.fromkeys(("Law", "Field"), "code: from a script, as parts of a scheme"),
    **dict.fromkeys(("Operation", "When", "Every", "State", "particle_loop"), "code: operations"),
}


def test_all_that_is_public_can_be_described():
    assert {p.__name__ for _, p, _ in PAIRS} | set(ELSEWHERE) >= set(pc.__all__)
    assert set(ELSEWHERE) <= set(pc.__all__)
    options = {option.name for option in run_command.params}
    assert set(inspect.signature(pc.Device).parameters) <= options | {"form"}  # of loops: code
    assert {"seed", "out", "progress", "overwrite"} <= options


@pytest.mark.parametrize(
    "table, made, without", PAIRS, ids=[f"{t.__name__}-{p.__name__}" for t, p, _ in PAIRS]
)
def test_tables_have_the_parameters_of_what_they_make(table, made, without):
    parameters = inspect.signature(made).parameters
    assert set(parameters) - set(without) <= set(table.model_fields)
    assert set(without) <= set(parameters) - set(table.model_fields)
    for name, info in table.model_fields.items():
        assert info.description, name
        other = ("velocity", "fixed", "seed", "volume", "points")  # made of something else
        if name in parameters and name not in other:
            default = parameters[name].default
            factory = info.default_factory is not None or name == "equation"
            assert factory or info.is_required() or info.default == default, name


def test_tables_of_the_simulation():
    whole = set(SimulationTable.model_fields) | {"seed", "device"}
    tables = set(FileCase.model_fields) - {"simulation", "stop", "run", "constants", "sbml"}
    code = {"operations", "observables"}
    assert set(inspect.signature(Simulation).parameters) <= whole | tables | code
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
    assert one.system.depth == two.system.depth and one.settings == two.settings
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
    python = pc.Simulation(box, [filled, *walls], pc.TransportVelocity(gravity=gravity), seed=1)
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
    pytest.importorskip("libsbml")
    enzyme = Path(__file__).parents[2] / "examples" / "enzyme.xml"
    network = {"path": str(enzyme), "units": {"time": "h"}}
    path.write_text(document(content | {"sbml": [network]}))
    assert call(["check", str(path)]) == 0
    assert "note:      units: 'h' for time is not used" in capsys.readouterr().out


def test_schema(capsys):
    assert call(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    spacing = schema["$defs"]["FilledPhase"]["properties"]["spacing"]
    assert spacing["x-unit"] == "m" and {"type": "string"} in spacing["anyOf"]
    of = schema["$defs"]["PackedFill"]["properties"]["of"]["discriminator"]["mapping"]
    assert set(of) == {"lattice", "rings", "shells", "points", "jittered"}
    assert "path" in schema["$defs"]["SBMLTable"]["required"]
    diffusivity = schema["$defs"]["SBMLTable"]["properties"]["diffusivity"]
    assert diffusivity["x-unit"] == "m^2/s" and len(diffusivity["anyOf"]) == 4
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


def test_rate_laws_with_functions_and_the_time():
    """A source that ends after 0.25 s, and one that ends where there is enough of its product."""
    reactions = [
        {"equation": "0 -> dye", "rate_law": "= where(not (t > pause), fastest, 0)"},
        {
            "equation": "0 -> dye_bound",
            "rate_law": "= fastest * sqrt(maximum(1 - dye_bound / half, 0))",
        },
    ]
    file = FileCase(
        **changed(
            scheme={"type": "Static"},
            species=[{"name": "dye"}, {"name": "dye_bound"}],
            reactions=reactions,
            initial=[],
            boundaries=[],
            constants__fastest="2 mol/m^3/s",
            constants__half="1 mol/m^3",
            constants__pause="0.25 s",
            simulation={"dt": 0.05},
        )
    )
    simulation = file.build(Context())
    simulation.advance(8)
    fluid = simulation.particles.select("fluid")
    found = [simulation.chemistry.concentration(n)[fluid] for n in ("dye", "dye_bound")]
    assert np.allclose(found[0], 0.5, rtol=2e-4)
    # with u = 1 - C/C0: d(sqrt u)/dt = -V/(2 C0), until 0.4 s
    assert np.allclose(found[1], 1 - (1 - 0.4) ** 2, rtol=1e-4)


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


def enzyme(**settings) -> dict:
    """The enzyme's network in particles at rest."""
    network = {"path": str(ENZYME), "diffusivity": {"S": "100 um^2/s"}}
    rest = {"species": [], "reactions": [], "initial": [], "boundaries": []}
    return changed(scheme={"type": "Static"}, sbml=[network], **{**rest, **settings})


def test_networks_from_sbml(tmp_path, monkeypatch):
    """The species, reactions and values that read_sbml gives; more can be added to them."""
    pytest.importorskip("libsbml")
    model = pc.read_sbml(ENZYME, diffusivity={"S": "100 um^2/s"})
    simulation = FileCase(**enzyme()).build(Context())
    assert list(simulation.chemistry.species.values()) == model.species
    fluid = simulation.particles.select("fluid")
    for name, value in model.initial.items():
        assert simulation.chemistry.concentration(name)[fluid] == pytest.approx(value)
    more = enzyme(
        species=[{"name": "I"}],
        reactions=[{"equation": "E + I -> 0", "forward": "1 m^3/mol/s"}],
        initial=[{"species": "E", "concentration": "2 uM"}],
        sbml__1__molecules=["E", "ES"],
        sbml__1__only_in={"cell": "fluid"},
    )
    simulation = FileCase(**more).build(Context())
    assert [s.name for s in simulation.chemistry.species.values()] == ["S", "E", "ES", "P", "I"]
    assert simulation.chemistry.species["E"].molecules
    assert simulation.chemistry.species["S"].only_in == ("fluid",)


def test_a_network_is_found_beside_the_file_and_kept_by_the_run(tmp_path, monkeypatch):
    pytest.importorskip("libsbml")
    (tmp_path / "cases").mkdir()
    shutil.copy(ENZYME, tmp_path / "cases" / "e.xml")
    path = tmp_path / "cases" / "my.toml"
    path.write_text(document(enzyme(sbml__1__path="e.xml")))
    monkeypatch.chdir(tmp_path)
    one = described_case("cases/my.toml", [])
    assert one.sbml[0].path == str(Path("cases") / "e.xml")
    (tmp_path / "cases" / "e.xml").unlink()
    again = FileCase(**json.loads(json.dumps(one.model_dump(mode="json"))))
    assert again == one
    assert len(again.build(Context()).chemistry.species) == 4


def test_arrangements_of_arrangements():
    """Jittered and packed ones are those of Python; volumes one by one."""
    cell = {"cell": {"type": "Circle", "center": ["50 um", "50 um"], "radius": "20 um"}}
    grid = {"type": "lattice", "spacing": "10 um", "shape": "cell"}
    moved = {"type": "jittered", "of": grid, "amplitude": "1 um", "seed": 4}
    relaxed = {"type": "packed", "of": moved, "spacing": "10 um", "keep_inside": "cell"}
    body = {"type": "Phase", "name": "cell", "material": "water", "kind": "wall"}
    rest = {"species": [], "reactions": [], "initial": [], "boundaries": []}

    def points(fill: dict, **more) -> np.ndarray:
        phase = {**body, "fill": fill, **more}
        made = case(phases=[phase], shapes=cell, scheme={"type": "Static"}, **rest)
        again = FileCase(**json.loads(json.dumps(made.model_dump(mode="json"))))
        return again.build(Context()).phases[0]

    box = pc.Domain((0, 0), (1e-4, 1e-4), "x")
    circle = pc.Circle((5e-5, 5e-5), 2e-5)
    first = pc.lattice(box, 1e-5, circle)
    second = pc.jittered(first, 1e-6, 4)
    assert np.allclose(points(moved).points, second, rtol=0, atol=1e-18)
    third = pc.packed(second, box, 1e-5, keep_inside=circle, iterations=3)
    assert np.allclose(points(relaxed | {"iterations": 3}).points, third, rtol=0, atol=1e-15)
    sizes = [f"{100 + k} um^2" for k in range(len(first))]
    assert np.allclose(points(grid, volume=sizes).volume, 1e-10 + 1e-12 * np.arange(len(first)))
    assert np.allclose(points(grid, volume="= height**2 / 100").volume, 1e-10)
    edge = {"type": "points", "points": [[0, "50 um"]], "spacing": "10 um"}
    out = points({"type": "jittered", "of": edge, "amplitude": "1 um", "seed": 1}).points
    assert 0 <= out[0, 0] <= 1e-4


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
