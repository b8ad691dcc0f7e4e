"""What ``particell check`` says: what would run, and for how long."""

from __future__ import annotations

import math
import sys
import time as clock
from collections.abc import Iterator

import numpy as np
from tqdm import tqdm

from particell.casefile.case import FileCase
from particell.casefile.scope import BYTES_A_PARTICLE
from particell.cases.base import Case, Context
from particell.cases.execution import set_threads
from particell.enclosure import open_sides
from particell.health import beyond, foresee
from particell.operations.reflection import Reflect
from particell.simulation import Simulation

#: How lines begin that say what makes a run end with status 1.
UNHEALTHY = "health:   "
#: Cases with more particles are counted, not built.
MOST_BUILT = 300_000
#: Bytes of a particle without its row of the neighbour list, by dimension, and of a place in that
#: (four, and room for rows that become longer).
FIELDS, BYTES_A_NEIGHBOUR = {1: 400, 2: 500, 3: 700}, 5.3
#: Notes of SBML files that are shown.
MOST_NOTES = 10
#: Seconds that steps are timed for, about.
TIMED = 2.0


def report(case: Case, timing: bool = True, threads: int | None = None) -> Iterator[str]:
    """Lines that say what would run.

    Parameters
    ----------
    case
        The case.
    timing
        Whether to time a few steps.
    threads
        Number of CPU threads, or None for all.

    Raises
    ------
    InputError
        Where the case cannot be run.
    """
    set_threads(threads)
    yield f"{case.name}: {case.title}".rstrip(": ")
    if isinstance(case, FileCase):
        scope = case.scope()
        yield from _notes([note for network in scope.networks for note in network.notes])
        estimates = case.estimates(scope)
        if (total := sum(estimates.values())) > MOST_BUILT:
            parts = ", ".join(f"{name} {number:.3g}" for name, number in estimates.items())
            yield f"particles: about {total:.3g} ({parts})"
            yield f"memory:    about {_bytes(total * BYTES_A_PARTICLE)}, more with a large support"
            yield "not built: too many to count one by one here; `particell run` checks the rest"
            return
    simulation = case.build(Context(threads=threads))
    steps = max(1, round(case.until / case.every)) * simulation.plan(case.every)
    groups = simulation.particles.host("group")
    counts = np.bincount(groups, minlength=len(simulation.group_names))
    parts = ", ".join(f"{n} {c}" for n, c in zip(simulation.group_names, counts, strict=True))
    yield f"particles: {len(groups)} ({parts})"
    yield f"step:      {simulation.dt:.3g} s, limited by {limit(simulation)}"
    if simulation.chemistry and simulation.chemistry_every > 1:
        yield f"chemistry: one step in {simulation.chemistry_every}"
    yield f"steps:     {steps} to {case.until:.3g} s, a frame every {case.every:.3g} s"
    yield f"memory:    about {_bytes(len(groups) * bytes_a_particle(simulation))}"
    for finding in beyond(foresee(simulation)):
        yield f"{UNHEALTHY} {finding.line}"
    for warning in warnings_of(case, simulation):
        yield f"warning:   {warning}"
    if timing:
        tqdm.write("timing a few steps (new loops are compiled first: up to a minute)", sys.stderr)
        yield f"time:      about {_duration(steps * seconds_a_step(simulation, steps))}"


def warnings_of(case: Case, simulation: Simulation) -> Iterator[str]:
    """What is allowed and is hardly meant."""
    reflections = [
        surface
        for operation in simulation.operations.by_name.values()
        if isinstance(operation, Reflect)
        for surface in operation.surfaces
    ]
    if not simulation.static:
        sides = open_sides(simulation.domain, simulation.phases, reflections)
        if sides:
            yield (
                f"fluid can leave through the {' and the '.join(sides)} side: that axis is neither "
                "periodic nor has walls there (channel_walls, box_walls)"
            )
    if not simulation.timing.automatic:
        largest, name = simulation.largest_step(), simulation.timing.limited_by
        if simulation.dt > largest * (1 + 1e-9):
            yield f"dt = {simulation.dt:.3g} s is above the rule's {largest:.3g} s ({name})"
    if isinstance(case, FileCase):
        equations = [" ".join(str(r.equation).split()) for r in case.reactions]
        for equation in dict.fromkeys(e for e in equations if equations.count(e) > 1):
            yield f"reaction '{equation}' stands {equations.count(equation)} times: all act"


def bytes_a_particle(simulation: Simulation) -> float:
    """Memory of a particle on a lattice, without species; rather too much than too little."""
    scheme, dim = simulation.scheme, simulation.domain.dim
    ball = math.pi ** (dim / 2) / math.gamma(dim / 2 + 1)
    listed = ball * (scheme.support * (1 + (scheme.skin or 0.1))) ** dim
    return FIELDS[dim] + BYTES_A_NEIGHBOUR * listed


def _notes(notes: list[str]) -> Iterator[str]:
    """What there is to know of SBML files."""
    for note in notes[:MOST_NOTES]:
        yield f"note:      {note}"
    if len(notes) > MOST_NOTES:
        yield f"note:      {len(notes) - MOST_NOTES} more, see read_sbml(…).notes"


def limit(simulation: Simulation) -> str:
    """What the time step is limited by, in words."""
    if not simulation.timing.automatic:
        return "dt as given (or the interval of frames)"
    limits = simulation.timing.limits()
    name = min(limits, key=lambda key: limits[key], default="")
    # a frame is a whole number of steps
    return name if name and limits[name] < 2 * simulation.dt else "the interval of frames"


def seconds_a_step(simulation: Simulation, most: int) -> float:
    """Mean time of up to ``most`` steps, without compilation; then the simulation is spent."""
    block, chemistry = simulation.chemistry_every, simulation.chemistry
    simulation.chemistry_every = sys.maxsize  # flow alone
    simulation.advance()  # compiles
    begin, done = clock.perf_counter(), 0
    while done == 0 or (done < most and clock.perf_counter() - begin < TIMED):
        simulation.advance()
        done += 1
    flow = (clock.perf_counter() - begin) / done
    return flow + (_seconds_of_chemistry(simulation, block) / block if chemistry else 0.0)


def _seconds_of_chemistry(simulation: Simulation, block: int) -> float:
    """Time of one chemistry step, from shorter ones where it has very many events."""
    chemistry = simulation.chemistry
    assert chemistry is not None
    share, step = 2.0**-30, simulation.step
    chemistry.step(step, share * block * simulation.dt)  # compiles
    while True:
        step += 1
        begin = clock.perf_counter()
        chemistry.step(step, share * block * simulation.dt)
        seconds = clock.perf_counter() - begin
        if share == 1.0 or seconds > 0.2 * TIMED:
            return seconds / share
        share = min(1.0, 8 * share)


def _bytes(number: float) -> str:
    units = ("kB", "MB", "GB", "TB")
    power = min(max(int(math.log10(max(number, 1.0)) / 3), 1), len(units))
    return f"{number / 1000**power:.3g} {units[power - 1]}"


def _duration(seconds: float) -> str:
    for unit, length in (("days", 86400), ("hours", 3600), ("minutes", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"
