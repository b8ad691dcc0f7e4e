"""Speed and results beside SpatialPy: the same models on the same particles.

    python benchmarks/against_spatialpy.py PYTHON [--json FILE]

PYTHON is the interpreter of a virtual environment with SpatialPy (``pip install spatialpy``; it
needs a C++ compiler at run time). Particell does not depend on it.

Every model is a square lattice of particles at rest in a box without flux, with species as
concentrations, as molecules, or both; one thread. Times are processor time of a whole run, output
in memory or files included, building (SpatialPy compiles every model anew) and our compilation of
loops left out. Codes run alternately.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from particell.analysis.statistics import decay_rate
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.compute.threads import set_threads
from particell.geometry.domain import Domain
from particell.materials import AVOGADRO, Fluid
from particell.phases import Phase
from particell.schemes.static import Static
from particell.simulation import Simulation

SIDE = Path(__file__).with_name("spatialpy_side.py")
#: The support that SpatialPy chooses, in spacings.
SUPPORT = 2.2


@dataclass(frozen=True)
class Model:
    """Particles at rest, species and reactions.

    ``n`` particles along an edge from the first to the last of length ``edge``; a species is
    (diffusivity, mean number in a particle, relative amplitude of a half wave along x); a reaction
    is (reactants, products, rate constant per volume of a particle and its molecules).
    """

    name: str
    n: int
    edge: float
    species: dict[str, tuple[float, float, float]]
    reactions: list[tuple[dict[str, int], dict[str, int], float]]
    every: float
    frames: int
    dt: float
    dim: int = 2
    concentrations: bool = True
    molecules: bool = True
    repeats: int = 1

    @property
    def spacing(self) -> float:
        """Distance of the particles."""
        return self.edge / (self.n - 1)


def theirs(python: str, model: Model) -> dict[str, Any]:
    """What SpatialPy finds."""
    done = subprocess.run(
        [python, str(SIDE)], input=json.dumps(asdict(model)), capture_output=True, text=True
    )
    if done.returncode:
        raise click.ClickException(f"SpatialPy failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def simulation_of(model: Model, seed: int) -> Simulation:
    """The model in Particell."""
    dx, dim = model.spacing, model.dim
    axes = [np.arange(model.n) * dx] * dim
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    # the particles' own volumes fill the box: it ends half a spacing outside of the last ones
    domain = Domain((-0.5 * dx,) * dim, (model.edge + 0.5 * dx,) * dim, depth=1.0)
    kinds = [k for k in ("concentrations", "molecules") if getattr(model, k)]
    name = {"concentrations": "{}", "molecules": "{}_m"}
    species, reactions = [], []
    for kind in kinds:
        whole = kind == "molecules"
        for s, (diffusivity, _, _) in model.species.items():
            species.append(Species(name[kind].format(s), diffusivity, whole))
        for reactants, products, rate in model.reactions:
            sides = (
                " + ".join(f"{c} {name[kind].format(s)}" for s, c in side.items()) or "0"
                for side in (reactants, products)
            )
            # rate constants in particles' volumes and molecules, to mol/m³
            order = sum(reactants.values())
            constant = rate * (AVOGADRO * dx**dim) ** (order - 1)
            reactions.append(Reaction(" -> ".join(sides), constant))
    water = Fluid(density=1.0, viscosity=1.0)
    simulation = Simulation(
        domain,
        Phase("all", water, points, dx**dim, spacing=dx),
        Static(support=SUPPORT),
        species,
        reactions,
        seed=seed,
        dt=model.dt,
        normalise_diffusion=True,
    )
    assert simulation.chemistry is not None
    x = simulation.particles.host("x")[:, 0]
    for s, (_, mean, wave) in model.species.items():
        counts = np.rint(mean * (1 + wave * np.cos(np.pi * (x + 0.5 * dx) / (model.n * dx))))
        for kind in kinds:
            if kind == "molecules":
                simulation.chemistry.set_count(f"{s}_m", counts.astype(int))
            else:
                simulation.chemistry.set_concentration(s, counts / (AVOGADRO * dx**dim))
    return simulation


def ours(model: Model, first_seed: int = 1) -> dict[str, Any]:
    """What Particell finds, in the form of :func:`theirs`."""
    simulation_of(model, 99).advance(2)  # compile
    found: dict[str, Any] = {"seconds": []}
    for seed in range(model.repeats):
        begin = time.process_time()
        simulation = simulation_of(model, first_seed + seed)
        run = simulation.run(model.every * model.frames, model.every, progress=False)
        found["seconds"].append(time.process_time() - begin)
    found["x"] = run.field("position")[0][:, 0].tolist()
    found["events"] = simulation.performance["ssa_events"]
    found["jumps"] = simulation.performance["diffusion_jumps"]
    for s in model.species:
        for kind, name in (("concentrations", s), ("molecules", f"{s}_m")):
            if getattr(model, kind):
                series = [run.field(f"concentration/{name}")[k] for k in range(len(run))]
                number = np.array(series) * AVOGADRO * model.spacing**model.dim
                found[f"{s} {kind}"] = number.tolist()
    return found


# --- models and what is known of them ----------------------------------------------------------


def timed(reaction: bool, kind: str, number: int, repeats: int) -> Model:
    """Diffusion, or A + B → ∅ with A mostly on one side and B on the other.

    ``number`` molecules of each in a particle at first (mean); a particle's volume is 1 in both
    codes, since SpatialPy starts concentrations with the numbers of molecules whatever it is.
    """
    n, d = 33, 10.0
    species = {"A": (d, float(number), 0.9), "B": (d, float(number), -0.9)}
    reactions: list[Any] = [({"A": 1, "B": 1}, {}, 10.0 / number)] if reaction else []
    return Model(
        "annihilation" if reaction else "diffusion",
        n,
        float(n),
        species,
        reactions,
        every=0.1,
        frames=5,
        dt=5e-3,
        concentrations=kind != "molecules",
        molecules=kind != "concentrations",
        repeats=repeats,
    )


def mean(found: dict[str, Any], name: str, frame: int) -> float:
    """Mean number in a particle of a frame."""
    return float(np.mean(found[name][frame]))


def share_of_b(found: dict[str, Any], model: Model) -> float:
    """Share of B in the second half of the run."""
    frames = range(model.frames // 2, model.frames + 1)
    b = sum(mean(found, "B molecules", k) for k in frames)
    return b / (b + sum(mean(found, "A molecules", k) for k in frames))


def diffusivity(found: dict[str, Any], model: Model, name: str) -> float:
    """Diffusivity of the decay of the half wave, over that asked for; without the first frames."""
    wave_number = np.pi / (model.n * model.spacing)
    wave = np.cos(wave_number * (np.array(found["x"]) + 0.5 * model.spacing))
    amplitude = np.array(found[name]) @ wave
    times = model.every * np.arange(len(amplitude))
    asked = model.species["A"][0] * wave_number**2
    return decay_rate(times[3:], amplitude[3:]).rate / asked


def result_rows(python: str) -> list[dict[str, Any]]:
    """Ours, theirs and what is exact, one row a question."""
    rows = []

    def ask(model: Model, questions: dict[str, tuple[Any, float]]) -> None:
        first, second = ours(model), theirs(python, model)
        for question, (answer, exact) in questions.items():
            row = {"question": question, "ours": answer(first), "spatialpy": answer(second)}
            rows.append({**row, "exact": exact, "model": model.name})
            print(
                f"{question:<66} ours {row['ours']:10.4g}  SpatialPy {row['spatialpy']:10.4g}  "
                f"exact {exact:.4g}",
                flush=True,
            )

    both: list[Any] = [({"A": 1}, {"B": 1}, 1.0), ({"B": 1}, {"A": 1}, 1.0)]
    for d in (0.0, 1.0):
        species = {"A": (d, 100.0, 0.0), "B": (d, 0.0, 0.0)}
        swap = Model("isomerisation", 11, 11.0, species, both, 0.1, 100, 0.01)
        question = f"A <-> B, equal rates, D = {d:g}: share of B"
        ask(swap, {question: (partial(share_of_b, model=swap), 0.5)})
    for dim, n, number in ((1, 32, 2000), (2, 17, 500)):
        wave_number = np.pi / n
        every = 0.5 / 20 / wave_number**2
        steps = int(np.ceil(every / 0.1))
        a = {"A": (1.0, float(number), 0.5)}
        model = Model("diffusion", n, n - 1.0, a, [], every, 20, every / steps, dim)
        for kind in ("concentrations", "molecules"):
            answer = partial(diffusivity, model=model, name=f"A {kind}")
            # how much of a difference is chance: from other seeds of ours
            others = [answer(ours(model, seed)) for seed in range(101, 109)]
            question = f"effective over given diffusivity, {dim}D, {kind}"
            if kind == "molecules":
                question += f" (chance: ± {np.std(others, ddof=1):.2f})"
            ask(model, {question: (answer, 1.0)})
    birth: list[Any] = [({}, {"A": 1}, 10.0), ({"A": 1}, {}, 1.0)]
    ask(
        Model("birth-death", 11, 11.0, {"A": (0.0, 0.0, 0.0)}, birth, 0.5, 20, 0.01),
        {
            f"0 -> A (10/s) and A -> 0 (1/s): mean number at 10 s, {kind}": (
                lambda f, kind=kind: mean(f, f"A {kind}", 20),
                -10 * float(np.expm1(-10.0)),
            )
            for kind in ("concentrations", "molecules")
        },
    )
    decay: list[Any] = [({"A": 1}, {}, 1.0)]
    ask(
        Model("decay", 11, 11.0, {"A": (0.0, 1000.0, 0.0)}, decay, 0.25, 4, 1e-3),
        {
            f"A -> 0 (1/s): part left in the frame of {t:g} s, {kind}": (
                lambda f, kind=kind, t=t: mean(f, f"A {kind}", round(t / 0.25)) / 1000,
                float(np.exp(-t)),
            )
            for t in (0.25, 1.0)
            for kind in ("concentrations", "molecules")
        },
    )
    rare: list[Any] = [({"A": 1}, {}, 1e-6)]
    ask(
        Model("rare", 11, 11.0, {"A": (0.0, 100.0, 0.0)}, rare, 1.0, 2, 0.01),
        {
            "A -> 0 (1e-6/s), 12 100 molecules: events in 1 s": (
                lambda f: 121 * (100 - mean(f, "A molecules", 1)),
                12_100 * 1e-6,
            )
        },
    )
    return rows


#: What is timed: with a reaction, species as what, molecules of each in a particle.
TIMED = (
    (True, "molecules", 1000),
    (True, "molecules", 100),
    (True, "concentrations", 100),
    (False, "molecules", 1000),
)


def speed_rows(python: str, repeats: int) -> Iterator[dict[str, Any]]:
    """Times of whole runs."""
    for reaction, kind, number in TIMED:
        model = timed(reaction, kind, number, repeats)
        first, second, again = ours(model), theirs(python, model), ours(model)
        mine = min(first["seconds"] + again["seconds"])
        row = {
            "model": model.name,
            "species as": kind,
            "number": number,
            "particles": model.n**2,
            "steps": round(model.every * model.frames / model.dt),
            "seconds": mine,
            "spatialpy_seconds": min(second["seconds"]),
            "ratio": min(second["seconds"]) / mine,
            "jumps": first["jumps"],
            "spatialpy_build_seconds": second["build"],
            "spatialpy": second["version"],
        }
        for key in ("A concentrations", "A molecules"):
            if key in first:
                row[f"{key} left"] = mean(first, key, model.frames)
                row[f"spatialpy {key} left"] = mean(second, key, model.frames)
        print(
            f"{model.name}, {kind}, {number} a particle: {mine:.3f} s, SpatialPy "
            f"{row['spatialpy_seconds']:.3f} s (and {second['build']:.1f} s of building): "
            f"{row['ratio']:.1f} times",
            flush=True,
        )
        yield row


@click.command()
@click.argument("python", type=click.Path(exists=True, dir_okay=False))
@click.option("--only", type=click.Choice(["speed", "results"]), help="One part only.")
@click.option("--repeats", default=2, show_default=True, help="Timed runs of each model.")
@click.option("--json", "json_file", type=click.Path(path_type=Path), help="Where to write rows.")
def main(python: str, only: str | None, repeats: int, json_file: Path | None) -> None:
    """Print ratios of run times to SpatialPy, run by PYTHON, and results of both."""
    set_threads(1)
    found: dict[str, list[dict[str, Any]]] = {"speed": [], "results": []}

    def keep(part: str, row: dict[str, Any]) -> None:
        found[part].append(row)
        if json_file is not None:
            json_file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")

    if only != "results":
        for row in speed_rows(python, repeats):
            keep("speed", row)
    if only != "speed":
        for row in result_rows(python):
            keep("results", row)


if __name__ == "__main__":
    main()
