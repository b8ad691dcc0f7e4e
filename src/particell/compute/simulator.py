"""Numba's CUDA simulator, which runs kernels as Python: what helper functions need there.

The simulator's arrays cannot be given to functions compiled for the CPU. Helpers that take arrays
are run as Python too, and so are those that they call.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from typing import Any

from particell.compute.cache import NUMBA_CONFIG


def simulating() -> bool:
    """Whether CUDA kernels run in the simulator (environment variable NUMBA_ENABLE_CUDASIM)."""
    return bool(NUMBA_CONFIG.ENABLE_CUDASIM)


def for_simulator(scope: dict[str, Any], known: dict[int, Callable] | None = None) -> None:
    """Replace the compiled functions among a function's globals, and among theirs."""
    known = {} if known is None else known
    for name, value in list(scope.items()):
        if hasattr(value, "py_func"):
            if id(value) not in known:
                known[id(value)] = _either(value, known)
            scope[name] = known[id(value)]


def _either(compiled: Any, known: dict[int, Callable]) -> Callable:
    function = compiled.py_func
    made: list[Callable] = []

    def call(*args: Any) -> Any:
        if not any(getattr(a, "ndim", 0) for a in args):
            return compiled(*args)
        if not made:
            scope = dict(function.__globals__)
            for_simulator(scope, known)
            made.append(
                types.FunctionType(
                    function.__code__,
                    scope,
                    function.__name__,
                    function.__defaults__,
                    function.__closure__,
                )
            )
        return made[0](*args)

    return call
