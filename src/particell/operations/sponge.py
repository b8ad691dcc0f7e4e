"""Sponges: velocities and species are brought to targets in parts of the space.

Targets are functions of position. They are evaluated anew as soon as a particle has moved by
:data:`TARGET_MOTION` of its support since; whether it is in a sponge, and how far, follows from its
place at the moment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from particell.boundaries.sponge import Sponge, relax_velocity, share_of_target, way_since
from particell.chemistry.engine import Chemistry
from particell.errors import InputError, unknown_name
from particell.fields import LOCAL, Field
from particell.operations.operation import Operation, When
from particell.state import State

#: Targets are evaluated again where a particle has moved by this part of its support.
TARGET_MOTION = 0.1


class RelaxInSponges(Operation):
    """All sponges of a simulation.

    Parameters
    ----------
    sponges
        The descriptions.
    chemistry
        The species, if any.
    dim, at_rest
        The number of dimensions; whether particles never move.

    Raises
    ------
    InputError
        For axes and species that there are not.
    """

    def __init__(
        self, sponges: Sequence[Sponge], chemistry: Chemistry | None, dim: int, at_rest: bool
    ):
        known = chemistry.species if chemistry else {}
        for sponge in sponges:
            if sponge.axis >= dim:
                raise InputError("axis of Sponge", sponge.axis, f"from 0 to {dim - 1}")
            for name in sponge.species:
                if name not in known:
                    raise unknown_name("species of Sponge", name, known)
        self.sponges, self.chemistry = list(sponges), chemistry
        given = [t for s in self.sponges for t in (s.velocity, *s.species.values())]
        self._follows = any(map(callable, given)) and not at_rest
        self.fields = tuple(self._declared(dim))
        self._seen = -1

    def _declared(self, dim: int) -> list[Field]:
        found = [Field("sponge_share", role=LOCAL)]
        for k, sponge in enumerate(self.sponges):
            if sponge.velocity is not None:
                found.append(Field(f"sponge_velocity_{k}", components=dim, role=LOCAL))
            found += [Field(f"sponge_{name}_{k}", role=LOCAL) for name in sponge.species]
        if self._follows:
            found.append(Field("sponge_x", components=dim, role=LOCAL))
        return found

    def acts(self) -> Mapping[When, Callable[[State], None]]:
        """Targets at the start, velocities at the end of a step, species after theirs."""
        found = {When.BEGUN: self.renew, When.END: self.relax_velocities}
        if self.chemistry and any(s.species for s in self.sponges):
            found[When.DONE] = self.relax_species
        return found

    def attach(self, state: State) -> None:
        """Bind the loops."""
        self._neighbours = state.neighbours
        dim, self._relaxations, self._shares = state.dim, [], []
        if self._follows:
            self._way = state.device.zeros(state.n, np.float64)
            self._measure_way = state.bind(way_since, {"way": self._way}, DIM=dim)
        for k, sponge in enumerate(self.sponges):
            window = sponge.window(state.domain)
            zone: dict[str, Any] = {
                "start": sponge.start,
                "end": sponge.end,
                "exponent": float(sponge.exponent),
                **dict(zip(("origin", "edge", "inverse_edge"), window, strict=True)),
            }
            self._shares.append(state.bind(share_of_target, zone, AXIS=sponge.axis))
            if sponge.velocity is not None:
                zone["target"] = state.particles[f"sponge_velocity_{k}"]
                relax = state.bind(relax_velocity, zone, DIM=dim, AXIS=sponge.axis)
                self._relaxations.append((relax, sponge.time))

    def renew(self, state: State) -> None:
        """Evaluate the targets at the particles' positions."""
        particles, domain = state.particles, state.domain
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
        self._seen = state.neighbours.builds

    def relax_velocities(self, state: State) -> None:
        """Bring velocities towards their targets."""
        if self._seen != state.neighbours.builds or self._moved_on(state):
            self.renew(state)
        for relax, time in self._relaxations:
            relax(state.n, state.dt / time)

    def _moved_on(self, state: State) -> bool:
        """Whether a particle has moved by :data:`TARGET_MOTION` since targets were evaluated."""
        if not self._follows:
            return False
        self._measure_way(state.n)
        return state.reduce.max(self._way) > TARGET_MOTION**2

    def relax_species(self, state: State) -> None:
        """Bring species towards their targets; what they gain is booked."""
        clock, particles = state.clock, state.particles
        if clock.step % clock.species_every or self.chemistry is None:
            return
        tau = clock.species_every * clock.dt
        for k, (sponge, share) in enumerate(zip(self.sponges, self._shares, strict=True)):
            if not sponge.species:
                continue
            share(state.n, tau / sponge.time)
            for name in sponge.species:
                target = particles[f"sponge_{name}_{k}"]
                self.chemistry.relax(name, particles["sponge_share"], target, clock.step, which=k)

    def saved(self) -> dict[str, Any]:
        """The list that the targets belong to; they themselves are fields."""
        return {"seen": self._seen}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """See :meth:`.Operation.restore`."""
        self._seen = saved["seen"]


def _target(within: np.ndarray, name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A target as an array of a shape; refused where it is none, or not finite in the sponge."""
    try:
        found = np.broadcast_to(np.asarray(values, dtype=float), shape)
    except (TypeError, ValueError):
        found = np.full(shape, np.nan)
    if not np.all(np.isfinite(found[within])):
        raise InputError(f"{name} of Sponge", values, f"finite numbers of shape {shape}")
    return found
