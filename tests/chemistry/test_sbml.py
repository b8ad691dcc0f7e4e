from __future__ import annotations

import sys

import numpy as np
import pytest
from sbml_files import math, reaction, species, write

import particell as pc
from particell.errors import InputError
from particell.materials import AVOGADRO

pytest.importorskip("libsbml")


@pytest.fixture
def read(tmp_path):
    """Writes a file (see sbml_files.write) and reads it."""

    def make(content, reactions, options=None, **more):
        return pc.read_sbml(
            write(tmp_path / "model.xml", content, reactions, **more), **(options or {})
        )

    return make


def rate(reaction, concentrations: dict[str, float]) -> float:
    """Events in mol/m³/s of a one-way reaction of concentrations."""
    law = reaction.rate_law.bind(list(concentrations))
    return law(np.array(list(concentrations.values())), 1.0)


def test_decay_in_minutes(read):
    model = read(
        [species("A", "Concentration=3")],
        [reaction("d", "A", "", "(* cell k A)")],
        parameters="k=6",
    )
    (decay,) = model.reactions
    assert model.kinds == {"d": "mass action"}
    assert (decay.reactants, decay.products) == ({"A": 1}, {})
    assert decay.forward == pytest.approx(0.1, rel=1e-14)  # 6/min
    assert model.initial == {"A": pytest.approx(3.0)}  # mmol/l = mol/m³
    assert model.volumes == {"cell": pytest.approx(2e-3)}
    assert model.parameters == {"k": 6.0}
    assert not decay.reversible


def test_reversible_binding(read):
    model = read(
        [species(s, "Concentration=1") for s in "ABC"],
        [reaction("b", "A + B", "C", "(* cell (- (* kf A B) (* kb C)))", "kf=120 kb=30", True)],
    )
    (binding,) = model.reactions
    assert binding.reversible
    assert binding.reactants == {"A": 1, "B": 1}
    assert binding.products == {"C": 1}
    assert binding.forward == pytest.approx(2.0)  # 120 l/mmol/min
    assert binding.backward == pytest.approx(0.5)


@pytest.mark.parametrize("formula", ["(* cell k A A)", "(* cell k (^ A 2))", "(* k cell A A)"])
def test_dimerisation_counts_events(read, formula):
    model = read([species("A", "Concentration=1"), species("D", "Concentration=0")],
                 [reaction("d", "2 A", "D", formula, "k=60")])  # fmt: skip
    (dimer,) = model.reactions
    assert dimer.reactants == {"A": 2}
    assert dimer.forward == pytest.approx(1.0)  # dA/dt = -2 k A², k in m³/mol/s


def test_michaelis_menten_becomes_a_law(read):
    model = read(
        [species("S", "Concentration=5"), species("P", "Concentration=0")],
        [reaction("m", "S", "P", "(/ (* cell Vmax S) (+ Km S))", "Vmax=90 Km=2")],
    )
    (law,) = model.reactions
    assert model.kinds == {"m": "rate law"}
    for s in (0.0, 1.0, 5.0):
        assert rate(law, {"P": 3.0, "S": s}) == pytest.approx(1.5 * s / (2 + s), abs=1e-15)
    as_molecules = read(
        [species("S", "Concentration=5"), species("P", "Concentration=0")],
        [reaction("m", "S", "P", "(/ (* cell Vmax S) (+ Km S))", "Vmax=90 Km=2")],
        {"molecules": True},
    ).reactions[0]
    volume = 3e-21
    one = 1 / (AVOGADRO * volume)
    found = as_molecules.propensity.bind(["S", "P"])(np.array([7, 1]), volume, 1.0)
    assert found == pytest.approx(1.5 * 7 * one / (2 + 7 * one) / one)


def test_law_in_a_simulation(read):
    """S is used up by Michaelis–Menten: t = (S₀ - S + Km ln S₀/S)/Vmax."""
    model = read(
        [species("X", "Concentration=1"), species("S", "Concentration=4"),
         species("P", "Concentration=0")],
        [reaction("m", "S", "P", "(/ (* cell Vmax S) (+ Km S))", "Vmax=90 Km=2")],
    )  # fmt: skip
    line = pc.Domain((0,), (8.0,), periodic="x", depth=1.0)
    phase = pc.fluid(line, pc.Fluid(density=1.0, viscosity=1.0), 1.0)
    simulation = pc.Simulation(line, phase, pc.Static(), model.species, model.reactions, dt=0.01)
    model.set_initial(simulation.chemistry)
    run = simulation.run(2.0, progress=False)
    s = run.field("concentration/S")[-1]
    assert (4.0 - s + 2 * np.log(4.0 / s)) / 1.5 == pytest.approx(2.0, rel=1e-4)
    np.testing.assert_allclose(s + run.field("concentration/P")[-1], 4.0)


def test_amounts_instead_of_concentrations(read):
    """hasOnlySubstanceUnits: symbols are mmol in 2 l."""
    model = read(
        [species("A", "Amount=6", amounts=True), species("B", "Amount=2", amounts=True)],
        [
            reaction("r", "A + B", "", "(* k A B)", "k=60"),
            reaction("d", "A", "", "(* k A)", "k=60"),
        ],
    )
    assert model.initial == {"A": pytest.approx(3.0), "B": pytest.approx(1.0)}
    # 60 mmol/min per mmol² in 2 l: per volume and in mol/m³ that is 1/s times 2
    assert model.reactions[0].forward == pytest.approx(2.0)
    assert model.reactions[1].forward == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("formula", "factor"), [("(/ (* c A (- A 1)) 2)", 0.5), ("(* c A (- A 1))", 1.0),
                            ("(* c (- (^ A 2) A))", 1.0), ("(* c A A)", 1.0)],
)  # fmt: skip
def test_pairs_of_molecules(read, formula, factor):
    """Items in a volume of 2 l: c N(N-1) events a minute are k N(N-1)/(V 𝒩) of mass action."""
    content = [species("A", "Amount=100", amounts=True), species("D", "Amount=0", amounts=True)]
    reactions = [reaction("d", "2 A", "D", formula, "c=60")]
    model = read(content, reactions, {"molecules": True}, substance="item")
    (dimer,) = model.reactions
    assert dimer.propensity is None
    assert dimer.forward == pytest.approx(factor * 2e-3 * AVOGADRO)
    assert not any("pairs" in note for note in model.notes)
    model = read(content, reactions, substance="item")
    assert model.reactions[0].forward == pytest.approx(factor * 2e-3 * AVOGADRO)
    assert any("pairs" in note for note in model.notes) == ("-" in formula)


def test_the_number_one_is_no_molecule_where_symbols_are_concentrations(read):
    model = read(
        [species("A", "Concentration=3"), species("D", "Concentration=0")],
        [reaction("d", "2 A", "D", "(* cell k A (- A 1))", "k=60")],
    )
    forward, backward = model.reactions
    assert model.kinds["d"] == "rate law"
    assert rate(forward, {"A": 3.0}) - rate(backward, {"A": 3.0}) == pytest.approx(6.0)
    assert (backward.reactants, backward.products) == ({"D": 1}, {"A": 2})


def test_third_order_and_source(read):
    model = read(
        [species("A", "Concentration=1"), species("B", "Concentration=1")],
        [
            reaction("t", "2 A + B", "", "(* cell k (^ A 2) B)", "k=60"),
            reaction("s", "", "A", "(* cell k)", "k=120"),
        ],
    )
    assert [r.forward for r in model.reactions] == [pytest.approx(1.0), pytest.approx(2.0)]
    assert model.reactions[1].reactants == {}


def test_modifier_is_a_catalyst_on_both_sides(read):
    model = read(
        [species(s, "Concentration=1") for s in "SPE"],
        [reaction("c", "S", "P", "(* cell k E S)", "k=60", modifiers="E")],
    )
    (catalysis,) = model.reactions
    assert catalysis.reactants == {"S": 1, "E": 1}
    assert catalysis.products == {"P": 1, "E": 1}
    assert catalysis.forward == pytest.approx(1.0)


def test_order_that_is_not_the_stoichiometry_is_a_law(read):
    model = read(
        [species("A", "Concentration=1")], [reaction("r", "2 A", "", "(* cell k A)", "k=60")]
    )
    assert model.kinds == {"r": "rate law"}
    assert rate(model.reactions[0], {"A": 3.0}) == pytest.approx(3.0)
    assert model.reactions[0].reactants == {"A": 2}


def test_constant_species_is_part_of_the_rate(read):
    model = read(
        [
            species("A", "Concentration=1"),
            species("X", "Concentration=5", boundaryCondition="true"),
        ],
        [reaction("r", "A + X", "", "(* cell k A X)", "k=60")],
    )
    assert [s.name for s in model.species] == ["A"]
    assert model.constants == {"X": pytest.approx(5.0)}
    assert model.reactions[0].reactants == {"A": 1}
    assert model.reactions[0].forward == pytest.approx(5.0)


def test_reversible_law_that_is_no_mass_action(read):
    formula = "(/ (* cell (- (* a S) (* b P))) (+ 1 S P))"
    content = [species("S", "Concentration=1"), species("P", "Concentration=1")]
    model = read(
        content, [reaction("r", "S", "P", formula, "a=60 b=30", True)], {"molecules": True}
    )
    assert len(model.reactions) == 2
    model = read(content, [reaction("r", "S", "P", formula, "a=60 b=30", True)])
    forward, backward = model.reactions
    values = {"S": 3.0, "P": 2.0}
    assert rate(forward, values) == pytest.approx(3 / 6)
    assert rate(backward, values) == pytest.approx(1 / 6)
    assert backward.reactants == {"P": 1}
    model = read(content, [reaction("r", "S", "P", formula, "a=60 b=30")], {"molecules": True})
    (law,) = model.reactions  # one propensity, as it stands; a run in which it is negative stops
    assert any("irreversible" in note for note in model.notes)
    propensity, volume = law.propensity.bind(["S", "P"]), 1e6 / AVOGADRO
    assert propensity(np.array([2, 3]), volume, 1.0) == pytest.approx(0.5 / (1 + 5e-6))
    assert propensity(np.array([1, 2]), volume, 1.0) == 0.0
    assert np.isnan(propensity(np.array([1, 3]), volume, 1.0))


def test_functions_and_initial_assignments_are_expanded(read):
    functions = (
        '<listOfFunctionDefinitions><functionDefinition id="twice">'
        f"{math('k').split('<ci>')[0]}<lambda><bvar><ci> x </ci></bvar><apply><times/><cn> 2 </cn>"
        "<ci> x </ci></apply></lambda></math></functionDefinition></listOfFunctionDefinitions>"
    )
    assignment = (
        '<listOfInitialAssignments><initialAssignment symbol="A">'
        f"{math('(* 2 k)')}</initialAssignment></listOfInitialAssignments>"
    )
    formula = math("(* cell k A)").replace(
        "<ci> k </ci>", "<apply><ci> twice </ci><ci> k </ci></apply>"
    )
    law = reaction("d", "A", "", "(* cell k A)").replace(math("(* cell k A)"), formula)
    model = read(
        [species("A", "Concentration=1")], [law], parameters="k=30", functions=functions,
        extra=assignment,
    )  # fmt: skip
    assert model.reactions[0].forward == pytest.approx(1.0)
    assert model.initial == {"A": pytest.approx(60.0)}


def test_level_2_has_units_of_its_own(tmp_path):
    path = tmp_path / "level2.xml"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<sbml xmlns="http://www.sbml.org/sbml/level2/version4" level="2" version="4"><model>'
        '<listOfCompartments><compartment id="c" size="1e-15"/></listOfCompartments>'
        '<listOfSpecies><species id="A" compartment="c" initialConcentration="2e-6"/>'
        "</listOfSpecies>"
        '<listOfReactions><reaction id="d" reversible="false"><listOfReactants>'
        '<speciesReference species="A" stoichiometry="2"/></listOfReactants><kineticLaw>'
        f'{math("(* c k A A)")}<listOfParameters><parameter id="k" value="3e6"/></listOfParameters>'
        "</kineticLaw></reaction></listOfReactions></model></sbml>"
    )
    model = pc.read_sbml(
        path, diffusivity={"A": "10 um^2/s"}, molecules=["A"], only_in={"c": "fluid"}
    )
    assert model.initial == {"A": pytest.approx(2e-3)}  # 2 µmol/l
    assert model.volumes == {"c": pytest.approx(1e-18)}
    assert model.reactions[0].forward == pytest.approx(3e3)  # l/mol/s in m³/mol/s
    (a,) = model.species
    assert a.molecules
    assert a.diffusivity == pytest.approx(1e-11)
    assert a.only_in == ("fluid",)
    assert model.reactions[0].only_in == ("fluid",)


A = [species("A", "Concentration=1")]
DECAY = [reaction("d", "A", "", "(* cell k A)", "k=1")]
MORE = '<parameter id="p" value="1" constant="false"/>'


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"extra": f'|<listOfEvents><event id="kick" useValuesFromTriggerTime="true"><trigger '
          f'initialValue="true" persistent="true">{math("(gt A 1)")}</trigger>'
          "</event></listOfEvents>"}, "event = 'kick'"),
        ({"more": MORE, "extra": f'<listOfRules><rateRule variable="p">{math("A")}'
          "</rateRule></listOfRules>"}, "rateRule = 'p'"),
        ({"more": MORE, "extra": f'<listOfRules><algebraicRule>{math("(- p A)")}'
          "</algebraicRule></listOfRules>"}, "algebraicRule"),
        ({"reactions": [reaction("f", "A", "", "(* cell k A)", "k=1", fast=True)]}, "fast.* = 'f'"),
        ({"reactions": [reaction("s", "1.5 A", "", "(* cell A)")], "options": {"molecules": True}},
         "stoichiometry of A.* = 1.5"),
        ({"reactions": [reaction("z", "A", "", "(/ A 0)")]}, "reaction z"),
        ({"dimensions": 2}, r"volume of compartment cell of 2 dimensions.*volumes=\{'cell'"),
        ({"substance": "kilogram"}, "'kilogram'"),
        ({"options": {"diffusivity": {"B": 1.0}}}, "diffusivity = 'B'"),
        ({"options": {"molecules": ["B"]}}, "molecules = 'B'"),
        ({"options": {"only_in": {"nucleus": "fluid"}}}, "nucleus"),
        ({"options": {"units": {"mass": "kg"}}}, "units = 'mass'"),
        ({"options": {"diffusivity": "3 kg"}}, "diffusivity of A"),
    ],
)  # fmt: skip
def test_refused_by_name(read, arguments, words):
    given = {"content": A, "reactions": DECAY, **arguments}
    with pytest.raises(InputError, match=words) as error:
        read(**given)
    assert "\n" not in str(error.value)


def test_delays_and_transport_are_refused(read, tmp_path):
    for formula, words in (
        ("(* cell (delay A 1))", r"law of reaction d = 'delay\(A, 1\)'"),
        ("(* cell k (rateOf B))", r"law of reaction d = 'rateOf\(B\)'"),
    ):
        with pytest.raises(InputError, match=words):
            content = [*A, species("B", "Concentration=1")]
            read(content, [reaction("d", "A", "", formula, "k=1", modifiers="B")], version=2)
    with pytest.raises(InputError, match="law of reaction d = 'the time'"):
        law = reaction("d", "A", "", "(* cell k time A)", "k=1")
        read(A, [law], {"molecules": True})
    path = write(tmp_path / "two.xml", [*A, species("B", "Concentration=1")],
                 [reaction("t", "A", "B", "(* k A)", "k=1")])  # fmt: skip
    text = path.read_text().replace(
        "</listOfCompartments>",
        '<compartment id="out" size="1" constant="true" spatialDimensions="3"/>'
        "</listOfCompartments>",
    )
    path.write_text(text.replace('id="B" compartment="cell"', 'id="B" compartment="out"'))
    with pytest.raises(InputError, match=r"compartments of reaction t.*volumes=\{'cell': '1 um"):
        pc.read_sbml(path)


def test_units_in_places_of_early_versions_are_refused(tmp_path):
    def write_level_2(law: str, more: str) -> str:
        path = tmp_path / "early.xml"
        path.write_text(
            '<?xml version="1.0" encoding="UTF-8"?>'
            '<sbml xmlns="http://www.sbml.org/sbml/level2" level="2" version="1"><model id="early">'
            '<listOfUnitDefinitions><unitDefinition id="ml"><listOfUnits><unit kind="litre" '
            'scale="-3"/></listOfUnits></unitDefinition></listOfUnitDefinitions>'
            '<listOfCompartments><compartment id="c" size="1"/></listOfCompartments><listOfSpecies>'
            f'<species id="A" compartment="c" initialConcentration="1"{more}/></listOfSpecies>'
            '<listOfReactions><reaction id="d" reversible="false"><listOfReactants>'
            f'<speciesReference species="A"/></listOfReactants><kineticLaw{law}>{math("(* c A)")}'
            "</kineticLaw></reaction></listOfReactions></model></sbml>"
        )
        return str(path)

    assert pc.read_sbml(write_level_2("", "")).reactions[0].forward == pytest.approx(1.0)
    with pytest.raises(InputError, match="kinetic law of reaction = 'd'"):
        pc.read_sbml(write_level_2(' timeUnits="second"', ""))
    same = pc.read_sbml(write_level_2("", ' spatialSizeUnits="litre"'))
    assert same.reactions[0].forward == pytest.approx(1.0)
    with pytest.raises(InputError, match="spatialSizeUnits of species = 'A'"):
        pc.read_sbml(write_level_2("", ' spatialSizeUnits="ml"'))


def test_units_that_the_file_leaves_open(tmp_path):
    path = write(tmp_path / "open.xml", A, DECAY)
    text = path.read_text()
    for name in ("substance", "extent", "volume", "time"):
        text = text.replace(f'{name}Units="mmol" ', "").replace(f'{name}Units="litre" ', "")
        text = text.replace(f' {name}Units="minute"', "").replace(f'{name}Units="minute"', "")
    path.write_text(text)
    with pytest.raises(
        InputError,
        match=r"units of time of the model.*'substance': 'mol', 'volume': 'm\^3', 'time'",
    ):
        pc.read_sbml(path)
    units = {"substance": "nmol", "volume": "ml", "time": "h"}
    model = pc.read_sbml(path, units=units)
    assert model.initial["A"] == pytest.approx(1e-3)
    assert model.reactions[0].forward == pytest.approx(1 / 3600)


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="readable"):
        pc.read_sbml(tmp_path / "none.xml")
    (tmp_path / "bad.xml").write_text("<sbml")
    with pytest.raises(InputError, match="valid"):
        pc.read_sbml(tmp_path / "bad.xml")
    empty = '<sbml xmlns="http://www.sbml.org/sbml/level3/version2/core" level="3" version="2"/>'
    (tmp_path / "empty.xml").write_text(f'<?xml version="1.0" encoding="UTF-8"?>{empty}')
    with pytest.raises(InputError, match="one with a model"):
        pc.read_sbml(tmp_path / "empty.xml")
    good = write(tmp_path / "good.xml", A, DECAY)
    text = good.read_text().replace(
        'level="3" version="1">',
        'level="3" version="1" xmlns:comp="http://www.sbml.org/sbml/level3/version1/comp/version1" '
        'comp:required="true">',
    )
    (tmp_path / "package.xml").write_text(text)
    with pytest.raises(InputError, match="package = 'comp'"):
        pc.read_sbml(tmp_path / "package.xml")
    (tmp_path / "twice.xml").write_text(good.read_text().replace(DECAY[0], DECAY[0] * 2))
    with pytest.raises(InputError, match="valid"):
        pc.read_sbml(tmp_path / "twice.xml")
    monkeypatch.setitem(sys.modules, "libsbml", None)
    with pytest.raises(InputError, match=r"particell\[sbml\]"):
        pc.read_sbml(good)
