"""Phases: named sets of particles that share a material and a role, as the user describes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from particell.checks import checked, positive
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.geometry.fill import fitting_spacing, lattice
from particell.geometry.shapes import HalfSpace, Shape
from particell.materials import Fluid
from particell.particles import KINDS
from particell.representation import block, table

Velocity = Callable[[np.ndarray], np.ndarray] | np.ndarray | tuple[float, ...] | None


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Phase:
    """Particles of one material and one role.

    Parameters
    ----------
    name
        Name of the group they form.
    material
        A :class:`~particell.materials.Fluid`; walls carry the density of the fluid they bound.
    points
        Positions (n, D) in m.
    volume
        Volume of a particle, or of each (n,), in m^D.
    kind
        ``"fluid"`` or ``"wall"``.
    velocity
        Initial velocity in m/s: a function of points (n, D) that returns (n, D), an array, D
        numbers, or None for rest. Walls keep it.
    spacing
        Distance of neighbours in m, which sets the support; by default volume^(1/D) (the mean).
    surface
        The solid region that a wall's particles fill; its surface is where the fluid begins.
    slides
        A wall whose velocity is that of its surface along itself, and whose particles keep their
        places: the lid of a cavity, a turning cylinder. Other walls are moved by their velocity.

    Raises
    ------
    InputError
        Where shapes or numbers do not fit.
    """

    name: str
    material: Fluid
    points: np.ndarray
    volume: float | np.ndarray
    kind: str = "fluid"
    velocity: Velocity = None
    spacing: float | None = None
    surface: Shape | None = None
    slides: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("kind", self.kind, f"one of {', '.join(KINDS)}")
        if self.slides and self.kind != "wall":
            raise InputError(f"slides of '{self.name}'", True, "False for what is no wall")
        points = np.asarray(self.points, dtype=float)
        if points.ndim != 2 or not 1 <= points.shape[1] <= 3:
            raise InputError(f"points of '{self.name}'", points.shape, "an array of shape (n, D)")
        if not np.all(np.isfinite(points)):
            raise InputError(f"points of '{self.name}'", "nan or inf", "finite")
        if self.spacing is not None:
            positive(f"spacing of '{self.name}'", self.spacing)
        volume = np.asarray(self.volume, dtype=float)
        if volume.shape not in ((), (len(points),)):
            raise InputError(f"volume of '{self.name}'", volume.shape, f"of shape ({len(points)},)")
        volume = np.broadcast_to(volume, (len(points),))
        if np.any(~((volume > 0) & (volume < np.inf))):
            raise InputError(f"volume of '{self.name}'", float(volume.min()), "positive")
        self._check_surface(points.shape[1])
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "volume", volume)
        if not callable(self.velocity):
            self.velocities()

    def _check_surface(self, dim: int) -> None:
        if self.surface is None:
            return
        try:
            self.surface.signed_distance(np.zeros((1, dim)))
        except ValueError:
            allowed = f"a shape in {dim} dimensions"
            raise InputError(f"surface of '{self.name}'", self.surface, allowed) from None

    def __repr__(self) -> str:
        return (
            f"Phase({self.name!r}, {self.material!r}, {len(self.points)} points in {self.dim}D, "
            f"kind={self.kind!r}, spacing={self.particle_spacing:.4g} m)"
        )

    def _repr_html_(self) -> str:
        return block(f"Phase {self.name}", phase_table([self]))

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return self.points.shape[1]

    @property
    def particle_spacing(self) -> float:
        """Distance of neighbours in m."""
        if self.spacing is not None:
            return self.spacing
        return float(np.mean(self.volume)) ** (1 / self.dim)

    def velocities(self) -> np.ndarray:
        """Initial velocities (n, D) in m/s."""
        if self.velocity is None:
            return np.zeros_like(self.points)
        value = self.velocity(self.points) if callable(self.velocity) else self.velocity
        try:
            values = np.asarray(value, dtype=float)
            values = np.array(np.broadcast_to(values, self.points.shape))
        except (TypeError, ValueError):
            allowed = f"numbers that fit the points, of shape {self.points.shape}"
            raise InputError(f"velocity of '{self.name}'", value, allowed) from None
        if not np.all(np.isfinite(values)):
            raise InputError(f"velocity of '{self.name}'", "nan or inf", "finite")
        return values


def phase_table(phases: Iterable[Phase]) -> str:
    """Name, kind, number of particles and material of each phase, as an HTML table."""
    rows = [
        (
            p.name,
            "sliding wall" if p.slides else p.kind,
            len(p.points),
            p.particle_spacing,
            p.material.density,
            p.material.viscosity,
            p.material.temperature,
        )
        for p in phases
    ]
    columns = ("spacing [m]", "density [kg/m³]", "viscosity [Pa s]", "temperature [K]")
    return table(rows, ("phase", "kind", "particles", *columns))


@checked
def fluid(
    domain: Domain,
    material: Fluid,
    spacing: float,
    shape: Shape | None = None,
    name: str = "fluid",
    velocity: Velocity = None,
    kind: str = "square",
) -> Phase:
    """Fill a domain, or a shape in it, with fluid on a lattice.

    Parameters
    ----------
    domain, spacing, shape, kind
        See :func:`particell.geometry.fill.lattice`.
    material, name, velocity
        See :class:`Phase`.
    """
    points = lattice(domain, spacing, shape, kind)
    if len(points) == 0:
        raise InputError("spacing", spacing, "small enough for at least one particle")
    steps = fitting_spacing(domain, spacing)
    total = len(lattice(domain, spacing, None, kind))
    volume = domain.volume / total
    return Phase(name, material, points, volume, velocity=velocity, spacing=float(np.max(steps)))


@checked
def channel_walls(
    domain: Domain,
    material: Fluid,
    spacing: float,
    axis: int,
    layers: int = 3,
    name: str = "wall",
    velocity: tuple[Velocity, Velocity] = (None, None),
) -> list[Phase]:
    """The lower and upper wall across one axis, as layers of particles outside the domain.

    Parameters
    ----------
    domain, spacing
        The lattice continues that of the domain.
    axis
        The axis across the channel (0, 1, 2).
    layers
        Number of layers; three suffice for a support of up to 3 spacings.
    name
        The walls are named ``name-lower`` and ``name-upper``.
    velocity
        Velocities of the two walls.
    """
    if not 0 <= axis < domain.dim:
        raise InputError("axis", axis, f"from 0 to {domain.dim - 1}")
    positive("layers", layers)
    steps = fitting_spacing(domain, spacing)
    return [
        _plane_wall(domain, material, steps, layers, axis, side, f"{name}-{side}", velocity[k])
        for k, side in enumerate(("lower", "upper"))
    ]


@checked
def box_walls(
    domain: Domain,
    material: Fluid,
    spacing: float,
    layers: int = 3,
    name: str = "wall",
    sliding: Mapping[str, Velocity] | None = None,
) -> list[Phase]:
    """The walls on all sides of a box, as layers of particles outside the domain.

    There are none across periodic axes: a box that is periodic along one axis in 3D is a duct.

    They are named ``name-x-lower``, ``name-x-upper``, ``name-y-lower``, …, and each is a plane.
    Edges and corners belong to the wall of the last axis there that does not slide: a lid that
    went on beyond a corner would look to the fluid as if that could follow it out of the box.

    Parameters
    ----------
    domain, material, spacing, layers
        See :func:`channel_walls`.
    name
        What the walls' names begin with.
    sliding
        Velocities of walls whose surface slides along itself, by side: ``{"y-upper": (1.0, 0.0)}``.

    Raises
    ------
    InputError
        Where there is no such side.
    """
    positive("layers", layers)
    steps = fitting_spacing(domain, spacing)
    axes = [int(axis) for axis in np.flatnonzero(~np.asarray(domain.periodic))]
    if not axes:
        raise InputError("domain", domain, "one with an axis that is not periodic, for walls")
    sides = [(axis, side) for axis in axes for side in ("lower", "upper")]
    names = {f"{'xyz'[axis]}-{side}": (axis, side) for axis, side in sides}
    velocities: dict[tuple[int, str], Velocity] = {}
    for key, velocity in (sliding or {}).items():
        if key not in names:
            raise InputError("sliding", key, f"one of {', '.join(names)}")
        velocities[names[key]] = velocity
    walls = []
    for key, (axis, side) in names.items():
        own = (axis, side)
        beyond = [  # where this wall has the edge with another
            [
                a in axes and axis != a and (own in velocities, -axis) < ((a, s) in velocities, -a)
                for a in range(domain.dim)
            ]
            for s in ("lower", "upper")
        ]
        wall = _plane_wall(
            domain,
            material,
            steps,
            layers,
            axis,
            side,
            f"{name}-{key}",
            velocities.get(own),
            (np.array(beyond[0]), np.array(beyond[1])),
        )
        walls.append(replace(wall, slides=own in velocities))
    return walls


def _plane_wall(
    domain: Domain,
    material: Fluid,
    steps: np.ndarray,
    layers: int,
    axis: int,
    side: str,
    name: str,
    velocity: Velocity = None,
    beyond: tuple[np.ndarray, np.ndarray] | None = None,
) -> Phase:
    """Layers outside one face; they go on past other faces (lower, upper) where ``beyond``."""
    thickness = layers * steps
    lower, upper = domain.lower.copy(), domain.upper.copy()
    if beyond is not None:
        lower[beyond[0]] -= thickness[beyond[0]]
        upper[beyond[1]] += thickness[beyond[1]]
    normal = np.zeros(domain.dim)
    if side == "lower":
        corner, normal[axis] = domain.lower, 1.0
        lower[axis], upper[axis] = corner[axis] - thickness[axis], corner[axis]
    else:
        corner, normal[axis] = domain.upper, -1.0
        lower[axis], upper[axis] = corner[axis], corner[axis] + thickness[axis]
    return Phase(
        name,
        material,
        _slab(lower, upper, steps),
        float(np.prod(steps)),
        kind="wall",
        velocity=velocity,
        spacing=float(np.max(steps)),
        surface=HalfSpace(corner, normal),
    )


def _slab(lower: np.ndarray, upper: np.ndarray, steps: np.ndarray) -> np.ndarray:
    axes = [
        low + (np.arange(round((high - low) / step)) + 0.5) * step
        for low, high, step in zip(lower, upper, steps, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(lower))
