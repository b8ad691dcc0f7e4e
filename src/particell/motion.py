"""What watches and constrains moving particles between the scheme's loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.boundaries.mean_velocity import MeanVelocity, add_velocity, axial_momentum
from particell.boundaries.reflection import Reflection, reflect, surface_table
from particell.boundaries.sponge import Sponge, relax_velocity, share_of_target, way_since
from particell.chemistry.reservoirs import FixedValueWall, FluxWall, Reservoir
from particell.compute.reduce import Reduction
from particell.errors import InputError, RunError, unknown_name
from particell.geometry.shapes import Ball
from particell.laws.buoyancy import Buoyancy, measure_buoyancy
from particell.materials import AVOGADRO
from particell.suspects import suspects

if TYPE_CHECKING:
    from particell.simulation import Simulation


#: Targets of sponges are evaluated again where a particle has moved by this part of its support.
TARGET_MOTION = 0.1


class Constraints:
    """Reflecting surfaces, sponges and mean velocities of a simulation.

    Targets of sponges are functions of position. They are evaluated anew as soon as a particle has
    moved by :data:`TARGET_MOTION` of its support since; whether it is in a sponge, and how far,
    follows from its place at the moment.
    """

    def __init__(self, simulation: Simulation, boundaries: Sequence[Any]):
        self.simulation = simulation
        self.sponges = [b for b in boundaries if isinstance(b, Sponge)]
        self.surfaces = [b for b in boundaries if isinstance(b, Reflection)]
        self.means = [b for b in boundaries if isinstance(b, MeanVelocity)]
        self._check(boundaries)
        for mean in self.means:
            if mean.axis not in np.flatnonzero(simulation.domain.periodic):
                raise InputError("axis of MeanVelocity", mean.axis, "that of a periodic direction")
        particles, dim = simulation.particles, simulation.domain.dim
        self._table = simulation.device.array(surface_table(self.surfaces, dim))
        if self.surfaces:
            particles.add("reflections", dtype=np.int64)
        for k, sponge in enumerate(self.sponges):
            if sponge.velocity is not None:
                particles.add(f"sponge_velocity_{k}", dim)
            for name in sponge.species:
                particles.add(f"sponge_{name}_{k}")
        if self.sponges:
            particles.add("sponge_share")
        given = [t for s in self.sponges for t in (s.velocity, *s.species.values())]
        self._follows = any(map(callable, given)) and not simulation.static
        if self._follows:
            particles.add("sponge_x", dim)
        self._seen = 0
        self._bound = False

    def _check(self, boundaries: Sequence[Any]) -> None:
        dim, chemistry = self.simulation.domain.dim, self.simulation.chemistry
        for sponge in self.sponges:
            if sponge.axis >= dim:
                raise InputError("axis of Sponge", sponge.axis, f"from 0 to {dim - 1}")
            for name in sponge.species:
                known = chemistry.species if chemistry else {}
                if name not in known:
                    raise unknown_name("species of Sponge", name, known)
        for reflection in self.surfaces:
            body = reflection.body
            if len(body.center if isinstance(body, Ball) else body.point) != dim:
                raise InputError("body of Reflection", body, f"in {dim} dimensions")
        for boundary in boundaries:
            if chemistry is None and isinstance(boundary, Reservoir | FixedValueWall | FluxWall):
                name = next(iter(boundary.values))
                raise InputError(f"species of {type(boundary).__name__}", name, "a species' name")

    def renew(self) -> None:
        """Evaluate the sponges' targets at the particles' positions."""
        particles, domain = self.simulation.particles, self.simulation.domain
        x, _ = domain.wrapped(np.array(particles.host("x"), dtype=float))
        for k, sponge in enumerate(self.sponges):
            within = sponge.strength_in(domain, x) > 0
            if sponge.velocity is not None:
                values = _target(within, "velocity", sponge.velocity(x), x.shape)
                particles.set(f"sponge_velocity_{k}", values)
            for name, value in sponge.species.items():
                given = value(x) if callable(value) else value
                particles.set(f"sponge_{name}_{k}", _target(within, name, given, (len(x),)))
        if self._follows:
            particles.set("sponge_x", particles.host("x"))
        self._seen = self.simulation.neighbours.builds

    def restored(self) -> None:
        """The targets were put back with the other fields: they are those of this list."""
        self._seen = self.simulation.neighbours.builds

    def reflect(self) -> None:
        """Mirror what has crossed a reflecting surface, and put what has crossed a wall back."""
        self.simulation.walls.turn_back()
        if self.surfaces:
            self._bind()
            self._reflect(len(self.simulation.particles))

    def relax(self, step: int, dt: float) -> None:
        """Bring velocities in sponges towards their targets, and the mean to its own."""
        if self.sponges:
            self._relax_sponges(dt)
        if self.means:
            self._bind()
            self._keep_means()

    def _relax_sponges(self, dt: float) -> None:
        self._bind()
        if self._seen != self.simulation.neighbours.builds or self._moved_on():
            self.renew()
        for sponge, relax in zip(self.sponges, self._relaxations, strict=True):
            if relax is not None:
                relax(len(self.simulation.particles), dt / sponge.time)

    def _moved_on(self) -> bool:
        """Whether a particle has moved by :data:`TARGET_MOTION` since targets were evaluated."""
        if not self._follows:
            return False
        self._measure_way(len(self.simulation.particles))
        return self._reduction.max(self._way) > TARGET_MOTION**2

    def _keep_means(self) -> None:
        n = len(self.simulation.particles)
        for mean, (gather, momentum, add) in zip(self.means, self._mean_loops, strict=True):
            gather(n)
            now = float(self._reduction.sum(momentum)[0]) / self._fluid_mass
            add(n, mean.velocity - now)

    def relax_species(self, step: int, tau: float) -> None:
        """Bring species in sponges towards their targets; what they gain is booked."""
        chemistry = self.simulation.chemistry
        if chemistry is None or not self.sponges:
            return
        self._bind()
        particles = self.simulation.particles
        for k, (sponge, share) in enumerate(zip(self.sponges, self._shares, strict=True)):
            if not sponge.species:
                continue
            share(len(particles), tau / sponge.time)
            for name in sponge.species:
                target = particles[f"sponge_{name}_{k}"]
                chemistry.relax(name, particles["sponge_share"], target, step)

    def counts(self) -> dict[str, float]:
        """How often particles were reflected or bounced back by walls, and how many are in these.

        Inside is beyond the surface where a wall has one.
        """
        particles = self.simulation.particles
        found = {"reflections": 0.0}
        if self.surfaces:
            found["reflections"] = float(particles.host("reflections").sum())
        if "bounces" in particles:
            mobile = particles.host("is_wall") == 0
            x = np.array(particles.host("x")[mobile], dtype=float)
            inside = self.simulation.walls.inside(x, self.simulation.time)
            found["bounces"] = float(particles.host("bounces").sum())
            found["inside walls"] = float(inside.sum())
        return found

    def _bind(self) -> None:
        """Look up the loops' arrays; they stay the same as long as the simulation lives."""
        if self._bound:
            return
        self._bound = True
        s = self.simulation
        bind, dim = s.device.bind, s.domain.dim
        fields = {**s.neighbours.fields, **s.particles.fields}
        table = {"surfaces": self._table, "number": len(self.surfaces)}
        self._reflect = bind(reflect, {**fields, **table}, DIM=dim)
        self._reduction = Reduction(s.device)
        momentum = s.device.zeros((len(s.particles), 1), np.float64) if self.means else None
        self._fluid_mass = float(s.particles.host("mass")[s.particles.host("is_wall") == 0].sum())
        self._mean_loops = []
        for mean in self.means:
            own = {**fields, "momentum": momentum}
            axis = {"AXIS": mean.axis}
            self._mean_loops.append(
                (bind(axial_momentum, own, **axis), momentum, bind(add_velocity, own, **axis))
            )
        self._relaxations: list[Callable[..., None] | None] = []
        self._shares = []
        if self._follows:
            self._way = s.device.zeros(len(s.particles), np.float64)
            self._measure_way = bind(way_since, {**fields, "way": self._way}, DIM=dim)
        for k, sponge in enumerate(self.sponges):
            window = sponge.window(s.domain)
            zone = {
                "start": sponge.start,
                "end": sponge.end,
                "exponent": float(sponge.exponent),
                **dict(zip(("origin", "edge", "inverse_edge"), window, strict=True)),
            }
            own = {**fields, **zone}
            self._shares.append(bind(share_of_target, own, AXIS=sponge.axis))
            relax = None
            if sponge.velocity is not None:
                own["target"] = s.particles[f"sponge_velocity_{k}"]
                relax = bind(relax_velocity, own, DIM=dim, AXIS=sponge.axis)
            self._relaxations.append(relax)


def _target(within: np.ndarray, name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A target as an array of a shape; refused where it is none, or not finite in the sponge."""
    try:
        found = np.broadcast_to(np.asarray(values, dtype=float), shape)
    except (TypeError, ValueError):
        found = np.full(shape, np.nan)
    if not np.all(np.isfinite(found[within])):
        raise InputError(f"{name} of Sponge", values, f"finite numbers of shape {shape}")
    return found


class Forces:
    """Body forces that depend on what particles carry: the field ``buoyancy``, which laws read."""

    def __init__(self, simulation: Simulation, forces: Sequence[Buoyancy]):
        self.simulation, self.forces = simulation, list(forces)
        dim = simulation.domain.dim
        known = simulation.chemistry.species if simulation.chemistry else {}
        for force in self.forces:
            if force.species not in known:
                raise InputError("species", force.species, f"one of {', '.join(known) or 'none'}")
            if known[force.species].switches:
                raise InputError("species", force.species, "one without switch_above, in a force")
            if len(force.gravity) != dim:
                raise InputError("gravity", force.gravity, f"{dim} numbers")
        if self.forces:
            simulation.particles.add("buoyancy", dim)
        self._loops: list[Callable[..., None]] | None = None

    def measure(self) -> None:
        """The sum of all forces at the particles, per mass."""
        if self._loops is None:
            bind, dim = self.simulation.device.bind, self.simulation.domain.dim
            self._loops = [
                bind(measure_buoyancy, self._values(force), DIM=dim, FIRST=k == 0)
                for k, force in enumerate(self.forces)
            ]
        for loop in self._loops:
            loop(len(self.simulation.particles))

    def _values(self, force: Buoyancy) -> dict[str, Any]:
        simulation = self.simulation
        chemistry, particles = simulation.chemistry, simulation.particles
        assert chemistry is not None
        whole = chemistry.species[force.species].molecules
        strength = -force.expansion * np.array(force.gravity, dtype=float)
        return {
            **particles.fields,
            "content": particles["count" if whole else "amount"],
            "s": chemistry.column(force.species),
            "scale": 1.0 / (simulation.depth_factor * AVOGADRO) if whole else 1.0,
            "reference": force.reference,
            "strength": simulation.device.array(strength),
        }


#: A run is refused where its automatic time step is larger by this factor than the flow allows.
#: It is then twice the Courant limit: what was slow to the sound speed is as fast as that.
TOO_LATE = 2.0


#: Fields that are never infinite; others are looked at for NaN only.
FINITE = ("x", "v", "density", "a", "amount")
#: Fields that never change: they are broken by nothing else.
GIVEN = ("mass", "support", "wall_depth", "wall_curvature")


def _rank(name: str) -> int:
    """Which fields messages name first."""
    return 0 if name in GIVEN else 1 if name in (*FINITE, "count") else 2


class Monitor:
    """Finds non-finite fields and lost particles; measures energy and momentum."""

    def __init__(self, simulation: Simulation):
        self.simulation = simulation

    def check(self) -> None:
        """Refuse to go on with a broken state.

        Raises
        ------
        RunError
            Naming step, time, the first particle and the field.
        """
        particles = self.simulation.particles
        if broken := {name: rows for name in particles if len(rows := self._bad_rows(name))}:
            # A NaN spreads: from what never changes, and from where there are fewest.
            field = min(broken, key=lambda name: (_rank(name), len(broken[name])))
            what = "negative" if field == "count" else "not finite"
            self._fail(f"a value is {what}", field, int(broken[field][0]))
        self._check_places()
        self._check_speeds()

    def _bad_rows(self, name: str) -> np.ndarray:
        """Rows of a field that hold what they must not."""
        values = self.simulation.particles.view(name)
        if name == "count":
            bad = values < 0
        elif values.dtype.kind != "f" or name.startswith("sponge_"):  # unused outside a sponge
            return np.empty(0, np.int64)
        else:  # some distances are infinite where there is nothing near
            own = [f.name for f in getattr(self.simulation.scheme, "fields", ())]
            bad = ~np.isfinite(values) if name in (*FINITE, *own) else np.isnan(values)
        return np.flatnonzero(bad.any(axis=1) if bad.ndim > 1 else bad)

    def _check_speeds(self) -> None:
        s = self.simulation
        fastest = self.largest_speed()
        if s.late(TOO_LATE, fastest):
            square = (s.particles.view("v").astype(float) ** 2).sum(axis=1)
            self._fail(
                f"the flow ({fastest:.3g} m/s) has become too fast for dt = {s.dt:.3g} s within a "
                "frame; give the speed that it reaches as reference_speed, or take shorter frames",
                "v",
                int(np.argmax(square)),
            )

    def _check_places(self) -> None:
        simulation = self.simulation
        domain, particles = simulation.domain, simulation.particles
        bounded = ~domain.periodic
        if not bounded.any() or simulation.static:
            return
        x = particles.view("x")[:, bounded]
        h = particles.view("support")[:, None]
        lost = (x < domain.lower[bounded] - h) | (x > domain.upper[bounded] + h)
        lost = lost.any(axis=1) & (particles.view("is_wall") == 0)
        if lost.any():
            self._fail("a particle has left the domain", "position", int(np.flatnonzero(lost)[0]))

    def _fail(self, message: str, field: str, row: int) -> None:
        s = self.simulation
        particle = int(s.particles.view("id")[row])
        message += suspects(s, field)
        raise RunError(message, step=s.step, time=s.time, field=field, particle=particle)

    def _masses(self) -> np.ndarray:
        p = self.simulation.particles
        mobile = p.view("is_wall") == 0
        return np.where(mobile, p.view("mass").astype(float), 0.0) * self.simulation.depth_factor

    def momentum(self) -> np.ndarray:
        """Σ m v of the mobile particles in kg m/s, shape (D,)."""
        v = self.simulation.particles.view("v").astype(float)
        return (self._masses()[:, None] * v).sum(axis=0)

    def absolute_momentum(self) -> float:
        """Σ m |v| of the mobile particles in kg m/s."""
        v = self.simulation.particles.view("v").astype(float)
        return float((self._masses() * np.linalg.norm(v, axis=1)).sum())

    def kinetic_energy(self) -> float:
        """½ Σ m v² of the mobile particles in J."""
        v = self.simulation.particles.view("v").astype(float)
        return float(0.5 * (self._masses() * (v**2).sum(axis=1)).sum())

    def largest_speed(self) -> float:
        """Largest |v| in m/s."""
        v = self.simulation.particles.view("v").astype(float)
        return float(np.sqrt((v**2).sum(axis=1).max(initial=0.0)))
