"""Summed densities: the energy behind the forces, and what a fluid with noise is given."""

from __future__ import annotations

import csv
import itertools
import math
from importlib.resources import files

import numpy as np
import pytest

import particell as pc
from particell.errors import InputError
from particell.kernels import CODES
from particell.schemes.density_stages import SumDensity
from particell.schemes.summation import (
    MOST_CONFINED,
    confinement_of,
    disorder,
    fluctuating_fluid,
    lattice_sum,
    measured_range,
)
from systems import UNIT_TEMPERATURE, channel, fluid_rows, periodic_lattice, unit_fluid

NOISE = {"fluctuations": True, "density": "summation"}


def energy(simulation) -> float:
    """Σ m e(ρ) − P_c V, of γ = 1: e = c² [ln(ρ/ρ₀) + ρ₀/ρ], at the positions as they are."""
    solver, p = simulation.solver, simulation.particles
    solver.build_list()
    solver.do(SumDensity())
    density, mass = p.host("density"), p.host("mass")
    c2, pc = (float(solver.flow.constants[k][0]) for k in ("sound_speed", "confinement"))
    return float((mass * (c2**2 * (np.log(density) + 1 / density) - pc / density)).sum())


@pytest.mark.parametrize(("side", "dim"), [(9, 2), (8, 3)])
def test_forces_are_the_gradient_of_the_energy(side, dim):
    """With noise on but no friction, and so no noise: m a = −∂E/∂x, P_c and s included."""
    material = unit_fluid(
        viscosity=0.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE, exponent=1.0
    )
    simulation = periodic_lattice(side, dim, material, jitter=0.3, **NOISE)
    simulation.start()
    p = simulation.particles
    a, x = np.array(p.host("a")), np.array(p.host("x"))
    assert float(simulation.solver.flow.constants["confinement"][0]) > 0
    assert float(simulation.solver.flow.constants["density_sum"][0]) > 1
    ids = np.array(p.host("id"))
    for i, d in itertools.product((0, side, len(p) // 2), range(dim)):
        values = []
        for step in (1e-5, -1e-5):
            moved = x[np.argsort(ids)].copy()  # by id
            moved[i, d] += step
            p.set("x", moved[p.host("id")])
            values.append(energy(simulation))
        force = -(values[0] - values[1]) / 2e-5
        assert a[ids == i][0, d] == pytest.approx(force, rel=1e-5, abs=1e-4)


def test_without_noise_a_lattice_has_its_density_and_mass():
    simulation = periodic_lattice(8, 2, unit_fluid(), density="summation", support=2.6)
    simulation.start()
    p = simulation.particles
    assert p.host("mass") == pytest.approx(np.ones(len(p)))
    assert p.host("density") == pytest.approx(np.ones(len(p)), abs=1e-12)
    assert np.abs(p.host("pressure")).max() < 1e-9
    assert simulation.settings["density_sum"] == [lattice_sum("lucy", 2.6, 2)]
    assert simulation.settings["confinement"] == [0.0]


def test_particles_are_given_what_makes_the_fluid_right():
    """c_p² K = c₀² at the particles' own θ, f η_p + g ρ c_p h = η, and P_c = √(ρ c_p² k_BT/V)."""
    asked = unit_fluid(viscosity=20.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
    given = fluctuating_fluid("lucy", 3.0, 2, asked, 1.0, 3.0)
    c = given.material.sound_speed
    found = disorder("lucy", 3.0, 2, 1 / c**2)
    assert c**2 * found.stiffness == pytest.approx(900, rel=1e-9)
    total = found.friction * given.material.viscosity + found.collisions * c * 3.0
    assert total == pytest.approx(20.0, rel=1e-9)
    assert given.confinement == pytest.approx(c)
    assert given.density_sum == pytest.approx(found.density_sum)


def test_confinement_stays_far_from_freezing():
    theta = np.geomspace(1e-8, 1e-1, 50)
    confined = np.array([confinement_of(t) for t in theta]) / theta  # in k_BT/V
    assert confined.max() == pytest.approx(MOST_CONFINED)
    assert np.all(np.diff(confined) <= 1e-9)


def rows_of_the_table() -> list[dict[str, str]]:
    text = (files("particell.schemes") / "disorder.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if line[:1] != "#"))


def test_the_table_s_rows_are_hit_and_held_beyond_its_ends():
    rows = rows_of_the_table()
    for row in rows:
        found = disorder(row["kernel"], float(row["support"]), int(row["D"]), float(row["theta"]))
        values = (found.density_sum, found.stiffness, found.friction, found.collisions)
        assert values == pytest.approx([float(row[k]) for k in "sKfg"], abs=1e-12)
    for kernel, dim in itertools.product(CODES, (2, 3)):
        (least, most), (weak, strong) = measured_range(kernel, dim)
        assert (least, most) == (2.0, {2: 4.0, 3: 3.0}[dim])
        assert disorder(kernel, 1.5, dim, weak / 9) == disorder(kernel, least, dim, weak)
        assert disorder(kernel, 6.0, dim, strong * 9) == disorder(kernel, most, dim, strong)
        of = [r for r in rows if (r["kernel"], r["D"]) == (kernel, str(dim))]
        supports = {r["support"] for r in of}
        # no holes: every support at every strength
        assert len(of) == len(supports) * len({r["theta"] for r in of})


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kernel", CODES)
def test_table_is_smooth_and_physical(kernel, dim):
    """The wider the support the less disorder does; statistics are small beside that."""
    rows = [r for r in rows_of_the_table() if (r["kernel"], r["D"]) == (kernel, str(dim))]
    for theta in sorted({r["theta"] for r in rows}):
        of = sorted((r for r in rows if r["theta"] == theta), key=lambda r: float(r["support"]))
        s, stiffness, friction, collisions = (np.array([float(r[k]) for r in of]) for k in "sKfg")
        error = np.array([[float(r[f"error_{k}"]) for r in of] for k in ("s", "K", "low", "high")])
        # pressure by 0.05 %, sound by 0.6 %, viscosity by 0.5 % where collisions carry nothing, and
        # by the aim of 2 % where most
        assert np.all(error.max(axis=1) < [5e-4, 0.012, 0.005, 0.02])
        assert np.all((s > 1) & (s < 1.07)) and np.all((stiffness > 0.25) & (stiffness < 1))
        assert np.all((friction > 0.75) & (friction < 1.01))
        assert np.all((collisions > -0.002) & (collisions < 0.15))
        # up to five standard errors of two numbers: one in 10⁶ and less
        assert np.all(np.diff(s) < 5 * error[0].max())
        assert np.all(np.diff(stiffness) > -5 * 1.4 * error[1].max())
        assert np.all(np.diff(friction) > -5 * 1.4 * error[2].max())


def test_a_channel_has_the_fluid_s_density_and_no_pressure():
    """Between walls the middle has ρ₀ and P_b: walls neither press nor draw.

    With the lattice's normalisation the pressure is 1.1 % of ρ c². Limits are the aim (0.2 %, and
    1 % for the number of particles) and five standard errors of 20 blocks.
    """
    hot = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
    simulation = channel((16, 20), hot, jitter=0.1, **NOISE)
    simulation.advance(2000)
    number, pressure = [], []
    for _ in range(200):
        simulation.advance(20)
        rows = fluid_rows(simulation)
        y = simulation.particles.host("x")[rows, 1]
        middle = np.abs(y - 10) < 5
        number.append(middle.sum() / 160)
        pressure.append(simulation.particles.host("pressure")[rows][middle].mean() / 900)
    for values, aim in ((number, 0.01), (pressure, 0.002)):
        blocks = np.array(values).reshape(20, -1).mean(axis=1)
        error = blocks.std(ddof=1) / np.sqrt(20)
        asked = 1.0 if values is number else 0.0
        assert abs(blocks.mean() - asked) < aim + 5 * error
        assert 5 * error < 2.5 * aim


@pytest.mark.parametrize("missing", ["fluid", "wall"])
@pytest.mark.parametrize("density", ["summation", "continuity"])
def test_noise_without_a_temperature_is_refused(missing, density):
    box = pc.Domain((0, 0), (8, 6), periodic="x", depth=1.0)
    cold, hot = unit_fluid(), unit_fluid(temperature=UNIT_TEMPERATURE)
    inside, outside = (cold, hot) if missing == "fluid" else (hot, cold)
    phases = [pc.fluid(box, inside, 1.0), *pc.channel_walls(box, outside, 1.0, axis=1)]
    with pytest.raises(InputError, match="temperature = None is not allowed"):
        pc.Simulation(box, phases, pc.SDPD(fluctuations=True, density=density))


@pytest.mark.parametrize("dt", [-0.01, 0.0, math.nan, math.inf, "auto", None])
def test_a_step_that_is_none_is_refused(dt):
    simulation = periodic_lattice(8, 2)
    with pytest.raises(InputError, match="dt = "):
        simulation.dt = dt
