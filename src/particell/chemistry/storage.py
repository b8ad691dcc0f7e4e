"""The arrays that the loops of chemistry use, by the names of the loops' arguments."""

from __future__ import annotations

from typing import Any

import numpy as np

from particell.chemistry import massaction
from particell.chemistry.joint import couples, joint_tables
from particell.chemistry.network import Tables
from particell.chemistry.rates import work_columns
from particell.chemistry.reservoirs import WALL_FLUX, WALL_VALUE
from particell.compute.device import Device
from particell.compute.loop import particle_loop
from particell.compute.threads import available_threads
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


@particle_loop
def remember(i, amount, amount_booked, amount_before, booked_before, *, COLUMNS):
    """Keep the amounts at the beginning of Heun's method."""
    for s in range(COLUMNS):
        amount_before[i, s] = amount[i, s]
        booked_before[i, s] = amount_booked[i, s]


@particle_loop
def average(i, amount, amount_booked, amount_before, booked_before, *, COLUMNS):
    """The mean of the amounts before and after two explicit steps: Heun's method."""
    for s in range(COLUMNS):
        amount[i, s] = 0.5 * (amount_before[i, s] + amount[i, s])
        amount_booked[i, s] = 0.5 * (booked_before[i, s] + amount_booked[i, s])


def scratch_fields(
    device: Device,
    particles: Particles,
    tables: tuple[Tables, Tables],
    surface: bool,
    flux: bool,
    strang: bool,
) -> dict[str, Any]:
    """Work arrays, no larger than what the species need."""
    zeros, n = device.zeros, particles.n
    deterministic, stochastic = tables
    threads = available_threads() if device.backend == "cpu" else 1
    columns = len(deterministic.names)
    molecules = n if stochastic.names else 1
    fields: dict[str, Any] = {
        "volume": zeros(n, np.float64),
        "facing": zeros(n if flux else 1, np.float64),
        "concentration": zeros((n if columns else 1, max(columns, 1)), np.float64),
        "amount_before": zeros((n if strang and columns else 1, max(columns, 1)), np.float64),
        "booked_before": zeros((n if strang and columns else 1, max(columns, 1)), np.float64),
        "cumulative": zeros(1, np.float32),
        "leave_rate": zeros(molecules, np.float64),
        "inflow": zeros(molecules, np.float64),
        "arrived": zeros(molecules, np.int64),
        "moving": zeros((threads, molecules), np.int64),
        "landed": zeros((threads, molecules), np.int64),
        "counters": zeros((threads, COUNTERS), np.int64),
        "event_counter": zeros((threads, COUNTERS), np.int64),
        "failed": zeros(molecules if stochastic.reactions else 1, np.uint8),
        "broken": zeros(1, np.uint8),
        "no_amount": zeros((1, 1), np.float64),
        "no_count": zeros((1, 1), np.int64),
        "no_continuous": zeros((1, 1), np.uint8),
        "zero_counters": np.zeros((threads, COUNTERS), np.int64),
    }
    lanes, length = 1, 1
    if couples(*tables):
        rows = deterministic.reactions + stochastic.reactions
        lanes, length = min(massaction.LANES, n), work_columns(columns + 1, rows)
    elif deterministic.reactions:
        lanes = min(massaction.LANES, n)
        timed = int(deterministic.timed)
        length = work_columns(columns + timed, deterministic.reactions + timed)
    fields["work"] = zeros((lanes, length), np.float64)
    fields["substeps"] = zeros(lanes, np.int64)
    fields["pace"] = zeros(lanes, np.float64)
    dim = particles.dim
    shapes: dict[str, Any] = {"wall_normal": (1, dim), "wall_depth": 1, "wall_curvature": 1}
    for name, shape in shapes.items():
        if name not in particles:
            if surface or flux:
                raise InputError(
                    "FixedValueWall" if surface else "FluxWall",
                    name,
                    "on walls whose particles know their surface",
                )
            fields[name] = zeros(shape)
    return fields


def table_fields(device: Device, tables: Tables, receives: np.ndarray) -> dict[str, Any]:
    """The tables of one kind of species.

    ``receives`` (G,) tells which groups take what comes through a wall.
    """
    array = device.array
    reacting = massaction.with_clock(tables)
    return {
        "pair_kappa": array(tables.pair_diffusivity),
        "status": array(tables.status),
        "value": array(tables.value),
        "held": array(tables.value),
        "inward": array(tables.flux),
        "transfer": array(tables.transfer),
        "diffusivity": array(tables.diffusivity),
        "receives": array((tables.present & receives[:, None]).astype(np.uint8)),
        "partner": array(tables.partner),
        "takes_part": array(reacting["takes_part"]),
        "shared": array(tables.shared),
        "net_amount": array(tables.net_amount),
        "reactants": array(reacting["reactants"]),
        "repeats": array(tables.repeats),
        "net": array(reacting["net"]),
        "rate": array(reacting["rate"]),
        "volume_power": array(tables.volume_power),
        "law": array(reacting["law"]),
        "found": array(np.zeros(tables.reactions, np.uint8)),
    }


def joint_fields(
    device: Device, tables: tuple[Tables, Tables], amounts: dict[str, Any]
) -> dict[str, Any]:
    """What reactions of molecules and concentrations together need beside the tables of both."""
    joint = {name: device.array(values) for name, values in joint_tables(*tables).items()}
    names = ("rate", "takes_part", "found")
    return joint | {f"{name}_amounts": amounts[name] for name in names}


def shared_jump_tables(
    device: Device, tables: Tables, receives: np.ndarray
) -> list[tuple[dict[str, Any], list[int]]]:
    """The tables of single species, each with the columns of the species that share it.

    A species that switches has one of its own: where it is an amount differs.
    """
    shared: dict[bytes, tuple[dict[str, Any], list[int]]] = {}
    for s in tables.diffusing:
        status = np.ascontiguousarray(tables.status[:, s])
        at_wall = (status == WALL_VALUE) | (status == WALL_FLUX)
        arrays = {
            "pair_kappa": np.ascontiguousarray(tables.pair_diffusivity[:, :, s]),
            "status": status,
            "value": np.where(at_wall, tables.value[:, s], 0.0),
            "inward": np.ascontiguousarray(tables.flux[:, s]),
            "transfer": np.ascontiguousarray(tables.transfer[:, s]),
            "diffusivity": np.ascontiguousarray(tables.diffusivity[:, s]),
            "receives": (tables.present[:, s] & receives).astype(np.uint8),
        }
        own = int(s) if tables.partner[s] >= 0 else -1
        key = b"".join(a.tobytes() for a in arrays.values()) + str(own).encode()
        if key not in shared:
            shared[key] = {k: device.array(a) for k, a in arrays.items()}, []
        shared[key][1].append(int(s))
    return list(shared.values())
