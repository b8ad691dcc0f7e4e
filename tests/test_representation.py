from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import particell as pc
from particell.representation import block, brief, shown, span, table


def parsed(markup: str) -> str:
    """The text in well-formed markup."""
    return " ".join(ElementTree.fromstring(markup).itertext())


def test_everything_is_escaped():
    markup = block("<b>", table([("<script>", "a & b")], ("name", '"<i>"'), "x < y"))
    assert "<script>" not in markup
    assert "<i>" not in markup
    assert parsed(markup) == '<b> x < y name "<i>" <script> a & b'


def test_cells():
    assert table([]) == ""
    assert shown(None) == ""
    assert shown(True) == "True"
    assert shown(0.123456) == "0.1235"
    assert shown(np.int64(3)) == "3"
    assert shown({"membrane": 1e-9}) == "membrane: 1e-09"
    assert shown(list(range(20))).endswith("11, … (20)")
    assert span(np.array([[0.0, 1.0], [2.0, 1.0]])) == "0 … 2; 1"
    assert span(np.zeros(0)) == "–"


def test_species_and_reactions():
    species = pc.Species("L", {"fluid": 1e-10}, molecules=True, only_in="fluid")
    assert repr(pc.Species("L", 1e-10)) == "Species('L', 1e-10)"
    for one in (species, pc.Species("L", 1e-10, True, None, 100, 50), pc.Species("L")):
        assert eval(repr(one), {"Species": pc.Species}) == one
    reaction = pc.Reaction("R + L <-> RL", 1.5, 0.5)
    assert repr(reaction) == "Reaction('R + L <-> RL', 1.5, 0.5)"
    tables = pc.Reaction(reactants={"A": 2}, products={"B": 1}, forward=3.0)
    for one in (reaction, tables):
        assert eval(repr(one), {"Reaction": pc.Reaction}) == one
    assert "fluid: 1e-10" in parsed(species._repr_html_())
    text = parsed(reaction._repr_html_())
    assert "1.5 m³/mol/s" in text
    assert "0.5 1/s" in text
    assert "0 … 1" not in brief(species)


@pytest.fixture(scope="module")
def simulation():
    box = pc.Domain((0, 0), (6e-6, 6e-6), periodic="xy", depth=1e-6)
    return pc.Simulation(
        box,
        pc.fluid(box, pc.Fluid(density=1000, viscosity=1e-3), 1e-6),
        pc.Static(),
        [pc.Species("A", 1e-12), pc.Species("M", 1e-12, molecules=True)],
        [pc.Reaction("A -> 0", 2.0)],
    )


def test_simulation(simulation):
    text = parsed(simulation._repr_html_())
    for words in ("36 particles in 2D", "A -> 0", "2 1/s", "molecules", "fluid", "1000"):
        assert words in text
    assert "Species('M', 1e-12, molecules=True)" in repr(simulation)
    assert "\n" not in repr(simulation)
    assert "A -> 0" in parsed(simulation.chemistry._repr_html_())
    (phase,) = simulation.phases
    assert "36 points in 2D" in repr(phase)
    assert "1e-06" in parsed(phase._repr_html_())


def test_particles(simulation):
    text = parsed(simulation.particles._repr_html_())
    for words in ("36 particles in 2D", "x m 5e-07 … 5.5e-06; 5e-07 … 5.5e-06", "kg/m", "group"):
        assert words in text


def test_run_reads_headers_only(simulation, tmp_path, monkeypatch):
    run = simulation.run(0.1, 0.05, out=tmp_path / "a<b", progress=False)
    monkeypatch.setattr(run.source, "read", None)
    monkeypatch.setattr(run.source, "static", None)
    text = parsed(run._repr_html_())
    for words in ("a<b", "frames 3", "0 … 0.1 s", "6 × 6 µm", "concentration/A mol/m^3", "mol"):
        assert words in text
    assert "3 frames" in repr(run)
    with pytest.raises(pc.InputError, match="an existing file"):
        pc.Run(Path(tmp_path) / "nothing")
