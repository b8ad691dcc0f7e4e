"""The automatic step against what is stable: the fastest growth in whole steps, as they are done.

A step is a linear map of what differs from rest by little. Applied again and again to a difference
that is scaled back each time it leaves the mode that grows fastest: the largest eigenvalue.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest

import particell as pc
from particell.geometry.fill import lattice
from systems import forces, same_bits, unit_fluid

KAPPA = 200.0
#: Of which the second half is looked at.
STEPS = 160
#: What is stable may grow as the number of steps; what is not grows by this part in each.
STABLE, UNSTABLE = 1.01, 1.1
#: What a step takes over from the one before.
STATE = ("x", "v", "a", "density", "density_rate", "flux", "shift", "shift_before")
HEAT = ("temperature", "temperature_rate")


class Conduction(pc.Law):
    """As in docs/howto/field.md."""

    def __init__(self, diffusivity=KAPPA):
        self.diffusivity = diffusivity

    def pair(self, i, j, ij):
        more = (j.temperature - i.temperature) * ij.extrapolation
        return {"temperature_rate": 2.0 * self.diffusivity * ij.weight * more}

    def largest_step(self, i):
        return 1.0 / (self.diffusivity * i.laplacian)


def growth(simulation, dt, names):
    """By what the fluid's fields ``names`` grow in a step of dt, in the mode that grows fastest."""
    simulation.start()
    p, solver = simulation.particles, simulation.solver
    names = [name for name in names if name in p]
    forces(simulation, 0, dt)
    fluid = p.host("is_wall") == 0
    before = {name: p.host(name).copy() for name in p}
    builds, clock = simulation.neighbours.builds, simulation.system.clock
    clock.dt, time = dt, clock.time

    def after(change):
        for field, values in before.items():
            p.set(field, values)
        for name, values in change.items():
            moved = before[name].copy()
            moved[fluid] += 1e-6 * values / unit(name, dt)
            p.set(name, moved)
        clock.step, clock.time, clock.now = 1, time, time
        solver.step()
        return {name: p.host(name)[fluid] * unit(name, dt) for name in names}

    random = np.random.default_rng(1)
    change = {name: random.normal(size=before[name][fluid].shape) for name in names}
    rest, factors = after({}), []
    for _ in range(STEPS):
        change = {name: (values - rest[name]) / 1e-6 for name, values in after(change).items()}
        factors.append(np.sqrt(sum((values**2).sum() for values in change.values())))
        change = {name: values / factors[-1] for name, values in change.items()}
    assert simulation.neighbours.builds == builds
    return np.exp(np.log(factors[STEPS // 2 :]).mean())


def unit(name, dt):
    """By what a field is multiplied so that all are of about one size: rates are of a step."""
    return dt if name.endswith("_rate") else dt**2 if name == "a" else dt if name == "v" else 1.0


def periodic(dim=2, side=7, jitter=0.0, scheme=pc.SDPD, fluids=None, **options):
    """Particles of volume 1 in a periodic box; of fluids that are mixed."""
    box = pc.Domain((0,) * dim, (side,) * dim, periodic="xyz"[:dim], depth=1.0)
    points = lattice(box, 1.0)
    points = (points + np.random.default_rng(5).uniform(-jitter, jitter, points.shape)) % side
    fluids = fluids or (unit_fluid(),)
    kind = np.arange(len(points)) % len(fluids)
    phases = [pc.Phase(f"f{k}", f, points[kind == k], 1.0) for k, f in enumerate(fluids)]
    return pc.Simulation(box, phases, scheme(**options))


def corner(dim=3, side=3, jitter=0.0, at=0.3, fluid=None, scheme=pc.SDPD, **options):
    """Particles between walls on all sides, one of them near to a corner."""
    box = pc.Domain((0,) * dim, (side,) * dim, depth=1.0)
    points = lattice(box, 1.0)
    points = points + np.random.default_rng(3).uniform(-jitter, jitter, points.shape)
    points[np.argmin(points.sum(axis=1))] = at
    fluid = fluid or unit_fluid()
    walls = pc.box_walls(box, fluid, 1.0, layers=3)
    return pc.Simulation(box, [pc.Phase("f", fluid, points, 1.0), *walls], scheme(**options))


def mirrored(slip, jitter=0.2, at=0.1, fluid=None, **options):
    """Particles in a corner of three mirrors in space, one of them near to all of these."""
    side = 4
    points = lattice(pc.Domain((0,) * 3, (side,) * 3, depth=1.0), 1.0)
    points = points + np.random.default_rng(3).uniform(-jitter, jitter, points.shape)
    points[np.argmin(points.sum(axis=1))] = at
    planes = [pc.Mirror(pc.HalfSpace((0,) * 3, normal), slip) for normal in np.eye(3)]
    box = pc.Domain((0,) * 3, (2 * side,) * 3, depth=1.0)
    phase = pc.Phase("f", fluid or unit_fluid(), points, 1.0)
    return pc.Simulation(box, phase, pc.SDPD(support=2.2, **options), boundaries=planes)


def two_supports(fluid=None, **options):
    """A fine half and a coarse one."""
    box = pc.Domain((0, 0), (14, 14), periodic="xy", depth=1.0)
    low, fluid = pc.Box((0, 0), (14, 6)), fluid or unit_fluid()
    phases = [pc.fluid(box, fluid, 1.0, low, name="fine")]
    phases.append(pc.fluid(box, fluid, 2.0, ~low, name="coarse"))
    return pc.Simulation(box, phases, pc.SDPD(**options))


VISCOUS = unit_fluid(viscosity=20.0)
MIXED = (unit_fluid(), unit_fluid(density=100.0, viscosity=1.0))
LATTICES = {
    "sound": lambda: periodic(),
    "viscosity, trapezoidal": lambda: periodic(fluids=(VISCOUS,), integrator="trapezoidal"),
    "sound in three dimensions": lambda: periodic(3, 5, support=2.2),
}
UNEVEN = {
    "sound, jittered": lambda: periodic(jitter=0.3),
    "viscosity, jittered": lambda: periodic(jitter=0.3, fluids=(VISCOUS,)),
    "sound, 1:100": lambda: periodic(jitter=0.2, fluids=MIXED),
    "viscosity, 2:1": lambda: two_supports(VISCOUS),
    "sound, 3D corner": lambda: corner(jitter=0.2),
    "viscosity, 3D corner": lambda: corner(fluid=VISCOUS),
    "sound, 3D corner of mirrors": lambda: mirrored(True),
    "viscosity, 3D corner of mirrors without slip": lambda: mirrored(False, at=0.3, fluid=VISCOUS),
}


@pytest.mark.parametrize("name", [*LATTICES, *UNEVEN])
def test_the_automatic_step_is_stable(name):
    simulation = {**LATTICES, **UNEVEN}[name]()
    assert simulation.timing.limited_by == name[: len(simulation.timing.limited_by)]
    assert growth(simulation, simulation.dt, STATE) < STABLE


@pytest.mark.parametrize("name", LATTICES)
def test_and_not_much_too_small(name):
    """On a lattice four times the step is unstable."""
    simulation = LATTICES[name]()
    assert growth(simulation, 4 * simulation.dt, STATE) > UNSTABLE


class Slower(Conduction):
    """A limit that depends on the field."""

    def largest_step(self, i):
        return super().largest_step(i) / (1.0 + i.temperature)


def test_a_resumed_run_has_the_same_bits():
    """The step, and how far fields are taken ahead, are those chosen for what the field was."""
    heat = {"more": [Slower(20.0)], "fields": [pc.Field("temperature")]}

    def warm():
        simulation = periodic(jitter=0.3, **heat)
        simulation.particles.set("temperature", simulation.particles.host("x")[:, 0])
        return simulation

    whole = warm()
    first = whole.dt
    whole.plan(0.5)
    assert whole.dt < 0.2 * first
    whole.advance(5)
    state = copy.deepcopy(whole.state())
    whole.advance(5)
    resumed = warm()
    resumed.restore(state)
    resumed.advance(5)
    assert same_bits(whole, resumed) == []
    assert resumed.solver.flow.law_limit == whole.solver.flow.law_limit


HEATED = {
    "quintic spline": lambda **o: periodic(kernel="quintic-spline", **o),
    "trapezoidal": lambda **o: periodic(integrator="trapezoidal", **o),
    "2:1": lambda **o: two_supports(**o),
    "jittered, transport velocity": lambda **o: periodic(
        jitter=0.3, scheme=pc.TransportVelocity, **o
    ),
    "jittered, 3D": lambda **o: periodic(3, 5, 0.3, support=2.2, **o),
    "3D corner": lambda **o: corner(3, 3, at=0.01, **o),
    "3D corner, jittered": lambda **o: corner(3, 3, 0.3, **o),
}


@pytest.mark.parametrize("name", HEATED)
def test_a_law_of_the_user_s_limits_the_step(name):
    """Conduction faster than the flow: its step is the automatic one, and is stable.

    On lattices four times that is not.
    """
    heat = {"more": [Conduction()], "fields": [pc.Field("temperature")]}
    simulation = HEATED[name](**heat)
    assert simulation.timing.limited_by == "Conduction"
    assert simulation.dt == simulation.solver.flow.law_limit
    assert growth(simulation, simulation.dt, HEAT) < STABLE
    if "jittered" not in name and "corner" not in name:
        assert growth(simulation, 4 * simulation.dt, HEAT) > UNSTABLE
