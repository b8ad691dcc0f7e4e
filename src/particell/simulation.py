"""The simulation: from a description to time steps.

A simulation is made of phases (who), a scheme (how they move), species and reactions (what they
carry), and boundaries. It steps; observers look at it between steps.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell import health, snapshot
from particell.averages import TimeAverage
from particell.boundaries.mean_velocity import MeanVelocity
from particell.boundaries.moving import WallMotion
from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.checks import checked
from particell.chemistry.carriage import Carriage
from particell.chemistry.engine import Chemistry
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import FixedValueWall, FluxWall, Reservoir
from particell.chemistry.species import Species
from particell.compute.device import Device
from particell.compute.loop import CompileLog
from particell.compute.philox import stream_key
from particell.errors import InputError, RunError
from particell.geometry.domain import Domain
from particell.laws.buoyancy import Buoyancy
from particell.limits import law_limit, limits_of
from particell.materials import Fluid
from particell.motion import Constraints, Forces, Monitor
from particell.phases import Phase
from particell.restart import restore, state_of
from particell.schemes.static import Static, StaticSolver
from particell.schemes.timestep import check_number_of_steps
from particell.setup import build_materials, build_neighbours, build_particles
from particell.speeds import (
    Scheme,
    check_given_step,
    default_sound_speed,
    flow_speed,
    with_noise,
)
from particell.walls import Walls

if TYPE_CHECKING:
    from particell.observers import Stop
    from particell.output.run import Run

Boundary = Reflection | WallMotion | Sponge | MeanVelocity | Reservoir | FixedValueWall | FluxWall
#: A chemistry step moves particles by at most this part of the support.
CHEMISTRY_MOTION = 0.1
#: An automatic time step is chosen anew where it is larger by this factor than the flow allows.
LATE = 1.05


@checked
class Simulation:
    """Particles that move, react and diffuse.

    Parameters
    ----------
    domain
        The simulated box.
    phases
        What is in it.
    scheme
        :class:`~particell.schemes.sdpd.SDPD`,
        :class:`~particell.schemes.transport_velocity.TransportVelocity`, or
        :class:`~particell.schemes.static.Static` for particles at rest.
    species, reactions
        What the particles carry.
    boundaries
        Reflecting surfaces, motions of walls, sponges, reservoirs, walls with fixed concentrations
        or fluxes.
    forces
        :class:`~particell.laws.buoyancy.Buoyancy`.
    seed
        Of all random numbers: the same seed gives the same bits for any number of threads.
    dt
        Time step in s, or ``"auto"`` for the largest that the rules allow. :meth:`run` makes an
        automatic one smaller, after a frame, where the flow has become faster than it was chosen
        for.
    device
        Where to compute; CPU and float64 by default.
    normalise_diffusion
        Divide the diffusion of species by its second moments over the neighbours that carry them:
        exact on every lattice, along membranes and beside walls (:mod:`particell.laws.carriers`).
    splitting
        Of diffusion and reactions: ``"lie"`` (first order), ``"strang"`` (second order, with two
        evaluations of the diffusion of concentrations a step), or ``"auto"``: Strang's where
        molecules and concentrations react together and something diffuses, else Lie's.

    Attributes
    ----------
    particles
        The :class:`~particell.particles.Particles`.
    chemistry
        The :class:`~particell.chemistry.engine.Chemistry`, or None without species.
    step, time, dt
        Steps done, time and time step in s.
    """

    def __init__(
        self,
        domain: Domain,
        phases: Sequence[Phase] | Phase,
        scheme: Scheme,
        species: Sequence[Species] = (),
        reactions: Sequence[Reaction] = (),
        boundaries: Sequence[Boundary] = (),
        forces: Sequence[Buoyancy] = (),
        seed: int = 1,
        dt: float | str = "auto",
        device: Device | None = None,
        normalise_diffusion: bool = True,
        splitting: str = "auto",
    ):
        if dt != "auto" and not (isinstance(dt, int | float) and dt > 0):
            raise InputError("dt", dt, "positive, or 'auto'")
        stream_key(seed, 0)  # refuses what is no seed
        self.domain, self.scheme, self.seed = domain, scheme, seed
        self.phases = [phases] if isinstance(phases, Phase) else list(phases)
        device, dim = device or Device(), domain.dim
        self.device = device
        spacing = min((p.particle_spacing for p in self.phases), default=1.0)
        self.depth = domain.depth if domain.depth is not None else spacing
        self.depth_factor = self.depth ** (3 - dim)
        self.static = isinstance(scheme, Static)
        flow = flow_speed(domain, self.phases, scheme, boundaries)
        self._speed = with_noise(flow, self.phases, scheme, self.depth_factor)
        sound_speed = default_sound_speed(domain, self.phases, scheme, self.depth_factor, flow)
        self.materials, index = build_materials(self.phases, sound_speed)
        self.particles = build_particles(
            self.device, domain, self.phases, index, scheme.support, self.static
        )
        self.neighbours = build_neighbours(self.device, domain, self.particles, scheme.skin or 0.1)
        self.walls = Walls(self, boundaries)
        self.solver = scheme.solver(
            device, domain, self.particles, self.neighbours, self.materials, seed, self.depth_factor
        )
        if self.walls.motions and not isinstance(self.solver, StaticSolver):
            self.solver.kept_volume.walls_move = True
        self.chemistry: Chemistry | None = None
        self.carriage: Carriage | None = None
        if species:
            self.chemistry = Chemistry(
                self.device,
                self.particles,
                self.neighbours,
                species,
                reactions,
                [b for b in boundaries if isinstance(b, Reservoir | FixedValueWall | FluxWall)],
                kernel=scheme.kernel,
                seed=seed,
                normalise=normalise_diffusion,
                depth=self.depth_factor,
                splitting=splitting,
                at_rest=self.static,
            )
            if getattr(scheme, "species_flux", False):
                self.carriage = Carriage(self)
                self.solver.carry_species = self.carriage.apply  # type: ignore[union-attr]
        elif reactions:
            raise InputError("reactions", list(reactions), "empty without species")
        self._books = any(getattr(b, "values", getattr(b, "species", None)) for b in boundaries)
        self.constraints = Constraints(self, boundaries)
        if not isinstance(self.solver, StaticSolver):
            self.solver.after_drift = self.constraints.reflect  # type: ignore[method-assign]
            self.solver.move_walls = self._move_walls  # type: ignore[method-assign]
            self.solver.before_pairs = self.walls.measure  # type: ignore[method-assign]
            acting = Forces(self, forces)
            self.solver.body_forces = acting.measure  # type: ignore[method-assign]
        self.monitor = Monitor(self)
        self.watch = health.Watch(self)
        self.automatic = dt == "auto"
        self.step, self.time = 0, 0.0
        self.chemistry_every = 1
        self.dt = self.largest_step() if self.automatic else float(dt)
        self.solver.law_limit = law_limit(self)
        if not self.automatic:
            h = float(self.particles.host("support").min())
            check_given_step(self.dt, h, self.given_materials, scheme, dim)
        self.resumed, self.resumed_plan = False, None
        self.resumed_averages: dict[str, np.ndarray] = {}
        self._started = False
        self._wall_seconds = self._compile_seconds = 0.0
        self._first_momentum: np.ndarray | None = None
        self._first_totals: dict[str, float] = {}

    # --- time step ---------------------------------------------------------------------------
    def largest_step(self, speed: float | None = None) -> float:
        """The largest time step in s that the rules allow for a speed in m/s.

        By default that is the largest initial or expected one, or what the flow has reached since.
        """
        speed = self._speed if speed is None else speed
        return min(limits_of(self, speed).values())

    @property
    def limited_by(self) -> str:
        """What allows the smallest of the steps of :meth:`largest_step`: a rule, or a law."""
        limits = limits_of(self, self._speed)
        return min(limits, key=lambda name: limits[name])

    @property
    def given_materials(self) -> list[Fluid]:
        """What particles of fluids are given so that these are the ones asked for, by group.

        With noise that is another sound speed and another viscosity
        (:mod:`particell.schemes.summation`): they limit the time step.
        """
        given = getattr(self.solver, "given", None)
        if given is None:
            return self.materials
        groups = zip(given, self.particles.groups, strict=True)
        return [m for m, g in groups if g.kind == "fluid"] or given

    def _diffusive_limit(self) -> float:
        """Largest step in s of the diffusion of concentrations, which is explicit."""
        limits = self.chemistry.limits() if self.chemistry else {}
        return limits.get("diffusion of concentrations", math.inf)

    def plan(self, every: float) -> int:
        """Choose dt and the chemistry's step so that ``every`` is a whole number of both.

        Returns
        -------
        int
            Time steps per interval ``every``.
        """
        if not (every > 0 and math.isfinite(every)):
            raise InputError("every", every, "positive")
        largest = self.largest_step() if self.automatic else self.dt
        self.solver.law_limit = law_limit(self)
        check_number_of_steps(largest, every)
        if largest > self._diffusive_limit() * (1 + 1e-9):
            allowed = f"at most {self._diffusive_limit():.3g} s (diffusion of concentrations)"
            raise InputError("dt", self.dt, allowed)
        block = 1
        if self.chemistry and not self.static:
            limits = [*self.chemistry.limits().values()]
            if self._speed > 0:
                h = float(self.particles.host("support").min())
                limits.append(CHEMISTRY_MOTION * h / self._speed)
            block = max(1, int(min(limits, default=largest) / largest))
        # frames may be closer than a step of the species could be long
        block = min(block, math.ceil(every / largest * (1 - 1e-12)))
        blocks = max(1, math.ceil(every / (block * largest) * (1 - 1e-12)))
        self.chemistry_every = block
        self.dt = every / (blocks * block)
        return blocks * block

    def outran(self) -> bool:
        """Whether the flow has become too fast for its automatic time step; if so, note its speed.

        The next :meth:`plan` is for that speed. Less than :data:`LATE` (the outliers of thermal
        noise) is no reason to choose the step anew.
        """
        fastest = self.monitor.largest_speed()
        if not self.late(LATE, fastest):
            return False
        self._speed = fastest
        return True

    def late(self, factor: float, speed: float) -> bool:
        """Whether an automatic dt is larger than ``factor`` times what the rules allow at a speed.

        Only where it was chosen for a smaller speed.
        """
        if self.static or not self.automatic or speed <= self._speed:
            return False
        return self.dt > factor * self.largest_step(speed)

    # --- stepping ----------------------------------------------------------------------------
    def start(self) -> None:
        """Build the neighbour list and the initial forces; done by the first step if needed."""
        if self._started:
            return
        self._started = True
        begin, compiling = clock.perf_counter(), CompileLog.seconds
        self.walls.move(self.time)
        self.solver.time = self.time
        self.solver.initialise(self.step, self.dt)
        self.constraints.renew()
        self.monitor.check()
        self._first_momentum = self.monitor.momentum()
        self._first_totals = snapshot.net_totals(self)
        self._wall_seconds += clock.perf_counter() - begin
        self._compile_seconds += CompileLog.seconds - compiling

    @checked
    def advance(self, steps: int = 1) -> None:
        """Do ``steps`` time steps of ``dt``.

        Raises
        ------
        RunError
            At the end, where a field is not finite, a particle has left the domain, or the flow
            is too fast for an automatic time step.
        """
        if steps < 0:
            raise InputError("steps", steps, "zero or more")
        self.start()
        begin, compiling = clock.perf_counter(), CompileLog.seconds
        chemistry, every = self.chemistry, self.chemistry_every
        solver, constraints, dt = self.solver, self.constraints, self.dt
        try:
            for _ in range(steps):
                solver.time = self.time
                solver.step(self.step, dt)
                self.walls.bounce_back()
                constraints.relax(self.step, dt)
                solver.finish(self.step, dt)
                self.step, self.time = self.step + 1, self.time + dt
                if chemistry is not None and self.step % every == 0:
                    chemistry.step(self.step, every * dt, self.time)
                    constraints.relax_species(self.step, every * dt)
        except RunError:
            self.monitor.check()  # names the field that it came from, where one shows it
            raise
        self.monitor.check()
        self._wall_seconds += clock.perf_counter() - begin
        self._compile_seconds += CompileLog.seconds - compiling

    def _move_walls(self, part: float) -> None:
        self.walls.move(self.time + part * self.dt)

    @checked
    def run(
        self,
        until: float,
        every: float | None = None,
        out: str | Path | None = None,
        progress: bool = True,
        checkpoint_every: float = 60.0,
        stop: Stop | None = None,
        overwrite: bool = False,
        averages: TimeAverage | Sequence[TimeAverage] = (),
    ) -> Run:
        """Advance to a time, with output.

        Parameters
        ----------
        until
            Time in s to advance to.
        every
            Interval in s of frames, a whole part of the time to run; by default a tenth of
            that.
        out
            Directory for ``run.h5`` and ``checkpoint.h5``, or None to keep frames in memory.
        progress
            Whether to show a progress bar.
        checkpoint_every
            Seconds of wall time between checkpoints; there is one more at the end.
        stop
            A condition that ends the run early.
        overwrite
            Whether to replace the run that ``out`` holds already.
        averages
            Fields to average in time, at points that do not move, between frames.

        Returns
        -------
        Run
            The frames and observables.

        Raises
        ------
        InputError, RunError, Interrupted
            See :mod:`particell.errors`.
        """
        from particell.observers import run_with_observers as run

        options = (progress, checkpoint_every, stop, overwrite, averages)
        return run(self, until, every, out, *options)

    # --- what can be seen --------------------------------------------------------------------
    @property
    def group_names(self) -> list[str]:
        """Names of the groups, in the order of the field ``group``."""
        return [g.name for g in self.particles.groups]

    def static_frame(self) -> dict[str, np.ndarray]:
        """Fields that do not change, in the order of ids; masses in kg."""
        return snapshot.static_frame_of(self)

    def frame(self) -> dict[str, np.ndarray]:
        """Fields of one trajectory frame, in the order of ids."""
        return snapshot.frame_of(self, self._books)

    def observables(self) -> dict[str, float]:
        """Scalars for time series."""
        return snapshot.observables_of(self)

    def conservation(self) -> dict[str, float]:
        """How far conserved quantities have drifted.

        Momentum (which walls, gravity and sponges change too) relative to Σ m|v|; sums of amounts
        that no reaction changes, net of booked boundary flux, relative to the amounts (molecules:
        whole numbers); how often walls turned particles back, and how many are inside.
        """
        return snapshot.drift_since(self, self._first_momentum, self._first_totals)

    def health(self) -> list[health.Finding]:
        """What tells whether the simulation can be trusted, each with its limit.

        The worst of the frames so far and of the present state; see :mod:`particell.health`.
        """
        return health.examine(self)

    @property
    def performance(self) -> dict[str, float]:
        """Particles, steps, seconds, and particle-steps per second (compilation left out)."""
        return snapshot.performance_of(self, self._wall_seconds, self._compile_seconds)

    @property
    def settings(self) -> dict[str, Any]:
        """What was chosen for this run, for the summary."""
        return snapshot.settings_of(self)

    # --- restart -----------------------------------------------------------------------------
    def state(self) -> dict[str, Any]:
        """Everything that a continuation bit for bit needs: see :meth:`restore`."""
        return state_of(self)

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a :meth:`state` of a simulation with the same description.

        Raises
        ------
        InputError
            Where the state belongs to another simulation.
        """
        restore(self, state)

    def __repr__(self) -> str:
        return snapshot.text_of(self)

    def _repr_html_(self) -> str:
        return snapshot.html_of(self)
