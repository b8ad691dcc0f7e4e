"""Particles at random places with any fields: sums over them by loops and by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from particell.compute.batches import BATCH
from particell.compute.device import Device
from particell.compute.expressions import Vector, components, early
from particell.compute.generated import load
from particell.compute.loop import cpu_python
from particell.compute.sweep import Sweep
from particell.kernels import normalisation, shape_f, shape_w
from particell.laws import Law, Values, pair_of
from particell.laws.fluctuations import pair_numbers
from particell.sources.mobile import MOBILE
from particell.sources.source import Names, Pair, Source, difference

#: Forms of loops that run on the CPU.
FORMS = ("gather", "cuda")
#: What noise is drawn from.
DRAW = {"step": 7, "key0": 12345, "key1": 678}


@dataclass(frozen=True)
class Beside(Source):
    """The last particles of a row, as those of a wall: ``grow`` and ``gap`` are what it extends."""

    first: str = "split"
    last: str = "stop"

    def see(self, i, j, kernel, uniform):
        """Differences of velocity grow; what is missed is known."""
        grow = early(1.0 + j.grow * i.support)
        velocity = grow * difference("v", i.v, j.v)
        pair = Pair(i, j, kernel, uniform, wall=True, extrapolation=grow)
        vars(pair)["v"] = velocity
        pair.missed = early(j.gap * i.gap)
        return i, j, pair


@dataclass
class Cloud:
    """n particles in a periodic box of side 7, of supports from 3/4 to 3.

    Attributes
    ----------
    dim, n
        Dimensions and particles; the last quarter are walls.
    scalars, vectors
        Fields by name (n,) and (n, dim).
    arrays
        What is of no particle.
    kernel
        The kernel's code.
    """

    dim: int
    n: int
    scalars: dict[str, np.ndarray]
    vectors: dict[str, np.ndarray]
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    kernel: int = 0
    side: float = 7.0

    def __post_init__(self):
        n = self.n
        self.first_wall = n - n // 4
        self.walls = np.arange(n) >= self.first_wall
        rows = [[j for j in range(n) if j != i] for i in range(n)]  # fluid first
        stop = (np.arange(n) + 1) * (n - 1)
        own = self.walls.astype(int)
        self.fields = {
            "neighbours": np.array(rows, np.uint32).ravel(),
            "start": stop - (n - 1),
            "split": stop - n // 4 + own,
            "stop": stop,
            "crosses": np.ones(n, np.uint8),
            "is_wall": self.walls.astype(np.uint8),
            "period": np.full(self.dim, self.side),
            "inverse_period": np.full(self.dim, 1 / self.side),
            "alpha": normalisation(self.kernel, self.dim),
            "id": np.arange(n),
            **self.scalars,
            **self.vectors,
            **self.arrays,
        }

    def sweep(self, laws: Sequence[Law], results: dict[str, int], derived, **options) -> Sweep:
        """Of laws over fluid and walls; ``results`` has the components of what they add to."""
        known = dict.fromkeys(self.scalars, 0) | dict.fromkeys(self.vectors, self.dim) | {"id": 0}
        names = Names(self.dim, {**known, **results}, derived=derived)
        how = {"targets": "all", **options}
        return Sweep("cloud", tuple(laws), (MOBILE, Beside()), names, self.kernel, False, **how)

    def run(self, sweep: Sweep, results: dict[str, int], form: str) -> dict[str, np.ndarray]:
        """What the generated loop gives, compiled."""
        made = self.zeros(results)
        run = sweep.bind(Device(), {**self.fields, **made}, {}, form)
        run(self.n, **DRAW)
        return made

    def read(self, sweep: Sweep, results: dict[str, int], form: str) -> dict[str, np.ndarray]:
        """What the text of the generated loop gives, as Python reads it: nothing is compiled."""
        made, source = self.zeros(results), sweep.source(form)
        module = load(sweep.name, source.text, source.functions)
        arrays = {**self.fields, **made, **DRAW, "record": np.zeros(self.n * source.record)}
        arrays["columns"] = np.zeros(source.columns * BATCH)
        arrays["whole_columns"] = np.zeros(source.whole_columns * BATCH, np.int64)
        arrays |= {argument: arrays[name] for argument, name in source.renamed.items()}
        for name in (f"pack_{sweep.name}", sweep.name):
            loop = getattr(module, name)
            given = (arrays[argument] for argument in loop.arguments)
            cpu_python(loop, {})(0, self.n, 0, *given)
        return made

    def zeros(self, results: dict[str, int]) -> dict[str, np.ndarray]:
        """Fields of so many components."""
        return {k: np.zeros((self.n, w) if w else self.n) for k, w in results.items()}

    def particle(self, k: int) -> Values:
        """All that is known of a particle, as floats."""
        values = {name: float(a[k]) for name, a in self.scalars.items()}
        values |= {name: Vector.of(name, a[k].tolist()) for name, a in self.vectors.items()}
        given = {"id": k, "dim": self.dim, **self.arrays}
        return Values(**values, **given, specific_volume=values["volume"] / values["mass"])

    def pair(self, i: Values, j: Values) -> Values | None:
        """A pair by hand, within its support; None beyond."""
        x = [p - q for p, q in zip(i.x.parts(self.dim), j.x.parts(self.dim), strict=True)]
        x = np.array([p - self.side * round(p / self.side) for p in x])
        r, h = float(np.sqrt(x @ x)), 0.5 * (i.support + j.support)
        if r >= h:
            return None
        wall = j.id >= self.first_wall
        grow = 1.0 + j.grow * i.support if wall else 1.0
        alpha = normalisation(self.kernel, self.dim) / h**self.dim
        F = alpha / h**2 * shape_f.py_func(r / h, self.kernel)
        whole = Vector.of("x", x.tolist())
        v = [p - q for p, q in zip(i.v.parts(self.dim), j.v.parts(self.dim), strict=True)]

        def noise(gaussian):
            drawn = pair_numbers(i.id, j.id, *DRAW.values(), gaussian, self.dim)
            return Vector.of("noise", drawn[: self.dim])

        return pair_of(
            i,
            j,
            F,
            alpha * shape_w.py_func(r / h, self.kernel),
            x=whole,
            v=grow * Vector.of("v", v),
            square=r * r,
            r=r,
            e=(1.0 / r) * whole,
            wall=wall,
            extrapolation=grow,
            missed=j.gap * i.gap,
            noise=noise,
        )

    def by_hand(self, laws: Sequence[Law]) -> list[list[dict]]:
        """What laws give, run on floats: for each particle, for each law, by name."""
        every = [self.particle(k) for k in range(self.n)]
        found = []
        for i in every:
            pairs = [(j, ij) for j in every if j is not i and (ij := self.pair(i, j))]
            found.append([summed(law, i, pairs) for law in laws])
        return found


def summed(law: Law, i: Values, pairs) -> dict:
    """What becomes of a law's sums over given pairs."""
    sums = dict.fromkeys(law.own, 0.0)
    for j, ij in pairs:
        for name, value in law.pair(i, j, ij).items():
            sums[name] = value + sums[name] if name in sums else value
    own = Values(**{name: sums.pop(name) for name in law.own})
    for name, value in law.finish(i, own).items():
        sums[name] = value + sums[name] if name in sums else value
    return sums


def width(value, dim: int) -> int:
    """Components of a field that holds such a value; 0 for a number."""
    return len(components(value, dim)) if hasattr(value, "parts") else 0


class Renamed(Law):
    """A law whose names begin with a number: many in one loop stay apart."""

    def __init__(self, law: Law, number: int):
        self.law, self.mark = law, f"r{number}_"
        self.own = tuple(self.mark + name for name in law.own)

    def pair(self, i, j, ij):
        return {self.mark + name: value for name, value in self.law.pair(i, j, ij).items()}

    def finish(self, i, sums):
        own = Values(**{name: getattr(sums, self.mark + name) for name in self.law.own})
        return {self.mark + name: value for name, value in self.law.finish(i, own).items()}
