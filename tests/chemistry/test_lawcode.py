"""Formulas as machine code: what they are compiled to, and that it is kept on disk."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import particell as pc
from particell.chemistry import lawcode
from particell.chemistry.formula import (
    FUNCTIONS,
    Call,
    Number,
    Operation,
    Symbol,
    call,
    extent,
    operation,
)
from particell.chemistry.lawcode import Law, dispatcher
from particell.chemistry.polynomials import MOST_TERMS, polynomial, split
from particell.compute import cache
from particell.compute.loop import Loop, cuda_python, particle_loop
from particell.errors import InputError

A, B = Symbol("A"), Symbol("B")


@particle_loop
def evaluate(i, values, out, *, LAW):
    """Both laws of a row of concentrations."""
    out[i] = LAW(0, values[i], 2.0) + LAW(1, values[i], 1.0)


def laws(exponent: float) -> list:
    """A/(1 + A^n), and exp(B)."""
    power = operation("^", A, Number(exponent))
    hill = operation("/", A, operation("+", Number(1.0), power))
    return [law.body(["A", "B"]) for law in (Law(hill), Law(call("exp", B)))]


VALUES = np.array([[2.0, 0.0], [1.0, 1.0]])


def outcome(choose) -> tuple[np.ndarray, object]:
    """What a loop that was not compiled in this process yet gives, and the cache's statistics."""
    loop = Loop(evaluate.body)
    made = []
    compiled = lawcode.njit  # the loop's own function is made by the same Numba

    class Recording:
        def __call__(self, **options):
            def make(function):
                made.append(compiled(**options)(function))
                return made[-1]

            return make

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("particell.compute.loop.njit", Recording())
        run = loop.specialise(LAW=choose)
    out = np.zeros(2)
    run(2, VALUES, out)
    return out, made[0].stats


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """No compiled code on disk."""
    monkeypatch.setenv("PARTICELL_CACHE_DIR", str(tmp_path))
    cache.cache_directory.cache_clear()
    yield
    cache.cache_directory.cache_clear()


def test_compiled_laws_are_kept_on_disk(empty_cache):
    first, stats = outcome(dispatcher(laws(2.0), "C, k"))
    np.testing.assert_allclose(first, [2 * 0.4 + 1, 1 + np.e])
    assert sum(stats.cache_misses.values()) == 1
    lawcode._dispatcher.cache_clear()  # as in another process
    again, stats = outcome(dispatcher(laws(2.0), "C, k"))
    assert sum(stats.cache_hits.values()) == 1
    np.testing.assert_array_equal(again, first)
    other, stats = outcome(dispatcher(laws(3.0), "C, k"))  # other laws are not taken for them
    assert not stats.cache_hits
    np.testing.assert_allclose(other, [4 / 9 + 1, 1 + np.e])


def test_functions_of_a_script_are_not_kept(empty_cache):
    def own(C, k):
        return k * C[0]

    found, stats = outcome(dispatcher([lawcode.njit(own), laws(2.0)[1]], "C, k"))
    assert stats.cache_path is None
    np.testing.assert_allclose(found, [5.0, 2 + np.e])


def test_the_text_of_a_law_has_nothing_of_a_file_in_it():
    tree = operation("*", Number(2.0), operation("/", Symbol("__import__"), B))
    (line,) = Law(tree).body(["__import__", "B"])
    assert line == "    return k * (2.0 * (C[0] / C[1]))"
    with pytest.raises(InputError, match="species in a rate law = 'A'"):
        Law(A).body(["B"])


def test_what_is_used_twice_is_computed_once_and_deep_formulas_get_lines():
    shared = operation("+", A, B)
    for _ in range(40):  # 2^40 terms, were they written out
        shared = operation("*", shared, operation("+", shared, Number(1.0)))
        shared = operation("/", shared, operation("+", Number(1.0), shared))
    law = Law(shared)
    assert len(law.body(["A", "B"])) < 200
    x = y = 0.75
    x += y
    for _ in range(40):
        x *= x + 1
        x /= 1 + x
    assert law.bind(["A", "B"])(np.array([0.75, 0.75]), 1.0) == pytest.approx(x)
    long = A
    for k in range(300):
        long = operation("+", long, Number(float(k)))
    assert Law(Operation("-", long, A)).bind(["A"])(np.ones(1), 1.0) == pytest.approx(300 * 299 / 2)


def test_long_formulas_are_not_multiplied_out():
    names = [Symbol(f"s{k}") for k in range(30)]
    total = names[0]
    for name in names[1:]:
        total = operation("+", total, name)
    assert len(polynomial(total) or {}) == 30
    assert polynomial(operation("^", total, Number(8.0))) is None
    assert MOST_TERMS >= 30


@pytest.mark.parametrize(
    ("tree", "seen"),
    [
        (operation("-", A, B), True),
        (call("exp", operation("-", A, B)), True),
        (operation("/", A, operation("^", operation("-", A, B), Number(2.0))), True),
        (call("where", call("<", A, B), operation("-", A, B), A), True),
        (call("maximum", operation("-", A, B), Number(0.0)), True),
        (operation("/", A, operation("-", A, B)), False),
        (call("sin", A), False),
        (call("minimum", operation("-", A, B), A), False),
    ],
)
def test_differences_are_taken_apart_or_left(tree, seen):
    """Both parts are never negative, and their difference is the formula."""
    parts = split(tree)
    assert (parts is not None) == seen
    if parts is None:
        return
    for values in ([2.0, 3.0], [3.0, 2.0]):
        one, other, whole = (Law(t).bind(["A", "B"])(np.array(values), 1.0) for t in (*parts, tree))
        assert one >= 0
        assert other >= 0
        assert one - other == pytest.approx(whole)


def test_numbers_are_worked_out_and_what_has_no_number_is_refused():
    assert call("log", call("exp", Number(2.0))) == Number(2.0)
    assert call("where", Number(1.0), A, B) is A
    for function, argument in (("log", 0.0), ("arccos", 2.0)):
        with pytest.raises(ValueError, match="finite"):
            call(function, Number(argument))
    assert isinstance(call("sqrt", A), Call)


def test_laws_are_plain_functions_in_kernels():
    """The CUDA kernel's helpers see the same function, which can be run as Python too."""
    choose = dispatcher(laws(2.0), "C, k")
    assert choose(1, [0.0, 1.0], 1.0) == pytest.approx(np.e)
    assert cuda_python(evaluate, {"LAW": choose}).__globals__["LAW"] is choose


def test_laws_that_no_compiler_gets_through_are_refused():
    """Nested too deeply, and of too many parts."""
    deep = shared = Symbol("A")
    for _ in range(321):
        deep = Call("sin", (deep,))
    for _ in range(60):
        shared = Operation("+", shared, shared)
    assert extent(shared) == (61, 61)  # computed once each, and not 2^61 times
    wide = [Call("sin", (Operation("*", Number(float(k)), A),)) for k in range(8192)]
    while len(wide) > 1:
        wide = [Operation("+", a, b) for a, b in zip(wide[::2], wide[1::2], strict=True)]
    for tree in (deep, wide[0]):
        with pytest.raises(InputError, match="at most 20000 parts, nested at most 320 times"):
            Law(tree).body(["A"])


def test_more_species_than_anybody_has():
    box = pc.Domain((0,), (10,), "x", depth=1.0)
    many = [pc.Species(f"S{k}") for k in range(1001)]
    phase = pc.fluid(box, pc.Fluid(1.0, 0.1, sound_speed=1.0), 1.0)
    with pytest.raises(InputError, match=r"number of species = 1001 .* at most 1000"):
        pc.Simulation(box, phase, pc.Static(), many)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_s_code_is_its_value_and_takes_as_many_arguments(name):
    function = FUNCTIONS[name]
    places = {int(place) for place in re.findall(r"{(\d)}", function.code)}
    assert places == set(range(function.arguments))
    first = 1.3 if name == "arccosh" else 0.3
    for given in ((first, 0.7, 0.9), (first, 0.0, 0.2), (first, first, first)):
        code = function.code.format(*map(repr, given))
        value = function.value(*given[: function.arguments])
        found = eval(code, {"math": math})
        found = bool(found) if function.condition else found
        assert found == pytest.approx(float(value), rel=1e-14)
