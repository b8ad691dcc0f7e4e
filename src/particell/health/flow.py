"""Whether a flow is what weakly compressible particles can follow: speeds, densities, spacing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from particell.analysis.fields import interpolate
from particell.health.finding import Finding
from particell.health.spacing import Spacing
from particell.materials import BOLTZMANN
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulated import Simulated

#: Largest Mach number; the rule aims at 0.1.
MACH = 0.25
#: Largest change of density, left out the 1 % of particles where it is largest (corners).
COMPRESSION = 0.05
#: Standard deviations of noise that a single particle may be off by: beyond that 1e-15 are.
DEVIATIONS = 8.0
#: Least part of the space around a particle that is filled, of what it was at the start.
FILLED = 0.7
#: Two particles are a clump that are nearer than this, in spacings; the part that may be in clumps.
CLUMP, IN_CLUMPS = 0.5, 0.02
#: Largest part of the fluid beyond open faces of the domain or in walls.
OUTSIDE = 0.002
#: Largest slip at walls, of the largest speed so far.
SLIP = 0.2
#: Largest scatter of velocities about a smooth field, of the largest speed so far.
SCATTER = 0.1
#: More places than are worth looking at.
SAMPLE = 4000
#: Fewer fluid particles have no field.
FEW_PARTICLES = 30


class Watch:
    """The worst of a run so far: looked at when a frame is taken, kept in checkpoints.

    Attributes
    ----------
    worst
        Largest values by name; where small is bad, of the negative.
    """

    def __init__(self, simulation: Simulated):
        self.simulation = simulation
        self.worst: dict[str, float] = {}
        self._spacing: Spacing | None = None

    def look(self) -> None:
        """Take the present state into account; nothing moves with ``Static``."""
        s = self.simulation
        if s.static or not (s.particles.host("is_wall") == 0).any():
            return
        if self._spacing is None:
            self._spacing = Spacing(s)
        closest, filled, number = self._spacing.measure()
        self.worst.setdefault("filled at first", float(filled.min()))
        self._note("speed", float(np.linalg.norm(self._motion(), axis=1).max()))
        self._note("mach", self._mach())
        self._note("compression", self._compression())
        self._note("empty", -float(filled.min()))
        self._note("clumps", float((closest < CLUMP).mean()))
        self._note("alone", -float(number.min()))
        self._note("outside", self._outside())

    def _note(self, name: str, value: float) -> None:
        self.worst[name] = max(value, self.worst.get(name, -np.inf))

    def _fluid(self, name: str) -> np.ndarray:
        particles = self.simulation.particles
        return np.array(particles.host(name)[particles.host("is_wall") == 0], dtype=float)

    def _per_material(self, values: list[float]) -> np.ndarray:
        """A number of each material for each fluid particle."""
        groups = self.simulation.particles.groups
        of_group = np.array([values[g.material] for g in groups])
        return of_group[self._fluid("group").astype(int)]

    def _mach(self) -> float:
        """Largest speed over sound; of a fluid without walls against its mean velocity."""
        sound = self._per_material([m.sound_speed or np.inf for m in self.simulation.materials])
        return float((np.linalg.norm(self._motion(), axis=1) / sound).max())

    def _motion(self) -> np.ndarray:
        """Velocities; of a fluid without walls against its mean velocity."""
        v = self._fluid("v")
        if not self.simulation.particles.host("is_wall").any():
            v -= np.average(v, axis=0, weights=self._fluid("mass"))
        return v

    def _fastest(self, v: np.ndarray) -> float:
        """Largest speed now or at a frame before: flows come to rest, or turn round."""
        return max(float(np.linalg.norm(v, axis=1).max()), self.worst["speed"])

    def _compression(self) -> float:
        """|ρ/ρ₀ − 1| that one particle in a hundred exceeds."""
        reference = self._per_material([m.density for m in self.simulation.materials])
        return float(np.quantile(np.abs(self._fluid("density") / reference - 1), 0.99))

    def _outside(self) -> float:
        """Part of the fluid beyond faces that are not periodic, or in walls with a surface."""
        s, x = self.simulation, self._fluid("x")
        open_faces = ~s.domain.periodic
        beyond = ((x < s.domain.lower) | (x > s.domain.upper))[:, open_faces].any(axis=1)
        return float((beyond | s.walls.inside(x, s.time)).mean())

    # --- judgement ---------------------------------------------------------------------------
    def findings(self) -> Iterator[Finding]:
        """The flow so far, and slip at the end of it."""
        if not self.worst:
            return
        s, worst = self.simulation, self.worst
        noise = DEVIATIONS * self._noise()
        yield Finding(
            "Mach number",
            worst["mach"],
            MACH + noise,
            "the fluid is as fast as its artificial sound: give the largest speed as "
            "reference_speed, or a larger sound_speed",
        )
        yield Finding(
            "change of density",
            worst["compression"],
            COMPRESSION + noise,
            "the fluid is compressed by more than the sound speed rule promises (1 %): give a "
            "larger reference_speed, pressure_drop or sound_speed",
        )
        yield Finding(
            "neighbours of the loneliest particle",
            -worst["alone"],
            float(s.domain.dim),
            "a particle without neighbours feels nothing: give a larger support, or more particles",
            least=True,
        )
        yield Finding(
            "part of the fluid outside or in walls",
            worst["outside"],
            OUTSIDE,
            "particles have gone through walls or open faces: give impenetrable=True, walls all "
            "around, or TransportVelocity",
        )
        if not s.scheme.fluctuations:
            yield from self._arrangement()
            scatter = self._scatter()
            if scatter is not None:
                yield Finding(
                    "scatter of velocities over the largest speed",
                    scatter,
                    SCATTER,
                    "neighbours do not move together, the flow is torn: use a spacing below 10 "
                    f"ν/U, or {self._even()}",
                )
            slip = self._slip()
            if slip is not None:
                yield Finding(
                    "slip at walls over the largest speed",
                    slip,
                    SLIP,
                    "the layer of fluid at walls is not resolved: give a smaller spacing",
                )

    def _even(self) -> str:
        """What keeps particles evenly spread, other than what the run uses."""
        if isinstance(self.simulation.scheme, TransportVelocity):
            return "the scheme's own kernel and support (lucy, 2.6), or a smaller spacing"
        return "TransportVelocity, or SDPD with shifting=0.5"

    def _arrangement(self) -> Iterator[Finding]:
        yield Finding(
            "space filled around the emptiest particle, of that at the start",
            -self.worst["empty"] / self.worst["filled at first"],
            FILLED,
            f"there are voids: use {self._even()}",
            least=True,
        )
        yield Finding(
            f"part of the particles nearer than {CLUMP:g} spacings to another",
            self.worst["clumps"],
            IN_CLUMPS,
            f"particles lie in clumps: use {self._even()}",
        )

    def _noise(self) -> float:
        """Thermal speed of the lightest fluid particle over the sound speed."""
        s = self.simulation
        if not s.scheme.fluctuations:
            return 0.0
        mass = self._fluid("mass") * s.system.depth_factor
        heat = self._per_material([BOLTZMANN * (m.temperature or 0.0) for m in s.materials])
        sound = self._per_material([m.sound_speed or np.inf for m in s.materials])
        return float((np.sqrt(heat / mass) / sound).max())

    def _scatter(self) -> float | None:
        """Root mean square of v minus the linear field that fits it around, over the largest."""
        s, x, v = self.simulation, self._fluid("x"), self._motion()
        speed = self._fastest(v)
        if not speed or len(x) < FEW_PARTICLES:
            return None
        rows = np.arange(len(x))[:: -(-len(x) // SAMPLE)]
        h, volume = self._fluid("support"), self._fluid("mass") / self._fluid("density")
        fit = interpolate(x[rows], x, v, volume=volume, support=h, domain=s.domain)
        return float(np.sqrt(((v[rows] - fit) ** 2).sum(axis=1).mean()) / speed)

    def _slip(self) -> float | None:
        """Root mean square of fluid's minus wall's velocity at surfaces, over the largest speed."""
        s = self.simulation
        walls = [p for p in s.phases if p.kind == "wall" and p.surface is not None]
        if not walls or any(s.walls.motions):
            return None
        x, v, h = self._fluid("x"), self._fluid("v"), self._fluid("support")
        wall = s.particles.host("is_wall") != 0
        x_wall, v_wall = s.particles.host("x")[wall], np.array(s.particles.host("v")[wall], float)
        speed = max(self._fastest(v), np.linalg.norm(v_wall, axis=1).max())
        feet = np.concatenate([_feet(s, p, x, h / s.scheme.support) for p in walls])
        if not speed or not len(feet):
            return None
        feet = feet[:: -(-len(feet) // SAMPLE)]
        volume = self._fluid("mass") / self._fluid("density")
        there = interpolate(feet, x, v, volume=volume, support=h, domain=s.domain)
        _, nearest = s.domain.tree(x_wall).query(s.domain.wrapped_from_zero(feet))
        square = ((there - v_wall[nearest]) ** 2).sum(axis=1)
        return float(np.sqrt(np.nanmean(square)) / speed)


def _feet(simulation: Simulated, phase, x: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Points of a wall's surface that are nearest to the fluid next to it."""
    wrapped = simulation.domain.wrapped(x)[0]
    distance = phase.surface.signed_distance(wrapped)
    near = (distance > 0) & (distance < spacing)
    normal = phase.surface.normal(wrapped[near], 1e-3 * float(spacing.min()))
    return wrapped[near] - distance[near, None] * normal
