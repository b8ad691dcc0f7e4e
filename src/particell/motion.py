"""What watches and constrains moving particles between the scheme's loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.boundaries.reflection import Reflection, reflect, surface_table
from particell.boundaries.sponge import Sponge, relax_velocity, share_of_target
from particell.errors import InputError, RunError
from particell.kernels import kernel_code
from particell.laws.buoyancy import Buoyancy, add_buoyancy, add_wall_head
from particell.materials import AVOGADRO

if TYPE_CHECKING:
    from particell.simulation import Simulation


class Constraints:
    """Reflecting surfaces and sponges of a simulation.

    Targets of sponges are functions of position. They are evaluated at each build of the
    neighbour list; between builds a particle moves by at most about 0.6 of its support (neighbours
    that flow together do not trigger one), in the yeast channel by a tenth.
    """

    def __init__(self, simulation: Simulation, boundaries: Sequence[Any]):
        self.simulation = simulation
        self.sponges = [b for b in boundaries if isinstance(b, Sponge)]
        self.surfaces = [b for b in boundaries if isinstance(b, Reflection)]
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
        self._seen = 0

    def renew(self) -> None:
        """Evaluate the sponges' targets at the particles' positions."""
        particles = self.simulation.particles
        for k, sponge in enumerate(self.sponges):
            x = np.array(particles.host("x"), dtype=float)
            if sponge.velocity is not None:
                particles.set(f"sponge_velocity_{k}", sponge.velocity(x))
            for name, value in sponge.species.items():
                values = value(x) if callable(value) else np.asarray(value)
                particles.set(f"sponge_{name}_{k}", values)
        self._seen = self.simulation.neighbours.builds

    def restored(self) -> None:
        """The targets were put back with the other fields: they are those of this list."""
        self._seen = self.simulation.neighbours.builds

    def reflect(self) -> None:
        """Mirror what has crossed a reflecting surface."""
        if self.surfaces:
            run, n, extra = self._loop(reflect, DIM=self.simulation.domain.dim)
            extra |= {"surfaces": self._table, "number": len(self.surfaces)}
            run(n, *(extra[name] for name in reflect.arguments))

    def relax(self, step: int, dt: float) -> None:
        """Bring velocities in sponges towards their targets."""
        if self.sponges and self._seen != self.simulation.neighbours.builds:
            self.renew()
        for k, sponge in enumerate(self.sponges):
            if sponge.velocity is None:
                continue
            dim = self.simulation.domain.dim
            run, n, extra = self._loop(relax_velocity, DIM=dim, AXIS=sponge.axis)
            extra |= self._zone(sponge, dt)
            extra["target"] = self.simulation.particles[f"sponge_velocity_{k}"]
            run(n, *(extra[name] for name in relax_velocity.arguments))

    def relax_species(self, step: int, tau: float) -> None:
        """Bring species in sponges towards their targets; what they gain is booked."""
        chemistry = self.simulation.chemistry
        if chemistry is None:
            return
        for k, sponge in enumerate(self.sponges):
            if not sponge.species:
                continue
            run, n, extra = self._loop(share_of_target, AXIS=sponge.axis)
            extra |= self._zone(sponge, tau)
            run(n, *(extra[name] for name in share_of_target.arguments))
            for name in sponge.species:
                target = self.simulation.particles[f"sponge_{name}_{k}"]
                chemistry.relax(name, self.simulation.particles["sponge_share"], target, step)

    def count(self) -> int:
        """How often particles were reflected."""
        if not self.surfaces:
            return 0
        return int(self.simulation.particles.host("reflections").sum())

    def _zone(self, sponge: Sponge, dt: float) -> dict[str, float]:
        return {
            "start": sponge.start,
            "end": sponge.end,
            "exponent": float(sponge.exponent),
            "dt_over_time": dt / sponge.time,
        }

    def _loop(self, loop: Any, **constants: Any) -> tuple[Any, int, dict[str, Any]]:
        s = self.simulation
        run = loop.specialise(s.device.backend, **constants)
        return run, len(s.particles), {**s.neighbours.fields, **s.particles.fields}


class Forces:
    """Body forces that depend on what the particles carry; they act after the force sweep."""

    def __init__(self, simulation: Simulation, forces: Sequence[Buoyancy]):
        self.simulation, self.forces = simulation, list(forces)
        self._strengths = []
        dim = simulation.domain.dim
        for force in self.forces:
            if simulation.chemistry is None or force.species not in simulation.chemistry.species:
                known = simulation.chemistry.species if simulation.chemistry else {}
                raise InputError("species", force.species, f"one of {', '.join(known) or 'none'}")
            if len(force.gravity) != dim:
                raise InputError("gravity", force.gravity, f"{dim} numbers")
            strength = -force.expansion * np.array(force.gravity, dtype=float)
            self._strengths.append(simulation.device.array(strength))

    def apply(self) -> None:
        """Add all forces to the particles' accelerations."""
        self._run(add_buoyancy, DIM=self.simulation.domain.dim)

    def add_wall_heads(self) -> None:
        """Add what the forces weigh to the pressure of walls."""
        simulation = self.simulation
        options = {"DIM": simulation.domain.dim, "KERNEL": kernel_code(simulation.scheme.kernel)}
        self._run(add_wall_head, **options)

    def _run(self, loop: Any, **constants: Any) -> None:
        simulation = self.simulation
        chemistry, particles = simulation.chemistry, simulation.particles
        for force, strength in zip(self.forces, self._strengths, strict=True):
            assert chemistry is not None
            whole = chemistry.species[force.species].molecules
            values = {
                **simulation.neighbours.fields,
                **particles.fields,
                "content": particles["count" if whole else "amount"],
                "s": chemistry.column(force.species),
                "scale": 1.0 / (simulation.depth_factor * AVOGADRO) if whole else 1.0,
                "reference": force.reference,
                "strength": strength,
            }
            run = loop.specialise(simulation.device.backend, **constants)
            run(len(particles), *(values[name] for name in loop.arguments))


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
        names = ["x", "v", "density", "a"]
        names += [name for name in ("amount", "count") if name in particles]
        for name in names:
            values = particles.host(name)
            bad = ~np.isfinite(values) if values.dtype.kind == "f" else values < 0
            if bad.any():
                row = int(np.argwhere(bad)[0][0])
                what = "not finite" if values.dtype.kind == "f" else "negative"
                self._fail(f"a value is {what}", name, row)
        self._check_places()

    def _check_places(self) -> None:
        simulation = self.simulation
        domain, particles = simulation.domain, simulation.particles
        bounded = ~domain.periodic
        if not bounded.any() or simulation.static:
            return
        x = particles.host("x")[:, bounded]
        h = particles.host("support")[:, None]
        lost = (x < domain.lower[bounded] - h) | (x > domain.upper[bounded] + h)
        lost = lost.any(axis=1) & (particles.host("is_wall") == 0)
        if lost.any():
            self._fail("a particle has left the domain", "position", int(np.flatnonzero(lost)[0]))

    def _fail(self, message: str, field: str, row: int) -> None:
        s = self.simulation
        particle = int(s.particles.host("id")[row])
        raise RunError(message, step=s.step, time=s.time, field=field, particle=particle)

    def _masses(self) -> np.ndarray:
        p = self.simulation.particles
        mobile = p.host("is_wall") == 0
        return np.where(mobile, p.host("mass").astype(float), 0.0) * self.simulation.depth_factor

    def momentum(self) -> np.ndarray:
        """Σ m v of the mobile particles in kg m/s, shape (D,)."""
        v = self.simulation.particles.host("v").astype(float)
        return (self._masses()[:, None] * v).sum(axis=0)

    def absolute_momentum(self) -> float:
        """Σ m |v| of the mobile particles in kg m/s."""
        v = self.simulation.particles.host("v").astype(float)
        return float((self._masses() * np.linalg.norm(v, axis=1)).sum())

    def kinetic_energy(self) -> float:
        """½ Σ m v² of the mobile particles in J."""
        v = self.simulation.particles.host("v").astype(float)
        return float(0.5 * (self._masses() * (v**2).sum(axis=1)).sum())

    def largest_speed(self) -> float:
        """Largest |v| in m/s."""
        v = self.simulation.particles.host("v").astype(float)
        return float(np.sqrt((v**2).sum(axis=1).max(initial=0.0)))
