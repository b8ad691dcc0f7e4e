"""Laws and functions are told apart by what they compute, not by what they are called."""

from __future__ import annotations

import copy
import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit

import particell as pc
from cloud import Cloud
from particell.laws import call
from particell.laws.digest import digest

BOX = pc.Domain((0, 0), (10, 10), depth=1.0)
UNIT = pc.Fluid(density=1.0, viscosity=1.0, sound_speed=10.0)


def two(*laws):
    """A simulation of two particles, with laws of the user's."""
    pair = pc.Phase("fluid", UNIT, np.array([[4.0, 5], [6.0, 5]]), 1.0)
    return pc.Simulation(BOX, pair, pc.SDPD(more=laws), dt=0.01)


def sum_of(law, compiled=True):
    """What a law gives a particle whose one neighbour is 2 m away, by a loop of its own."""
    scalars = {name: np.ones(2) for name in ("volume", "mass", "grow", "gap")}
    vectors = {"x": np.array([[2.0], [4.0]]), "v": np.zeros((2, 1))}
    cloud = Cloud(1, 2, {**scalars, "support": np.full(2, 3.0)}, vectors)
    run = cloud.run if compiled else cloud.read
    return run(cloud.sweep([law], {"sum": 0}, {}), {"sum": 0}, "gather")["sum"][0]


def module(tmp_path, text, name="users_own"):
    """The module of that text, in the file and under the name that others before it had."""
    file = tmp_path / f"{name}.py"
    file.write_text(text)
    spec = importlib.util.spec_from_file_location(name, file)
    made = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


LAW = """
from numba import njit
import particell as pc
from particell.laws import call

FACTOR = {factor}

@njit
def inner(r):
    return {inner} * r

@njit
def profile(r):
    return FACTOR * inner(r) + {more}

class Own(pc.Law):
    def pair(self, i, j, ij):
        return {{"sum": call(profile, (ij.r,))}}
"""


@pytest.mark.parametrize("values", [(3.0, 1.0, 0.0), (1.0, 3.0, 0.0), (1.0, 1.0, 4.0)])
def test_a_changed_function_is_another_loop(tmp_path, values):
    """Its own body, a number of its module, and a function that it calls; in one process."""
    for factor, inner, more in ((1.0, 1.0, 0.0), values, (1.0, 1.0, 0.0)):
        law = module(tmp_path, LAW.format(factor=factor, inner=inner, more=more)).Own()
        assert sum_of(law, compiled=False) == pytest.approx(factor * inner * 2.0 + more)


SCRIPT = """
import sys
sys.path[:0] = {paths}
from test_digest import sum_of
from users_own import Own
print(sum_of(Own()))
"""


def test_a_changed_function_is_another_loop_in_the_next_process(tmp_path):
    """The cache on the disk knows the body, not only the name."""
    found = []
    for inner in (1.0, 3.0):
        (tmp_path / "users_own.py").write_text(LAW.format(factor=1.0, inner=inner, more=0.0))
        paths = [str(Path(__file__).parent), str(Path(__file__).parent.parent), str(tmp_path)]
        command = [sys.executable, "-c", SCRIPT.format(paths=paths)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        found.append(float(done.stdout))
    assert found == pytest.approx([2.0, 6.0])


class Answers(pc.Law):
    def __init__(self, answer):
        self.answer = answer

    def pair(self, i, j, ij):
        return {"sum": self.answer(ij.r)}


TABLE = np.linspace(0.0, 3.0, 2001) ** 2


def square(r):
    place = r * 2000.0 / 3.0
    k = min(max(int(place), 0), 1999)
    return TABLE[k] + (place - k) * (TABLE[k + 1] - TABLE[k])


@pytest.mark.parametrize("function", [square, njit(square)], ids=["plain", "compiled"])
def test_a_table(function):
    assert sum_of(Answers(lambda r: call(function, (r,)))) == pytest.approx(4.0, rel=1e-6)


def test_two_functions_of_one_name():
    def of(value):
        @njit
        def same(r):
            return value * r

        return same

    one, other = of(1.0), of(2.0)
    law = Answers(lambda r: call(one, (r,)) + call(other, (r,)))
    assert sum_of(law, compiled=False) == pytest.approx(6.0)


class Holds(pc.Law):
    def __init__(self, value):
        self.value = value

    def finish(self, i, sums):
        return {}


class Odd:
    __slots__ = ()


def shifted(by):
    return lambda r: r + by


LONG = np.arange(5000.0)
CHANGED = LONG.copy()
CHANGED[2500] += 1e-9


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (LONG, CHANGED),
        (LONG, LONG.astype(np.float32)),
        (lambda r: r + 1.0, lambda r: r + 2.0),
        (shifted(1.0), shifted(2.0)),
        ({"a": LONG}, {"a": CHANGED}),
        ([1.0, (2, "x")], [1.0, (2, "y")]),
        (np.float64(1.0), np.float32(1.0)),
        (1.0, np.nextafter(1.0, 2.0)),
        (np.sin, np.cos),
        (UNIT, pc.Fluid(density=1.0, viscosity=2.0, sound_speed=10.0)),
    ],
)
def test_what_differs_is_seen(one, other):
    assert Holds(one).described() != Holds(other).described()
    same = one if callable(one) else copy.deepcopy(one)
    assert Holds(one).described() == Holds(same).described()


def test_functions_of_the_same_code_are_the_same():
    assert Holds(shifted(1.0)).described() == Holds(shifted(1.0)).described()
    function = shifted(1.0)
    before = digest(function, "")
    for _ in range(5000):
        function(1.0)  # Python may rewrite what runs often
    assert digest(function, "") == before


def test_a_run_goes_on_with_the_laws_that_it_began_with():
    for one, same, other in (
        (LONG, LONG.copy(), CHANGED),
        (shifted(0.0), shifted(0.0), shifted(1.0)),
    ):
        state = two(Holds(one)).state()
        two(Holds(same)).restore(state)
        with pytest.raises(pc.InputError, match="scheme of the checkpoint") as error:
            two(Holds(other)).restore(state)
        assert "\n" not in str(error.value)


def test_a_law_whose_code_changed_is_another(tmp_path):
    texts = [LAW.format(factor=1.0, inner=1.0, more=more) for more in (0.0, 0.0, 1.0)]
    found = [module(tmp_path, text).Own().described() for text in texts]
    assert found[0] == found[1] != found[2]


def test_what_cannot_be_compared_is_refused_in_one_line():
    with pytest.raises(pc.InputError, match=r"value of Holds .* described") as error:
        two(Holds(Odd())).state()
    assert "\n" not in str(error.value)

    class Says(Holds):
        def described(self):
            return "as ever"

    state = two(Says(Odd())).state()
    two(Says(Odd())).restore(state)
