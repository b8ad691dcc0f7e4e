"""Reads every SBML file of a directory and compares its reactions with libRoadRunner.

python benchmarks/sbml_models.py DIRECTORY [--until 100] [--most 30] [--names FILE] [--read]

Each file is read, its reactions run in well-mixed particles, and the amounts of all species at 20
times compared with libRoadRunner (``pip install libroadrunner``).
A line for each file: "agrees" where no species is more than 1e-4 of its largest amount off (plus
1e-9 of that of all species), how far the worst one is, or why the file is refused. Compartments of
a file with several share one space. With --read files are read only.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np

import particell as pc
from particell.chemistry.sbml import _document
from particell.chemistry.sbml_symbols import items
from particell.chemistry.sbml_units import Units

TOLERANCE = 1e-4
#: Units that a file leaves open.
LEFT_OPEN = {"substance": "mol", "volume": "l", "time": "s"}
#: What libRoadRunner resolves, of the largest amount.
RESOLVED = 1e-9
SPACE = 1e-3  # m³, of compartments that share it


def read(path):
    """The model, the unit of each species in mol, and that of time in s."""
    document, _ = _document(path.read_text(encoding="utf-8-sig"), path)
    model = document.getModel()
    compartments = items(model.getListOfCompartments())
    shared = len(compartments) > 1 or any(
        c.getSpatialDimensionsAsDouble() != 3 for c in compartments
    )
    volumes = {c.getId(): SPACE for c in compartments} if shared else None
    found = pc.read_sbml(path, units=LEFT_OPEN, volumes=volumes)
    units = Units(model, LEFT_OPEN, [])
    substance = {
        s.getId(): units.value("substance", s.getSubstanceUnits())
        for s in items(model.getListOfSpecies())
    }
    space = {s.getId(): found.volumes[s.getCompartment()] for s in items(model.getListOfSpecies())}
    return found, {name: space[name] / one for name, one in substance.items()}, units.value("time")


def simulate(model, scales, unit, times):
    """Amounts in the file's units by species, at times in the file's units."""
    box = pc.Domain((0,), (5.0,), periodic="x", depth=1.0)
    phase = pc.fluid(box, pc.Fluid(density=1.0, viscosity=1.0), 1.0)
    every = (times[1] - times[0]) * unit
    simulation = pc.Simulation(box, phase, pc.Static(), model.species, model.reactions, dt=every)
    model.set_initial(simulation.chemistry)
    run = simulation.run(until=times[-1] * unit, every=every, progress=False)
    names = [s.name for s in model.species]
    return {n: run.field(f"concentration/{n}")[:, 0] * scales[n] for n in names}


def reference(path, names, times):
    """The same by libRoadRunner."""
    import roadrunner

    roadrunner.Logger.setLevel(roadrunner.Logger.LOG_FATAL)
    runner = roadrunner.RoadRunner(str(path))
    runner.integrator.relative_tolerance = 1e-10
    runner.integrator.absolute_tolerance = 1e-14
    runner.integrator.maximum_num_steps = 1_000_000
    found = runner.simulate(times[0], times[-1], len(times), ["time", *names])
    return {name: np.asarray(found)[:, k + 1] for k, name in enumerate(names)}


def compare(path, until, only_read):
    """A word for the table, the worst difference, and what else there is to say."""
    try:
        model, scales, unit = read(path)
    except pc.InputError as error:
        return "refused", math.nan, " ".join(str(error).split())
    if only_read:
        return "read", math.nan, ""
    times = np.linspace(0, until, 21)
    names = [s.name for s in model.species]
    try:
        there = reference(path, names, times)
    except RuntimeError as error:
        return "no reference", math.nan, " ".join(str(error).split())[:150]
    try:
        here = simulate(model, scales, unit, times)
    except (pc.RunError, pc.InputError) as error:
        return "failed", math.nan, " ".join(str(error).split())
    largest = max((np.abs(x).max() for x in there.values()), default=0.0)
    differences = {
        n: np.abs(here[n] - there[n]).max() / (np.abs(there[n]).max() + RESOLVED * largest or 1.0)
        for n in names
    }
    worst = max(differences, key=differences.get)
    word = "agrees" if differences[worst] <= TOLERANCE else "differs"
    return word, differences[worst], worst


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--until", type=float, default=100.0, help="in the files' unit of time")
    parser.add_argument("--most", type=int, default=10**9, help="files, from the first on")
    parser.add_argument("--names", type=Path, help="file with the names of the files to take")
    parser.add_argument("--read", action="store_true", help="read only")
    options = parser.parse_args()
    paths = sorted(options.directory.rglob("*.xml"))
    if options.names:
        names = options.names.read_text().split()
        paths = [p for p in paths if p.name in names]
    words = {}
    for path in paths[: options.most]:
        start = time.perf_counter()
        word, worst, more = compare(path, options.until, options.read)
        words[word] = words.get(word, 0) + 1
        seconds = time.perf_counter() - start
        print(f"{path.stem:24} {word:12} {worst:9.1e} {seconds:6.1f} s  {more}", flush=True)
    print(", ".join(f"{number} {word}" for word, number in sorted(words.items())))


if __name__ == "__main__":
    main()
