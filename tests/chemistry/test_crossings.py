"""Molecules that a shift carries: their mean, their law, their sum, and what is not met."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, t

from particell.chemistry.species import Species
from particell.compute.threads import kept_threads, set_threads
from particell.kernels import LUCY, normalisation, shape_f
from particell.materials import AVOGADRO
from systems import carriage, carry_species, same_bits, transported_lattice, vortices

#: Of each stochastic test, for any seed.
FALSE_ALARM = 1e-7
MOLECULES = Species("M", 0.1, molecules=True)


def system(side, species, dim=2, seed=0):
    """Vortices among scattered particles."""
    flow = {"velocity": vortices(side), "seed": seed, "dt": 0.01}
    return transported_lattice(dim, side, 0.2, species=species, species_flux=True, **flow)


def shifted(simulation, step=0, tau=0.01):
    """One call of the flux with a random shift, the same for every seed."""
    p = simulation.particles
    shift = np.random.default_rng(2).normal(size=p.host("v").shape)
    p.set("transport", p.host("v") + shift)
    carry_species(simulation, step, tau)


@pytest.mark.parametrize("dim", [2, 3])
def test_mean_is_that_of_concentrations(dim):
    """With 1e15 molecules a particle: to the deviation of the drawn numbers, some 1e-7."""
    both = [Species("C", 0.0), Species("M", 0.0, molecules=True)]
    simulation = system(16 if dim == 2 else 8, both, dim)
    simulation.chemistry.set_concentration("C", 1.0)
    simulation.start()
    p = simulation.particles
    number = 1e15 * (1 + np.random.default_rng(3).uniform(0, 1, len(p)))
    p.set("count", np.floor(number).astype(np.int64)[:, None])
    p.set("amount", np.floor(number)[:, None])
    shifted(simulation)
    gain = p.host("count")[:, 0] - np.floor(number)
    expected = p.host("amount")[:, 0] - np.floor(number)
    assert np.abs(expected).max() > 1e12  # something is carried
    # sums of some 28 binomial numbers of at most this variance, in n particles
    sigma = np.sqrt(np.abs(expected).max() * 30)
    assert np.abs(gain - expected).max() < 8 * sigma


def mean_flux(simulation, number, shift, tau):
    """The law's mean numbers (n, n) that go from i to j, straight from its definition."""
    p = simulation.particles
    x, h, volume = p.host("x"), p.host("support")[0], p.host("mass") / p.host("density")
    offset = x[:, None] - x[None]
    offset -= simulation.domain.lengths * np.rint(offset / simulation.domain.lengths)
    r = np.linalg.norm(offset, axis=2)
    scale = normalisation(LUCY, 2) / h**4
    f = scale * np.vectorize(shape_f.py_func)(r / h, LUCY) * (r < h)
    weight = volume[:, None] * volume[None] * f
    own = weight * np.einsum("ijd,id->ij", offset, shift)
    its = weight * np.einsum("ijd,jd->ij", offset, shift)

    def out(n):
        content = (n - n.sum() / p.host("mass").sum() * p.host("mass")) / volume
        return tau * (own * content[:, None] + its * content[None])

    return np.maximum(0.0, out(number - 0.5 * out(number).sum(axis=1)))


def test_numbers_follow_the_multinomial_law():
    """Of one particle with 40 molecules, a thousand steps: what leaves, and where it goes."""
    simulation = system(16, [Species("M", 0.0, molecules=True)])
    simulation.start()
    p, steps = simulation.particles, 1000
    start = np.zeros((len(p), 1), np.int64)
    start[100] = 40
    left, arrived = [], np.zeros(len(p))
    for step in range(steps):
        p.set("count", start)
        shifted(simulation, step, tau=0.2)
        count = p.host("count")[:, 0]
        left.append(40 - count[100])
        arrived += count
        assert count.sum() == 40 and count.min() >= 0
    shift = p.host("transport") - p.host("v")
    flux = mean_flux(simulation, start[:, 0].astype(float), shift, 0.2)[100]
    mean, chance = flux.sum(), flux.sum() / 40
    assert 0.02 < chance < 0.9
    z = (np.mean(left) - mean) / np.sqrt(40 * chance * (1 - chance) / steps)
    assert abs(z) < 5.4  # FALSE_ALARM of a normal number
    spread = np.var(left) / (40 * chance * (1 - chance))
    low, high = chi2.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], steps - 1) / (steps - 1)
    assert low < spread < high
    often = sum(left) * flux / mean > 20
    assert often.sum() > 5
    found = np.append(arrived[often], arrived[~often].sum() - arrived[100])
    expected = sum(left) * np.append(flux[often], flux[~often].sum()) / mean
    score = np.sum((found - expected)[expected > 0] ** 2 / expected[expected > 0])
    assert score < chi2.ppf(1 - FALSE_ALARM, often.sum())


def test_what_particles_do_not_hold_is_counted():
    """Particles without molecules cannot send any; the mean that they owed is counted."""
    simulation = system(16, [Species("M", 0.0, molecules=True)])
    simulation.start()
    p = simulation.particles
    count = np.zeros((len(p), 1), np.int64)
    count[::2] = 1000
    p.set("count", count)
    shifted(simulation)
    molecules = carriage(simulation).molecules
    moved = simulation.device.to_host(molecules._fields["moved"])
    owed = moved[1::2, 0].sum()
    assert owed > 0 and molecules.unmet == pytest.approx(owed, rel=1e-12)
    assert molecules.expected == pytest.approx(moved[:, 0].sum(), rel=1e-12)
    assert simulation.conservation()["molecules' flux not met"] == molecules.unmet_part > 0
    assert p.host("count").sum() == count.sum()


def test_means_in_a_flow_are_those_of_concentrations():
    """Twenty runs of 100 steps with 30 molecules a particle, Poisson numbers at the start.

    With diffusion, as whoever takes molecules has it. The amplitude of the sine that they start
    with is a sum over all particles, hence normal: a t-test against the concentrations' amplitude,
    which is deterministic. And they stay Poisson numbers but for the flux's noise, which acts on
    deviations (the docs have its size after 1500 steps).
    """
    side, runs, spread = 16, 20, []
    deviations = []
    for seed in range(runs):
        simulation = system(side, [MOLECULES, Species("C", 0.1)], seed=seed)
        simulation.start()
        p = simulation.particles
        wave = np.sin(2 * np.pi * p.host("x")[:, 1] / side)
        mean = 30 * (1 + 0.5 * wave)
        p.set("count", np.random.default_rng(seed).poisson(mean)[:, None].astype(np.int64))
        p.set("amount", mean[:, None])
        simulation.advance(100)
        wave = np.sin(2 * np.pi * p.host("x")[:, 1] / side)
        count, amount = p.host("count")[:, 0], p.host("amount")[:, 0]
        deviations.append(wave @ (count - amount))
        spread.append(((count - amount) ** 2 / amount).mean())
        assert carriage(simulation).molecules.expected > 10
    z = np.mean(deviations) / (np.std(deviations, ddof=1) / np.sqrt(runs))
    assert abs(z) < t.ppf(1 - FALSE_ALARM / 2, runs - 1)
    n = runs * side**2
    assert 1 - 5.4 * np.sqrt(2 / n) < np.mean(spread) < 1.03 + 5.4 * np.sqrt(2 / n)


@pytest.mark.usefixtures("always_shared")
def test_one_and_two_threads_give_the_same_bits_and_resume_too():
    found = []
    with kept_threads():
        for threads in (1, 2):
            set_threads(threads)
            simulation = system(12, [MOLECULES, Species("C", 0.1)])
            simulation.chemistry.set_concentration("M", lambda x: (20 + x[:, 0]) / AVOGADRO)
            simulation.chemistry.set_concentration("C", lambda x: 1 + x[:, 0])
            simulation.advance(10)
            state = simulation.state()
            simulation.advance(10)
            found.append(simulation)
    assert same_bits(*found) == []
    again = system(12, [MOLECULES, Species("C", 0.1)])
    again.restore(state)
    again.advance(10)
    assert same_bits(again, found[0]) == []
    assert carriage(again).crossings == carriage(found[0]).crossings > (0, 0)


def test_a_continuation_counts_on():
    """What was to cross, and what was not met, so far; with particles that hold nothing."""
    first, second = (system(12, [MOLECULES]) for _ in range(2))
    first.start()
    count = np.zeros((len(first.particles), 1), np.int64)
    count[::2] = 1000
    first.particles.set("count", count)
    shifted(first)
    second.restore(first.state())
    assert carriage(second).crossings == carriage(first).crossings
    assert min(carriage(second).crossings) > 0
