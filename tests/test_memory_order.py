"""Results depend on the state, not on where particles lie in memory nor on what was before."""

from __future__ import annotations

import numpy as np
import pytest

from particell.boundaries.mean_velocity import MeanVelocity
from particell.boundaries.mirror import Mirror
from particell.boundaries.sponge import Sponge
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace
from particell.laws.buoyancy import Buoyancy
from particell.phases import Phase, box_walls, channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import UNIT_TEMPERATURE, unit_fluid

HOT = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
SPECIES = [
    Species("dye", diffusivity=1.0),
    Species("few", diffusivity=1.0, molecules=True),
    Species("many", diffusivity=2.0, molecules=True),
]


def stirred(points):
    """A velocity that mixes particles, so that lists are built again."""
    v = np.zeros_like(points)
    v[:, 0] = 3.0 * np.sin(points[:, 1])
    return v


def jittered(domain, material):
    inside = fluid(domain, material, 1.0)
    noise = np.random.default_rng(5).uniform(-0.1, 0.1, inside.points.shape)
    return Phase("fluid", material, inside.points + noise, 1.0, velocity=stirred)


def noisy(sides):
    """SDPD with noise, walls, a sponge, and (in 2D) species of both kinds that react."""
    flat = len(sides) == 2
    domain = Domain((0,) * len(sides), sides, periodic="xz"[: len(sides) - 1], depth=1.0)
    target = lambda x: np.eye(len(sides))[0] * np.sin(x)  # noqa: E731
    return Simulation(
        domain,
        [jittered(domain, HOT), *channel_walls(domain, HOT, 1.0, axis=1)],
        SDPD(fluctuations=True, density="summation"),
        SPECIES if flat else (),
        [Reaction("few <-> many", 0.5, 0.5), Reaction("dye -> few", 1e-23)] if flat else (),
        [
            Sponge(1.0, 4.0, 0.5, target, {"dye": 2.0, "many": 1e-22} if flat else {}),
            MeanVelocity(0.5, axis=0),
        ],
        seed=3,
    )


def transported(sides):
    """Transport velocity in a closed box, whose volume is kept.

    Species are carried, and one is heavy.
    """
    domain = Domain((0,) * len(sides), sides, depth=1.0)
    return Simulation(
        domain,
        [jittered(domain, unit_fluid()), *box_walls(domain, unit_fluid(), 1.0)],
        TransportVelocity(),
        SPECIES,
        forces=[Buoyancy("dye", 0.1, (0.0, -1.0))],
        seed=3,
    )


def mirrored(sides):
    """A fluid in a corner of two mirrors, one that slips and one that does not."""
    domain = Domain((0,) * len(sides), sides, depth=1.0)
    planes = [Mirror(HalfSpace((0, 0), (1, 0))), Mirror(HalfSpace((0, 0), (0, 1)), slip=False)]
    return Simulation(
        domain, jittered(domain, unit_fluid()), SDPD(), SPECIES, boundaries=planes, seed=3
    )


def fill(simulation):
    """Molecules and concentrations, by id."""
    chemistry = simulation.chemistry
    if chemistry is None:
        return
    number = simulation.particles.n
    random = np.random.default_rng(8)
    fluid_ids = simulation.particles.by_id("is_wall") == 0
    for name, largest in (("few", 3), ("many", 4000)):
        given = random.integers(0, largest, number)[fluid_ids]
        chemistry.set_count(name, given, group="fluid", by_id=True)
    chemistry.set_concentration("dye", random.uniform(0, 1, number)[fluid_ids], "fluid", by_id=True)


@pytest.mark.parametrize(
    ("make", "sides"),
    [(noisy, (9, 8)), (noisy, (8, 6, 8)), (transported, (8, 8)), (mirrored, (8, 8))],
)
def test_same_bits_for_any_order_in_memory(make, sides):
    one, two = make(sides), make(sides)
    n = one.particles.n
    order = np.random.default_rng(1).permutation(n)
    two.particles.permute(order)
    for simulation in (one, two):
        fill(simulation)
        simulation.advance(8)
    two.particles.permute(order)
    for simulation in (one, two):
        simulation.neighbours.build(simulation.particles)
        simulation.advance(8)
    assert one.neighbours.builds > 2
    assert one.chemistry is None or one.chemistry.jumps > 0
    differ = [f for f in one.particles if _bits(one, f) != _bits(two, f)]
    assert differ == []


def _bits(simulation, field):
    return simulation.particles.by_id(field).tobytes()
