"""The flux of species by a shift: antisymmetric, exact for linear fields, uniform."""

from __future__ import annotations

import numpy as np
import pytest

from particell.chemistry.species import Species
from particell.errors import InputError
from particell.laws.species_flux import species_flux
from systems import carry_species, lattice_offsets, transported_lattice, vortices

SUPPORT = 2.6


def system(dim, side, jitter, species=None, **options):
    species = [Species("C", 0.0), Species("D", 0.1)] if species is None else species
    return transported_lattice(
        dim, side, jitter, species=species, dt=0.01, support=SUPPORT, species_flux=True, **options
    )


def test_what_leaves_one_particle_enters_the_other():
    into_i = species_flux(0.2, -0.4, 1.1, 0.9)
    into_j = species_flux(0.4, -0.2, 0.9, 1.1)
    assert into_i == pytest.approx(-(1.1 * 0.2 - 0.9 * 0.4)) and into_i == -into_j


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_linear_concentration_on_a_lattice(dim):
    """δv·∇C, up to the lattice sum T, for uniform δv; to first order in the step."""
    random = np.random.default_rng(1)
    slope, shift = 0.01 * random.normal(size=dim), random.normal(size=dim)
    simulation = system(dim, 9, 0.0, [Species("C", 0.0)], periodic=False)
    simulation.chemistry.set_concentration("C", lambda x: 2.0 + x @ slope)
    simulation.start()
    p, tau = simulation.particles, 1e-6
    p.set("transport", p.host("v") + shift)
    before = p.host("amount")[:, 0].copy()
    carry_species(simulation, 0, tau)
    gain = (p.host("amount")[:, 0] - before) / tau
    centre = np.linalg.norm(p.host("x") - 4.5, axis=1) < 0.1
    offsets, weight = lattice_offsets(dim, SUPPORT)
    tensor = np.einsum("n,na,nb->ab", weight, offsets, offsets)
    assert gain[centre][0] == pytest.approx(shift @ tensor @ slope, rel=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_uniform_stays_uniform_and_amounts_are_conserved(dim):
    """Both to round-off, in a flow whose particles the shift puts in order."""
    side = 16 if dim == 2 else 8
    simulation = system(dim, side, 0.2, velocity=vortices(side))
    chemistry = simulation.chemistry
    chemistry.set_concentration("C", 3.0)
    chemistry.set_concentration("D", lambda x: 1.0 + np.sin(2 * np.pi * x[:, 0] / side))
    simulation.start()
    p = simulation.particles
    before = [chemistry.totals()[name][0] for name in "CD"]
    simulation.advance(200)
    amount = p.host("amount")
    np.testing.assert_allclose(amount[:, 0] / p.host("mass"), 3.0, rtol=1e-12)
    after = [chemistry.totals()[name][0] for name in "CD"]
    np.testing.assert_allclose(after, before, rtol=1e-13)


def test_species_that_switch_are_refused():
    species = Species("M", 0.1, molecules=True, switch_above=40, switch_below=10)
    with pytest.raises(InputError, match=r"species_flux.*switches"):
        system(2, 8, 0.0, [species])
