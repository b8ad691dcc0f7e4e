"""The processes of the discrete stochastic models test suite (Evans, Gillespie & Wilkinson 2008).

Its models are written anew here, in its definitions; events are left out. Their exact means and
standard deviations come from the master equation, solved on a finite set of states.
"""

from __future__ import annotations

import numpy as np
from sbml_files import math, reaction, species
from scipy.sparse import diags
from scipy.sparse.linalg import expm_multiply

TIMES = np.arange(0.0, 51.0)  # s, as in the suite
COMMON = {"substance": "item", "time": "second", "volume": None}


def amount(name: str, number: int, **more: str) -> str:
    return species(name, f"Amount={number}", amounts=True, **more)


def concentration(name: str, number: int) -> str:
    return species(name, f"Amount={number}")


def birth_death(birth="(* Lambda X)", death="(* Mu X)", local=("", ""), sink="", **more):
    """X -> 2 X, X -> 0, from 100."""
    found = {
        "content": [amount("X", 100)],
        "reactions": [
            reaction("birth", "X", "2 X", birth, local[0]),
            reaction("death", "X", sink, death, local[1]),
        ],
        "parameters": "Lambda=0.1 Mu=0.11",
    }
    return {**COMMON, **found, **more}


def immigration(rate="Alpha", death="(* Mu X)", local=("", ""), source="", sink="", **more):
    """0 -> X, X -> 0, from 0."""
    found = {
        "content": [amount("X", 0)],
        "reactions": [
            reaction("immigration", source, "X", rate, local[0]),
            reaction("death", "X", sink, death, local[1]),
        ],
        "parameters": "Alpha=1 Mu=0.1",
    }
    return {**COMMON, **found, **more}


def dimers(law="(/ (* k1 P (- P 1)) 2)", start=100, **more):
    """2 P <-> P2, in two reactions."""
    found = {
        "content": [amount("P", start), amount("P2", 0)],
        "reactions": [
            reaction("on", "2 P", "P2", law),
            reaction("off", "P2", "2 P", "(* k2 P2)"),
        ],
        "parameters": "k1=0.001 k2=0.01",
    }
    return {**COMMON, **found, **more}


def dimers_alone(law):
    """The same with P removed by the conservation law."""
    return {
        **COMMON,
        "content": [amount("P2", 0)],
        "reactions": [reaction("on", "", "P2", law), reaction("off", "P2", "", "(* k2 P2)")],
        "parameters": "k1=0.001 k2=0.01",
    }


def batches(size, mu):
    """0 -> n X, X -> 0, from 0."""
    return immigration(
        reactions=[
            reaction("immigration", "", f"{size} X", "Alpha"),
            reaction("death", "X", "", "(* Mu X)"),
        ],
        parameters=f"Alpha=1 Mu={mu}",
    )


X, SINK = amount("X", 100), amount("Sink", 0, boundaryCondition="true")
SOURCE, NONE = amount("Source", 0, boundaryCondition="true"), amount("X", 0)
HELD = amount("Sink", 0, boundaryCondition="true", constant="true")
Y = f'<listOfRules><assignmentRule variable="y">{math("(* 2 X)")}</assignmentRule></listOfRules>'
LEFT = "(* k1 (- 100 (* 2 P2)) (- (- 100 (* 2 P2)) 1))"

#: By name: the model, and the process that it is.
MODELS: dict[str, tuple[dict, tuple]] = {
    "001-01": (birth_death(), ("birth", 0.1, 0.11, 100)),
    "001-02": (
        birth_death(local=("Lambda=0.1", "Mu=0.11"), parameters=""),
        ("birth", 0.1, 0.11, 100),
    ),
    "001-03": (birth_death(parameters="Lambda=1 Mu=1.1"), ("birth", 1.0, 1.1, 100)),
    "001-04": (birth_death(content=[amount("X", 10)]), ("birth", 0.1, 0.11, 10)),
    "001-05": (birth_death(content=[amount("X", 10000)]), ("birth", 0.1, 0.11, 10000)),
    "001-06": (birth_death(content=[X, SINK], sink="Sink"), ("birth", 0.1, 0.11, 100)),
    "001-07": (birth_death(content=[X, amount("Sink", 0)], sink="Sink"),
               ("birth", 0.1, 0.11, 100)),
    "001-08": (birth_death(volume=1.0), ("birth", 0.1, 0.11, 100)),
    "001-09": (birth_death(volume=2.0), ("birth", 0.1, 0.11, 100)),
    "001-10": (birth_death(content=[concentration("X", 100)], volume=1.0),
               ("birth", 0.1, 0.11, 100)),
    "001-11": (birth_death(content=[concentration("X", 100)], volume=2.0),
               ("birth", 0.05, 0.055, 100)),
    "001-12": (birth_death("(* Lambda X 0.5 2)"), ("birth", 0.1, 0.11, 100)),
    "001-13": (birth_death("(* Lambda X 0.5)", parameters="Lambda=0.2 Mu=0.11"),
               ("birth", 0.1, 0.11, 100)),
    "001-14": (birth_death("(/ (/ (* Lambda X) 2) 0.5)"), ("birth", 0.1, 0.11, 100)),
    "001-15": (birth_death("(/ (* Lambda (/ X 2)) 0.5)"), ("birth", 0.1, 0.11, 100)),
    "001-16": (birth_death("(/ (* Lambda X) (/ 2 2))"), ("birth", 0.1, 0.11, 100)),
    "001-17": (birth_death("(* cell Lambda X)", "(* cell Mu X)", volume=1.0),
               ("birth", 0.1, 0.11, 100)),
    "001-18": (birth_death("(* cell Lambda X)", "(* cell Mu X)", volume=0.5),
               ("birth", 0.05, 0.055, 100)),
    "001-19": (birth_death(content=[X, amount("y", 0)], extra=Y), ("birth", 0.1, 0.11, 100)),
    "002-01": (immigration(), ("immigration", 1.0, 0.1, 1)),
    "002-02": (immigration(parameters="Alpha=10 Mu=0.1"), ("immigration", 10.0, 0.1, 1)),
    "002-03": (immigration(parameters="Alpha=10 Mu=0.1", local=("Alpha=5", "")),
               ("immigration", 5.0, 0.1, 1)),
    "002-04": (immigration(parameters="Alpha=1000 Mu=0.1"), ("immigration", 1000.0, 0.1, 1)),
    "002-05": (immigration(parameters="Alpha=10 Mu=0.1", source="Source", sink="Sink",
                           content=[NONE, SOURCE, SINK]), ("immigration", 10.0, 0.1, 1)),
    "002-06": (immigration(parameters="Alpha=10 Mu=0.1", source="Source", sink="Sink",
                           content=[NONE, SOURCE, amount("Sink", 0)]),
               ("immigration", 10.0, 0.1, 1)),
    "002-07": (immigration(parameters="Alpha=10 Mu=0.1", source="Source", sink="Sink",
                           content=[NONE, SOURCE, HELD]), ("immigration", 10.0, 0.1, 1)),
    "002-08": (immigration("k", "(* k X)", local=("k=1", "k=0.1"), parameters="k=2"),
               ("immigration", 1.0, 0.1, 1)),
    "003-01": (dimers(), ("dimers", 0.001, 0.01, 100)),
    "003-02": (dimers(start=1000, parameters="k1=0.0002 k2=0.004"),
               ("dimers", 0.0002, 0.004, 1000)),
    "003-05": (dimers_alone(f"(/ {LEFT} 2)"), ("dimers", 0.001, 0.01, 100)),
    "003-06": (dimers_alone(f"(* 0.5 {LEFT})"), ("dimers", 0.001, 0.01, 100)),
    "003-07": (dimers_alone("(/ (* k1 (- 100 (* 2 P2)) (- 99 (* 2 P2))) 2)"),
               ("dimers", 0.001, 0.01, 100)),
    "004-01": (batches(5, 0.2), ("immigration", 1.0, 0.2, 5)),
    "004-02": (batches(10, 0.4), ("immigration", 1.0, 0.4, 10)),
    "004-03": (batches(100, 4.0), ("immigration", 1.0, 4.0, 100)),
}  # fmt: skip


def exact(process: tuple) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, standard deviation and kurtosis at TIMES of X, or of P2, by the master equation."""
    kind, a, b, number = process
    most = {"birth": 2 * number + 400, "dimers": number // 2}.get(kind)
    if kind == "immigration":
        most = int(a * number / b + 40 * np.sqrt(a * number * (number + 1) / b) + 40)
    n = np.arange(most + 1.0)
    step = number if kind == "immigration" else 1
    up = {
        "birth": a * n,
        "immigration": np.full_like(n, a),
        "dimers": 0.5 * a * (number - 2 * n) * (number - 2 * n - 1),
    }[kind]
    up[most + 1 - step :] = 0.0
    down = b * n
    generator = diags([up[:-step], -(up + down), down[1:]], [-step, 0, 1], format="csr")
    begin = np.zeros(most + 1)
    begin[number if kind == "birth" else 0] = 1.0
    p = expm_multiply(generator, begin, start=0.0, stop=TIMES[-1], num=len(TIMES), endpoint=True)
    assert abs(p.sum(axis=1) - 1).max() < 1e-8
    assert p[:, -step:].max() < 1e-9 or kind == "dimers"
    mean = p @ n
    central = [np.sum(p * (n - mean[:, None]) ** power, axis=1) for power in (2, 4)]
    variance = np.maximum(central[0], 0.0)
    with np.errstate(all="ignore"):
        return mean, np.sqrt(variance), np.where(variance > 0, central[1] / variance**2, 3.0)
