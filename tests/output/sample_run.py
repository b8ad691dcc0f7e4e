"""A small trajectory to write and read."""

from __future__ import annotations

import numpy as np

from particell.geometry.domain import Domain

GROUPS = ["fluid", "membrane"]
N = 5


def domain() -> Domain:
    return Domain((-1.0, 0.0), (3.0, 2.0), periodic="x", depth=0.1)


def static() -> dict[str, np.ndarray]:
    return {
        "id": np.arange(N),
        "group": np.array([0, 1, 0, 0, 1], np.int32),
        "mass": np.linspace(1, 2, N),
        "support": np.full(N, 0.5),
    }


def frame(k: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(k)
    return {
        "position": random.random((N, 2)),
        "velocity": random.random((N, 2)),
        "density": np.full(N, 1000.0 + k),
        "image": np.full((N, 2), k, np.int32),
        "concentration/L": random.random(N),
        "count/R": np.arange(N) + k,
    }


def observables(k: int) -> dict[str, float]:
    return {"kinetic_energy": 0.5 * k, "amount_L": 3.0}
