r"""Mirrors: planes of symmetry, and walls without particles.

Near a mirror each fluid particle is seen once more, where it would be behind the plane
(:mod:`particell.sources.images`): sums over neighbours are those of the whole that is symmetric
about the plane, to round-off. With ``slip`` velocities are mirrored too: half a channel is the
whole channel. Without it the velocity of an image is :math:`2v_w - v`, so that the fluid at the
plane has the plane's velocity: a wall that needs no particles, and exact for shear flows. What
crosses the plane is put back as by a :class:`~particell.boundaries.reflection.Reflection`.

To species a mirror is an end that nothing crosses: molecules and concentrations stay on their side,
and :mod:`particell.laws.carriers` makes a closed end second order, here as anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from particell.boundaries.moving import WallMotion
from particell.boundaries.reflection import Reflection
from particell.checks import checked
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace
from particell.laws.buoyancy import Buoyancy
from particell.phases import Phase
from particell.sources.images import ANGLE, Plane, chains

#: Particles nearer than this part of their size to a mirror are on it: their images never part
#: from them.
ON_IT = 1e-6
#: What a component along a normal may be off zero by round-off, as a part of the whole.
ROUND_OFF = 1e-9


@checked
@dataclass(frozen=True)
class Mirror:
    """A plane of symmetry, or with ``slip=False`` a plane that fluid sticks to.

    For flows without noise. Several are at right angles to each other (edges, corners), or parallel
    and a support apart; walls are further away than the support.

    Parameters
    ----------
    body
        What is behind the plane, without any particles: a :class:`HalfSpace`, whose normal points
        into the fluid.
    slip
        Whether fluid slips along the plane: symmetry. Otherwise it has the plane's velocity there.
    velocity
        Of the plane along itself, in m/s, one number per dimension; for planes without slip.
    """

    body: HalfSpace
    slip: bool = True
    velocity: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.velocity is None:
            return
        if self.slip:
            raise InputError("velocity", self.velocity, "None for a Mirror with slip")
        normal, velocity = self.body.direction, np.asarray(self.velocity, float)
        if velocity.shape != normal.shape:
            raise InputError("velocity", self.velocity, f"{len(normal)} numbers")
        if abs(velocity @ normal) > ROUND_OFF * np.linalg.norm(velocity):
            raise InputError("velocity", self.velocity, "along the plane of the Mirror")

    @property
    def speed(self) -> float:
        """|velocity| in m/s."""
        return 0.0 if self.velocity is None else math.hypot(*self.velocity)

    def plane(self, name: str) -> Plane:
        """The plane that images are made by."""
        point, direction = (tuple(a.tolist()) for a in (self.body.point, self.body.direction))
        return Plane(name, point, direction, self.slip, tuple(self.velocity or ()))

    def reflection(self) -> Reflection:
        """What keeps particles on their side."""
        return Reflection(self.body)


def mirrors_of(
    domain: Domain,
    phases: Sequence[Phase],
    scheme: Any,
    boundaries: Sequence[Any],
    forces: Sequence[Any] = (),
) -> tuple[Plane, ...]:
    """The planes of all mirrors of a description.

    Raises
    ------
    InputError
        For what has no symmetric whole, or no images.
    """
    mirrors = [b for b in boundaries if isinstance(b, Mirror)]
    if not mirrors:
        return ()
    for name, wrong, allowed in _unfit_schemes(scheme):
        if wrong:
            raise InputError(name, wrong, f"{allowed} with a Mirror")
    planes = tuple(m.plane(f"mirror_{k}") for k, m in enumerate(mirrors))
    reach = scheme.support * max((p.particle_spacing for p in phases), default=0.0)
    for mirror, plane in zip(mirrors, planes, strict=True):
        _check_axes(domain, scheme, forces, mirror.body, plane)
        _check_particles(domain, phases, mirror.body, reach)
        for motion in boundaries:
            if isinstance(motion, WallMotion):
                _check_motion(phases, motion, mirror.body, reach)
    chains(planes, reach)
    return planes


def _unfit_schemes(scheme: Any) -> Iterator[tuple[str, Any, str]]:
    """Options, their values, and what is allowed in place of those that are not false."""
    yield "scheme", "Static" if scheme.at_rest else "", "one that moves particles"
    if not scheme.at_rest:  # whose thermal numbers would have to be mirrored as well
        yield "fluctuations", scheme.fluctuations, "False"
        yield "species_flux", scheme.species_flux, "False"


def _check_axes(
    domain: Domain, scheme: Any, forces: Sequence[Any], body: HalfSpace, plane: Plane
) -> None:
    """Refuse planes of another dimension, across a period, or that a constant force crosses."""
    normal = np.array(plane.direction)
    if len(normal) != domain.dim:
        raise InputError("body of Mirror", body, f"in {domain.dim} dimensions")
    if np.any(np.abs(normal[domain.periodic]) > ANGLE):
        raise InputError("body of Mirror", body, "without a normal along a periodic axis")
    carried = [f.gravity for f in forces if isinstance(f, Buoyancy)]
    for gravity in (scheme.gravity, *carried):
        if gravity is None or np.shape(gravity) != normal.shape:
            continue
        force = np.asarray(gravity, float)
        if abs(force @ normal) > ROUND_OFF * np.linalg.norm(force):
            raise InputError("gravity", gravity, "along the plane of a Mirror")


def _check_particles(
    domain: Domain, phases: Sequence[Phase], body: HalfSpace, reach: float
) -> None:
    """Refuse fluid behind the plane or on it, and walls within a support of it."""
    for phase in phases:
        if not len(phase.points) or phase.dim != domain.dim:  # the latter is refused elsewhere
            continue
        distance = body.signed_distance(phase.points)
        first = int(np.argmin(distance))
        place = phase.points[first].tolist()
        if phase.kind == "wall":
            if distance[first] < reach:
                allowed = f"further than the support ({reach:g} m) from a Mirror, on its side"
                raise InputError(f"points of '{phase.name}'", place, allowed)
        elif distance[first] < ON_IT * phase.particle_spacing:
            allowed = f"in front of the Mirror of {body}"
            raise InputError(f"points of '{phase.name}'", place, allowed)


def _check_motion(
    phases: Sequence[Phase], motion: WallMotion, body: HalfSpace, reach: float
) -> None:
    """Refuse motions by which a wall may come within a support of the plane."""
    far = math.inf
    for phase in phases:
        if phase.name == motion.group and motion.turns and len(phase.points):
            centre = np.asarray(motion.centre, float)
            arm = float(np.linalg.norm(phase.points - centre, axis=1).max())
            far = float(body.signed_distance(centre[None])[0]) - arm
    towards = motion.velocity is not None and body.direction @ np.asarray(motion.velocity) < 0
    if towards or motion.displacement is not None or far < reach:
        allowed = f"a motion that stays further than the support ({reach:g} m) from a Mirror"
        raise InputError(f"WallMotion of '{motion.group}'", motion.velocity, allowed)
