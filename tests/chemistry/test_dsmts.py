"""Stochastic models of the SBML test suite, by its own statistics, and against exact ones."""

from __future__ import annotations

import math

import dsmts
import numpy as np
import pytest
from sbml_files import write

import particell as pc
from particell.materials import AVOGADRO

pytest.importorskip("libsbml")

VOLUME = 1e-18  # m³, of a particle and of the compartment
REPLICATES = 1000
#: Of Z and of Y by its own standard deviation, at 50 times of eight processes: were they normal,
#: a correct program would fail with a probability of 1e-7.
BOUND = 6.5


def read(tmp_path, name, version=1):
    given, process = dsmts.MODELS[name]
    path = write(tmp_path / f"{name}.xml", **given, version=version)
    return pc.read_sbml(path, molecules=True, volumes={"cell": VOLUME}), process


def events(model, counts: dict[str, int]) -> dict[tuple, float]:
    """Events per second by change of the counts."""
    found: dict[tuple, float] = {}
    for reaction in model.reactions:
        sides = [(reaction.reactants, reaction.products, reaction.forward)]
        if reaction.reversible:
            sides.append((reaction.products, reaction.reactants, reaction.backward))
        for left, right, rate in sides:
            if reaction.propensity is not None:
                names = list(counts)
                speed = reaction.propensity.bind(names)(np.array(list(counts.values())), VOLUME, 1)
            else:
                ways = math.prod(math.perm(counts[s], k) for s, k in left.items())
                speed = rate * ways * (VOLUME * AVOGADRO) ** (1 - sum(left.values()))
            change = tuple(right.get(s, 0) - left.get(s, 0) for s in counts)
            found[change] = found.get(change, 0.0) + speed
    return found


@pytest.mark.parametrize("name", dsmts.MODELS)
def test_every_model_is_the_process_that_it_describes(tmp_path, name):
    model, (kind, a, b, number) = read(tmp_path, name, version=1 + (name[-1] > "5"))
    names = [s.name for s in model.species]
    x = "P2" if kind == "dimers" else "X"
    for n in (1, 7, 50):
        counts = {s: n if s == x else 0 for s in names}
        alone = "P" not in names
        if kind == "dimers" and not alone:
            counts["P"] = number - 2 * n
        up, ways = {
            "birth": (1, a * n),
            "immigration": (number, a),
            "dimers": (1, 0.5 * a * (number - 2 * n) * (number - 2 * n - 1)),
        }[kind]
        found = {c[names.index(x)]: v for c, v in events(model, counts).items()}
        assert found == {up: pytest.approx(ways, rel=1e-12, abs=1e-12), -1: pytest.approx(b * n)}
    if name == "001-19":
        twice = model.assigned["y"]({"X": 3.0 / (VOLUME * AVOGADRO)})
        assert twice == pytest.approx(6.0)
    assert not model.notes or "irreversible" in model.notes[0] or "changes no" in model.notes[0]


def statistics(model, process, seed, n):
    """The suite's Z and Y, and the standard deviation of Y, at all times after the first."""
    box = pc.Domain((0,), (n * 1e-6,), periodic="x", depth=1e-6)
    phase = pc.fluid(box, pc.Fluid(density=1000.0, viscosity=1e-3), 1e-6)
    simulation = pc.Simulation(
        box, phase, pc.Static(), model.species, model.reactions, dt=1.0, seed=seed
    )
    model.set_initial(simulation.chemistry)
    run = simulation.run(until=dsmts.TIMES[-1], every=1.0, progress=False)
    x = run.field("count/P2" if process[0] == "dimers" else "count/X")[:]
    assert x.shape == (len(dsmts.TIMES), n)
    mean, deviation, kurtosis = (each[1:] for each in dsmts.exact(process))
    assert np.all(x[0] == x[0, 0])
    z = math.sqrt(n) * (x[1:].mean(axis=1) - mean) / deviation
    y = math.sqrt(n / 2) * (x[1:].var(axis=1, ddof=1) / deviation**2 - 1)
    return z, y, np.sqrt((kurtosis - 1) / 2)


@pytest.mark.parametrize(
    "name", ["001-01", "001-04", "001-11", "002-01", "002-03", "003-01", "003-05", "004-01"]
)
def test_means_and_deviations(tmp_path, name):
    z, y, spread = statistics(*read(tmp_path, name), seed=5, n=REPLICATES)
    assert np.abs(z).max() < BOUND
    assert np.abs(y / spread).max() < BOUND
