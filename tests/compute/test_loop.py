from __future__ import annotations

import re
import threading
import time

import numba
import numpy as np
import pytest

from particell.compute import loop as module
from particell.compute import threads
from particell.compute.device import Device
from particell.compute.loop import FASTMATH, particle_loop
from particell.compute.reduce import Reduction
from particell.compute.rounding import nearest_integer
from particell.compute.threads import Shared, get_threads, kept_threads, set_threads
from particell.errors import InputError


@particle_loop
def double_positive(i, values, result, *, FACTOR):
    """Skips the others: 'return' ends the work on one particle only."""
    if values[i] <= 0.0:
        return
    if values[i] > 100.0:
        result[i] = -1.0
        return
    result[i] = FACTOR * values[i]


@particle_loop
def return_in_loop(i, values):
    for k in range(3):
        if values[k] > 0.0:
            return
    values[i] = 0.0


@particle_loop
def return_in_while(i, values):
    while values[i] > 0.0:
        return


@particle_loop
def returns_value(i, values):
    return values[i]


def test_return_goes_on_with_the_next_particle():
    values = np.array([1.0, -1.0, 2.0, 200.0, 0.0, 3.0])
    result = np.zeros(6)
    double_positive.specialise(FACTOR=2)(6, values, result)
    assert result.tolist() == [2, 0, 4, -1, 0, 6]
    double_positive.specialise(FACTOR=3)(3, values, result)
    assert result.tolist() == [3, 0, 6, -1, 0, 6]


@pytest.mark.parametrize("bad", [return_in_loop, return_in_while, returns_value])
def test_bodies_that_are_refused(bad):
    with pytest.raises(SyntaxError):
        bad.specialise()


def test_constants_must_be_those_of_the_body():
    assert double_positive.arguments == ["values", "result"]
    assert double_positive.constants == ["FACTOR"]
    for wrong in ({}, {"DIM": 2}, {"FACTOR": 2, "DIM": 2}):
        with pytest.raises(TypeError, match="FACTOR"):
            double_positive.specialise(**wrong)
    assert double_positive.specialise(FACTOR=2) is double_positive.specialise(FACTOR=2)


def test_bound_loops_name_what_is_missing():
    device, values = Device(), np.ones(3)
    run = device.bind(double_positive, {"values": values}, FACTOR=2)
    result = np.zeros(3)
    run(3, result)
    run(3, result)
    assert result.tolist() == [2, 2, 2]
    with pytest.raises(TypeError, match="result"):
        run(3)


def test_number_of_threads():
    everything = numba.config.NUMBA_NUM_THREADS
    try:
        assert set_threads(1) == 1
        assert set_threads(everything) == everything
        for wrong in (0, everything + 1):
            with pytest.raises(ValueError, match="threads"):
                set_threads(wrong)
        with kept_threads():
            set_threads(1)
        assert get_threads() == everything
    finally:
        set_threads(everything)


def test_threads_share_a_loop(monkeypatch):
    """Every particle once, whoever does it; a small loop stays on one thread; errors come back."""
    monkeypatch.setattr(threads, "SECONDS_PER_THREAD", 1.0)
    done: list[tuple[int, int, int]] = []

    def piece(first, last, thread, fails):
        if fails:
            raise ArithmeticError
        done.append((int(first), int(last), int(thread)))

    shared = Shared(piece)
    for _ in range(2):  # the first call, in which it is compiled, is not measured
        shared(1000, False)
    assert done == 2 * [(0, 1000, 0)]
    if get_threads() < 2:
        pytest.skip("this machine has one thread")
    monkeypatch.setattr(threads, "SECONDS_PER_THREAD", 1e-12)
    done.clear()
    shared(1000, False)
    assert len(done) == get_threads()
    covered = [i for first, last, _ in sorted(done) for i in range(first, last)]
    assert covered == list(range(1000))
    shared.alone = 1.0  # many pieces for each, where they take long
    done.clear()
    shared(1000, False)
    assert len(done) == get_threads() * threads.PIECES_PER_THREAD
    with pytest.raises(ArithmeticError):
        shared(1000, True)
    done.clear()
    shared(1000, False)
    assert sum(last - first for first, last, _ in done) == 1000


@pytest.mark.usefixtures("always_shared")
def test_errors_of_other_threads_come_back():
    main = threading.get_ident()

    def piece(first, last, thread):
        time.sleep(0.01)
        if threading.get_ident() != main:
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        Shared(piece)(1000)


@pytest.mark.parametrize("faster", ["alone", "together"])
def test_loops_run_on_what_is_faster(monkeypatch, faster):
    """And the other way is tried now and then; by a clock that only the loop's work moves."""
    if get_threads() < 2:
        pytest.skip("this machine has one thread")
    now, used = 0.0, []

    def work(way):
        nonlocal now
        now += 1e-3 if way == faster else 2e-3
        used.append(way)

    monkeypatch.setattr(threads, "perf_counter", lambda: now)
    monkeypatch.setattr(Shared, "_on_threads", lambda *_: work("together"))
    shared = Shared(lambda *_: work("alone"))
    for _ in range(40):  # until it has measured both
        shared(100)
    used.clear()
    for _ in range(2 * threads.TRY_OTHER):
        shared(100)
    assert len(used) - used.count(faster) == 2


def test_compile_log_counts_the_first_call():
    before = module.CompileLog.loops
    run = double_positive.specialise(FACTOR=7)
    run(1, np.ones(1), np.zeros(1))
    run(1, np.ones(1), np.zeros(1))
    assert module.CompileLog.loops == before + 1


@pytest.mark.parametrize("place", [0, 5, 299, 599])
def test_the_largest_of_what_holds_a_nan_is_a_nan(place):
    """It is how non-finite rates are found."""
    values = np.linspace(-1.0, 1.0, 600)
    values[place] = np.nan
    assert np.isnan(Reduction(Device()).max(values))


def test_device_refuses():
    for options in ({"backend": "gpu"}, {"precision": "float16"}):
        with pytest.raises(InputError):
            Device(**options)
    try:
        from numba import cuda
    except ImportError:
        usable = False
    else:
        usable = cuda.is_available()
    if not usable:
        with pytest.raises(InputError, match="backend = 'cuda'"):
            Device("cuda")


def test_device_arrays_are_copies():
    device, source = Device(precision="float32"), np.arange(4.0)
    array = device.array(source)
    source[0] = 9
    assert array[0] == 0
    assert device.zeros(3).dtype == np.float32
    device.write(array, np.ones(4))
    assert device.to_host(array).tolist() == [1, 1, 1, 1]


@numba.njit
def tripled(x):
    return 2.0 * x + x


@particle_loop(vectorise=True)
def sum_of(i, x, total, *, FUNCTION):
    for k in range(len(x)):
        total[i] += FUNCTION(x[k])


def test_helpers_do_not_inherit_the_options_of_a_vectorised_loop():
    """Else results would depend on which loop was compiled first in the process.

    For types of numbers that come later too. It keeps no options: on a GPU any means all of them.
    """
    total = np.zeros(4)
    run = sum_of.specialise(FUNCTION=tripled)  # which is not kept on disk
    before = dict(tripled.targetoptions)
    for dtype in (np.float64, np.float32, np.int64):
        run(4, np.ones(4, dtype), total)
    assert total == pytest.approx(np.full(4, 36.0))
    assert tripled.targetoptions == before and len(tripled.signatures) == 3
    for signature in tripled.signatures:
        sums = [line for line in tripled.inspect_llvm(signature).splitlines() if " fadd " in line]
        flags = [set(re.findall(r"nsz|arcp|contract|reassoc|fast", line)) for line in sums]
        assert flags and all(f == FASTMATH for f in flags)


@numba.njit(fastmath=True)
def nearest(x):
    return nearest_integer(x)


def test_whole_numbers_are_found_in_a_function_of_any_options():
    """Re-associated, (s + W) - W is s: wrong distances across every periodic edge."""
    assert [nearest(kind(2.3)) for kind in (float, np.float32)] == [2.0, 2.0]


def test_a_loop_of_code_without_a_module_runs_again(tmp_path, monkeypatch):
    """As on a page, or in text that is executed: kept machine code would not find its module."""
    path = tmp_path / "page.py"
    path.write_text(
        "from particell.compute.loop import particle_loop\n"
        "@particle_loop\n"
        "def double(i, values):\n"
        "    values[i] *= 2.0\n"
    )
    for _ in range(2):
        names = {"__name__": None}
        exec(compile(path.read_text(), str(path), "exec"), names)
        values = np.arange(3.0)
        names["double"].specialise()(3, values)
        assert values.tolist() == [0.0, 2.0, 4.0]
