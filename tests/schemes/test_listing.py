"""A case's laws, their equations, and the loops that are made of them."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.cli import call
from particell.laws import where


def test_laws_and_equations(capsys):
    assert call(["laws", "couette", "--equations"]) == 0
    text = capsys.readouterr().out
    assert "a += F_ij*m_j*x_ij*(Pi_i + Pi_j)" in text
    assert "ConsistentContinuity" in text


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
    simulation = pc.Simulation(box, pair, scheme(more=laws))
    simulation.start()
    return simulation


@pytest.mark.parametrize("scheme", [pc.SDPD, pc.TransportVelocity])
def test_a_law_of_one_s_own_acts(scheme):
    for stiffness in (0.5, 3.0):  # with other numbers it is the same loop
        a = two(Spring(stiffness), scheme=scheme).particles.by_id("a")
        assert a[:, 0] == pytest.approx([2 * stiffness, -2 * stiffness])
    made = [two(Spring(s)).solver.sweeps().forces().source().text for s in (1.0, 2.0)]
    assert made[0] == made[1]


class Unknown(pc.Law):
    def pair(self, i, j, ij):
        return {"a": j.densty * ij.x}


class Nowhere(pc.Law):
    def pair(self, i, j, ij):
        return {"acceleration": j.density * ij.x}


class Branches(pc.Law):
    def pair(self, i, j, ij):
        return {"a": ij.x} if ij.r < 1.0 else {}


@pytest.mark.parametrize(
    ("law", "words"),
    [(Unknown(), "densty"), (Nowhere(), "acceleration"), ("spring", "each item a Law")],
)
def test_what_is_wrong_is_said_in_one_line(law, words):
    with pytest.raises(pc.InputError, match=words):
        two(law)


def test_a_law_must_not_branch_on_values():
    with pytest.raises(TypeError, match="where"):
        two(Branches())
