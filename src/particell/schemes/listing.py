"""What a simulation's particles obey, in words and as the loops that are made of it."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

from particell.compute.sweep import Sweep
from particell.errors import InputError, unknown_name
from particell.laws.equation import equations
from particell.laws.law import Law
from particell.simulated import Simulated


def sweeps_of(simulation: Simulated) -> dict[str, Sweep]:
    """The sweeps of a simulation's steps, by name.

    Raises
    ------
    InputError
        For particles at rest, which have none.
    """
    if simulation.static:
        raise InputError("scheme", "Static", "one in which particles move: no sweeps otherwise")
    return {sweep.name: sweep for sweep in simulation.solver.descriptions()}


def describe(simulation: Simulated, written: bool = False, exchange: bool = False) -> Iterator[str]:
    """Lines: every sweep and its laws.

    With ``written`` their equations, with ``exchange`` the fields that are read of neighbours and
    of the particle, and written.
    """
    for name, sweep in sweeps_of(simulation).items():
        form = sweep.form_on(simulation.device)
        made = sweep.source(form)
        yield f"{name}: {', '.join(sweep.writes())}"
        width = max(len(type(law).__name__) for law in sweep.laws)
        for law in sweep.laws:
            yield f"  {type(law).__name__:{width}}  {first_line(law)}"
            if written:
                for result, value in equations(law, simulation.domain.dim).items():
                    yield f"  {'':{width}}    {result} += {value}"
        if exchange:
            yield f"  of neighbours: {', '.join(sweep.reads_of_neighbours())}"
            yield f"  of the particle: {', '.join(sweep.reads())}"
            yield f"  written: {', '.join(sweep.writes())}"
        yield f"  ({form}: {made.record} numbers of a neighbour, {made.columns} columns)"


def first_line(law: Law) -> str:
    """What a law is, from its docstring."""
    return (inspect.getdoc(type(law)) or "").split("\n")[0]


def generated(simulation: Simulated, name: str) -> list[str]:
    """The lines of the loop that a sweep is.

    Raises
    ------
    InputError
        Where there is no sweep of that name.
    """
    sweeps = sweeps_of(simulation)
    if name not in sweeps:
        raise unknown_name("sweep", name, sweeps)
    sweep = sweeps[name]
    return sweep.source(sweep.form_on(simulation.device)).text.splitlines()
