"""What can be seen of a simulation between steps: frames, scalars, conservation, settings."""

from __future__ import annotations

import time as wall_clock
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from particell.analysis.bounded import Arrangement
from particell.chemistry.invariants import conserved_totals
from particell.chemistry.listing import reaction_table, species_table
from particell.chemistry.reservoirs import WALL_VALUE
from particell.compute.loop import CompileLog
from particell.errors import InputError
from particell.phases import phase_table
from particell.representation import block, table
from particell.roles import Role
from particell.simulated import Simulated


class Account:
    """What a simulation began with, and the seconds that it took.

    Attributes
    ----------
    wall_seconds, compile_seconds
        Time spent in steps, and in compiling on the way.
    momentum, totals
        At the start: Σ m v in kg m/s, None before; sums of amounts that no reaction changes.
    """

    def __init__(self) -> None:
        self.wall_seconds = self.compile_seconds = 0.0
        self.momentum: np.ndarray | None = None
        self.totals: dict[str, float] = {}

    @contextmanager
    def measuring(self) -> Iterator[None]:
        """Count the time of a block, if it ends well."""
        begin, compiling = wall_clock.perf_counter(), CompileLog.seconds
        yield
        self.wall_seconds += wall_clock.perf_counter() - begin
        self.compile_seconds += CompileLog.seconds - compiling

    def open(self, simulation: Simulated) -> None:
        """Note what the simulation begins with."""
        self.momentum = simulation.monitor.momentum()
        self.totals = net_totals(simulation)

    def saved(self) -> dict[str, Any]:
        """What :meth:`restore` puts back."""
        return dict(vars(self))

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with another run's account."""
        vars(self).update(saved)


def static_frame_of(simulation: Simulated) -> dict[str, np.ndarray]:
    """See :meth:`particell.simulation.Simulation.static_frame`."""
    p = simulation.particles
    frame = {name: p.by_id(name) for name in ("id", "group", "support")}
    frame["mass"] = p.by_id("mass") * simulation.system.depth_factor
    walls = (name for name in ("wall_normal", "wall_depth", "wall_curvature") if name in p)
    return frame | {name: p.by_id(name) for name in walls}


def roles_of(simulation: Simulated) -> list[Role]:
    """What each group is to fields, in their order."""
    chemistry = simulation.chemistry
    rubs = not simulation.static and any(m.viscosity > 0 for m in simulation.materials)
    found = []
    for g, phase in enumerate(simulation.phases):
        holds: set[str] = set()
        held: dict[str, float] = {}
        for kept in chemistry.tables if chemistry else ():
            holds |= {kept.names[s] for s in np.flatnonzero(kept.present[g])}
            fixed = np.flatnonzero(kept.status[g] == WALL_VALUE)
            held |= {kept.names[s]: float(kept.value[g, s]) for s in fixed}
        sticks = rubs and phase.kind == "wall"
        found.append(Role(phase.name, phase.kind, tuple(sorted(holds)), held, sticks))
    return found


def arrangement_of(simulation: Simulated) -> Arrangement:
    """The particles in memory order, as fields and surfaces see them."""
    p = simulation.particles
    names = ("wall_normal", "wall_depth", "wall_curvature")
    surface = [p.host(name).astype(float) for name in names if name in p]
    group, position, support = (p.host(name) for name in ("group", "x", "support"))
    return Arrangement(
        simulation.domain, roles_of(simulation), group, position.astype(float), support, *surface
    )


def field_names_of(simulation: Simulated) -> list[str]:
    """What of the particles changes in time, other than positions and what came in."""
    names = ["velocity"] if simulation.static else ["velocity", "density", "pressure"]
    names += [f.name for f in simulation.scheme.fields]
    chemistry = simulation.chemistry
    for name, s in chemistry.species.items() if chemistry else ():
        names += [f"concentration/{name}", f"count/{name}"][: 2 if s.molecules else 1]
    return names


def units_of(simulation: Simulated) -> dict[str, str]:
    """Units of the fields of the user's."""
    return {f.name: f.unit for f in simulation.scheme.fields if f.unit}


def field_of(simulation: Simulated, name: str) -> np.ndarray:
    """One of :func:`field_names_of`, in memory order."""
    kind, _, species = name.partition("/")
    if species:
        assert simulation.chemistry is not None
        return getattr(simulation.chemistry, kind)(species)
    return simulation.particles.view("v" if name == "velocity" else name)


def frame_of(simulation: Simulated) -> dict[str, np.ndarray]:
    """See :meth:`particell.simulation.Simulation.frame`; what came in is booked for some."""
    p, chemistry = simulation.particles, simulation.chemistry
    order = np.argsort(p.host("id"))
    # particles that leave the box are brought back to it at the next build of the lists only
    position, turns = simulation.domain.wrapped(p.by_id("x"))
    frame = {"position": position, "image": p.by_id("image") + turns.astype(np.int32)}
    frame |= {name: field_of(simulation, name)[order] for name in field_names_of(simulation)}
    if simulation.books and chemistry:
        frame |= {f"inflow/{name}": _booked(simulation, name) for name in chemistry.species}
    return frame


def _booked(simulation: Simulated, name: str) -> np.ndarray:
    """What came into each particle through boundaries so far: mol or molecules, by id."""
    chemistry = simulation.chemistry
    assert chemistry is not None
    whole = chemistry.species[name].molecules
    booked = simulation.particles.by_id("count_booked" if whole else "amount_booked")
    values = booked[:, chemistry.column(name)]
    return values if whole else values * simulation.system.depth_factor


def observables_of(simulation: Simulated) -> dict[str, float]:
    """See :meth:`particell.simulation.Simulation.observables`."""
    values: dict[str, float] = {}
    monitor, chemistry = simulation.monitor, simulation.chemistry
    if not simulation.static:
        values["kinetic_energy"] = monitor.kinetic_energy()
        for axis, p in zip("xyz", monitor.momentum(), strict=False):
            values[f"momentum_{axis}"] = float(p)
        values["largest_speed"] = monitor.largest_speed()
    if chemistry:
        for name, (total, booked) in chemistry.totals().items():
            scale = 1 if chemistry.species[name].molecules else simulation.system.depth_factor
            values[f"amount_{name}"] = total * scale
            values[f"inflow_{name}"] = booked * scale
    for name, value in simulation.operations.observables().items():
        if name in values:
            raise InputError("observable", name, "a name that nothing else has")
        values[name] = value
    return values


def net_totals(simulation: Simulated) -> dict[str, float]:
    """Sums of amounts that no reaction changes, net of what was booked at boundaries."""
    if not simulation.chemistry:
        return {}
    return {name: value for name, (value, _) in conserved_totals(simulation.chemistry).items()}


def drift_since(simulation: Simulated, account: Account) -> dict[str, float]:
    """See :meth:`particell.simulation.Simulation.conservation`."""
    drift: dict[str, float] = {}
    monitor = simulation.monitor
    if not simulation.static and account.momentum is not None:
        change = monitor.momentum() - account.momentum
        for plane in simulation.system.mirrors:  # they change it, as walls do
            normal = np.array(plane.direction)
            change = change - (change @ normal) * normal if plane.slip else 0.0 * change
        scale = monitor.absolute_momentum()
        drift["momentum"] = float(np.linalg.norm(change) / scale) if scale else 0.0
    if simulation.chemistry:
        for name, (value, size) in conserved_totals(simulation.chemistry).items():
            drift[f"amount {name}"] = float((value - account.totals[name]) / size)
    return drift | {"reflections": 0.0} | simulation.operations.counts()


def performance_of(simulation: Simulated, account: Account) -> dict[str, float]:
    """See :attr:`particell.simulation.Simulation.performance`."""
    n, chemistry = len(simulation.particles), simulation.chemistry
    busy = max(account.wall_seconds - account.compile_seconds, 1e-9)
    return {
        "particles": n,
        "steps": simulation.step,
        "wall_seconds": account.wall_seconds,
        "compile_seconds": account.compile_seconds,
        "particle_steps_per_second": n * simulation.step / busy,
        "neighbour_list_builds": simulation.neighbours.builds,
        "ssa_events": chemistry.events if chemistry else 0,
        "diffusion_jumps": chemistry.jumps if chemistry else 0,
    }


def settings_of(simulation: Simulated) -> dict[str, Any]:
    """See :attr:`particell.simulation.Simulation.settings`."""
    scheme, chemistry = simulation.scheme, simulation.chemistry
    remarks = chemistry.remarks if chemistry else []
    return {
        "scheme": type(scheme).__name__,
        "kernel": scheme.kernel,
        "forms": simulation.solver.forms(),
        "support": float(simulation.particles.host("support").max()),
        "skin": simulation.neighbours.skin,
        "dt": simulation.dt,
        "largest_dt_by": simulation.timing.limited_by,
        "chemistry_every": simulation.chemistry_every,
        "sound_speed": [m.sound_speed for m in simulation.materials],
        "depth": simulation.system.depth,
        **solver_settings(simulation),
        **({"remarks": list(remarks)} if remarks else {}),
    }


def solver_settings(simulation: Simulated) -> dict[str, list[float]]:
    """What summed densities are divided by, and P_c in Pa (:mod:`.summation`), by group."""
    if simulation.scheme.density != "summation":
        return {}
    tables = simulation.solver.flow.properties.tables
    return {name: tables[name].tolist() for name in ("density_sum", "confinement")}


def text_of(simulation: Simulated) -> str:
    """The simulation in one line."""
    s = simulation
    carried = f", {s.chemistry}" if s.chemistry else ""
    return (
        f"Simulation({s.scheme!r}, {s.particles!r}{carried}, step={s.step}, t={s.time:.6g} s, "
        f"dt={s.dt:.3g} s)"
    )


def html_of(simulation: Simulated) -> str:
    """The simulation as tables, for notebooks."""
    s, chemistry = simulation, simulation.chemistry
    rows = [
        ("time", f"{s.time:.6g} s after {s.step} steps of {s.dt:.3g} s"),
        ("scheme", repr(s.scheme)),
        ("box", f"{s.domain!r} in m"),
        ("seed", s.seed),
        ("computes on", f"{s.device.backend} in {s.device.real}"),
    ]
    return block(
        f"Simulation of {len(s.particles)} particles in {s.domain.dim}D",
        table(rows),
        phase_table(s.phases),
        species_table(chemistry.species.values()) if chemistry else "",
        reaction_table(chemistry.reactions) if chemistry else "",
    )
