"""A loop over particles, written once as the body for particle *i*.

``@particle_loop`` takes the body and makes of it, on demand, a multi-threaded CPU loop or a CUDA
kernel. Keyword-only parameters of the body are compile-time constants (dimension, kernel, options):
each set of values is compiled to its own machine code, in which the branches not taken are gone.

>>> @particle_loop
... def drift(i, x, v, dt, *, DIM):
...     for d in range(DIM):
...         x[i, d] += dt * v[i, d]
>>> step = drift.specialise(DIM=2)          # doctest: +SKIP
>>> step(n, x, v, dt)                       # doctest: +SKIP

A body writes to row *i* only (gather, never scatter); so results do not depend on the number of
threads. The one exception is :func:`particell.compute.scatter.scatter_add` for integers, whose sum
does not depend on the order.
"""

from __future__ import annotations

import ast
import functools
import gc
import hashlib
import inspect
import re
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, overload

import numba
from numba import njit
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError

from particell.compute.cache import keep
from particell.compute.simulator import for_simulator, simulating
from particell.compute.threads import Shared
from particell.errors import InputError

#: ``fastmath=True`` would delete ``isfinite``. Re-association is for loops over batches only: with
#: it LLVM vectorises sums over neighbours with gather instructions, which are more than twice
#: slower than scalar loads on processors with the mitigations of recent years.
FASTMATH = {"contract", "arcp", "nsz"}
#: Of a GPU; the simulator starts as many of Python's, for the smallest systems too.
THREADS_PER_BLOCK = 8 if simulating() else 128
#: Characters that constants may take in the name of a loop; file systems allow 255 in all.
LONGEST_TAG = 120


class CompileLog:
    """Seconds in which loops were compiled, or read from the disk."""

    seconds: float = 0.0
    loops: int = 0


class Loop:
    """The body of a loop over particles, and its compiled forms."""

    def __init__(
        self, body: Callable[..., None], vectorise: bool = False, reassociate: bool = True
    ):
        self.body = body
        self.vectorise, self.reassociate = vectorise, vectorise and reassociate
        self.__doc__ = body.__doc__
        self.__name__ = body.__name__
        signature = inspect.signature(body)
        kinds = inspect.Parameter
        named = [p for p in signature.parameters.values() if p.kind != kinds.KEYWORD_ONLY]
        self.index, *self.arguments = [p.name for p in named]
        self.constants = [
            p.name for p in signature.parameters.values() if p.kind == kinds.KEYWORD_ONLY
        ]
        self._compiled: dict[tuple, Callable[..., None]] = {}

    def specialise(self, backend: str = "cpu", **constants: Any) -> Callable[..., None]:
        """The compiled loop ``f(n, *arguments)`` for one set of compile-time constants.

        Parameters
        ----------
        backend
            ``"cpu"`` or ``"cuda"``.
        **constants
            A value for every keyword-only parameter of the body: numbers, booleans, or a
            function compiled by Numba. One without the attribute ``disk_key`` (which says what
            it is, see :mod:`particell.chemistry.lawcode`) switches the disk cache off.
        """
        if set(constants) != set(self.constants):
            raise TypeError(f"{self.__name__} needs constants {self.constants}, got {constants}")
        key = (backend, *sorted(constants.items(), key=lambda item: item[0]))
        if key not in self._compiled:
            build = _cuda_loop if backend == "cuda" else _cpu_loop
            self._compiled[key] = build(self, constants)
        return self._compiled[key]

    def tree(self) -> ast.FunctionDef:
        """The body's syntax tree, without decorator and docstring."""
        source = textwrap.dedent(inspect.getsource(self.body))
        function = ast.parse(source).body[0]
        assert isinstance(function, ast.FunctionDef)
        ast.increment_lineno(function, self.body.__code__.co_firstlineno - 1)
        first = function.body[0]
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
            function.body = function.body[1:]
        return function


@overload
def particle_loop(body: Callable[..., None], /) -> Loop: ...
@overload
def particle_loop(
    *, vectorise: bool, reassociate: bool = True
) -> Callable[[Callable[..., None]], Loop]: ...
def particle_loop(
    body: Callable[..., None] | None = None,
    /,
    *,
    vectorise: bool = False,
    reassociate: bool = True,
) -> Any:
    """Decorate the body for particle ``i`` (its first parameter); see the module's docstring.

    ``vectorise`` lets the compiler turn inner loops and their sums into vector instructions; it is
    for bodies that gather their neighbours first (:mod:`particell.compute.batches`).
    """
    if body is None:
        return functools.partial(Loop, vectorise=vectorise)
    return Loop(body)


class _ReturnToContinue(ast.NodeTransformer):
    """``return`` ends the work on particle i: inside the loop over i that is ``continue``."""

    def visit_Return(self, node: ast.Return) -> ast.AST:
        if node.value is not None:
            raise SyntaxError("the body of a particle loop returns nothing")
        return ast.copy_location(ast.Continue(), node)

    def visit_For(self, node: ast.For) -> ast.AST:
        return _without_return(node)

    def visit_While(self, node: ast.While) -> ast.AST:
        return _without_return(node)


def _without_return(node: ast.For | ast.While) -> ast.AST:
    if any(isinstance(inner, ast.Return) for inner in ast.walk(node)):
        raise SyntaxError("'return' inside an inner loop of a particle loop's body")
    return node


class _GiveThread(ast.NodeTransformer):
    """Tell the functions that keep something for each thread which thread it is."""

    def __init__(self, names: set[str]):
        self.names = names

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id in self.names:
            node.args.append(ast.copy_location(ast.Name("thread", ast.Load()), node))
        return node


def _define(
    loop: Loop, first: list[str], constants: dict[str, Any], statements: list, extra: dict
) -> Callable:
    """Compile ``def loop(*first, *arguments): statements`` with the constants as its globals."""
    function = loop.tree()
    function.args = ast.arguments(
        posonlyargs=[],
        args=[ast.arg(arg=name) for name in [*first, *loop.arguments]],
        kwonlyargs=[],
        kw_defaults=[],
        defaults=[],
    )
    function.decorator_list, function.body, function.returns = [], statements, None
    module = ast.fix_missing_locations(ast.Module(body=[function], type_ignores=[]))
    code = compile(module, loop.body.__code__.co_filename, "exec")
    scope = {**loop.body.__globals__, **extra, **constants}
    exec(code, scope)
    made = scope[loop.__name__]
    shown = {k: getattr(v, "disk_key", "") if callable(v) else v for k, v in constants.items()}
    tag = "_".join(f"{k}{v}" for k, v in sorted(shown.items()) if v != "")
    if len(tag) > LONGEST_TAG:  # cached machine code is filed under the name
        tag = hashlib.blake2b(tag.encode(), digest_size=16).hexdigest()
    made.__qualname__ = f"{loop.__name__}_{tag}".replace(".", "p").replace("-", "m")
    made.__module__ = loop.body.__module__
    return made


def cpu_python(loop: Loop, constants: dict[str, Any]) -> Callable[..., None]:
    """The Python function that is compiled to run a range of particles on one thread."""
    from particell.compute import batches, scatter

    of_threads = {id(scatter.scatter_add), id(batches.batch_row)}
    names = {name for name, value in loop.body.__globals__.items() if id(value) in of_threads}
    tree = loop.tree()
    transforms = [_ReturnToContinue(), _GiveThread(names)]
    inner = tree.body
    for transform in transforms:
        inner = [transform.visit(statement) for statement in inner]
    header = ast.parse(f"for {loop.index} in range(first, last):\n    pass").body[0]
    assert isinstance(header, ast.For)
    header.body = inner
    whole = [ast.copy_location(header, tree.body[0])]
    return _define(loop, ["first", "last", "thread"], constants, whole, {})


def _has_module(loop: Loop) -> bool:
    """Whether machine code that is kept on disk would find the loop's module again."""
    return getattr(loop.body, "__module__", None) in sys.modules


def _cpu_loop(loop: Loop, constants: dict[str, Any]) -> Callable[..., None]:
    options: dict[str, Any] = {
        "fastmath": FASTMATH | {"reassoc"} if loop.reassociate else FASTMATH,
        "error_model": "numpy",
        "nogil": True,
    }
    made = njit(**options)(cpu_python(loop, constants))
    keyed = all(hasattr(v, "disk_key") for v in constants.values() if callable(v))
    if _has_module(loop) and keyed:
        keep(made, loop.body.__code__.co_filename)
    _compile_alone(made, loop.vectorise)
    return Shared(made)


def _switch_vectorisers(on: bool) -> None:
    config: Any = numba.config
    config.LOOP_VECTORIZE = config.SLP_VECTORIZE = int(on)


@contextmanager
def vectorisers(on: bool, compiled: Any) -> Iterator[None]:
    """Switch LLVM's vectorisers; off, gathers are avoided and compiling is faster.

    On, they are so for the loop ``compiled`` alone: the helper functions that are compiled on the
    way get what they get for any other loop, so that results do not depend on who comes first.
    """
    config: Any = numba.config
    before = config.LOOP_VECTORIZE, config.SLP_VECTORIZE
    _switch_vectorisers(on)
    try:
        with event.install_listener("numba:compile", _PlainHelpers(compiled, on)):
            yield
    finally:
        config.LOOP_VECTORIZE, config.SLP_VECTORIZE = before


@contextmanager
def no_collector() -> Iterator[None]:
    """Spare compilation the search for garbage among the millions of objects that it makes.

    It takes 7 % of its time otherwise, and finds little.
    """
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


class _PlainHelpers(event.Listener):
    """While a loop is compiled: its helpers without vectorisers and re-association.

    A helper without options of its own would inherit those of the first loop that calls it, in
    whose process all others would get it as it is. What it is given here it has for that long
    only: on a GPU any such option means all of them.
    """

    def __init__(self, loop: Any, vectorise: bool):
        self.loop, self.vectorise = loop, vectorise
        self.given: list[bool] = []

    def on_start(self, happened: event.Event) -> None:
        helper = happened.data["dispatcher"]
        if helper is not self.loop:
            self.given.append("fastmath" not in helper.targetoptions)
            helper.targetoptions.setdefault("fastmath", FASTMATH)
            _switch_vectorisers(False)

    def on_end(self, happened: event.Event) -> None:
        helper = happened.data["dispatcher"]
        if helper is not self.loop:
            if self.given.pop():
                del helper.targetoptions["fastmath"]
            _switch_vectorisers(self.vectorise and not self.given)


def _compile_alone(made: Any, vectorise: bool) -> None:
    """Let a loop be compiled under its own options, for each types of arguments that it meets.

    Seconds in which it is compiled, or read from the disk, are counted.
    """
    plain = made.compile

    def compile_for(signature: Any) -> Any:
        begin = time.perf_counter()
        with global_compiler_lock, vectorisers(vectorise, made), no_collector():
            try:
                return plain(signature)
            except NumbaError as error:
                raise _not_compiled(made, error) from error
            finally:
                CompileLog.seconds += time.perf_counter() - begin
                CompileLog.loops += 1

    made.compile = compile_for


def _not_compiled(compiled: Any, error: NumbaError) -> InputError:
    """What Numba says of code that it cannot compile, in one line."""
    lines = [line.strip() for line in re.sub(r"\x1b\[\d+m", "", str(error)).splitlines()]
    said = [line for line in lines if line and not line.startswith(("Failed in", "During", "File"))]
    name = compiled.py_func.__name__
    return InputError(f"code of the loop '{name}'", said[0] if said else "?", "what Numba compiles")


def cuda_python(loop: Loop, constants: dict[str, Any]) -> Callable[..., None]:
    """The Python function that becomes the CUDA kernel of a loop."""
    from numba import cuda

    from particell.compute import batches, scatter, scatter_cuda

    tree = loop.tree()
    guard = ast.parse(f"{loop.index} = cuda.grid(1)\nif {loop.index} >= n:\n    return").body
    for statement in guard:
        ast.copy_location(statement, tree.body[0])
    extra: dict[str, Any] = {"cuda": cuda}
    replaced = {
        id(scatter.scatter_add): scatter_cuda.scatter_add,
        id(batches.batch_row): scatter_cuda.batch_row,
    }
    for name, value in loop.body.__globals__.items():
        if id(value) in replaced:
            extra[name] = replaced[id(value)]
    if simulating():
        helpers = {**loop.body.__globals__, **constants}
        constants = dict(constants)
        for_simulator(helpers)
        constants.update({name: helpers[name] for name in constants})
        extra = {**helpers, **extra}
    return _define(loop, ["n"], constants, [*guard, *tree.body], extra)


def _cuda_loop(loop: Loop, constants: dict[str, Any]) -> Callable[..., None]:
    from numba import cuda

    kernel = cuda.jit(cuda_python(loop, constants))

    def launch(n: int, *args: Any) -> None:
        if n > 0:
            kernel[(n + THREADS_PER_BLOCK - 1) // THREADS_PER_BLOCK, THREADS_PER_BLOCK](n, *args)

    return launch


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a serial host function (sorting, prefix sums), cached on disk like the loops."""
    made = njit(fastmath=FASTMATH, error_model="numpy", nogil=True)(function)
    keep(made, function.__code__.co_filename)
    _compile_alone(made, vectorise=False)
    return made
