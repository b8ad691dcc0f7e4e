"""Walls of a simulation while it runs: how they move, where their surface is, what turns back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.boundaries.impenetrable import turn_back
from particell.boundaries.moving import WallMotion, place_walls
from particell.boundaries.volume_fraction import bounce_back, fraction_profile, measure_walls
from particell.errors import InputError
from particell.geometry.program import program_of, program_table
from particell.kernels import kernel_code, normalisation
from particell.phases import Phase

if TYPE_CHECKING:
    from particell.simulation import Simulation


class Walls:
    """All walls of a simulation, for whatever scheme.

    Walls with a surface made of half-spaces, balls and boxes turn particles back at that surface
    (:mod:`particell.boundaries.impenetrable`), others by the volume fraction; both only if the
    scheme is ``impenetrable``. Walls without a surface have their distances from the fraction
    (:mod:`particell.boundaries.volume_fraction`) in any case.
    """

    def __init__(self, simulation: Simulation, boundaries: Sequence[Any]):
        self.simulation = simulation
        s, phases = simulation, simulation.phases
        particles, dim = s.particles, s.domain.dim
        self.motions = self._motions([b for b in boundaries if isinstance(b, WallMotion)])
        walls = [p.kind == "wall" and not s.static for p in phases]
        impenetrable = bool(getattr(s.scheme, "impenetrable", False))
        programs = [
            program_of(p.surface, dim) if w else None for p, w in zip(phases, walls, strict=True)
        ]
        rigid = [
            p.slides or p.name in self.motions or bool(np.all(p.velocities() == p.velocities()[:1]))
            for p in phases
        ]
        solid = [
            impenetrable and program is not None and whole
            for program, whole in zip(programs, rigid, strict=True)
        ]
        unknown = [w and p.surface is None for p, w in zip(phases, walls, strict=True)]
        bounced = [impenetrable and w and not k for w, k in zip(walls, solid, strict=True)]
        measured = [u or b for u, b in zip(unknown, bounced, strict=True)]
        self.turns_back, self.bounces, self.measures = any(solid), any(bounced), any(measured)
        self.active = bool(self.motions) or self.turns_back or self.measures
        if not self.active:
            return
        array, groups = s.device.array, len(phases)
        self.tables: dict[str, Any] = {
            "centre": np.zeros((groups, dim)),
            "displacement": np.zeros((groups, dim)),
            "body_velocity": np.zeros((groups, dim)),
            "body_acceleration": np.zeros((groups, dim)),
            "rotation": np.tile(np.eye(dim).ravel(), (groups, 1)),
            "spin": np.zeros((groups, 3)),
            "spin_rate": np.zeros((groups, 3)),
        }
        names = [p.name for p in phases]
        moves = np.array([name in self.motions for name in names], dtype=np.uint8)
        for name, motion in self.motions.items():
            if motion.centre is not None:
                self.tables["centre"][names.index(name)] = motion.centre
        first, codes, numbers = program_table(programs, dim)
        code = kernel_code(s.scheme.kernel)
        profile = np.zeros(1)
        if self.measures:
            profile = fraction_profile(s.scheme.kernel, dim, s.scheme.support)
        self.constants = {name: array(values) for name, values in self.tables.items()}
        self.constants |= {
            "moves": array(moves),
            "solid": array(np.array(solid, dtype=np.uint8)),
            "by_fraction": array(np.array(measured, dtype=np.uint8)),
            "first_code": array(first),
            "codes": array(codes),
            "numbers": array(numbers),
            "profile": array(profile),
            "alpha": normalisation(code, dim),
        }
        self._options = {"DIM": dim, "KERNEL": code}
        x, normal = particles.host("x").copy(), particles.host("wall_normal").copy()
        particles.add("body_point", dim, values=x)
        particles.add("body_normal", dim, values=normal)
        particles.add("wall_acceleration", dim)
        if impenetrable:
            particles.add("bounces", dtype=np.int64)
        if self.bounces:
            particles.add("fraction_before")
        if self.measures:
            particles.add("wall_fraction")
            particles.add("wall_direction", dim)
            particles.add("wall_distance", values=np.full(len(particles), np.inf))
        self._rows: Any = None
        self._place: Any = None
        self._scratch: dict[str, Any] = {}

    def _motions(self, motions: list[WallMotion]) -> dict[str, WallMotion]:
        s = self.simulation
        walls = {p.name: p for p in s.phases if p.kind == "wall"}
        found: dict[str, WallMotion] = {}
        for motion in motions:
            if s.static:
                raise InputError("boundaries", motion, "no WallMotion with Static")
            if motion.group not in walls:
                raise InputError("group", motion.group, f"one of {', '.join(walls) or 'no walls'}")
            if motion.group in found:
                raise InputError("group", motion.group, "given one WallMotion")
            phase = walls[motion.group]
            if phase.slides or np.any(phase.velocities()):
                raise InputError(
                    f"velocity of '{phase.name}'", "given", "that of its WallMotion alone"
                )
            motion.check(s.domain.dim)
            found[motion.group] = motion
        return found

    def _bind(self) -> None:
        """Look up arrays again where those of the neighbour list are new."""
        s = self.simulation
        listed = s.neighbours.fields["neighbours"]
        if self._rows is listed:
            return
        self._rows = listed
        fields = {**s.neighbours.fields, **s.particles.fields, **self.constants}
        fields.setdefault("transport", fields["v"])
        bind, options = s.device.bind, self._options
        if self.turns_back:
            self._turn_back = bind(turn_back, fields, **options)
        if self.measures:
            uniform = bool(s.neighbours.constants["UNIFORM"])
            sweep = measure_walls(options["DIM"], options["KERNEL"], uniform)
            self._measure = sweep.bind(s.device, fields, self._scratch)
        if self.bounces:
            self._bounce_back = bind(bounce_back, fields, **options)

    def move(self, time: float) -> None:
        """Put walls that move as rigid bodies where they are at a time in s."""
        if not self.motions:
            return
        s = self.simulation
        for g, phase in enumerate(s.phases):
            if phase.name in self.motions:
                state = self.motions[phase.name].state(time, s.dt, s.domain.dim)
                for name, values in state.items():
                    self.tables[name][g] = values
        for name, values in self.tables.items():
            s.device.write(self.constants[name], values)
        if self._place is None:
            fields = {**s.neighbours.fields, **s.particles.fields, **self.constants}
            self._place = s.device.bind(place_walls, fields, DIM=s.domain.dim)
        self._place(len(s.particles))

    def measure(self) -> None:
        """Fraction, direction and distance of walls at the particles' places."""
        if self.measures:
            self._bind()
            self._measure(len(self.simulation.particles))

    def turn_back(self) -> None:
        """Put what has crossed a known surface back."""
        if self.turns_back:
            self._bind()
            self._turn_back(len(self.simulation.particles), self.simulation.dt)

    def bounce_back(self) -> None:
        """Turn what is inside walls without a known surface and moves on into them."""
        if self.bounces:
            self._bind()
            self._bounce_back(len(self.simulation.particles), self.simulation.dt)

    def inside(self, x: np.ndarray, time: float) -> np.ndarray:
        """Mask (n,) of the points x (n, D) that lie beyond the surface of a wall at a time."""
        found = np.zeros(len(x), dtype=bool)
        for phase in self.simulation.phases:
            if phase.kind == "wall" and phase.surface is not None and len(phase.points):
                found |= phase.surface.signed_distance(self._in_body(phase, x, time)) < 0
        return found

    def _in_body(self, phase: Phase, x: np.ndarray, time: float) -> np.ndarray:
        """Points in the frame of a body: where they would be at t = 0 if they moved with it."""
        domain = self.simulation.domain
        middle = phase.points.mean(axis=0)
        rotation, now = np.eye(domain.dim), middle
        motion = self.motions.get(phase.name)
        if motion is not None:
            state = motion.state(time, self.simulation.dt, domain.dim)
            rotation = state["rotation"].reshape(domain.dim, domain.dim)
            centre = np.zeros(domain.dim) if motion.centre is None else np.array(motion.centre)
            now = centre + state["displacement"] + rotation @ (middle - centre)
        elif not phase.slides:
            now = middle + time * phase.velocities().mean(axis=0)
        offset = x - now
        offset -= domain.lengths * np.rint(offset * domain.inverse_periods)
        return middle + offset @ rotation
