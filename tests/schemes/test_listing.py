"""A case's laws, their equations, and the loops that are made of them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import particell as pc
from particell.cli import call
from particell.laws import cos, exp, vector, where
from particell.laws.diffusion import pair_slopes
from particell.laws.dimensions import check_units
from particell.laws.equation import equations
from systems import forces


def test_laws_and_equations(capsys):
    assert call(["laws", "couette", "--equations"]) == 0
    text = capsys.readouterr().out
    assert "a += F_ij*m_j*x_ij*(Pi_i + Pi_j)" in text
    assert "ConsistentContinuity" in text


@pytest.mark.parametrize("case", ["natural-convection", "thermal-modes", "yeast-channel"])
def test_equations_of_cases(capsys, case):
    """With a head, with noise, with shifting."""
    assert call(["laws", case, "--equations"]) == 0
    assert "a += " in capsys.readouterr().out


def test_what_is_read_and_written(capsys):
    assert call(["laws", "couette", "--exchange"]) == 0
    text = capsys.readouterr().out
    filtered = text[text.index("filtered_density: ") : text.index("forces: ")]
    assert "\n  of neighbours: mass, volume, x\n" in filtered
    assert "\n  of the particle: is_wall, mass, support, volume, x\n" in filtered
    assert "\n  written: density_half\n" in filtered


def test_the_loop_is_shown(capsys):
    assert call(["laws", "couette", "--show", "forces"]) == 0
    text = capsys.readouterr().out
    assert "def forces(" in text and "Generated" in text
    assert call(["laws", "couette", "--show", "force"]) == 2
    assert "did you mean 'forces'?" in capsys.readouterr().err


def test_particles_at_rest_have_none(capsys):
    assert call(["laws", "turing"]) == 2
    assert "Static" in capsys.readouterr().err


class Spring(pc.Law):
    """A pull towards all neighbours, by a number of its own."""

    def __init__(self, stiffness):
        self.stiffness = stiffness

    def pair(self, i, j, ij):
        inside = where(ij.r < ij.support, 1.0, 0.0)
        return {"a": (-self.stiffness * inside / i.mass) * ij.x}


def two(*laws, scheme=pc.SDPD):
    box = pc.Domain((0, 0), (10, 10), depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    pair = pc.Phase("fluid", unit, np.array([[4.0, 5], [6.0, 5]]), 1.0)
    fields = [pc.Field("temperature")]
    simulation = pc.Simulation(box, pair, scheme(more=laws, fields=fields))
    simulation.start()
    return simulation


@pytest.mark.parametrize("scheme", [pc.SDPD, pc.TransportVelocity])
def test_a_law_of_one_s_own_acts(scheme):
    for stiffness in (0.5, 3.0):  # with other numbers it is the same loop
        a = two(Spring(stiffness), scheme=scheme).particles.by_id("a")
        assert a[:, 0] == pytest.approx([2 * stiffness, -2 * stiffness])
    made = [two(Spring(s)).solver.flow.sweeps().forces().source().text for s in (1.0, 2.0)]
    assert made[0] == made[1]


class Unknown(pc.Law):
    def pair(self, i, j, ij):
        return {"a": j.densty * ij.x}


class Nowhere(pc.Law):
    def pair(self, i, j, ij):
        return {"acceleration": j.density * ij.x}


class Other(pc.Law):
    def finish(self, i, sums):
        return {"tempature_rate": 1.0}


class Misnamed(pc.Law):
    def Pair(self, i, j, ij):  # noqa: N802
        return {"a": ij.x}


class Text(pc.Law):
    own = "weights"

    def pair(self, i, j, ij):
        return {"weights": ij.W}


class Three(pc.Law):
    def finish(self, i, sums):
        return {"a": vector(1.0, 2.0, 3.0)}


class Flat(pc.Law):
    def finish(self, i, sums):
        return {"a": i.density}


class Branches(pc.Law):
    def pair(self, i, j, ij):
        return {"a": ij.x} if ij.r < 1.0 else {}


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (Unknown(), "densty.*did you mean 'density'"),
        (Nowhere(), "acceleration"),
        ("spring", "each item a Law"),
        (Other(), "what Other adds to.*did you mean 'temperature_rate'.*Field.'tempature'"),
        (Misnamed(), "law Misnamed = 'Pair' is not"),
        (Text(), "own of Text"),
        (Three(), "what Three adds to a.*2 components"),
        (Flat(), "what Flat adds to a = 'a number'.*a vector"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(law, words):
    with pytest.raises(pc.InputError, match=words):
        two(law)


def test_a_law_must_not_branch_on_values():
    with pytest.raises(pc.InputError, match=r"Branches\.pair.*where"):
        two(Branches())


class Decay(pc.Law):
    """A rate that reads the field in pair and in finish."""

    def __init__(self, name):
        self.name = name

    def pair(self, i, j, ij):
        return {f"{self.name}_rate": 0.0 * (getattr(j, self.name) - getattr(i, self.name)) * ij.W}

    def finish(self, i, sums):
        return {f"{self.name}_rate": -1.0 * getattr(i, self.name)}


@pytest.mark.parametrize("name", ["c", "k", "at", "x0", "own_2", "t1", "lambda_", "n", "T"])
def test_fields_may_be_called_like_variables_of_the_loop(name):
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    scheme = pc.SDPD(more=[Decay(name)], fields=[pc.Field(name, 1.0)])
    simulation = pc.Simulation(box, pc.fluid(box, unit, 1.0), scheme, dt=0.01)
    simulation.advance(10)
    assert simulation.particles.by_id(name) == pytest.approx(np.exp(-0.1), rel=1e-3)


@pytest.mark.parametrize("name", ["record", "alpha", "time", "position", "closed", "rest_weight"])
def test_names_with_another_meaning_are_refused(name):
    box = pc.Domain((0, 0), (8, 8), periodic="xy")
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    with pytest.raises(pc.InputError, match="does not use itself"):
        pc.Simulation(box, pc.fluid(box, unit, 1.0), pc.SDPD(fields=[pc.Field(name)]))


def test_a_law_s_numbers_are_those_that_it_has_now():
    law = Spring(1.0)
    simulation = two(law)
    before = simulation.particles.by_id("a")[0, 0]
    law.stiffness = 3.0
    forces(simulation, 0, simulation.dt)
    assert simulation.particles.by_id("a")[0, 0] == pytest.approx(
        3 * before, rel=0.01
    )  # but for friction


@pytest.mark.parametrize("kind", [float, np.float32, np.float64, np.array])
def test_numbers_of_any_kind_may_change(kind):
    law = Spring(kind(1.0))
    simulation = two(law)
    before = simulation.particles.by_id("a")[0, 0]
    law.stiffness = kind(3.0)
    forces(simulation, 0, simulation.dt)
    assert simulation.particles.by_id("a")[0, 0] == pytest.approx(3 * before, rel=0.01)


def test_whole_numbers_are_part_of_the_loop_and_must_not_change():
    law = Spring(1)
    simulation = two(law)
    simulation.advance(1)
    law.stiffness = 3
    with pytest.raises(pc.InputError, match=r"stiffness of Spring, changed, = 3 .* be 1, as"):
        simulation.advance(1)


def test_numbers_may_become_whole_numbers():
    law = Spring(1.0)
    simulation = two(law)
    before = simulation.particles.by_id("a")[0, 0]
    law.stiffness = 3
    forces(simulation, 0, simulation.dt)
    assert simulation.particles.by_id("a")[0, 0] == pytest.approx(3 * before, rel=0.01)


@pytest.mark.parametrize("value", ["3", None, [3.0], np.array([3.0]), 1j])
def test_numbers_must_stay_numbers(value):
    law = Spring(1.0)
    simulation = two(law)
    simulation.advance(1)
    law.stiffness = value
    with pytest.raises(pc.InputError, match=r"stiffness of Spring, changed, = .* be a number"):
        simulation.advance(1)


class Times(pc.Law):
    """What is not zero beyond the support by itself, times a number."""

    def __init__(self, factor):
        self.described_factor = lambda: factor

    def pair(self, i, j, ij):
        return {"a": self.described_factor() * (ij.square * j.volume) * ij.e}


def test_whole_numbers_in_a_law_are_numbers():
    """They were taken for numbers of expressions, some of which vanish beyond the support."""
    texts, flow = {}, two(Times(2)).solver.flow
    for factor in (*range(2, 40), *map(float, range(2, 40))):
        sweep = replace(flow.sweeps().forces(), laws=(Times(factor),))
        text = sweep.source("lanes").text
        texts[repr(factor)] = re.sub(rf"\b{int(factor)}(\.0)?\b", "K", text)
    for factor in range(2, 40):
        assert texts[str(factor)] == texts[f"{factor}.0"]


class Lonely(pc.Law):
    """What is finished, with a sum of its own."""

    own = ("weights",)

    def pair(self, i, j, ij):
        return {"weights": j.volume * ij.W, "a": 1.5 * np.pi * ij.x}

    def finish(self, i, sums):
        return {"a": sums.weights * i.x}


def test_equations_have_what_is_finished():
    found = {name: str(value) for name, value in equations(Lonely(), 2).items()}
    assert found == {
        "weights": "V_j*W_ij",
        "a": "3*pi*x_ij/2",
        "a, at the end": "(sum_weights*x_i, sum_weights*y_i)",
    }
    swing = equations(pc.BodyForce(lambda x, y, t: (0.3 * cos(t), 1e-7 * y)), 2)["a"]
    assert str(swing) == "(3*cos(time_i)/10, 1.0e-7*y_i)"


def test_units_of_a_law():
    for dim in (1, 2, 3):
        assert (
            check_units(Spring(2.0), dim, stiffness=f"N/m^{4 - dim}")["a"] == "meter / second ** 2"
        )
    with pytest.raises(pc.InputError, match="unit of what Spring adds to a = "):
        check_units(Spring(2.0), 2, stiffness="N/m")
    with pytest.raises(pc.InputError, match="units in Wrong"):
        check_units(Wrong())
    with pytest.raises(pc.InputError, match="number of Spring = 'stifness'"):
        check_units(Spring(2.0), stifness="N/m")
    with pytest.raises(pc.InputError, match="unit = 'foo'"):
        check_units(Spring(2.0), stiffness="foo")
    with pytest.raises(pc.InputError, match="units in Decay"):  # 1/m³ and none beside each other
        check_units(Decay("c"), fields={"c": "mol/m^3"})


class Wrong(pc.Law):
    def pair(self, i, j, ij):
        return {"a": (ij.r + i.density) * ij.x}


class Explodes(pc.Law):
    """What grows without bound."""

    def finish(self, i, sums):
        return {"c_rate": 1e300 * exp(1e3 * i.time) * i.c}


class Slow(pc.Law):
    """A push that says how long a step may be."""

    def __init__(self, push):
        self.push = push

    def finish(self, i, sums):
        return {"a": self.push * i.x}

    def largest_step(self, i):
        return 1e-3


def test_messages_of_broken_runs_name_laws_of_the_user_s():
    """Of a field of theirs they alone are the cause; of what moves they may be."""
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    laws = [Explodes(), Slow(0.0)]
    scheme = pc.SDPD(more=laws, fields=[pc.Field("c", 1.0)])
    simulation = pc.Simulation(box, pc.fluid(box, unit, 1.0), scheme, dt=0.01)
    with pytest.raises(pc.RunError, match=r"only laws of your own change it: Explodes\)"):
        simulation.advance(3)
    laws[1].push = np.inf
    simulation = pc.Simulation(box, pc.fluid(box, unit, 1.0), scheme, dt=0.01)
    with pytest.raises(pc.RunError, match=r"act on it: Slow\) at dt = 0.01 s.*Slow allows 0.001 s"):
        simulation.advance(1)


@pytest.mark.parametrize("answer", [lambda i: i.densty, lambda i: -1.0, lambda i: "soon"])
def test_a_wrong_largest_step_is_said_in_one_line(answer):
    class Limits(pc.Law):
        def largest_step(self, i):
            return answer(i)

    with pytest.raises(pc.InputError, match=r"Limits.largest_step|did you mean 'density'") as error:
        two(Limits())
    assert "\n" not in str(error.value)


class Answers(pc.Law):
    def __init__(self, answer):
        self.answer = answer

    def pair(self, i, j, ij):
        return self.answer(i, j, ij)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda i, j, ij: ij.x, "a dict"),
        (lambda i, j, ij: {"a": 1.0}, "what Answers adds to a = 'a number'.*a vector"),
        (lambda i, j, ij: {"a": np.cos(ij.r) * ij.x}, "particell.laws"),
        (lambda i, j, ij: {"v": ij.x}, "what Answers adds to = 'v'"),
        (lambda i, j, ij: {"a": ij.x if ij.r == 2.0 else -ij.x}, "where"),
        (lambda i, j, ij: {"a": ij.dist * ij.x}, "Answers.pair"),
        (lambda i, j, ij: {"a": ij.x.outer(ij.x)}, "adds to a = 'a tensor'"),
        (lambda i, j, ij: {"a": ij.x * ij.x}, "Answers.pair"),
        (lambda i, j, ij: {"a": "far"}, "what Answers adds"),
        (lambda i, j, ij: {"a": None}, "what Answers adds"),
        (lambda i, j, ij: {"temperature_rate": "warm"}, "what Answers adds"),
        (lambda i, j, ij: {"temperature_rate": ij.x}, "a vector'.*a number"),
        (lambda i, j, ij: {1: ij.x}, "Answers.pair.*a dict"),
        (lambda i, j, ij: {"a": ij.suport * ij.x}, "Answers.pair.*did you mean 'support'"),
        (lambda i, j, ij: {"a": i.densty * ij.x}, "Answers.pair.*did you mean 'density'"),
    ],
)
def test_wrong_answers_name_the_law(answer, words):
    with pytest.raises(pc.InputError, match=words):
        two(Answers(answer))


def test_equality_is_a_comparison_of_values():
    law = Answers(lambda i, j, ij: {"a": where(i.density == 1.0, 2.0, 5.0) * ij.x})
    assert two(law).particles.by_id("a")[0, 0] == pytest.approx(-4.0)


class Drawn(pc.Law):
    """Reads one field of neighbours, another one of the particle, a third one when it ends."""

    def pair(self, i, j, ij):
        return {"a": (i.mine * j.its * ij.F) * ij.x}

    def finish(self, i, sums):
        return {"a": i.last * i.v}


def test_a_field_that_a_law_reads_of_neighbours_is_known_without_a_word():
    fields = [pc.Field(name) for name in ("mine", "its", "last")]
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)

    def forces(*more):
        scheme = pc.SDPD(more=more, fields=fields)
        return pc.Simulation(box, pc.fluid(box, unit, 1.0), scheme).solver.flow.sweeps().forces()

    before, after = forces(), forces(Drawn())
    for what, more in (
        ("reads_of_neighbours", {"its", "its_rate"}),  # fields are seen half a step on
        ("reads", {"mine", "mine_rate", "last", "last_rate"}),
        ("writes", set()),
    ):
        old, new = (set(getattr(sweep, what)()) for sweep in (before, after))
        assert new - old == more and old <= new
    assert before.writes() == ("a",)
    assert {"x", "v", "volume", "pressure_term"} <= set(before.reads_of_neighbours())
    assert not {"a", "image", "wall_normal"} & set(pair_slopes(2, 0, True).reads_of_neighbours())


def test_functions_that_take_the_particle_s_place_read_what_they_take():
    """Of walls the depth and the normal, by their place in the list."""
    box = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)
    walls = pc.channel_walls(box, unit, 1.0, axis=1)
    simulation = pc.Simulation(box, [pc.fluid(box, unit, 1.0), *walls], pc.SDPD())
    read = simulation.solver.flow.sweeps().forces().reads_of_neighbours()
    assert {"wall_normal", "wall_depth", "wall_curvature"} <= set(read)


def test_what_does_not_vanish_by_itself_ends_at_the_support():
    """Lanes that only fill a vector add nothing: here seven of eight."""
    law = Answers(lambda i, j, ij: {"a": 3.0 * ij.e})
    assert two(law).particles.by_id("a")[:, 0] == pytest.approx([-3.0, 3.0])


class Sums(pc.Law):
    """Sums whose names differ by case, and by what looks like a component."""

    own = ("s", "S", "s_0")

    def pair(self, i, j, ij):
        return {"s": ij.e, "S": 10.0 * ij.W * 0.0 + 10.0, "s_0": 100.0 + 0.0 * ij.W}

    def finish(self, i, sums):
        return {"a": 1.0 * sums.s + vector(sums.S, sums.s_0)}


def test_sums_of_like_names_are_apart():
    a = two(Sums()).particles.by_id("a")
    assert a[0] == pytest.approx([-1.0 + 10.0, 100.0])


@pytest.mark.parametrize("bulk", [0.0, 0.4])
def test_two_particles_at_one_place_do_nothing(bulk):
    box = pc.Domain((0, 0, 0), (10, 10, 10), depth=1.0)
    unit = pc.Fluid(density=1.0, viscosity=1.0, bulk_viscosity=bulk, sound_speed=10.0)
    pair = pc.Phase("fluid", unit, np.array([[5.0, 5, 5], [6.0, 5, 5]]), 1.0)
    simulation = pc.Simulation(box, pair, pc.SDPD(), dt=0.01)
    simulation.particles.set("x", np.full((2, 3), 5.0))
    simulation.start()
    assert np.abs(simulation.particles.by_id("a")).max() == 0.0


def test_a_cache_that_cannot_be_written_costs_a_file_of_the_process(monkeypatch, tmp_path):
    from particell.compute import generated

    (tmp_path / "sweeps").write_text("in the way")
    monkeypatch.setenv("PARTICELL_CACHE_DIR", str(tmp_path))
    module = generated.load("trial", "VALUE = 3\n", {})
    assert module.VALUE == 3
