"""Signed distances inside loops over particles: a shape as a short program.

A shape that is made of half-spaces, balls and boxes by ``|``, ``&``, ``-`` and ``~`` becomes a list
of instructions in postfix order, one row each, which :func:`program_distance` evaluates with a
stack of :data:`STACK` numbers. The result is that of
:meth:`~particell.geometry.shapes.Shape.signed_distance`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from particell.geometry.shapes import Ball, Box, HalfSpace, Shape, _Combined, _Complement

PLANE, BALL, BOX, UNION, INTERSECTION, COMPLEMENT = range(6)
#: Intermediate distances that a program may hold at once.
STACK = 4

Instruction = tuple[int, np.ndarray]


def program_of(shape: Shape | None, dim: int) -> list[Instruction] | None:
    """The instructions of a shape, or None where it holds anything else or nests too deeply.

    Parameters
    ----------
    shape
        The shape; None has no program.
    dim
        Number of dimensions; each instruction has 2 dim numbers.
    """
    found = _translate(shape, dim)
    return None if found is None or found[1] > STACK else found[0]


def _translate(shape: Shape | None, dim: int) -> tuple[list[Instruction], int] | None:
    """Instructions and the height of the stack that they need."""
    numbers = np.zeros(2 * dim)
    if isinstance(shape, _Combined):
        first, second = _translate(shape.first, dim), _translate(shape.second, dim)
        if first is None or second is None:
            return None
        code = UNION if shape.rule is np.minimum else INTERSECTION
        return [*first[0], *second[0], (code, numbers)], max(first[1], 1 + second[1])
    if isinstance(shape, _Complement):
        inner = _translate(shape.shape, dim)
        return None if inner is None else ([*inner[0], (COMPLEMENT, numbers)], inner[1])
    rule = None if shape is None else type(shape).signed_distance
    if isinstance(shape, HalfSpace) and rule is HalfSpace.signed_distance:
        numbers[:dim], numbers[dim:] = shape.point, shape.direction
        return [(PLANE, numbers)], 1
    if isinstance(shape, Ball) and rule is Ball.signed_distance:
        numbers[:dim], numbers[dim] = shape.center, shape.radius
        return [(BALL, numbers)], 1
    if isinstance(shape, Box) and rule is Box.signed_distance:
        numbers[:dim], numbers[dim:] = shape.lower, shape.upper
        return [(BOX, numbers)], 1
    return None


def program_table(
    programs: Sequence[list[Instruction] | None], dim: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Programs as arrays: first instruction of each (one more than programs), codes, numbers."""
    lengths = [len(p or []) for p in programs]
    every = [row for p in programs for row in p or []]
    codes = np.array([code for code, _ in every] or [PLANE], dtype=np.int64)
    numbers = np.array([row for _, row in every] or [np.zeros(2 * dim)])
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64), codes, numbers


@njit(error_model="numpy")
def program_distance(px, py, pz, begin, end, codes, numbers, DIM):
    """Signed distance of the point p by the instructions ``begin`` to ``end``."""
    top, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        code = codes[k]
        if code in (UNION, INTERSECTION):
            top = min(second, top) if code == UNION else max(second, top)
            second, third = third, fourth
            continue
        if code == COMPLEMENT:
            top = -top
            continue
        value, square = 0.0, 0.0
        if code == BOX:
            value = -math.inf
        for d in range(DIM):
            p = px if d == 0 else (py if d == 1 else pz)
            first = numbers[k, d]
            if code == PLANE:
                value += (p - first) * numbers[k, DIM + d]
            elif code == BALL:
                square += (p - first) * (p - first)
            else:
                beyond = max(first - p, p - numbers[k, DIM + d])
                value = max(value, beyond)
                square += max(beyond, 0.0) ** 2
        if code == BALL:
            value = math.sqrt(square) - numbers[k, DIM]
        elif code == BOX:
            value = math.sqrt(square) + min(value, 0.0)
        fourth, third, second, top = third, second, top, value
    return top
