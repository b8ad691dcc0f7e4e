"""What files of SBML have besides species, parameters and powers: functions, rules, units …"""

from __future__ import annotations

import math as m

import numpy as np
import pytest
from sbml_files import MATHML, math, reaction, species, write

import particell as pc
from particell.chemistry.sbml import Assigned
from particell.errors import InputError
from particell.materials import AVOGADRO

pytest.importorskip("libsbml")

A = [species("A", "Concentration=1")]
X, K = 3.0, 0.25


@pytest.fixture
def read(tmp_path):
    """Writes a file (see sbml_files.write) and reads it."""

    def make(content, reactions, options=None, **more):
        path = write(tmp_path / "model.xml", content, reactions, **more)
        return pc.read_sbml(path, **(options or {}))

    return make


def rules(**formulas: str) -> str:
    found = "".join(
        f'<assignmentRule variable="{name}">{math(formula)}</assignmentRule>'
        for name, formula in formulas.items()
    )
    return f"<listOfRules>{found}</listOfRules>"


def assignments(**formulas: str) -> str:
    found = "".join(
        f'<initialAssignment symbol="{name}">{math(formula)}</initialAssignment>'
        for name, formula in formulas.items()
    )
    return f"<listOfInitialAssignments>{found}</listOfInitialAssignments>"


def varying(*names: str) -> str:
    return "".join(f'<parameter id="{n}" value="1" constant="false"/>' for n in names)


def run(model, until, dt, splitting="lie"):
    """Concentrations of the first species at the end, with steps of dt."""
    box = pc.Domain((0,), (5.0,), periodic="x", depth=1.0)
    phase = pc.fluid(box, pc.Fluid(density=1.0, viscosity=1.0), 1.0)
    simulation = pc.Simulation(
        box, phase, pc.Static(), model.species, model.reactions, dt=dt, splitting=splitting
    )
    model.set_initial(simulation.chemistry)
    simulation.advance(round(until / dt))
    return {s.name: simulation.chemistry.concentration(s.name)[0] for s in model.species}


#: Formulas of A = 3 and k = 1/4, and what they come to.
FORMULAS = {
    "(abs (- k A))": X - K,
    "(exp (- k))": m.exp(-K),
    "(ln A)": m.log(X),
    "(log A)": m.log10(X),
    "(log logbase 2 A)": m.log2(X),
    "(* (ln 2) A)": m.log(2) * X,
    "(* pi A)": m.pi * X,
    "(* avogadro A)": AVOGADRO * X,
    "(root A)": m.sqrt(X),
    "(root degree 3 A)": X ** (1 / 3),
    "(^ A k)": X**K,
    "(^ (- k A) 2)": (K - X) ** 2,
    "(/ 1 (+ 1 (^ (- A 1) 2)))": 0.2,
    "(floor (/ A 2))": 1.0,
    "(ceiling (/ A 2))": 2.0,
    "(quotient A 2)": 1.0,
    "(rem A 2)": 1.0,
    "(factorial 4)": 24.0,
    "(max k A 2)": 3.0,
    "(min k A 2)": K,
    "(sin A)": m.sin(X),
    "(cos A)": m.cos(X),
    "(tan A)": m.tan(X),
    "(sec A)": 1 / m.cos(X),
    "(arccot A)": m.atan(1 / X),
    "(arcsin k)": m.asin(K),
    "(arccosh A)": m.acosh(X),
    "(arctan A)": m.atan(X),
    "(sinh A)": m.sinh(X),
    "(tanh A)": m.tanh(X),
    "(coth A)": 1 / m.tanh(X),
    "(piecewise 1 (lt A 2) 5 (lt A 4) 7)": 5.0,
    "(piecewise (/ 1 (- A 3)) (neq A 3) 7)": 7.0,
    "(piecewise 2 (and (geq A 3) (leq A 3) (eq A 3)))": 2.0,
    "(piecewise 2 (or (gt A 3) (not (lt A 3))) 1)": 2.0,
    "(piecewise 2 (xor (gt A 3) true) 1)": 2.0,
    "(piecewise 2 (lt k A 5) 1)": 2.0,
    "(piecewise 2 (implies (gt A 2) false) 1)": 1.0,
    "(* time A)": 5.0 * X,
    "(- k A)": K - X,
    "(/ (- A k) (- A 1))": (X - K) / 2,
    "(* (sin A) (- k A))": m.sin(X) * (K - X),
}


@pytest.mark.parametrize("formula", FORMULAS)
def test_functions_in_laws_and_in_rules(read, formula):
    """By compiled laws (one or the difference of two), and worked out for arrays."""
    newest = ("quotient", "rem", "max", "min", "implies")
    model = read(
        A, [reaction("r", "", "A", f"(* cell {formula})")], parameters=f"k={K}",
        more=varying("y"), extra=rules(y=formula), time="second",
        version=2 if any(f"({name} " in formula for name in newest) else 1,
    )  # fmt: skip
    values = np.array([X, 1e-9 * 5.0])  # the time after the species
    total = 0.0
    for each in model.reactions:
        change = each.products.get("A", 0) - each.reactants.get("A", 0)
        sign = float(np.sign(change))
        if each.rate_law is not None:
            total += sign * each.rate_law.bind(["A"])(values, 1.0)
        else:
            total += sign * each.forward * X ** each.reactants.get("A", 0)
        if each.reversible:
            total -= each.backward * X
    assert total == pytest.approx(FORMULAS[formula], rel=1e-12)
    several = model.assigned["y"]({"A": np.array([X, X])}, 5.0)
    np.testing.assert_allclose(several * np.ones(2), FORMULAS[formula], rtol=1e-12)


def test_a_choice_without_an_answer_has_no_value(read):
    law = [reaction("r", "A", "", "(* cell (piecewise k (lt A 2)))")]
    (only,) = read(A, law, parameters="k=60").reactions
    law = only.rate_law.bind(["A"])
    assert law(np.array([1.0]), 1.0) == pytest.approx(1.0)
    assert np.isnan(law(np.array([2.0]), 1.0))


def test_rules_are_put_into_laws_and_can_be_asked(read):
    """Of parameters, of a boundary species, of rules and of a reaction's speed."""
    model = read(
        [*A, species("B", "Concentration=1", boundaryCondition="true")],
        [
            reaction("r", "A", "", "(* cell y B)", modifiers="B"),
            reaction("s", "", "A", "(* 2 r)"),
        ],
        parameters="k=30", more=varying("y", "z"),
        extra=rules(z="(* k A)", y="(* 2 z)", B="(+ A 1)"),
    )  # fmt: skip
    assert [s.name for s in model.species] == ["A"]
    values = np.array([X])
    rates = [r.rate_law.bind(["A"])(values, 1.0) for r in model.reactions]
    assert rates == pytest.approx([X * (X + 1), 2 * X * (X + 1)])  # 30/min and 2 y
    assert set(model.assigned) == {"y", "z", "B"}
    assert model.assigned["B"]({"A": np.array([1.0, 2.0])}) == pytest.approx([2.0, 3.0])
    assert isinstance(model.assigned["y"], Assigned)
    with pytest.raises(InputError, match="with A"):
        model.assigned["y"]({})


def test_initial_values_follow_from_each_other(read):
    """Of a size, of parameters, and of concentrations and amounts."""
    model = read(
        [*A, species("B", "Amount=1", amounts=True)],
        [reaction("r", "A", "", "(* cell p A)")],
        parameters="k=60 p=7",
        extra=assignments(cell="(+ p 1)", p="(/ k 20)", A="(* 2 p)", B="(* A cell)"),
    )
    assert model.parameters == {"k": 60.0, "p": 3.0}
    assert model.volumes == {"cell": pytest.approx(4e-3)}
    assert model.initial == {"A": pytest.approx(6.0), "B": pytest.approx(6.0)}
    assert model.reactions[0].forward == pytest.approx(3 / 60)


def test_a_rule_may_give_a_constant_size(read):
    decay = [reaction("r", "A", "", "(* cell k A)")]
    more = {"parameters": "k=3", "extra": rules(cell="(* 2 k)"), "fixed": False}
    content = [species("A", "Amount=6")]
    assert read(content, decay, **more).initial == {"A": pytest.approx(1.0)}
    with pytest.raises(InputError, match="compartment cell = 'changing'"):
        read(content, decay, **{**more, "extra": rules(cell="(* 2 k time)")})


def test_a_compartment_without_a_size(read):
    amounts = [species("A", "Amount=6", amounts=True)]
    decay = [reaction("r", "A", "", "(* k A)", "k=60")]
    model = read(amounts, decay, volume=None)
    assert model.initial == {"A": pytest.approx(6.0)}  # mmol in one litre
    assert any("cell has no size" in note for note in model.notes)
    model = read(amounts, decay, {"volumes": {"cell": "3 l"}}, volume=None)
    assert model.initial == {"A": pytest.approx(2.0)}
    assert not model.notes
    with pytest.raises(InputError, match=r"size of compartment cell.*volumes=\{'cell'"):
        read([species("A", "Amount=6")], decay, volume=None)
    with pytest.raises(InputError, match="size of compartment cell"):
        read(amounts, [reaction("r", "A", "", "(* cell k A)", "k=60")], volume=None)


def test_a_membrane_stands_for_a_volume(read):
    """4 dm² of a membrane, with 2 mmol/dm², in the 8 l of the particles that stand for it."""
    bind = [reaction("r", "2 A", "", "(* cell k A A)", "k=60")]
    content = [species("A", "Concentration=2")]
    model = read(content, bind, {"volumes": {"cell": "8 l"}}, volume=4.0, dimensions=2)
    assert model.initial == {"A": pytest.approx(1.0)}  # 8 mmol in 8 l
    assert model.reactions[0].forward == pytest.approx(2.0)  # 16 mmol/s in 8 l
    with pytest.raises(InputError, match=r"of 2 dimensions.*volumes=\{'cell': '1 um\^3'\}"):
        read(content, bind, dimensions=2)
    with pytest.raises(InputError, match="compartment in volumes = 'sell'"):
        read(content, bind, {"volumes": {"sell": "8 l"}})
    with pytest.raises(InputError, match="volume of compartment cell"):
        read(content, bind, {"volumes": {"cell": "-8 l"}})


TWO = '<compartment id="out" size="3" constant="true" spatialDimensions="3"/></listOfCompartments>'


def test_compartments_that_share_their_space(tmp_path):
    """A in 1 l, B in 3 l: amounts follow dA/dt = -k (A/1 - B/3), whatever space they share."""
    path = write(
        tmp_path / "two.xml", [*A, species("B", "Concentration=0")],
        [reaction("r", "A", "B", "(* k (- A B))", "k=60", reversible=True)], volume=1.0,
    )  # fmt: skip
    text = path.read_text().replace("</listOfCompartments>", TWO)
    path.write_text(text.replace('id="B" compartment="cell"', 'id="B" compartment="out"'))
    with pytest.raises(InputError, match="compartments of reaction r"):
        pc.read_sbml(path, volumes={"cell": "1 l", "out": "3 l"})
    shared = {"cell": "5 l", "out": "5 l"}
    with pytest.raises(InputError, match="in the same groups"):
        pc.read_sbml(path, volumes=shared, only_in={"cell": "fluid"})
    model = pc.read_sbml(path, volumes=shared)
    found = run(model, 0.5, 0.1)
    exact = 1 - 0.75 * (1 - m.exp(-0.5 * 4 / 3))
    assert found["A"] * 5 == pytest.approx(exact, rel=1e-6)
    assert found["A"] + found["B"] == pytest.approx(0.2, rel=1e-14)


def test_conversion_factors_and_units_of_extent(read, tmp_path):
    decay = [reaction("r", "A", "", "(* k A)", "k=60")]
    model = read(
        [species("A", "Amount=6", amounts=True)], decay, parameters="c=0.5",
        head=' conversionFactor="c"', extent="mole",
    )  # fmt: skip
    assert model.reactions[0].forward == pytest.approx(0.5)
    with pytest.raises(InputError, match=r"units of extent of reaction r = '1 mol'.*species A"):
        read([species("A", "Amount=6", amounts=True)], decay, extent="mole")
    content = [species("A", "Amount=6", conversionFactor="c"), species("B", "Amount=1")]
    with pytest.raises(InputError, match="conversion factors of reaction r = 'A, B'"):
        read(content, [reaction("r", "A", "B", "(* k A)", "k=1")], parameters="c=0.5")


def test_stoichiometries(read, tmp_path):
    """Fractions are whole in a slower reaction; what does not change is constant."""
    model = read(
        [*A, species("B", "Concentration=0")],
        [
            reaction("r", "A", "0.25 B", "(* cell k A)", "k=60"),
            reaction("s", "A", "", "(* cell A)"),
        ],
    )
    first, second = model.reactions
    assert (first.reactants, first.products) == ({"A": 4}, {"B": 1})
    assert first.rate_law.bind(["A", "B"])(np.array([2.0, 0.0]), 1.0) == pytest.approx(0.5)
    assert second.reactants == {"A": 1}
    changing = reaction("r", "2 A", "", "(* cell k A)", "k=60").replace(
        'stoichiometry="2" constant="true"', 'id="n" stoichiometry="2" constant="false"'
    )
    assert read(A, [changing]).reactions[0].reactants == {"A": 2}
    assert read(A, [changing], extra=assignments(n="(+ 1 2)")).reactions[0].reactants == {"A": 3}
    with pytest.raises(InputError, match="stoichiometry of A in reaction r = 'changing'"):
        read(A, [changing], extra=rules(n="(+ 1 A)"))
    path = tmp_path / "level2.xml"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?><sbml xmlns="http://www.sbml.org/sbml/level2/version4"'
        ' level="2" version="4"><model><listOfCompartments><compartment id="c" size="1"/>'
        '</listOfCompartments><listOfSpecies><species id="A" compartment="c" initialAmount="1"/>'
        '</listOfSpecies><listOfReactions><reaction id="d" reversible="false"><listOfReactants>'
        f'<speciesReference species="A"><stoichiometryMath>{math("(/ 6 2)")}</stoichiometryMath>'
        f"</speciesReference></listOfReactants><kineticLaw>{math('(* c A)')}</kineticLaw>"
        "</reaction>"
        "</listOfReactions></model></sbml>"
    )
    assert pc.read_sbml(path).reactions[0].reactants == {"A": 3}


def test_what_changes_nothing_is_left_out_aloud(read):
    constraint = (
        f"|<listOfConstraints><constraint>{math('(gt A 0)')}</constraint></listOfConstraints>"
    )
    held = species("B", "Concentration=1", boundaryCondition="true")
    model = read(
        [*A, held],
        [reaction("r", "B", "", "(* cell k B)", "k=1"), reaction("z", "A", "", "(* 0 A)")],
        extra=constraint,
    )
    assert model.kinds == {"r": "nothing", "z": "nothing"}
    assert not model.reactions
    for words in ("r changes no species", "z has the rate 0", "constraints are not watched"):
        assert any(words in note for note in model.notes)


def test_units_that_are_given_in_vain(read):
    decay = [reaction("d", "A", "", "(* cell k A)", "k=1")]
    model = read(A, decay, {"units": {"volume": "ml", "time": "s"}})
    notes = [note for note in model.notes if "is not used" in note]
    assert len(notes) == 2
    assert "'ml' for volume is not used: the file says 'litre' (0.001 m^3)" in notes[0]
    plain = read(A, decay, {"units": {"substance": "nmol"}}, substance="dimensionless")
    assert plain.initial == {"A": pytest.approx(1e-6)}
    with pytest.raises(InputError, match=r"be said by units=\{'substance'"):
        read(A, decay, substance="dimensionless")


def test_byte_order_marks(tmp_path):
    path = write(tmp_path / "m.xml", A, [reaction("d", "A", "", "(* cell k A)", "k=60")])
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert pc.read_sbml(path).reactions[0].forward == pytest.approx(1.0)


def test_rules_that_need_themselves_and_functions_within_functions(read, tmp_path):
    with pytest.raises(InputError, match="SBML file"):  # libSBML's own check
        read(A, [], more=varying("y", "z"), extra=rules(y="(+ z 1)", z="(+ y 1)"))
    inner = "<lambda><bvar><ci> x </ci></bvar>{}</lambda>"
    body = "<apply><times/><cn> {} </cn>{}</apply>"
    functions = (
        "<listOfFunctionDefinitions>"
        f'<functionDefinition id="twice"><math xmlns="{MATHML}">'
        + inner.format(body.format(2, "<ci> x </ci>"))
        + f'</math></functionDefinition><functionDefinition id="six"><math xmlns="{MATHML}">'
        + inner.format(body.format(3, "<apply><ci> twice </ci><ci> x </ci></apply>"))
        + "</math></functionDefinition></listOfFunctionDefinitions>"
    )
    law = reaction("d", "A", "", "(* cell k A)", "k=10").replace(
        "<ci> k </ci>", "<apply><ci> six </ci><ci> k </ci></apply>"
    )
    assert read(A, [law], functions=functions).reactions[0].forward == pytest.approx(1.0)


@pytest.mark.parametrize("splitting", ["lie", "strang"])
def test_laws_that_depend_on_the_time(read, splitting):
    """dA/dt = -k (1 + sin wt) A, exactly A exp(-k (t + (1 - cos wt)/w)); and a source for 2 s."""
    model = read(
        [*A, species("B", "Concentration=0")],
        [
            reaction("d", "A", "", "(* cell k (+ 1 (sin (* w time))) A)"),
            reaction("s", "", "B", "(* cell (piecewise k (leq time 2) 0))"),
        ],
        parameters="k=0.3 w=2", time="second",
    )  # fmt: skip
    found = run(model, 4.0, 0.5, splitting)
    exact = m.exp(-0.3 * (4.0 + (1 - m.cos(8.0)) / 2))
    assert found["A"] == pytest.approx(exact, rel=1e-5)
    assert found["B"] == pytest.approx(0.6, rel=2e-4)  # a jump, at the end of a step


def test_numbers_of_molecules_are_compared_exactly(read):
    """X is made while there are less than five: never six, as 5 - 1e-16 would have it."""
    model = read(
        [species("X", "Amount=0", amounts=True)],
        [reaction("r", "", "X", "(piecewise k (lt X 5) 0)", "k=5")],
        {"molecules": True, "volumes": {"cell": 0.1 * 0.7}},
        substance="item", time="second", volume=None,
    )  # fmt: skip
    law = model.reactions[0].propensity.bind(["X"])
    volume = 0.07 * (1 + 3e-16)
    assert [law(np.array([n]), volume, 1.0) for n in (0, 4, 5, 6)] == pytest.approx([5, 5, 0, 0])
    # in half the space half as many are as dense
    assert [law(np.array([n]), 0.035, 1.0) for n in (2, 3)] == pytest.approx([2.5, 0])


def test_an_irreversible_difference_of_molecules(read):
    """Events in one direction alone: k (3 - X), not k 3 there and k X back."""
    content = [species("X", "Amount=0", amounts=True)]
    options = {"molecules": True, "volumes": {"cell": 0.07}}
    more = {"substance": "item", "time": "second", "volume": None}
    law = reaction("r", "", "X", "(* k (- 3 X))", "k=5")
    (only,) = read(content, [law], options, **more).reactions
    propensity = only.propensity.bind(["X"])
    found = [propensity(np.array([n]), 0.07 * (1 + 3e-16), 1.0) for n in (0, 2, 3)]
    assert found == pytest.approx([15, 5, 0])
    assert np.isnan(propensity(np.array([4]), 0.07, 1.0))  # a run that comes there is stopped
    both = read(
        content, [law.replace('reversible="false"', 'reversible="true"')], options, **more
    ).reactions
    assert sum(r.reversible for r in both) == 1
    unseen = reaction("r", "", "X", "(* k (sin X))", "k=5", reversible=True)
    model = read(content, [unseen], options, **more)
    there, back = (r.propensity.bind(["X"]) for r in model.reactions)
    assert (there(np.array([1]), 0.07, 1.0), back(np.array([1]), 0.07, 1.0)) == pytest.approx(
        (5 * m.sin(1), 0)
    )
    assert back(np.array([4]), 0.07, 1.0) == pytest.approx(-5 * m.sin(4))
    assert any("one direction at a time" in note for note in model.notes)


def test_functions_that_grow_without_end_are_refused(tmp_path):
    """Thirty functions that each call the one before twice would be 10⁹ parts."""
    body = f'<math xmlns="{MATHML}"><lambda><bvar><ci> x </ci></bvar>'
    functions = (
        f'<functionDefinition id="f0">{body}<ci> x </ci></lambda></math></functionDefinition>'
    )
    for k in range(30):
        twice = f"<apply><ci> f{k} </ci><ci> x </ci></apply>"
        functions += (
            f'<functionDefinition id="f{k + 1}">{body}<apply><plus/>{twice}{twice}</apply></lambda>'
            "</math></functionDefinition>"
        )
    functions = f"<listOfFunctionDefinitions>{functions}</listOfFunctionDefinitions>"
    law = reaction("r", "A", "", "(* cell (f30 A))").replace("<f30/>", "<ci> f30 </ci>")
    file = write(tmp_path / "f.xml", [species("A", "Concentration=1")], [law], functions=functions)
    with pytest.raises(InputError, match="at most 20000 parts"):
        pc.read_sbml(file)
