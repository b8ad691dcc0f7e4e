"""A set of particles: named fields, one array each, all materials in one set.

Every particle belongs to a *group* (fluid, wall, membrane, …). Whatever differs between groups,
such as material, diffusivities or reactions, is a small table indexed by the particle's group.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.compute.device import Device
from particell.compute.philox import check_word
from particell.errors import unknown_name
from particell.representation import block, span, table

# Kinds of group: what the particles do in the equations of motion.
FLUID, WALL = 0, 1
KINDS = {"fluid": FLUID, "wall": WALL}
# Units of the fields that a reader knows; a mass is per m of each dimension that is missing.
UNITS = {"x": "m", "v": "m/s", "a": "m/s²", "density": "kg/m³", "pressure": "Pa", "support": "m"}


@dataclass(frozen=True)
class Group:
    """What particles of one name have in common.

    Attributes
    ----------
    name
        Unique name.
    kind
        ``"fluid"`` (moved by forces) or ``"wall"`` (fixed, or moved as prescribed).
    material
        Index into the simulation's materials.
    """

    name: str
    kind: str
    material: int


class Particles:
    """Named fields of n particles, as a structure of arrays.

    Parameters
    ----------
    device
        Where the arrays live.
    n
        Number of particles.
    dim
        Number of dimensions.
    groups
        The groups, in the order of the field ``group``.

    Raises
    ------
    InputError
        Where they are too many for their ids (of 32 bits in random numbers).

    Notes
    -----
    Rows are kept in cell order and change places when neighbour lists are built, the first time at
    the first step; ``id`` is persistent. :meth:`host` returns fields in memory order, :meth:`by_id`
    in the order of ids, which is that of the phases and of their points.
    """

    def __init__(self, device: Device, n: int, dim: int, groups: list[Group]):
        check_word("number of particles", n)
        self.device, self.n, self.dim, self.groups = device, n, dim, groups
        self.fields: dict[str, object] = {}
        self._parts: dict[str, str] = {}
        self._scratch: dict[tuple, object] = {}
        self._order = device.zeros(n, np.int64)
        self.add("id", dtype=np.int64, values=np.arange(n))
        self.add("group", dtype=np.int32)
        self.add("is_wall", dtype=np.uint8)
        self.add("slides", dtype=np.uint8)
        self.add("image", dim, np.int32)
        for name in ("x", "v", "a"):
            self.add(name, dim)
        for name in ("mass", "density", "pressure", "support"):
            self.add(name)

    def add(self, name: str, components: int = 0, dtype=None, values=None, part_of="") -> None:
        """Add a field of shape (n,) or, with components, (n, components).

        With ``part_of`` it tells which part of another field is taken away before the next step:
        none where that field is :meth:`set`.
        """
        if name in self.fields:
            raise ValueError(f"field '{name}' exists already")
        if part_of:
            self._parts[name] = part_of
        shape = (self.n, components) if components else (self.n,)
        kind = np.dtype(dtype) if dtype else self.device.real
        host = np.zeros(shape, kind)
        if values is not None:
            host[...] = values
        self.fields[name] = self.device.array(host)

    def __getitem__(self, name: str):
        if name not in self.fields:
            raise unknown_name("field", name, self.fields)
        return self.fields[name]

    def __contains__(self, name: str) -> bool:
        return name in self.fields

    def __iter__(self) -> Iterator[str]:
        return iter(self.fields)

    def __len__(self) -> int:
        return self.n

    def __repr__(self) -> str:
        sizes = np.bincount(self.host("group"), minlength=len(self.groups))
        parts = ", ".join(f"{g.name}: {k}" for g, k in zip(self.groups, sizes, strict=True))
        return f"Particles({self.n} in {self.dim}D; {parts})"

    def _repr_html_(self) -> str:
        sizes = np.bincount(self.host("group"), minlength=len(self.groups))
        groups = [(g.name, g.kind, k) for g, k in zip(self.groups, sizes, strict=True)]
        mass = {3: "kg", 2: "kg/m", 1: "kg/m²"}[self.dim]
        units = {**UNITS, "mass": mass}
        rows = [(name, unit, span(self.host(name))) for name, unit in units.items()]
        others = [name for name in self.fields if name not in units]
        return block(
            f"{self.n} particles in {self.dim}D",
            table(groups, ("group", "kind", "particles")),
            table(rows, ("field", "unit", "least … greatest, of each component")),
            table([("further fields", others)]),
        )

    def host(self, name: str) -> np.ndarray:
        """A field as a new NumPy array, in memory order."""
        return np.array(self.device.to_host(self[name]))

    def view(self, name: str) -> np.ndarray:
        """A field to look at, in memory order, read-only: without a copy where it can be (CPU)."""
        values = self.device.to_host(self[name]).view()
        values.flags.writeable = False
        return values

    def by_id(self, name: str) -> np.ndarray:
        """A field as a new NumPy array, in the order of persistent ids."""
        return self.in_order_of_ids(self.view(name))

    def in_order_of_ids(self, values: np.ndarray) -> np.ndarray:
        """Values (n, …) in memory order as a new array in the order of persistent ids."""
        ordered = np.empty_like(values)
        ordered[self.view("id")] = values
        return ordered

    def set(self, name: str, values: np.ndarray, by_id: bool = False) -> None:
        """Overwrite a field, given in memory order or, with ``by_id``, in the order of ids.

        Velocities go on as they are given, also beside walls with thermal noise.
        """
        host = np.empty(self[name].shape, self[name].dtype)
        host[...] = values
        self.device.write(self[name], host[self.view("id")] if by_id else host)
        for part in [p for p, whole in self._parts.items() if whole == name]:
            self.set(part, np.zeros(()))

    def select(self, group: str, by_id: bool = False) -> np.ndarray:
        """Boolean mask (n,) of a group's particles, in memory order or that of their ids."""
        names = [g.name for g in self.groups]
        if group not in names:
            raise unknown_name("group", group, names)
        return (self.by_id("group") if by_id else self.view("group")) == names.index(group)

    def permute(self, order: np.ndarray, *others: Any) -> None:
        """Put row ``order[k]`` of every field, and of other arrays (n, …), in place k."""
        self.device.write(self._order, order)
        for array in (*self.fields.values(), *others):
            rows = array.reshape(self.n, -1)  # type: ignore[attr-defined]
            columns = rows.shape[1]
            key = (columns, rows.dtype)
            if key not in self._scratch:
                self._scratch[key] = self.device.zeros((self.n, columns), rows.dtype)
            scratch = self._scratch[key]
            self.device.permute(rows, self._order, scratch)
