r"""A body force of place and time.

.. math:: a_i \mathrel{+}= f(x_i, t)

What it weighs in a closed space is not taken out of the pressure, as that of a constant
``gravity`` is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from particell.checks import checked, takes
from particell.compute.expressions import Number, sqrt, vector
from particell.errors import InputError
from particell.laws.law import Adds, Law

#: Of the support over the acceleration, whose root limits the step.
COURANT = 0.25


@checked
class BodyForce(Law):
    """A force per mass that is a function of place and time.

    Parameters
    ----------
    acceleration
        ``f(x, t)``, ``f(x, y, t)`` or ``f(x, y, z, t)``: the components in m/s² at a place in m
        and a time in s. It is arithmetic on what it is given, with ``where``, ``sqrt``, ``cos``, …
        of :mod:`particell.laws`. Along a periodic axis it should have the period of the domain.

    Raises
    ------
    InputError
        Where it is no function, or has not one component for each dimension.

    Examples
    --------
    >>> from particell.laws import cos
    >>> swing = BodyForce(lambda x, y, t: (1e-3 * cos(20.0 * t), 0.0))
    """

    def __init__(self, acceleration: Callable[..., Sequence[Number]]):
        if not callable(acceleration):
            raise InputError("acceleration", acceleration, "a function of place and time")
        self.acceleration = acceleration

    def _at(self, i: Any) -> tuple[Number, ...]:
        given = ", ".join(("x", "y", "z")[: i.dim]) + ", t"
        takes("acceleration of BodyForce", self.acceleration, given)
        found = self.acceleration(*i.x.parts(i.dim), i.time)
        many = isinstance(found, Sequence | np.ndarray) and not isinstance(found, str)
        if not many or len(found) != i.dim:
            wrong = f"{len(found)} components" if many else found
            allowed = f"a function of ({given}) that gives {i.dim} numbers, one for each dimension"
            raise InputError("acceleration of BodyForce", wrong, allowed)
        for part in found:
            if isinstance(part, float | np.ndarray) and not np.isfinite(part).all():
                raise InputError("acceleration of BodyForce", part, "finite")
        return tuple(found)

    def finish(self, i: Any, sums: Any) -> Adds:
        """In m/s²."""
        return {"a": vector(*self._at(i))}

    def largest_step(self, i: Any) -> Number:
        """That of gravity: 0.25 √(h/|f|), with f as it is now."""
        square: Number = 1e-300
        for part in self._at(i):
            square = square + part * part
        return COURANT * sqrt(i.support / sqrt(square))
