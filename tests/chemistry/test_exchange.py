"""The weights of diffusion and what is exchanged with them, in all forms of their sweeps."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from particell.chemistry.jumprates import jump_rates
from particell.laws.carriers import carrier_weights
from particell.laws.diffusion import diffuse
from systems import unit_fluid


@pytest.fixture(scope="module")
def layer():
    """Jittered particles between a wall with a value and one with a flux, three species."""
    box = pc.Domain((0, 0), (8, 6), periodic="x", depth=1.0)
    unit = unit_fluid()
    inside, walls = pc.fluid(box, unit, 1.0), pc.channel_walls(box, unit, 1.0, axis=1)
    shaken = inside.points + np.random.default_rng(1).uniform(-0.2, 0.2, inside.points.shape)
    names = [wall.name for wall in walls]
    boundaries = [
        pc.FixedValueWall(names[0], {"A": 2.0, "M": 1e-23}),
        pc.FluxWall(names[1], {"A": 0.3}, transfer={"C": (0.5, 1.5)}),
    ]
    species = [pc.Species("A", 1.0), pc.Species("C", 0.4), pc.Species("M", 1.0, molecules=True)]
    simulation = pc.Simulation(
        box,
        [pc.Phase("fluid", unit, shaken, 1.0), *walls],
        pc.Static(support=2.6),
        species,
        boundaries=boundaries,
        dt=0.02,
    )
    for name in "AC":
        simulation.chemistry.set_concentration(name, lambda x: 1 + 0.1 * x[:, 1])
    simulation.chemistry.set_count("M", 20)
    simulation.advance(1)
    return simulation


def in_both_forms(simulation, sweep, fields, written, **numbers):
    """What a sweep leaves in arrays, in vectors and in the form of GPUs."""
    found = []
    for form in ("gather", "cuda"):
        given = {**fields, **{name: np.array(fields[name]) for name in written}}
        sweep.bind(simulation.device, given, {}, form)(len(simulation.particles), **numbers)
        found.append([given[name] for name in written])
    for name, one, other in zip(written, *found, strict=True):
        scale = np.abs(one).max()
        assert scale > 0 and np.abs(one - other).max() <= 1e-12 * scale, name


def test_both_forms_agree(layer):
    chemistry, groups = layer.chemistry, len(layer.particles.groups)
    exchange = chemistry._diffusion.exchanges[0]
    exchange._slopes(len(layer.particles))
    weights = carrier_weights(2, 0, groups, normalise=True, walls=True)
    in_both_forms(layer, weights, exchange._all, ("exchange", "row_rate"))
    exchange.measure(len(layer.particles), {})
    for column in range(2):
        sweep, written = diffuse(2, 0, groups, True, False), ("amount", "amount_booked")
        in_both_forms(layer, sweep, exchange._all, written, column=column, tau=0.01)
    (walks,) = chemistry._diffusion.walks
    written = ("cumulative", "leave_rate", "inflow")
    in_both_forms(layer, jump_rates(2, 0, groups, True, False), walks._fields, written)


def test_moments_are_right_where_two_spacings_meet():
    """Σ w x xᵀ / 2ΣV = 1 to what regularisation leaves (7e-5), at the mean support of each pair."""
    box, unit = pc.Domain((0, 0), (10, 10), periodic="xy", depth=1.0), unit_fluid()
    random, phases = np.random.default_rng(1), []
    for spacing, start in ((1.0, 0), (1.25, 5)):
        part = pc.Domain((start, 0), (start + 5, 10), depth=1.0)
        points = pc.lattice(part, spacing)
        points += random.uniform(-0.15, 0.15, points.shape)
        phases.append(pc.Phase(f"at {start}", unit, points, spacing**2, spacing=spacing))
    simulation = pc.Simulation(
        box, phases, pc.Static(support=3.0), [pc.Species("A", 1.0)], normalise_diffusion=True
    )
    simulation.advance(1)
    given = simulation.chemistry._diffusion.exchanges[0]._all
    assert np.ptp(given["support"]) > 0.5
    moments = np.zeros((2, 2))
    for i, (first, stop) in enumerate(zip(given["start"], given["stop"], strict=True)):
        offset = given["x"][i] - given["x"][given["neighbours"][first:stop]]
        offset -= 10 * np.rint(offset / 10)
        moments += np.einsum("k,ka,kb->ab", given["exchange"][first:stop], offset, offset)
    assert moments / (2 * 100) == pytest.approx(np.eye(2), abs=2e-4)


def test_walls_of_species_are_walls():
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    inside = pc.fluid(box, unit_fluid(), 1.0)
    boundary = pc.FixedValueWall(inside.name, {"A": 1.0})
    with pytest.raises(pc.InputError, match="FixedValueWall"):
        pc.Simulation(box, inside, pc.Static(), [pc.Species("A", 1.0)], boundaries=[boundary])
