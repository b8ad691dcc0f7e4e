"""Compiled functions of numbers, for arrays: what loops and analysis have in common."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any


@functools.cache
def elementwise(function: Any) -> Callable[..., Any]:
    """A function that Numba compiles, for arrays; compiled by the first call, not by the import."""
    from numba import vectorize

    return vectorize(function.py_func)
