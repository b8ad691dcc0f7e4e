"""States that no simulation has: one line each, before anything compiled sees them."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

import particell as pc
from particell.errors import InputError
from systems import periodic_lattice, unit_fluid


def flow() -> pc.Simulation:
    return periodic_lattice(8, 2, velocity=lambda x: 0.1 * np.cos(x))


def at_rest() -> pc.Simulation:
    line = pc.Domain((0,), (10,), "x", depth=1.0)
    species = [pc.Species("C"), pc.Species("M", 0.1, molecules=True)]
    made = pc.Simulation(
        line,
        pc.fluid(line, unit_fluid(), 1.0),
        pc.Static(),
        species,
        [pc.Reaction("M -> 0", 1.0)],
        observables={"one": lambda state: 1.0},
    )
    made.chemistry.set_count("M", 3)
    return made


@pytest.fixture(scope="module")
def states():
    made = {"flow": flow(), "at rest": at_rest()}
    for simulation in made.values():
        simulation.plan(0.01)
        simulation.advance(3)
    return {name: simulation.state() for name, simulation in made.items()}


def _row(name: str, value: float):
    def spoil(state: dict) -> None:
        state["fields"][name].reshape(-1)[2] = value

    return spoil


def _put(*path: str, value):
    def spoil(state: dict) -> None:
        place = state
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value

    return spoil


def _without(*path: str):
    def spoil(state: dict) -> None:
        place = state
        for key in path[:-1]:
            place = place[key]
        del place[path[-1]]

    return spoil


def _as(name: str, change):
    def spoil(state: dict) -> None:
        state["fields"][name] = change(state["fields"][name])

    return spoil


FLOW = {
    "an id twice": _row("id", 0),
    "an id below zero": _row("id", -1),
    "an id beyond": _row("id", 64),
    "a huge id": _row("id", 2**62),
    "a group that is not there": _row("group", 1),
    "a group below zero": _row("group", -(2**31)),
    "a wall": _row("is_wall", 1),
    "a wall that slides": _row("slides", 255),
    "a place that is no number": _row("x", math.nan),
    "a place without end": _row("x", math.inf),
    "a place far away": _row("x", 1e300),
    "a velocity that is no number": _row("v", math.nan),
    "a velocity beyond all": _row("v", 1e308),
    "no mass": _row("mass", 0.0),
    "a mass below zero": _row("mass", -1.0),
    "a support beyond the list's": _row("support", 1e3),
    "a support of nothing": _row("support", 0.0),
    "a density that is no number": _row("density", math.nan),
    "a pressure that is no number": _row("pressure", math.nan),
    "fewer rows": _as("x", lambda x: x[:-1]),
    "more rows": _as("id", lambda x: np.arange(len(x) + 1)),
    "other columns": _as("v", lambda v: v[:, :1]),
    "single precision": _as("x", lambda x: x.astype(np.float32)),
    "whole numbers": _as("mass", lambda m: m.astype(np.int64)),
    "floats as ids": _as("id", lambda i: i.astype(float)),
    "a list": _as("x", lambda x: x.tolist()),
    "text": _as("x", lambda x: "x"),
    "nothing": _as("x", lambda x: None),
    "a field less": _without("fields", "x"),
    "a field more": _put("fields", "y", value=np.zeros(64)),
    "another list": _put("neighbours", value={}),
    "places of the list without end": _put("neighbours", "x_built", value=np.full((64, 2), np.inf)),
    "places of the list far away": _put("neighbours", "x_built", value=np.full((64, 2), 1e300)),
    "places of another list": _put("neighbours", "x_built", value=np.zeros((63, 2))),
    "builds below zero": _put("neighbours", "builds", value=-1),
    "a step below zero": _put("clock", "step", value=-1),
    "a step beyond all": _put("clock", "step", value=2**70),
    "half a step": _put("clock", "step", value=1.5),
    "a time that is no number": _put("clock", "time", value=math.nan),
    "a time of text": _put("clock", "time", value="soon"),
    "no dt": _put("clock", "dt", value=0.0),
    "a dt below zero": _put("clock", "dt", value=-1e-3),
    "a dt without end": _put("clock", "dt", value=math.inf),
    "steps of species": _put("clock", "species_every", value=0),
    "more in the clock": _put("clock", "now", value=0.0),
    "a speed that is no number": _put("timing", "speed", value=math.nan),
    "no timing": _put("timing", value=None),
    "a limit below zero": _put("timing", "law_limit", value=-1.0),
    "an account with more": _put("account", "saved", value=1),
    "a momentum of text": _put("account", "momentum", value="much"),
    "another account": _put("account", value=[]),
    "health of text": _put("worst", "mach", value="fine"),
    "no health": _put("worst", value=3),
    "no operations": _put("operations", value=None),
    "other operations": _put("operations", value={"more": {}}),
    "a description less": _without("description", "seed"),
    "another description": _put("description", value=3),
}
AT_REST = {
    "molecules below zero": _row("count", -1),
    "molecules beyond counting": _row("count", 2**62),
    "an amount that is no number": _row("amount", math.nan),
    "a time beyond all numbers": _put("clock", "time", value=10**400),
    "health beyond all numbers": _put("worst", "mach", value=-(10**400)),
    "no chemistry": _without("chemistry"),
    "nothing of operations": _put("operations", value={}),
    "operations without names": _put("operations", value={3: {}}),
    "an operation that is a number": _put("operations", "Observables", value=3),
    "an operation of nothing": _put("operations", "Observables", value={}),
    "names that are a number": _put("operations", "Observables", "names", value=3),
    "names that are numbers": _put("operations", "Observables", "names", value=[1]),
    "events of text": _put("chemistry", "events", value="many"),
    "jumps below zero": _put("chemistry", "jumps", value=-1),
    "a pace that is no number": _put("chemistry", "pace", value=math.nan),
    "remarks that are none": _put("chemistry", "remarks", value=[1]),
    "totals of nothing": _put("account", "totals", value={}),
    "totals of text": _put("account", "totals", value={"C": "much", "M": 1}),
}


@pytest.mark.parametrize(("kind", "spoilt"), [("flow", FLOW), ("at rest", AT_REST)])
def test_states_that_no_simulation_has(states, kind, spoilt):
    make = {"flow": flow, "at rest": at_rest}[kind]
    again = make()
    for what, spoil in spoilt.items():
        state = copy.deepcopy(states[kind])
        spoil(state)
        with pytest.raises(InputError) as error:
            again.restore(state)
        assert "\n" not in str(error.value) and len(str(error.value)) < 3000, what
        assert again.step == 0 and not again.resumed, what
    again.restore(states[kind])
    assert again.step == 3


def test_whole_states_of_walls_that_are_far_away_are_taken(states):
    """What is odd and yet may be: places beyond a periodic box, before lists are built anew."""
    state = copy.deepcopy(states["flow"])
    state["fields"]["x"] += 3.0
    state["neighbours"]["x_built"] += 3.0
    flow().restore(state)
