"""A sweep: laws over sources of neighbours, as a loop that runs.

The plan of the loop comes from giving the laws symbols; see :mod:`particell.compute.composer`.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from particell.compute.batches import BATCH, batch_rows
from particell.compute.bins import LANES
from particell.compute.composer import Generated, source_of
from particell.compute.device import Device
from particell.compute.expressions import Node, Symmetric, Vector, components, symbol
from particell.compute.forms import form_of
from particell.compute.generated import load
from particell.compute.plan import Pass, Plan, Result, sum_symbols
from particell.errors import InputError, unknown_name
from particell.laws.law import Law, Values, fixed_of, number_of, numbers_of
from particell.sources.source import Names, Pair, Side, Source

#: What laws add.
_KINDS = (int, float, np.number, Node, Vector, Symmetric)


@dataclass(frozen=True)
class Sweep:
    """Laws, and over whom they sum.

    Attributes
    ----------
    name
        Of the loop.
    laws
        What is summed.
    sources
        Over whom, one after the other.
    names
        What can be read.
    kernel
        The kernel's code.
    uniform
        Whether all supports are equal.
    targets
        Which particles have sums: ``"mobile"``, ``"walls"`` or ``"all"``.
    zeroed
        Fields that are zero for the others.
    stored
        Values of pairs that are kept, by the law's name for them: arrays along the list.
    running
        Sums that are kept pair by pair as they grow, by the name of an array along the list.
    exact
        Whether records are in double precision on any device.
    addable
        Fields that laws may add to; all where it is left out.
    """

    name: str
    laws: tuple[Law, ...]
    sources: tuple[Source, ...]
    names: Names
    kernel: int
    uniform: bool
    targets: str = "mobile"
    zeroed: tuple[str, ...] = ()
    stored: tuple[str, ...] = ()
    running: Mapping[str, str] = field(default_factory=dict)
    exact: bool = False
    addable: tuple[str, ...] | None = None

    def _with_symbols(self) -> list[Law]:
        """The laws with symbols for their own numbers: other values are the same loop."""
        found = []
        for k, law in enumerate(self.laws):
            shown = copy.copy(law)
            for name in numbers_of(law):
                known = symbol("number", f"{_name(law, k)}_{name}")
                object.__setattr__(shown, name, known)
            found.append(shown)
        return found

    def _running(self) -> dict[str, str]:
        """What is kept as it grows, by the sums' full names."""
        own = {s: f"{_name(law, k)}.{s}" for k, law in enumerate(self.laws) for s in law.own}
        return {array: own.get(total, total) for array, total in self.running.items()}

    def plan(self) -> Plan:
        """What the loop is generated from.

        Raises
        ------
        InputError
            Where a law reads or adds what there is not.
        """
        return self._plan

    @functools.cached_property
    def _plan(self) -> Plan:
        dim = self.names.dim
        laws = self._with_symbols()
        me = Side(self.names, "i")
        passes: list[Pass] = []
        sums: dict[str, tuple[int, Any]] = {}
        adding: dict[str, Law] = {}
        for source in self.sources:
            i, j, ij = source.see(me, Side(self.names, "j"), self.kernel, self.uniform)
            adds: dict[str, Any] = {}
            for number, law in enumerate(laws):
                for name, value in _asked(law, "pair", dim, i, j, ij).items():
                    key = f"{_name(law, number)}.{name}" if name in law.own else name
                    adding[key] = law
                    adds[key] = _added(law, name, adds.get(key), value)
            stored = {name: adds.pop(name) for name in self.stored if name in adds}
            parts = {name: components(value, dim) for name, value in adds.items()}
            sums |= {name: (len(parts[name]), adds[name]) for name in parts}
            passes.append(
                Pass(
                    source.first,
                    source.last,
                    parts,
                    support=None if self.uniform else ij.support,
                    stored=stored,
                    offset=() if ij.offset is None else ij.offset.parts(dim),
                    itself=ij.itself,
                    only=ij.only,
                    weighed=ij.weighed,
                    running=self._running(),
                )
            )
            if ij.itself and stored:
                raise InputError(f"{self.name} over images", ", ".join(stored), "not kept of pairs")
        return Plan(
            name=self.name,
            title=", ".join(type(law).__name__ for law in self.laws),
            dim=dim,
            passes=tuple(passes),
            results=self._results(me, laws, sums, adding),
            targets=self.targets,
            zeroed=self.zeroed,
        )

    def _results(
        self,
        me: Side,
        laws: Sequence[Law],
        sums: Mapping[str, tuple[int, Any]],
        adding: dict[str, Law],
    ) -> dict[str, Result]:
        """What becomes of the sums, by field; ``adding`` has the law that was last to add to it."""
        dim = self.names.dim
        symbols = {name: _like(v, sum_symbols(name, k), dim) for name, (k, v) in sums.items()}
        totals = {name: value for name, value in symbols.items() if "." not in name}
        for number, law in enumerate(laws):
            prefix = f"{_name(law, number)}."
            own = {n: symbols.get(prefix + n, 0.0) for n in law.own}
            for name, value in _asked(law, "finish", dim, me, Values(**own)).items():
                adding[name] = law
                totals[name] = _added(law, name, totals.get(name), value)
        known = self.names.fields if self.addable is None else self.addable
        for name, value in totals.items():
            if name not in known:
                raise _unknown(adding[name], name, known)
            width = self._width(name)
            if len(components(value, dim)) != max(1, width):
                needed = f"a vector of {width} components" if width else "a number"
                raise InputError(_what(adding[name], name), _kind(value), needed)
        return {
            name: Result(components(value, dim), self._width(name) > 0, self._column(name))
            for name, value in totals.items()
        }

    def _width(self, name: str) -> int:
        """Components of a field, 0 of a number."""
        width = self.names.fields[name]
        return width if isinstance(width, int) else 0

    def _column(self, name: str) -> str:
        """The number of the column that is written, nothing for whole fields."""
        width = self.names.fields[name]
        return width if isinstance(width, str) else ""

    def reads_of_neighbours(self) -> tuple[str, ...]:
        """Fields that must be there of all neighbours, those of other ranks too."""
        return tuple(sorted(self.plan().reads_of_neighbours()))

    def reads(self) -> tuple[str, ...]:
        """Fields of the particle itself that are read."""
        return tuple(sorted(self.plan().reads()))

    def writes(self) -> tuple[str, ...]:
        """Fields of the particle that are written; what is kept of pairs is in ``stored``."""
        return tuple(sorted(self.plan().results))

    def form_on(self, device: Device) -> str:
        """The form that runs on a device."""
        return form_of(self.plan(), device.backend, device.form)

    def source(self, form: str = "gather") -> Generated:
        """The generated loops' text and sizes."""
        if form not in self._sources:
            self._sources[form] = source_of(self.plan(), form)
        return self._sources[form]

    @functools.cached_property
    def _sources(self) -> dict[str, Generated]:
        return {}

    def bind(
        self,
        device: Device,
        fields: Mapping[str, Any],
        scratch: dict[str, Any],
        form: str | None = None,
    ) -> Callable[..., None]:
        """The loop on a device, with its arrays looked up.

        Parameters
        ----------
        device
            Where it runs.
        fields
            Arrays and numbers by name; numbers that are missing are given at every call, by name.
        scratch
            Records and columns that sweeps share, since one runs after the other.
        form
            ``"gather"``, ``"lanes"`` or ``"cuda"``; that of the device where it is left out.

        Returns
        -------
        callable
            ``f(n, **numbers)``.
        """
        form = form or self.form_on(device)
        made = self.source(form)
        module = load(self.name, made.text, made.functions)
        lanes = form == "lanes"
        n = len(fields["member" if lanes else "start"])
        rows, real = batch_rows(device, n), np.float64 if self.exact else device.real
        sizes: dict[str, tuple[int, Any]] = {"record": (n * made.record, real)}
        if lanes:
            sizes["lanes"] = (made.columns * LANES * rows, np.float64)
        else:
            sizes["columns"] = (made.columns * BATCH * rows, real)
            sizes["whole_columns"] = (made.whole_columns * BATCH * rows, np.int64)
        for name, (size, kind) in sizes.items():
            if name not in scratch or len(scratch[name]) < size:
                scratch[name] = device.zeros(max(1, size), kind)
        arrays = {**fields, **scratch, "octets": np.uint64(1)}
        arrays |= {argument: fields[name] for argument, name in made.renamed.items()}
        loops = {
            f"pack_{self.name}": n if lanes else None,
            self.name: n // LANES if lanes else None,
        }
        there = {getattr(module, k): number for k, number in loops.items() if hasattr(module, k)}
        return _Bound(self, device, there, arrays)


def _asked(law: Law, method: str, dim: int, *given: Any) -> Mapping[str, Any]:
    """What a law answers in ``dim`` dimensions, or one line that names it."""
    where = f"{type(law).__name__}.{method}"
    try:
        found = getattr(law, method)(*given)
    except InputError as error:  # a name that there is not
        raise InputError(f"{where}: {error.key}", error.value, error.allowed) from error
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        if isinstance(error, AttributeError) and isinstance(error.obj, Pair):
            known = [name for name in dir(error.obj) if not name.startswith("_")]
            raise unknown_name(f"{where}: what is read of ij", str(error.name), known) from error
        allowed = "arithmetic on what it is given, with where, sqrt, cos, … of particell.laws"
        raise InputError(where, str(error), allowed) from error
    if not isinstance(found, Mapping) or not all(isinstance(name, str) for name in found):
        raise InputError(where, found, "a dict of what is added, by name")
    for name, value in found.items():
        if not isinstance(value, _KINDS) or isinstance(value, bool):
            raise InputError(_what(law, name), value, "a number, a vector or a symmetric tensor")
        try:
            components(value, dim)
        except ValueError as error:
            allowed = f"with {dim} components, one for each dimension"
            raise InputError(_what(law, name), str(error), allowed) from None
    return found


def _what(law: Law, name: str) -> str:
    """What a message is about."""
    return f"what {type(law).__name__} adds to {name}"


def _kind(value: Any) -> str:
    """What a law adds, in words."""
    if isinstance(value, Vector):
        return "a vector"
    return "a tensor" if isinstance(value, Symmetric) else "a number"


def _unknown(law: Law, name: str, known: Collection[str]) -> InputError:
    """The error for a name that is neither a field nor a sum of the law's own."""
    error = unknown_name(f"what {type(law).__name__} adds to", name, known)
    if not name.endswith("_rate"):
        return error
    field = name.removesuffix("_rate")
    allowed = f"{error.allowed}; the scheme has no fields=[Field('{field}')]"
    return InputError(error.key, error.value, allowed)


def _added(law: Law, name: str, before: Any, value: Any) -> Any:
    """The sum of what laws add to one name."""
    if before is None:
        return value
    try:
        return before + value
    except TypeError:
        allowed = f"{_kind(before)}, as what others add"
        raise InputError(_what(law, name), _kind(value), allowed) from None


def _name(law: Law, number: int) -> str:
    """What a law of a sweep is called."""
    return f"{type(law).__name__}_{number}"


class _Bound:
    """Loops that run one after the other, with numbers given at every call.

    ``loops`` has over how many they run; None for those over particles.
    """

    def __init__(
        self,
        sweep: Sweep,
        device: Device,
        loops: Mapping[Any, int | None],
        arrays: Mapping[str, Any],
    ):
        self.constants = {n: v for source in sweep.sources for n, v in source.numbers().items()}
        named = [(law, _name(law, k)) for k, law in enumerate(sweep.laws)]
        self.changing = [
            (law, name, f"{called}_{name}") for law, called in named for name in numbers_of(law)
        ]
        self.fixed = [
            (law, name, value) for law in sweep.laws for name, value in fixed_of(law).items()
        ]
        self.parts = [
            (device.bind(loop, arrays), [a for a in loop.arguments if a not in arrays], length)
            for loop, length in loops.items()
        ]

    def __call__(self, n: int, **numbers: Any) -> None:
        numbers |= self.constants
        for law, name, argument in self.changing:  # as the laws have them now
            numbers[argument] = number_of(law, name)
        for law, name, value in self.fixed:
            if getattr(law, name) != value:
                what = f"{name} of {type(law).__name__}, changed,"
                allowed = f"{value}, as the compiled loop has it: write it as a float"
                raise InputError(what, getattr(law, name), allowed)
        for run, missing, length in self.parts:
            run(n if length is None else length, *(numbers[name] for name in missing))


def _like(value: Any, parts: tuple[Node, ...], dim: int) -> Any:
    """Symbols of a sum as the kind of value that was summed."""
    if isinstance(value, Vector):
        return Vector.of("sum", parts)
    if isinstance(value, Symmetric):
        return Symmetric(dim, dict(zip(value.values, parts, strict=True)))
    return parts[0]
