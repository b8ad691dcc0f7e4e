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
from particell.errors import InputError, unknown_name
from particell.fields import GIVEN, WORK, Field
from particell.representation import block, span, table

# Kinds of group: what the particles do in the equations of motion.
FLUID, WALL = 0, 1
KINDS = {"fluid": FLUID, "wall": WALL}


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
        self.declared: dict[str, Field] = {}
        self._scratch: dict[tuple, object] = {}
        self.add(Field("id", role=GIVEN, kind=np.int64), np.arange(n))
        for field in _always(dim):
            self.add(field)

    def add(self, field: Field, values: np.ndarray | float | None = None) -> None:
        """Add a field of shape (n,) or, with components, (n, components).

        Parameters
        ----------
        field
            The declaration.
        values
            What it holds at first, in memory order; :attr:`.Field.initial` where it is left out.

        Raises
        ------
        InputError
            Where there is one of that name.
        """
        if field.name in self.fields:
            raise InputError("name of Field", field.name, "one that nothing else has")
        shape = (self.n, field.components) if field.components else (self.n,)
        kind = np.dtype(field.kind) if field.kind else self.device.real
        host = np.empty(shape, kind)
        host[...] = field.initial if values is None else values
        self.declared[field.name] = field
        self.fields[field.name] = self.device.array(host)

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
        units = {name: field.unit for name, field in self.declared.items() if field.unit}
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

        Raises
        ------
        InputError
            For values of another shape, and for what are no real numbers.
        """
        host = np.empty(self[name].shape, self[name].dtype)
        given = np.asarray(values)
        try:
            if given.dtype.kind not in "fiub":
                raise ValueError
            host[...] = given
        except (TypeError, ValueError):
            shown = f"numbers of shape {given.shape}" if given.dtype.kind in "fiub" else values
            allowed = f"one number, or real numbers of shape {host.shape}"
            raise InputError(f"values of '{name}'", shown, allowed) from None
        self.device.write(self[name], host[self.view("id")] if by_id else host)
        for part in [f.name for f in self.declared.values() if f.part_of == name]:
            self.set(part, np.zeros(()))

    def select(self, group: str, by_id: bool = False) -> np.ndarray:
        """Boolean mask (n,) of a group's particles, in memory order or that of their ids."""
        names = [g.name for g in self.groups]
        if group not in names:
            raise unknown_name("group", group, names)
        return (self.by_id("group") if by_id else self.view("group")) == names.index(group)

    def permute(self, order: Any, *others: Any) -> None:
        """Put row ``order[k]`` of every field, and of other arrays (n, …), in place k.

        ``order`` is an array of the device.
        """
        for array in (*self.fields.values(), *others):
            rows = array.reshape(self.n, -1)  # type: ignore[attr-defined]
            columns = rows.shape[1]
            key = (columns, rows.dtype)
            if key not in self._scratch:
                self._scratch[key] = self.device.zeros((self.n, columns), rows.dtype)
            scratch = self._scratch[key]
            self.device.permute(rows, order, scratch)


def _always(dim: int) -> list[Field]:
    """What every set of particles has besides ids; masses are per m of each missing dimension."""
    return [
        Field("group", role=GIVEN, kind=np.int32),
        Field("is_wall", role=GIVEN, kind=np.uint8),
        Field("slides", role=GIVEN, kind=np.uint8),
        Field("image", components=dim, kind=np.int32),
        Field("x", unit="m", components=dim),
        Field("v", unit="m/s", components=dim),
        Field("a", unit="m/s²", components=dim),
        Field("mass", unit={3: "kg", 2: "kg/m", 1: "kg/m²"}[dim], role=GIVEN),
        Field("density", unit="kg/m³"),
        Field("pressure", unit="Pa", role=WORK),
        Field("support", unit="m", role=GIVEN),
    ]
