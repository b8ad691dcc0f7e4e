"""One model in SpatialPy, for ``against_spatialpy.py``: run by the Python that has SpatialPy.

Reads a model as JSON from standard input and writes its results as one line of JSON.
"""

import json
import resource
import sys
import time

import numpy as np
import spatialpy
from spatialpy.solvers.solver import Solver


class Counts(spatialpy.InitialCondition):
    """Given numbers of molecules, one for each particle."""

    def __init__(self, species, counts):
        self.species, self.counts = species, counts

    def apply(self, model):
        """Set them."""
        model.u0[list(model.listOfSpecies).index(self.species)] = self.counts


def built(spec):
    """The model of a specification (see ``against_spatialpy.Model``)."""
    model = spatialpy.Model(spec["name"].replace("-", "_"))
    n, edge = spec["n"], spec["edge"]
    numbers = (n, 1) if spec["dim"] == 1 else (n, n)
    model.add_domain(
        spatialpy.Domain.create_2D_domain([0, edge], [0, edge], *numbers, mass=1.0, nu=0.0)
        if spec["dim"] == 2
        else spatialpy.Domain.create_2D_domain([0, edge], [0, 1], *numbers, mass=1.0, nu=0.0)
    )
    x = model.domain.coordinates()[:, 0]
    for name, (diffusivity, mean, wave) in spec["species"].items():
        model.add_species(spatialpy.Species(name, diffusion_coefficient=diffusivity))
        # a wave of zero slope at the faces, half a spacing outside of the particles
        spacing = edge / (n - 1)
        shape = 1 + wave * np.cos(np.pi * (x + 0.5 * spacing) / (n * spacing))
        model.add_initial_condition(Counts(name, np.rint(mean * shape)))
    for k, (reactants, products, rate) in enumerate(spec["reactions"]):
        constant = spatialpy.Parameter(f"k{k}", expression=rate)
        model.add_parameter(constant)
        model.add_reaction(
            spatialpy.Reaction(f"r{k}", reactants=reactants, products=products, rate=constant)
        )
    model.enable_pde, model.enable_rdme = spec["concentrations"], spec["molecules"]
    times = spec["every"] * np.arange(spec["frames"] + 1)
    model.timespan(times, timestep_size=spec["dt"])
    return model


def main():
    """Build, run, and print totals of every frame and the last frame of each species."""
    spec = json.load(sys.stdin)
    solver = Solver(built(spec))
    begin = time.perf_counter()
    solver.compile()
    build = time.perf_counter() - begin

    def used():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    seconds = []
    for seed in range(spec["repeats"]):
        begin = used()
        result = solver.run(seed=1 + seed, number_of_threads=1, verbose=False, timeout=300)
        seconds.append(used() - begin)
    found = {"build": build, "seconds": seconds, "version": spatialpy.__version__}
    found["x"] = result.model.domain.coordinates()[:, 0].tolist()
    for name in spec["species"]:
        for kind, whole in (("concentrations", False), ("molecules", True)):
            if spec[kind]:
                values = result.get_species(name, deterministic=not whole)
                found[f"{name} {kind}"] = values.tolist()
    sys.stdout.write("\n" + json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
