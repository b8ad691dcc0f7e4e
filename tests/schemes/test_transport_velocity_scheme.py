"""The transport-velocity scheme as a whole: what stays uniform, what is conserved, time steps."""

from __future__ import annotations

import numpy as np
import pytest

from particell.chemistry.species import Species
from particell.compute.threads import kept_threads, set_threads
from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.phases import channel_walls, fluid
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import (
    densities,
    filter_density,
    fluid_rows,
    resting_poiseuille_error,
    same_bits,
    transported_lattice,
    unit_fluid,
    vortices,
)


@pytest.mark.parametrize("dim", [2, 3])
def test_uniform_velocity_stays_uniform(dim):
    """To round-off, while the shift orders scattered particles; pressure is switched off."""
    simulation = transported_lattice(
        dim, 8, jitter=0.2, velocity=(0.5,) * dim, material=unit_fluid(sound_speed=1e-9), dt=0.01
    )
    simulation.solver.flow.constants["shift_sound"][...] = 0.01 / 2.6  # τ is the step
    simulation.solver.flow.constants["shift_pressure"][...] = 100.0
    simulation.start()
    before = simulation.particles.by_id("x").copy()
    simulation.advance(100)
    p = simulation.particles
    moved = p.by_id("x") + 8.0 * p.by_id("image") - before - 0.5 * simulation.time
    assert np.abs(moved).max() > 0.05
    assert p.host("v") == pytest.approx(0.5, abs=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
def test_momentum_density_and_amounts_in_a_flow(dim):
    """With Adami's form momentum is conserved, with the uniform one its drift is bounded.

    Volumes stay the domain's, the mean density drifts by less than 0.5 %, amounts are conserved to
    round-off.
    """
    side = 32 if dim == 2 else 20
    for form, limit in (("conserving", 1e-12), ("uniform", 2e-3)):
        simulation = transported_lattice(
            dim,
            side,
            velocity=vortices(side),
            species=[Species("C", 0.05)],
            momentum_flux=form,
        )
        simulation.chemistry.set_concentration("C", lambda x: 1.0 + (x[:, 0] < side / 2))
        simulation.start()
        total = simulation.chemistry.totals()["C"][0]
        simulation.advance(round(0.7 * side / simulation.dt))
        assert simulation.conservation()["momentum"] < limit, form
        assert simulation.chemistry.totals()["C"][0] == pytest.approx(total, rel=1e-12)
        assert simulation.particles.host("density").mean() == pytest.approx(1.0, abs=5e-3)


def test_filter_keeps_uniform_density_and_removes_noise():
    simulation = transported_lattice(2, 10, jitter=0.3)
    simulation.start()
    p = simulation.particles
    p.set("density", np.full(len(p), 1.02))
    densities(simulation)
    filter_density(simulation)
    assert p.host("density") == pytest.approx(1.02, rel=1e-14)
    rough = 1 + 0.01 * np.random.default_rng(6).normal(size=len(p))
    p.set("density", rough)
    densities(simulation)
    filter_density(simulation)
    assert p.host("density").std() < 0.5 * rough.std()


def poiseuille(y, t, force=0.8, viscosity=0.1):
    """Velocity between plates at 0 and 1 after a start from rest."""
    u = force * y * (1 - y) / (2 * viscosity)
    for k in range(1, 120, 2):
        decay = np.exp(-((k * np.pi) ** 2) * viscosity * t)
        u -= 4 * force / (viscosity * np.pi**3 * k**3) * np.sin(k * np.pi * y) * decay
    return u


def test_flow_between_plates_starts_as_the_series_says():
    """20 particles across, Re = 10: L2 error of the velocity over the largest one."""
    domain = Domain((0, 0), (0.6, 1), periodic="x")
    material = unit_fluid(exponent=1.0)
    walls = channel_walls(domain, material, 0.05, axis=1)
    scheme = TransportVelocity(gravity=(0.8, 0.0), reference_speed=1.0)
    simulation = Simulation(domain, [fluid(domain, material, 0.05), *walls], scheme)
    p = simulation.particles
    for time in (0.25, 0.5, 3.0):
        simulation.advance(round((time - simulation.time) / simulation.dt))
        rows = fluid_rows(simulation)
        expected = poiseuille(p.host("x")[rows, 1], simulation.time)
        error = p.host("v")[rows, 0] - expected
        assert np.sqrt(np.mean(error**2)) < 6e-3
    assert simulation.conservation()["inside walls"] == 0


@pytest.mark.parametrize("surface", [True, False])
@pytest.mark.parametrize(
    ("support", "kernel"), [(2.6, "lucy"), (3.0, "lucy"), (3.0, "wendland-c2")]
)
def test_normalised_viscosity_is_exact_between_plates(support, kernel, surface):
    """Whatever the kernel; where distances are measured, to their accuracy. The plain sum has a
    floor."""
    errors = {}
    for normalise in (True, False):
        scheme = TransportVelocity(kernel, support, normalise_viscosity=normalise)
        errors[normalise] = [resting_poiseuille_error(scheme, ny, surface) for ny in (20, 40, 80)]
    good = errors[True]
    if surface:
        assert max(good) < 1e-12
    else:
        assert good[0] < 5e-4 and np.log2(good[0] / good[2]) > 1.9
    assert min(errors[False]) > 3 * max(good)


def test_a_restart_gives_the_same_bits():
    one, two = (transported_lattice(2, 12, jitter=0.1, velocity=vortices(12)) for _ in range(2))
    one.advance(30)
    two.advance(17)
    three = transported_lattice(2, 12, jitter=0.1, velocity=vortices(12))
    three.restore(two.state())
    three.advance(13)
    assert same_bits(one, three) == []


@pytest.mark.usefixtures("always_shared")
def test_one_and_two_threads_give_the_same_bits():
    """Thirty steps of vortices among scattered particles, shared out from the first one on."""
    runs = []
    with kept_threads():
        for threads in (1, 2):
            set_threads(threads)
            runs.append(transported_lattice(2, 12, jitter=0.1, velocity=vortices(12)))
            runs[-1].advance(30)
    assert same_bits(*runs) == []
    assert runs[0].neighbours.builds > 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("support", 1.0),
        ("background", 0.0),
        ("momentum_flux", "both"),
        ("filter_every", -1),
        ("filter_every", 1.5),
        ("density_diffusion", -0.1),
        ("density_diffusion", 0.3),
        ("skin", 0.0),
        ("kernel", "gauss"),
    ],
)
def test_wrong_values_are_refused(name, value):
    with pytest.raises(InputError, match=name):
        TransportVelocity(**{name: value})


def test_bulk_viscosity_is_refused():
    with pytest.raises(InputError, match="bulk_viscosity"):
        transported_lattice(2, material=unit_fluid(bulk_viscosity=0.1))
