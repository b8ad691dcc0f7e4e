r"""Walls that move as rigid bodies.

A wall particle with the initial position :math:`X` is at

.. math:: x(t) = c + s(t) + R(\theta(t))\,(X - c),

with the displacement *s*, the angle θ about the centre *c* (about an axis through it in 3D), and
the rotation *R*: a function of time, not integrated, so that bodies keep their shape for ever. What
the fluid sees of it is the motion of the surface point nearest to the particle,
:math:`r = x + d\,n - c - s`,

.. math:: v = \dot s + \omega\times r, \qquad
          a = \ddot s + \dot\omega\times r + \omega\times(\omega\times r),

the velocity for no slip, the acceleration for the pressure of walls and for the bounce-back.
Normals turn with the body. (The particles' own velocities are lower inside a turning body, and
taken as the wall's they would be of first order: −2.9 % at a radius of 20 spacings.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from particell.checks import checked
from particell.compute.loop import particle_loop
from particell.errors import InputError

#: Displacements and angles given as functions are differentiated with this part of a time step.
DIFFERENCE = 0.25


@checked
@dataclass(frozen=True)
class WallMotion:
    """The motion of a wall as a rigid body; at t = 0 it is where its phase says.

    Parameters
    ----------
    group
        Name of the wall's phase.
    velocity
        Constant velocity of the centre in m/s, one number per dimension.
    angular_velocity
        In rad/s, about the centre; anticlockwise in 2D, about ``axis`` in 3D.
    centre
        The point about which it turns, in m.
    axis
        Direction of the axis in 3D; need not have unit length.
    displacement
        A function of time (s) that returns a displacement (D,) in m, added to that by
        ``velocity``; its value at t = 0 is subtracted. Smooth, since accelerations are taken.
    angle
        A function of time that returns an angle in rad, likewise.

    Raises
    ------
    InputError
        Where numbers do not fit.
    """

    group: str
    velocity: tuple[float, ...] | None = None
    angular_velocity: float = 0.0
    centre: tuple[float, ...] | None = None
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    displacement: Callable[[float], np.ndarray] | None = None
    angle: Callable[[float], float] | None = None

    def __post_init__(self) -> None:
        if not np.isfinite(self.angular_velocity):
            raise InputError("angular_velocity", self.angular_velocity, "finite")
        if not np.linalg.norm(self.axis) > 0:
            raise InputError("axis", self.axis, "different from zero")
        if self.turns and self.centre is None:
            raise InputError("centre", None, "given for a wall that turns")

    @property
    def turns(self) -> bool:
        """Whether the angle changes."""
        return self.angular_velocity != 0 or self.angle is not None

    def check(self, dim: int) -> None:
        """Refuse vectors of the wrong length, and a rotation in one dimension."""
        for name in ("velocity", "centre"):
            value = getattr(self, name)
            if value is not None and np.shape(value) != (dim,):
                raise InputError(f"{name} of '{self.group}'", value, f"{dim} numbers")
        if self.turns and dim == 1:
            raise InputError(f"angular_velocity of '{self.group}'", self.turns, "zero in 1D")
        if self.displacement is not None and np.shape(self.displacement(0.0)) != (dim,):
            shape = np.shape(self.displacement(0.0))
            raise InputError(f"displacement of '{self.group}'", shape, f"of shape ({dim},)")

    def constant_speed(self, points: np.ndarray) -> float:
        """Largest speed in m/s that the constant velocities give to points (n, D)."""
        speed = 0.0 if self.velocity is None else float(np.linalg.norm(self.velocity))
        if self.angular_velocity and len(points):
            arms = np.linalg.norm(points - np.asarray(self.centre, dtype=float), axis=1)
            speed += abs(self.angular_velocity) * float(arms.max())
        return speed

    def place(self, time: float, dim: int) -> tuple[np.ndarray, float]:
        """Displacement (D,) in m and angle in rad since t = 0."""
        moved = np.zeros(dim)
        if self.velocity is not None:
            moved += np.asarray(self.velocity, dtype=float) * time
        if self.displacement is not None:
            moved += np.asarray(self.displacement(time)) - np.asarray(self.displacement(0.0))
        angle = self.angular_velocity * time
        if self.angle is not None:
            angle += self.angle(time) - self.angle(0.0)
        return moved, angle

    def state(self, time: float, dt: float, dim: int) -> dict[str, np.ndarray]:
        """Where the body is and how it moves; derivatives of functions by central differences.

        Returns
        -------
        dict
            ``displacement``, ``body_velocity``, ``body_acceleration`` (D,); ``rotation`` (D²),
            row by row; ``spin`` and ``spin_rate`` (3,), ω and its rate as vectors.
        """
        moved, angle = self.place(time, dim)
        velocity = np.zeros(dim) if self.velocity is None else np.array(self.velocity, dtype=float)
        acceleration, rate, change = np.zeros(dim), self.angular_velocity, 0.0
        if self.displacement is not None or self.angle is not None:
            e = DIFFERENCE * dt
            (before, angle_before), (after, angle_after) = (
                self.place(time - e, dim),
                self.place(time + e, dim),
            )
            if self.displacement is not None:
                velocity = (after - before) / (2 * e)
                acceleration = (after - 2 * moved + before) / e**2
            if self.angle is not None:
                rate = (angle_after - angle_before) / (2 * e)
                change = (angle_after - 2 * angle + angle_before) / e**2
        axis = np.array(self.axis if dim == 3 else (0.0, 0.0, 1.0), dtype=float)
        axis /= np.linalg.norm(axis)
        return {
            "displacement": moved,
            "body_velocity": velocity,
            "body_acceleration": acceleration,
            "rotation": rotation_matrix(axis, angle)[:dim, :dim].ravel(),
            "spin": rate * axis,
            "spin_rate": change * axis,
        }


def rotation_matrix(axis: np.ndarray, angle: float) -> np.ndarray:
    """The rotation (3, 3) by an angle in rad about a unit vector (Rodrigues' formula)."""
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


@particle_loop
def place_walls(
    i,
    x,
    v,
    group,
    is_wall,
    image,
    body_point,
    body_normal,
    wall_normal,
    wall_depth,
    wall_acceleration,
    moves,
    centre,
    displacement,
    body_velocity,
    body_acceleration,
    rotation,
    spin,
    spin_rate,
    period,
    *,
    DIM,
):
    """Position, normal, velocity and acceleration of wall particle i of a body that moves."""
    g = group[i]
    if is_wall[i] == 0 or moves[g] == 0:
        return
    rx, ry, rz = 0.0, 0.0, 0.0
    for d in range(DIM):
        arm, normal = 0.0, 0.0
        for c in range(DIM):
            turn = rotation[g, d * DIM + c]
            arm += turn * (body_point[i, c] - centre[g, c])
            normal += turn * body_normal[i, c]
        wall_normal[i, d] = normal
        x[i, d] = centre[g, d] + displacement[g, d] + arm - image[i, d] * period[d]
        arm += wall_depth[i] * normal
        if d == 0:
            rx = arm
        elif d == 1:
            ry = arm
        else:
            rz = arm
    wx, wy, wz = spin[g, 0], spin[g, 1], spin[g, 2]
    bx, by, bz = spin_rate[g, 0], spin_rate[g, 1], spin_rate[g, 2]
    ux, uy, uz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
    v[i, 0] = body_velocity[g, 0] + ux
    wall_acceleration[i, 0] = body_acceleration[g, 0] + by * rz - bz * ry + wy * uz - wz * uy
    if DIM > 1:
        v[i, 1] = body_velocity[g, 1] + uy
        wall_acceleration[i, 1] = body_acceleration[g, 1] + bz * rx - bx * rz + wz * ux - wx * uz
    if DIM > 2:
        v[i, 2] = body_velocity[g, 2] + uz
        wall_acceleration[i, 2] = body_acceleration[g, 2] + bx * ry - by * rx + wx * uy - wy * ux
