"""Walls of a simulation while it runs: how they move, where their surface is, what turns back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from particell.boundaries.impenetrable import turn_back
from particell.boundaries.moving import WallMotion, place_walls
from particell.boundaries.volume_fraction import bounce_back, fraction_profile, measure_walls
from particell.errors import InputError
from particell.fields import Field, work
from particell.geometry.program import program_of, program_table
from particell.kernels import kernel_code, normalisation
from particell.operations.operation import Operation, When
from particell.phases import Phase
from particell.state import State


class Walls(Operation):
    """All walls of a simulation, for whatever scheme.

    Walls with a surface made of half-spaces, balls and boxes turn particles back at that surface
    (:mod:`particell.boundaries.impenetrable`), others by the volume fraction; both only if the
    scheme is ``impenetrable``. Walls without a surface have their distances from the fraction
    (:mod:`particell.boundaries.volume_fraction`) in any case.
    """

    def __init__(
        self,
        state: State,
        motions: Sequence[WallMotion],
        kernel: str,
        support: float,
        impenetrable: bool,
        at_rest: bool,
    ):
        self.state = state
        phases, dim = state.phases, state.dim
        self.motions = self._checked(motions, at_rest)
        walls = [p.kind == "wall" and not at_rest for p in phases]
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
        self.fields = tuple(self._declared(dim, impenetrable)) if self.active else ()
        if self.active:
            self._tabulate(programs, solid, measured, kernel, support)

    def _declared(self, dim: int, impenetrable: bool) -> list[Field]:
        found = [work(name, dim) for name in ("body_point", "body_normal", "wall_acceleration")]
        if impenetrable:
            found.append(Field("bounces", kind=np.int64))
        if self.bounces:
            found.append(work("fraction_before"))
        if self.measures:
            found += [work("wall_fraction"), work("wall_direction", dim)]
            found.append(work("wall_distance"))
        return found

    def _tabulate(
        self, programs: list, solid: list[bool], measured: list[bool], kernel: str, support: float
    ) -> None:
        """Tables by group: motions, surfaces, the fraction's profile."""
        s, dim, phases = self.state, self.state.dim, self.state.phases
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
        code = kernel_code(kernel)
        profile = fraction_profile(kernel, dim, support) if self.measures else np.zeros(1)
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
        self._rows: Any = None
        self._place: Any = None
        self._scratch: dict[str, Any] = {}

    def attach(self, state: State) -> None:
        """Note where bodies are at t = 0."""
        if self.active:
            state.particles.set("body_point", state.particles.host("x"))
            state.particles.set("body_normal", state.particles.host("wall_normal"))
        if self.measures:
            state.particles.set("wall_distance", np.array(np.inf))

    def acts(self) -> Mapping[When, Callable[[State], None]]:
        """What walls do in a step, as far as there are such."""
        found: dict[When, Callable[[State], None]] = {}
        if self.motions:
            found[When.MOVED] = self.move
        if self.measures:
            found[When.PAIRS] = self.measure
        if self.turns_back:
            found[When.DRIFTED] = self.turn_back
        if self.bounces:
            found[When.END] = self.bounce_back
        return found

    def _checked(self, motions: Sequence[WallMotion], at_rest: bool) -> dict[str, WallMotion]:
        s = self.state
        walls = {p.name: p for p in s.phases if p.kind == "wall"}
        found: dict[str, WallMotion] = {}
        for motion in motions:
            if at_rest:
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
        s = self.state
        s.neighbours.want("rows")
        listed = s.neighbours.fields["neighbours"]
        if self._rows is listed:
            return
        self._rows = listed
        more = dict(self.constants)
        if "transport" not in s.particles:
            more["transport"] = s.particles["v"]
        options = self._options
        if self.turns_back:
            self._turn_back = s.bind(turn_back, more, **options)
        if self.measures:
            uniform = bool(s.neighbours.constants["UNIFORM"])
            sweep = measure_walls(options["DIM"], options["KERNEL"], uniform)
            fields = {**s.neighbours.fields, **s.particles.fields, **more}
            form = "cuda" if s.device.backend == "cuda" else "gather"
            self._measure = sweep.bind(s.device, fields, self._scratch, form)
        if self.bounces:
            self._bounce_back = s.bind(bounce_back, more, **options)

    def move(self, state: State) -> None:
        """Put walls that move as rigid bodies where they are."""
        for g, phase in enumerate(state.phases):
            if phase.name in self.motions:
                motion = self.motions[phase.name].state(state.time, state.dt, state.dim)
                for name, values in motion.items():
                    self.tables[name][g] = values
        for name, values in self.tables.items():
            state.device.write(self.constants[name], values)
        if self._place is None:
            self._place = state.bind(place_walls, self.constants, DIM=state.dim)
        self._place(state.n)

    def measure(self, state: State) -> None:
        """Fraction, direction and distance of walls at the particles' places."""
        self._bind()
        self._measure(state.n)

    def turn_back(self, state: State) -> None:
        """Put what has crossed a known surface back."""
        self._bind()
        self._turn_back(state.n, state.dt)

    def bounce_back(self, state: State) -> None:
        """Turn what is inside walls without a known surface and moves on into them."""
        self._bind()
        self._bounce_back(state.n, state.dt)

    def counts(self, state: State) -> dict[str, float]:
        """How often walls turned particles back, and how many are beyond a surface."""
        particles = state.particles
        if "bounces" not in particles:
            return {}
        mobile = particles.host("is_wall") == 0
        inside = self.inside(np.array(particles.host("x")[mobile], dtype=float), state.time)
        return {
            "bounces": float(particles.host("bounces").sum()),
            "inside walls": float(inside.sum()),
        }

    def moving_surfaces(self) -> set[int]:
        """The walls whose surfaces are elsewhere at other times, by group.

        A plane that moves along itself, or a cylinder that turns, has the same one all the time.
        """
        p, found = self.state.particles, set()
        v, normal, group = (p.view(name) for name in ("v", "wall_normal", "group"))
        for g, phase in enumerate(self.state.phases):
            rows = group == g
            if phase.kind != "wall" or phase.slides or not rows.any():
                continue
            motion = self.motions.get(phase.name)
            across = np.abs(np.sum(v[rows] * normal[rows], axis=1)).max()
            if across > 1e-9 * np.abs(v[rows]).max() or (motion and motion.displacement):
                found.add(g)
        return found

    def inside(self, x: np.ndarray, time: float) -> np.ndarray:
        """Mask (n,) of the points x (n, D) that lie beyond the surface of a wall at a time."""
        found = np.zeros(len(x), dtype=bool)
        for phase in self.state.phases:
            if phase.kind == "wall" and phase.surface is not None and len(phase.points):
                found |= phase.surface.signed_distance(self._in_body(phase, x, time)) < 0
        return found

    def _in_body(self, phase: Phase, x: np.ndarray, time: float) -> np.ndarray:
        """Points in the frame of a body: where they would be at t = 0 if they moved with it."""
        domain = self.state.domain
        middle = phase.points.mean(axis=0)
        rotation, now = np.eye(domain.dim), middle
        motion = self.motions.get(phase.name)
        if motion is not None:
            state = motion.state(time, self.state.dt, domain.dim)
            rotation = state["rotation"].reshape(domain.dim, domain.dim)
            centre = np.zeros(domain.dim) if motion.centre is None else np.array(motion.centre)
            now = centre + state["displacement"] + rotation @ (middle - centre)
        elif not phase.slides:
            now = middle + time * phase.velocities().mean(axis=0)
        offset = x - now
        offset -= domain.lengths * np.rint(offset * domain.inverse_periods)
        return middle + offset @ rotation
