"""What particles exchange by diffusion: the weights of pairs, one set for each kind of carriers.

Species that the same groups carry share the weights of :mod:`particell.laws.carriers`; without
normalisation all species do. Explicit exchange of concentrations is stable during tau if no
eigenvalue is beyond 2/tau; they are bounded by the largest row of the weights in use (Gershgorin),
with walls and edges as they are, and longer steps are divided.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from particell.chemistry import fluxes
from particell.chemistry.network import Tables
from particell.chemistry.origin import origin
from particell.chemistry.reservoirs import FREE, HELD, WALL_FLUX, WALL_VALUE
from particell.compute.device import Device
from particell.compute.reduce import Reduction
from particell.laws import carriers as law
from particell.laws import diffusion


def carrier_codes(tables: Tables, receives: np.ndarray) -> np.ndarray:
    """uint8 (G, G, S): what the second group is to a species in the first one.

    ``receives`` (G,) tells which groups take what comes through walls. Pairs of groups of which
    one has no diffusivity are apart; where neither has, they are carriers for what a wall brings.
    """
    status, moves = tables.status, tables.diffusivity > 0
    inside = tables.present & ((status == FREE) | (status == HELD))
    taking = tables.present & receives[:, None]
    flux = status == WALL_FLUX
    rests = inside & ~moves & (taking & flux.any(axis=0))
    moves &= inside
    code = np.zeros((len(status), *status.shape), np.uint8)
    for holds in (moves, rests):
        code[holds[:, None, :] & holds[None, :, :]] = law.CARRIES
    code[moves[:, None, :] & (status == WALL_VALUE)[None, :, :]] = law.SURFACE_OF
    code[taking[:, None, :] & flux[None, :, :]] = law.SURFACE_OF
    return code


def weight_fields(device: Device, n: int, dim: int, uniform: bool, normalise: bool) -> dict:
    """Arrays that all sets of weights use one after the other."""
    made = law.tensor_fields(device, n, dim, uniform) if normalise else {}
    made["row_rate"] = device.zeros(n, np.float64)
    made["negative"] = device.zeros(n, np.int64)
    return made


class Exchange:
    """The weights for the species with the same carriers.

    Parameters
    ----------
    device
        Where loops run.
    codes
        uint8 (G, G), see :func:`carrier_codes`.
    n
        Number of particles.

    Attributes
    ----------
    amounts
        Columns of the concentrations that diffuse with these weights.
    fastest
        Their largest diffusivity in m²/s.
    rate
        No eigenvalue of their exchange is beyond this, in 1/s.
    broken
        Field and row of the particle that makes the rate not finite; None where it is finite.
    """

    def __init__(self, device: Device, codes: np.ndarray, n: int):
        self.device = device
        self.amounts: list[int] = []
        self.fastest = self.rate = 0.0
        self.broken: tuple[str, int] | None = None
        self.fields: dict[str, Any] = {
            "carriers": device.array(codes),
            "wall_scale": device.zeros(len(codes), np.float64),
        }
        self._scale = np.zeros(len(codes))
        self._reduction = Reduction(device)
        self._scratch: dict[str, Any] = {}

    def bind(
        self,
        fields: Mapping[str, Any],
        pairs: int,
        shape: dict[str, Any],
        constants: dict[str, Any],
        normalise: bool,
    ) -> None:
        """Look up the loops' arrays for a neighbour list with room for ``pairs``."""
        bind, dim = self.device.bind, shape["DIM"]
        self.fields["exchange"] = self.device.zeros(pairs, np.float64)
        partners = self.device.to_host(fields["partner"])
        self._all = f = {**fields, **self.fields}
        if normalise:
            self._slopes = bind(law.carrier_tensors, f, **shape)
        else:
            slopes = diffusion.pair_slopes(dim, shape["KERNEL"], shape["UNIFORM"])
            self._slopes = slopes.bind(self.device, f, self._scratch)
        kernel, groups = shape["KERNEL"], len(self._scale)
        walls = bool(constants["SURFACE"] or constants["FLUX"])
        weights = law.carrier_weights(dim, kernel, groups, normalise, walls)
        self._weights = weights.bind(self.device, f, self._scratch)
        self._facing: Any = None
        if walls:
            facing = fluxes.facing_area(dim, kernel)
            self._facing = facing.bind(self.device, f, self._scratch)
        self._diffuse = []
        for column in self.amounts:
            partner = int(partners[column])
            switch = constants["SWITCH"] and partner >= 0
            sweep = diffusion.diffuse(dim, kernel, groups, walls, switch)
            run = sweep.bind(self.device, f, self._scratch)
            numbers = {"column": column, **({"counted": partner} if switch else {})}
            self._diffuse.append(functools.partial(run, **numbers))

    def measure(self, n: int, areas: Mapping[int, float]) -> None:
        """The weights of n particles where they are now, and the shares of walls with a flux."""
        self._slopes(n)
        self._weights(n)
        for g, area in areas.items():
            self._facing(n, wanted=g)
            total = self._reduction.sum(self._all["facing"].reshape(n, 1))[0]
            self._scale[g] = area / total if total > 0 else 0.0
        if areas:
            self.device.write(self.fields["wall_scale"], self._scale)
        if self.amounts:
            largest = self._reduction.max(self._all["row_rate"])
            self.rate = self.fastest * largest * max(1.0, self._scale.max())
            # at once: the next set of weights writes to the same rows
            self.broken = None
            if not math.isfinite(self.rate):
                self.broken = origin(self.device, self._all, self._all["row_rate"])

    def diffuse(self, n: int, tau: float) -> None:
        """One explicit step of the concentrations."""
        for exchange in self._diffuse:
            exchange(n, tau=tau)


def exchanges(
    device: Device,
    n: int,
    deterministic: Tables,
    stochastic: Tables,
    receives: np.ndarray,
    normalise: bool,
) -> tuple[list[Exchange], dict[int, Exchange]]:
    """All sets of weights, and that of each diffusing species of molecules by its column."""
    found: dict[bytes, Exchange] = {}
    of_molecules: dict[int, Exchange] = {}
    kinds = [(tables, carrier_codes(tables, receives)) for tables in (deterministic, stochastic)]
    used = [codes[:, :, s] for tables, codes in kinds for s in tables.diffusing]
    if used and not normalise:
        joint = np.max(used, axis=0)
        kinds = [(t, np.repeat(joint[:, :, None], len(t.names), axis=2)) for t, _ in kinds]
    for tables, codes in kinds:
        for s in tables.diffusing:
            code = np.ascontiguousarray(codes[:, :, s])
            if code.tobytes() not in found:
                found[code.tobytes()] = Exchange(device, code, n)
            one = found[code.tobytes()]
            if tables is deterministic:
                one.amounts.append(int(s))
                one.fastest = max(one.fastest, float(tables.pair_diffusivity[:, :, s].max()))
            else:
                of_molecules[int(s)] = one
    return list(found.values()), of_molecules
