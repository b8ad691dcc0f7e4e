"""The arrays that the loops of chemistry use, by the names of the loops' arguments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import config

from particell.chemistry import massaction
from particell.chemistry.network import Tables
from particell.chemistry.reservoirs import WALL_VALUE
from particell.compute.device import Device
from particell.compute.loop import particle_loop
from particell.errors import InputError
from particell.particles import Particles

#: Length of a thread's row of counters, so that threads do not share cache lines.
COUNTERS = 16


@particle_loop
def prepare(i, mass, density, amount, volume, concentration, *, COLUMNS):
    """Volumes and concentrations of all particles."""
    volume[i] = mass[i] / density[i]
    for s in range(COLUMNS):
        concentration[i, s] = amount[i, s] / volume[i]


def scratch_fields(
    device: Device,
    particles: Particles,
    deterministic: Tables,
    stochastic: Tables,
    surface: bool,
    normalise: bool,
) -> dict[str, Any]:
    """Work arrays, no larger than what the species need."""
    zeros, n = device.zeros, particles.n
    threads = config.NUMBA_NUM_THREADS if device.backend == "cpu" else 1  # type: ignore[attr-defined]
    columns = len(deterministic.names)
    molecules = n if stochastic.names else 1
    fields: dict[str, Any] = {
        "volume": zeros(n, np.float64),
        "kernel_sum": zeros(n if normalise else 1, np.float64),
        "concentration": zeros((n if columns else 1, max(columns, 1)), np.float64),
        "cumulative": zeros(1, np.float32),
        "leave_rate": zeros(molecules, np.float64),
        "inflow": zeros(molecules, np.float64),
        "arrived": zeros(molecules, np.int64),
        "moving": zeros((threads, molecules), np.int64),
        "landed": zeros((threads, molecules), np.int64),
        "counters": zeros((threads, COUNTERS), np.int64),
        "event_counter": zeros((threads, COUNTERS), np.int64),
        "zero_counters": np.zeros((threads, COUNTERS), np.int64),
    }
    if deterministic.reactions:
        lanes = min(massaction.LANES, n)
        fields["work"] = zeros((lanes, massaction.work_columns(columns)), np.float64)
        fields["substeps"] = zeros(lanes, np.int64)
    dim = particles.dim
    shapes: dict[str, Any] = {"wall_normal": (1, dim), "wall_depth": 1, "wall_curvature": 1}
    for name, shape in shapes.items():
        if name not in particles:
            if surface:
                raise InputError(
                    "FixedValueWall", name, "on walls whose particles know their surface"
                )
            fields[name] = zeros(shape)
    return fields


def table_fields(device: Device, tables: Tables, field: str) -> dict[str, Any]:
    """The tables of one kind of species (``field``: ``"amount"`` or ``"count"``)."""
    array = device.array
    fields = {
        "pair_kappa": array(tables.pair_diffusivity),
        "status": array(tables.status),
        "value": array(tables.value),
        "columns": array(tables.diffusing),
        "reactants": array(tables.reactants),
        "repeats": array(tables.repeats),
        "net": array(tables.net),
        "rate": array(tables.rate),
        "volume_power": array(tables.volume_power),
        "law": array(tables.law),
    }
    if not tables.names:
        fields[field] = device.zeros((1, 1), np.float64 if field == "amount" else np.int64)
    return fields


def shared_jump_tables(device: Device, tables: Tables) -> list[tuple[dict[str, Any], list[int]]]:
    """The tables of single species, each with the columns of the species that share it."""
    shared: dict[bytes, tuple[dict[str, Any], list[int]]] = {}
    for s in tables.diffusing:
        kappa = np.ascontiguousarray(tables.pair_diffusivity[:, :, s])
        status = np.ascontiguousarray(tables.status[:, s])
        value = np.where(status == WALL_VALUE, tables.value[:, s], 0.0)
        key = kappa.tobytes() + status.tobytes() + value.tobytes()
        if key not in shared:
            arrays = {"pair_kappa": kappa, "status": status, "value": value}
            shared[key] = {k: device.array(a) for k, a in arrays.items()}, []
        shared[key][1].append(int(s))
    return list(shared.values())
