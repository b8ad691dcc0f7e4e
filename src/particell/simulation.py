"""The simulation: a state, a scheme, species and operations, put together and stepped.

A simulation is made of phases (who), a scheme (how they move), species and reactions (what they
carry), and boundaries. It steps; observers look at it between steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from particell import health, observers, snapshot
from particell.averages import TimeAverage
from particell.boundaries.mirror import mirrors_of
from particell.boundaries.sponge import Sponge
from particell.checks import checked, positive
from particell.chemistry.engine import Chemistry
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.compute.device import Device
from particell.compute.philox import stream_key
from particell.description import described_parts
from particell.errors import InputError, RunError
from particell.geometry.domain import Domain
from particell.laws.body_force import BodyForce
from particell.laws.buoyancy import Buoyancy
from particell.monitor import Monitor
from particell.observers import Stop
from particell.operations.build import OF_SPECIES, Boundary, operations_of, walls_of
from particell.operations.operation import Operation, Operations
from particell.output.run import Run
from particell.phases import Phase
from particell.recorder import kept_of_run, new_id
from particell.restart import restore, state_of
from particell.schemes.flow import Flow
from particell.schemes.solver import Solver, add_fields
from particell.setup import build_state, depth_of
from particell.speeds import Scheme, default_sound_speed, flow_speed, with_noise
from particell.state import State
from particell.timing import TimeStep


def _of_clock(name: str, doc: str) -> Any:
    """A property that is the clock's."""

    def read(self: Simulation) -> Any:
        return getattr(self.system.clock, name)

    def write(self: Simulation, value: Any) -> None:
        if name == "dt":
            positive("dt", value)
        setattr(self.system.clock, name, value)

    return property(read, write, doc=doc)


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
        Mirrors, reflecting surfaces, motions of walls, sponges, reservoirs, walls with fixed
        concentrations or fluxes, and boundaries of your own
        (:class:`~particell.operations.operation.Operation`).
    forces
        :class:`~particell.laws.buoyancy.Buoyancy`, :class:`~particell.laws.body_force.BodyForce`.
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
    operations
        What else happens while it runs: :class:`~particell.operations.every.Every`, or classes of
        your own derived from :class:`~particell.operations.operation.Operation`.
    observables
        Numbers for the time series: functions of the :class:`~particell.state.State`, by name.

    Attributes
    ----------
    system
        The :class:`~particell.state.State`.
    particles
        The :class:`~particell.particles.Particles`.
    chemistry
        The :class:`~particell.chemistry.engine.Chemistry`, or None without species.
    step, time, dt
        Steps done, time and time step in s.
    """

    step = _of_clock("step", "Steps done.")
    time = _of_clock("time", "Time in s.")
    dt = _of_clock("dt", "Time step in s.")
    chemistry_every = _of_clock("species_every", "Steps of the flow in one of the species.")

    def __init__(
        self,
        domain: Domain,
        phases: Sequence[Phase] | Phase,
        scheme: Scheme,
        species: Sequence[Species] = (),
        reactions: Sequence[Reaction] = (),
        boundaries: Sequence[Boundary] = (),
        forces: Sequence[Buoyancy | BodyForce] = (),
        seed: int = 1,
        dt: float | str = "auto",
        device: Device | None = None,
        normalise_diffusion: bool = True,
        splitting: str = "auto",
        operations: Sequence[Operation] = (),
        observables: Mapping[str, Callable[[State], float]] | None = None,
    ):
        if dt != "auto" and not (isinstance(dt, int | float) and dt > 0):
            raise InputError("dt", dt, "positive, or 'auto'")
        stream_key(seed, 0)  # refuses what is no seed
        if reactions and not species:
            raise InputError("reactions", list(reactions), "empty without species")
        self.described = described_parts(
            boundaries,
            forces,
            reactions,
            operations,
            observables or {},
            splitting=splitting,
            normalise_diffusion=normalise_diffusion,
            dt=dt,
        )
        self.domain, self.scheme, self.seed, self.static = domain, scheme, seed, scheme.at_rest
        self.phases = [phases] if isinstance(phases, Phase) else list(phases)
        depth_factor = depth_of(domain, self.phases) ** (3 - domain.dim)
        flow_speed_ = flow_speed(domain, self.phases, scheme, boundaries)
        speed = with_noise(flow_speed_, self.phases, scheme, depth_factor)
        sound = default_sound_speed(domain, self.phases, scheme, depth_factor, flow_speed_)
        laws = [force for force in forces if isinstance(force, BodyForce)]
        if forces and self.static:
            raise InputError("forces", list(forces), "empty with Static, where nothing moves")
        self.device = device or Device()
        mirrors = mirrors_of(domain, self.phases, scheme, boundaries, forces)
        self.system = build_state(domain, self.phases, scheme, sound, self.device, seed, mirrors)
        self.particles, self.neighbours = self.system.particles, self.system.neighbours
        self.materials = self.system.materials
        flow = None if self.static else Flow(self.system, scheme, laws)
        self.walls = walls_of(self.system, scheme, boundaries)
        if flow is not None:
            flow.kept_volume.walls_move = bool(self.walls.motions)
            add_fields(flow)
        self.chemistry: Chemistry | None = None
        if species:
            self.chemistry = Chemistry(
                self.device,
                self.particles,
                self.neighbours,
                species,
                reactions,
                [b for b in boundaries if isinstance(b, OF_SPECIES)],
                kernel=scheme.kernel,
                seed=seed,
                normalise=normalise_diffusion,
                depth=depth_factor,
                splitting=splitting,
                at_rest=self.static,
            )
        self.system.species = self.chemistry
        parts = (self.system, scheme, flow, self.walls, self.chemistry)
        carried = [force for force in forces if isinstance(force, Buoyancy)]
        acting = operations_of(*parts, boundaries, carried, operations, observables or {})
        own = [o for o in (*boundaries, *operations) if isinstance(o, Operation)]
        if flow is not None:
            flow.check_names(field for operation in own for field in operation.fields)
        self.operations = Operations(self.system, acting)
        self.solver = Solver(self.system, scheme, flow, self.operations)
        self.solver.check_moments(own)
        self.monitor = Monitor(self.system, flow)
        self.watch = health.Watch(self)
        self.timing = TimeStep(self.system, scheme, flow, self.chemistry, speed, dt)
        self.books = any(
            isinstance(b, OF_SPECIES) or (isinstance(b, Sponge) and b.species) for b in boundaries
        )
        self.run_id, self.resumed = new_id(), False
        self.resumed_plan: Mapping[str, Any] | None = None
        self.resumed_run: Mapping[str, Any] | None = None
        self.resumed_step = 0
        self.resumed_averages: Mapping[str, np.ndarray] = {}
        self.resumed_averaged: Mapping[str, str] = {}
        self.account = snapshot.Account()
        self._started = False

    # --- stepping ----------------------------------------------------------------------------
    def largest_step(self, speed: float | None = None) -> float:
        """The largest time step in s that the rules allow for a speed in m/s.

        By default that is the largest initial or expected one, or what the flow has reached since.
        """
        return self.timing.largest(speed)

    def plan(self, every: float) -> int:
        """Choose dt and the chemistry's step so that ``every`` is a whole number of both.

        Returns
        -------
        int
            Time steps per interval ``every``.
        """
        return self.timing.plan(every)

    def start(self) -> None:
        """Build the neighbour list and the initial forces; done by the first step if needed."""
        if self._started:
            return
        self._started = True
        with self.account.measuring():
            self.solver.start()
            self.check()
            self.account.open(self)

    @checked
    def advance(self, steps: int = 1, check: bool = True) -> None:
        """Do ``steps`` time steps of ``dt``; unless ``check`` is false, look at the state then.

        Raises
        ------
        RunError
            At the end, where a field is not finite, a particle has left the domain, or the flow
            is too fast for an automatic time step.
        """
        if steps < 0:
            raise InputError("steps", steps, "zero or more")
        self.start()
        with self.account.measuring():
            try:
                for _ in range(steps):
                    self.solver.step()
            except RunError:
                self.check()  # names the field that it came from, where one shows it
                raise
            if check:
                self.check()

    def check(self) -> None:
        """Refuse to go on with a broken state, or a flow that is too fast for its time step.

        Raises
        ------
        RunError
            Naming step, time, the first particle and the field.
        """
        self.monitor.check()
        self.timing.check(self.monitor)

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
            Interval in s of frames, a whole part of the time to run; by default that of the run
            that goes on, or a tenth of the time. After :meth:`advance` it may be a part of
            ``until`` instead: the first frame is at the present time, others at multiples of it.
        out
            Directory for ``run.h5``, checkpoints and ``status.json``, or None to keep frames in
            memory. The run in it goes on where this simulation has come from it: by
            :meth:`restore`, or by an earlier call.
        progress
            Whether to show a progress bar.
        checkpoint_every
            Seconds of wall time between checkpoints; there is one more at the end.
        stop
            A condition that ends the run early: called with time and observables after every
            frame.
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
        options = (progress, checkpoint_every, stop, overwrite, averages)
        return observers.run_with_observers(self, until, every, out, *options)

    @property
    def depth(self) -> float:
        """Extent of the dimensions that are not simulated, in m."""
        return self.system.depth

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
        return snapshot.frame_of(self)

    def observables(self) -> dict[str, float]:
        """Scalars for time series."""
        return snapshot.observables_of(self)

    def conservation(self) -> dict[str, float]:
        """How far conserved quantities have drifted.

        Momentum (which walls, gravity and sponges change too; without what mirrors take up, which
        is that along the normal, without slip all) relative to Σ m|v|; sums of amounts that no
        reaction changes, net of booked boundary flux, relative to the amounts (molecules:
        whole numbers); how often walls turned particles back, and how many are inside.
        """
        return snapshot.drift_since(self, self.account)

    def health(self) -> list[health.Finding]:
        """What tells whether the simulation can be trusted, each with its limit.

        The worst of the frames so far and of the present state; see :mod:`particell.health`.
        """
        self.start()
        return health.examine(self, self.watch)

    @property
    def performance(self) -> dict[str, float]:
        """Particles, steps, seconds, and particle-steps per second (compilation left out)."""
        return snapshot.performance_of(self, self.account)

    @property
    def settings(self) -> dict[str, Any]:
        """What was chosen for this run, for the summary."""
        return snapshot.settings_of(self)

    # --- restart -----------------------------------------------------------------------------
    def state(self) -> dict[str, Any]:
        """Everything that a continuation bit for bit needs: see :meth:`restore`."""
        self.start()
        return state_of(self)

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a :meth:`state` of a simulation with the same description.

        Raises
        ------
        InputError
            Where the state belongs to another simulation.
        """
        kept = kept_of_run(state)
        restore(self, state)
        self.resumed, self._started, self.resumed_step = True, True, self.step
        self.resumed_plan, self.resumed_run = kept.get("plan"), kept.get("run")
        self.resumed_averages, self.resumed_averaged = kept["averages"], kept["averaged"]
        self.run_id = self.resumed_run["id"] if self.resumed_run else new_id()

    def __repr__(self) -> str:
        return snapshot.text_of(self)

    def _repr_html_(self) -> str:
        return snapshot.html_of(self)
