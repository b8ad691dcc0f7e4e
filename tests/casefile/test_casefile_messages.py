"""Every wrong case file is refused in one line that says what, where, and what is allowed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from case_files import case, changed, document, small

from particell.casefile.case import FileCase
from particell.cases.base import Context
from particell.cases.files import MOST_BYTES, read_case_file
from particell.cli import call
from particell.errors import InputError


def refused(*words: str, **settings) -> None:
    with pytest.raises(InputError) as error:
        case(**settings).build(Context())
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_lengths():
    refused("radius", "greater than 0", shapes__c={"type": "Ball", "center": [0, 0], "radius": 0})
    refused("phases #1.spacing = -1.0", "greater than 0", phases__1__spacing=-1.0)
    refused("domain.depth = 0", "greater than 0", domain__depth=0)
    refused("upper", "greater than 'lower'", domain__upper=[0, "1 um"])
    refused("domain.upper #1", "a number in m", domain__upper=[1e400, 1])


def test_masses():
    refused("materials.water.density = 0", "greater than 0", materials__water__density=0)
    refused("materials.water.density = '-1.0 kg", constants__density="-1 kg/m^3")
    refused("mass of 'fluid'", "1e-200", materials__water__density=1e300)


def test_diffusivities():
    refused("diffusivity in species 'dye'", "finite number >= 0", species__1__diffusivity=-1)
    refused("diffusivity in fluid in species 'dye'", species__1__diffusivity={"fluid": -1})


def test_empty_domain():
    empty = {"type": "Ball", "center": ["9 mm", 0], "radius": "1 um"}
    refused(
        "at least one particle",
        phases=[{**small()["phases"][0], "shape": "c"}],
        shapes__c=empty,
        species=[],
        reactions=[],
        initial=[],
        boundaries=[],
    )
    refused("phases", "at least 1 item", phases=[])
    refused("spacing", "at most the shortest edge", phases__1__spacing=1.0, phases__2__spacing=1.0)


def test_points_of_a_phase_that_are_nearly_at_the_same_place():
    near = {"type": "points", "points": [[1e-5, 1e-5], [1.01e-5, 1e-5]], "spacing": 1e-5}
    phase = {"type": "Phase", "name": "f", "material": "water", "fill": near}
    rest = {"species": [], "reactions": [], "initial": [], "boundaries": []}
    refused("phases", "on top of each other", phases=[phase], **rest)


def test_overlapping_particles():
    again = {**small()["phases"][0], "name": "again"}
    refused("again and fluid", "on top of each other", phases=[*small()["phases"], again])


def test_support():
    refused("support", "half of the shortest periodic edge", scheme__support=5)


def test_unknown_names():
    refused("species in initial", "'dye'", "did you mean 'dye'", initial__1__species="dy")
    refused("reactions", "'dye_bond'", "'dye_bound'", reactions__1__equation="dye <-> dye_bond")
    refused("boundaries #1", "'dy'", boundaries__1__values={"dy": 1})
    refused("group in", "'wall-upper'", boundaries__1__group="wal-upper")
    refused("material", "phases 'fluid'", "'water'", phases__1__material="watr")
    refused("shape", "'upper_half'", phases__1__shape="uper_half")
    refused("kernel", "did you mean 'lucy'", scheme__kernel="lucky")
    refused("observable in stop", "kinetic_energy", stop={"observable": "energy"})
    refused("forces #1", "'dye'", forces=[_buoyancy("dyy")])
    sponge = {"type": "Sponge", "start": 0, "end": 1e-5, "time": 1, "species": {"dyee": 1}}
    refused("species in Sponge", "'dye'", boundaries=[sponge])
    refused("only_in", "fluid", species__1__only_in="fluit")
    refused("fixed", "wall-upper", phases=[_packed(["walls"]), *small()["phases"][1:]])
    refused("without themselves", phases=[_packed(["fluid"]), *small()["phases"][1:]])
    refused("shape in shapes.a", "upper_half", shapes__a={"type": "complement", "of": "half"})
    refused("without themselves", shapes__a={"type": "complement", "of": "a"})


def test_an_item_is_named_once():
    """By its place in the file, and not again by the class that refuses it."""

    def refuses(begin: str, **settings) -> None:
        with pytest.raises(InputError) as error:
            case(**settings).build(Context())
        assert str(error.value).startswith(f"{begin} is not allowed: it must be"), error.value

    place = "reactions 'dye -> dye_bound'"
    plain = {"equation": "dye -> dye_bound", "forward": 1.0}
    refuses("species in reactions 'dye -> x' = 'x'", reactions=[{**plain, "equation": "dye -> x"}])
    refuses("reactions = 'dye <- x'", reactions__1__equation="dye <- x")
    refuses(f"forward rate in {place} = -1", reactions=[{**plain, "forward": -1}])
    refuses(f"units in {place} = 'mol'", reactions=[{**plain, "units": "mol"}])
    refuses(f"group in forward in {place} = 'x'", reactions=[{**plain, "forward": {"x": 1}}])
    refuses("diffusivity in species 'dye' = -1", species__1__diffusivity=-1)
    refuses("diffusivity in fluid in species 'dye' = -1.0", species__1__diffusivity={"fluid": -1})
    refuses("species in initial #1 = 'dy'", initial__1__species="dy")


def _buoyancy(name: str) -> dict:
    return {"type": "Buoyancy", "species": name, "expansion": 1, "gravity": [0, 1]}


def _packed(fixed: list[str]) -> dict:
    fill = {"type": "arranged", "kind": "packed", "spacing": "= spacing", "fixed": fixed}
    return {"type": "Phase", "name": "fluid", "material": "water", "fill": fill}


def test_units():
    refused("phases #1.spacing = '3 kg'", "'kilogram'", phases__1__spacing="3 kg")
    motion = {"type": "WallMotion", "group": "wall-upper"}
    refused("angle", "in rad", boundaries=[{**motion, "angle": "= t"}])
    refused("one of", boundaries=[{**motion, "angle": "= x / height"}])
    refused("velocity", "one of", phases__1__velocity=["= speed * t / t", 0])
    refused("forward in reactions", "'meter'", "1/s", reactions__1__forward="3 m")
    refused("forward", "m^3/mol^1/s", reactions__1={"equation": "2 dye -> dye", "forward": "1 1/s"})
    refused("velocity", "another dimension", phases__1__velocity=["= y", 0])
    refused("velocity", "units go together", phases__1__velocity=["= y + speed", 0])
    refused("constants.height", "unit", constants__height="100 umm")
    refused("constants.height", "unit", constants__height="100 (um")
    refused("run.until = '0.8 m'", "'meter'", run__until="0.8 m")
    refused("gravity", "2 numbers", scheme__gravity=[1])
    law = {"equation": "dye -> dye_bound", "rate_law": "dye * 2"}
    refused("rate_law", "mol/m^3/s", reactions=[law])
    refused("rate_law", "dye_bound", reactions=[{**law, "rate_law": "dy / (1 s)"}])
    timed = {**law, "rate_law": "where(t < height / speed, dye, 0) * speed / height"}
    whole = [{"name": "dye", "molecules": True}, {"name": "dye_bound", "molecules": True}]
    refused("rate_law", "without the time t", reactions=[timed], species=whole)
    refused(
        "rate_law",
        "units go together",
        reactions=[{**law, "rate_law": "exp(dye) * speed / height"}],
    )


def test_numbers_of_molecules():
    refused("count of dye", "2.5", "whole number", initial=[{"species": "dye", "count": 2.5}])
    refused("count of dye", "-1", "whole number", initial=[{"species": "dye", "count": -1}])
    whole = [{"name": "dye", "molecules": True}, {"name": "dye_bound", "molecules": True}]
    count = {"species": "dye", "count": "= y / height"}
    refused("count of dye", "whole numbers", species=whole, initial=[count])
    refused("molecules=True", initial=[{"species": "dye", "count": 3}])
    refused("given one of them", initial=[{"species": "dye"}])


def test_what_cannot_be_stepped():
    refused("dt = ", "at least", run={"until": 1e20})
    refused("dt", "at least", materials__water__sound_speed=1e100)
    refused("numbers that can be computed", materials__water__sound_speed=1e200)
    refused("dt = ", "viscosity makes the step unstable", simulation={"dt": "1 s"})
    fast = {"simulation": {"dt": "0.1 ms"}, "species__1__diffusivity": "1e-5 m^2/s"}
    refused("dt = ", "diffusion of concentrations", **fast)
    whole = [{"name": "dye", "molecules": True}, {"name": "dye_bound", "molecules": True}]
    many = [{"species": "dye", "concentration": 1e100}]
    refused("number of molecules", species=whole, initial=many)


def test_misspelt_keys():
    refused("key = 'domian'", "did you mean 'domain'", domian={})
    refused("key in domain = 'uper'", "did you mean 'upper'", domain__uper=1)
    refused("key in phases #2 = 'layer'", "did you mean 'layers'", phases__2__layer=3)
    refused("phases #2.type", "did you mean 'channel_walls'", phases__2__type="chanel_walls")
    refused("scheme.type = None", "SDPD", scheme={})
    refused("key in species 'dye' = 'molecule'", "'molecules'", species__1__molecule=True)
    refused("did you mean 'until'", run={"untill": 1})
    refused("run.until = None", "given", run={})
    refused("materials.water", "a table", materials__water=3)
    refused("a table", phases=[3])
    refused("phases", "a list", phases=3)


def test_what_else_does_not_fit():
    refused("phase = 'wall-lower'", "used once", phases=[*small()["phases"], small()["phases"][1]])
    refused("at most 1 in 2 dimensions", phases__2__axis=2)
    refused("2 numbers, as the domain", shapes__upper_half={"type": "HalfSpace"} | _plane())
    refused("'Ball' in 2", shapes__c={"type": "Sphere", "center": [0, 0], "radius": 1})
    refused("at most 'until'", run={"until": 1, "every": 2})
    refused("memory", phases__1__spacing=1e-12)
    refused("memory", phases__2__spacing=1e-30)
    refused("1e+09 frames", run__every=5e-324)
    refused("finite wherever", phases__1__velocity=["= speed / (y / height - y / height)", 0])
    refused("axis of MeanVelocity", boundaries=[{"type": "MeanVelocity", "velocity": 1, "axis": 1}])
    refused("name", name="../../elsewhere")


def _plane() -> dict:
    return {"point": [0, 0, 0], "normal": [0, 0, 1]}


def test_averages():
    refused("one of grid, line, points", averages=[{"fields": ["velocity"]}])
    refused("one of grid", averages=[{"grid": [2, 2], "points": [[0, 0]]}])
    refused("did you mean 'velocity'", averages=[{"fields": ["velocty"], "grid": [2, 2]}])
    refused("averages", "a name each", averages=[{"grid": [2, 2]}] * 2)
    refused("points", "of 2 numbers", averages=[{"points": [[0, 0, 0]]}])
    refused("group in averages", averages=[{"grid": [2, 2], "groups": ["water"]}])
    refused("shape", "averages #1", averages=[{"grid": [2, 2, 2]}])
    refused("at most", averages=[{"grid": [10**9, 10**9]}])
    refused("kernel", averages=[{"grid": [2, 2], "kernel": "gauss"}])


def test_networks(tmp_path):
    pytest.importorskip("libsbml")
    path = Path(__file__).parents[2] / "examples" / "enzyme.xml"
    network = {"path": str(path)}
    rest = {"species": [], "reactions": [], "initial": [], "boundaries": []}
    refused("SBML file in sbml #1", "a readable file", sbml=[{"path": "nothing.xml"}])
    refused("a readable file", sbml=[{"path": "a\0"}])
    refused("a readable file", sbml=[{"path": str(tmp_path)}])
    (tmp_path / "a.xml").write_bytes(b"\xff\xfe")
    refused("in UTF-8", sbml=[{"path": str(tmp_path / "a.xml")}])
    refused("sbml #1", "valid (line", sbml=[{**network, "text": "<sbml>"}])
    refused("key in sbml #1", "'molecules'", sbml=[{**network, "molecule": True}])
    refused("species in molecules in sbml #1", "'E'", sbml=[{**network, "molecules": ["EX"]}])
    refused("compartment", "'cell'", sbml=[{**network, "only_in": {"sell": "fluid"}}])
    refused("compartment in volumes", "'cell'", sbml=[{**network, "volumes": {"sell": "1 um^3"}}])
    length = {**network, "volumes": {"cell": "1 um"}}
    refused("volume of compartment", "'micrometer'", sbml=[length])
    refused("group", "'fluid'", sbml=[{**network, "only_in": {"cell": "fluit"}}], **rest)
    slow = {"S": {"fluit": 1}}
    refused("diffusivity of S", "'fluid'", sbml=[{**network, "diffusivity": slow}], **rest)
    refused("diffusivity", "'meter'", sbml=[{**network, "diffusivity": {"S": "1 m"}}], **rest)
    refused("sbml #1.path", "given", sbml=[{}])
    refused("species", "'S'", sbml=[network], **rest | {"species": [{"name": "S"}]})


def test_arrangements_of_arrangements():
    grid = {"type": "lattice", "spacing": "= spacing"}
    moved = {"type": "jittered", "of": grid, "amplitude": 1e-7}

    def fill(words, *more, **table):
        phase = {"type": "Phase", "name": "f", "material": "water", "fill": table}
        refused(words, *more, phases=[phase])

    fill("key in phases 'f'.fill.of", "'spacing'", **moved | {"of": {**grid, "spacin": 1}})
    fill("fill.of.type", "rings", type="jittered", of={}, amplitude=1)
    fill("fill.of.type", "lattice", type="jittered", of={"type": "packd"}, amplitude=1)
    fill("amplitude", "greater than or equal to 0", **moved | {"amplitude": -1})
    packed = {"type": "packed", "of": moved, "spacing": 1e-6}
    fill("iterations", "10000", **packed | {"iterations": 10**9})
    fill("shape in phases 'f'", "'upper_half'", **packed | {"keep_inside": "uper_half"})
    fill("fixed", "'f'", **packed | {"fixed": ["g"]})
    fill("without themselves", **packed | {"fixed": ["f"]})


def test_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(document(changed(domain__uper=1)))
    for command in ("run", "check"):
        assert call([command, "my.toml"]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "did you mean 'upper'" in error
    assert not (tmp_path / "out").exists()
    assert call(["check", "my.toml", "--set", "run.untill=3"]) == 2
    assert "did you mean" in capsys.readouterr().err
    for text in ("a = [" * 3000, "a = 1" + "0" * 5000, "a = \xff", "\0", "a = 1\na = 2"):
        (tmp_path / "bad.toml").write_text(text, encoding="latin-1")
        assert call(["check", "bad.toml"]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_existing_output_directory(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(document(small()))
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "thesis.tex").write_text("precious")
    assert call(["run", "my.toml", "--out", "used"]) == 2
    assert "a new or empty directory (or give --overwrite)" in capsys.readouterr().err
    (tmp_path / "case.toml").write_text("mine")
    assert call(["new"]) == 2
    assert "a new file" in capsys.readouterr().err
    assert (tmp_path / "case.toml").read_text() == "mine"


def test_schema_knows_every_table():
    schema = FileCase.model_json_schema()
    assert json.dumps(schema)
    assert schema["additionalProperties"] is False
    assert {"domain", "phases", "scheme", "run"} <= set(schema["required"])


def test_a_file_larger_than_anybody_writes_is_not_read(tmp_path):
    path = tmp_path / "large.toml"
    path.write_bytes(b"#" * MOST_BYTES)
    assert read_case_file(path) == (FileCase, {"name": "large"})
    path.write_bytes(b"#" * (MOST_BYTES + 1))
    with pytest.raises(InputError, match=f"a file of at most {MOST_BYTES} bytes"):
        read_case_file(path)
