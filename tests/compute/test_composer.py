"""Loops that are generated from laws: each term once, all forms alike, nothing where nothing is."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from cloud import FORMS, Cloud
from particell.compute.composer import source_of
from particell.compute.expressions import Node, Vector, call, maximum, sqrt, symbol, where
from particell.compute.plan import Pass, Plan, Result, sum_symbols
from particell.kernels import shape_f
from particell.schemes.flow_sweeps import tables_of
from systems import UNIT_TEMPERATURE, channel, periodic_lattice, transported_lattice, unit_fluid


def field(name, side):
    return symbol("field", name, side)


OFFSET = [symbol("pair", f"dx{d}", "pair") for d in range(2)]


def plan(value, **options):
    """A loop in the plane that sums ``value`` as ``total``."""
    one = Pass("start", "split", {"total": (value,)})
    result = {"total": Result(sum_symbols("total", 1), rows=False)}
    return Plan("loop", "A test", 2, (one,), result, **options)


def text(value, form="gather"):
    return source_of(plan(value), form).text


def test_shared_terms_are_computed_once():
    x = Vector.of("x", OFFSET)
    r = sqrt(x.dot(x))
    value = r * field("mass", "j") + r * r * field("volume", "j")
    assert text(value).count("math.sqrt") == 1


def test_what_is_of_one_particle_stays_out_of_the_loop_over_pairs():
    made = text(sqrt(field("mass", "i")) * sqrt(field("mass", "j")) * OFFSET[0])
    before, inside = made.split("for q in range(np.uint64(0), ")
    assert "math.sqrt" not in inside
    # of the neighbour it is in its record, of the particle itself there too, rounded alike
    assert before.count("math.sqrt(mass[i])") == 1
    assert "own_2 = record" in before


def test_zeros_and_ones_vanish():
    x = field("mass", "j")
    assert 0.0 * x == 0.0 and 1.0 * x is x and x + 0.0 is x and x / 1.0 is x
    assert where(True, x, 2.0) is x and isinstance(maximum(x, 1.0), Node)
    assert call(shape_f, (0.25, 0)) == shape_f(0.25, 0)  # of numbers it is a number


def test_a_node_has_no_truth():
    with pytest.raises(TypeError, match="where"):
        bool(field("mass", "j") > 0.0)


def test_what_is_true_or_false_is_in_no_record():
    """Numba does not write it into an array of numbers: what it is made of is there."""
    heavy = (field("mass", "j") > 1.0) & (field("volume", "j") < 2.0)
    made = text(where(heavy, OFFSET[0], 0.0))
    assert "record[at + 2] = mass[i]" in made and "record[at + 3] = volume[i]" in made


def test_pairs_with_kept_weights_need_no_places():
    weight, total = symbol("stored", "weight", "pair"), sum_symbols("total", 1)
    one = Pass("start", "stop", {"total": (weight * field("mass", "j"),)}, weighed="weight",
               running={"grown": "total"})  # fmt: skip
    made = source_of(Plan("loop", "A test", 2, (one,), {"total": Result(total, False)}), "gather")
    assert "dx0" not in made.text and "x[i" not in made.text and made.columns == 0
    assert "record[at + 0] = mass[i]" in made.text
    assert "grown[k] = sum_total_" in made.text


def test_lanes_that_only_fill_a_vector_divide_by_what_is_there():
    made = text(OFFSET[0] / (field("mass", "i") + field("mass", "j")))
    assert "columns[base + np.uint64(64) + c - np.uint64(1)]" in made


def test_terms_that_are_shared_again_and_again_cost_no_time():
    value = field("mass", "j")
    for _ in range(60):
        value = value + value
    assert "for q in range(np.uint64(0), c)" in text(value)  # nothing makes it zero by itself


def test_vectors_collect_what_is_added_along_a_base():
    x = Vector.of("x", OFFSET)
    total = field("mass", "j") * x + field("volume", "j") * x
    assert len(total.terms) == 1


HOT = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)


def two_fluids():
    box = pc.Domain((0, 0), (8, 8), periodic="x", depth=1.0)
    other = unit_fluid(viscosity=3.0, density=2.0)
    low = pc.Box((0, 0), (8, 4))
    walls = pc.channel_walls(box, unit_fluid(), 1.0, axis=1)
    scheme = pc.TransportVelocity(
        gravity=(0.1, -0.1), density_diffusion=0.1, reference_speed=1.0, filter_every=1
    )
    inside = [pc.fluid(box, unit_fluid(), 1.0, low, name="a")]
    inside.append(pc.fluid(box, other, 1.0, ~low, name="b"))
    return pc.Simulation(box, [*inside, *walls], scheme, dt=0.01)


SYSTEMS = {
    "noise": lambda: periodic_lattice(8, 3, HOT, jitter=0.1, fluctuations=True,
                                      density="summation"),
    "walls": lambda: channel((8, 6), gravity=(0.1, 0.0), density_diffusion=0.1),
    "hot walls": lambda: channel((8, 6), HOT, fluctuations=True, density="summation",
                                 density_diffusion=None),
    "trapezoidal": lambda: periodic_lattice(8, 2, jitter=0.1, integrator="trapezoidal"),
    "one dimension": lambda: periodic_lattice(12, 1, jitter=0.1),
    "transported": lambda: transported_lattice(3, 7, 0.1, dt=0.01, normalise_viscosity=True),
    "two fluids": two_fluids,
}  # fmt: skip


@pytest.mark.parametrize("name", SYSTEMS)
def test_all_forms_give_the_same_to_round_off(name):
    """Lanes, and the form of GPUs compiled for the CPU, against columns; every sweep of a step."""
    simulation = SYSTEMS[name]()
    random = np.random.default_rng(1)
    p = simulation.particles
    mobile = p.host("is_wall") == 0
    p.set("v", np.where(mobile[:, None], random.normal(0, 0.1, p.host("v").shape), 0.0))
    for part in ("rows", "clusters"):
        simulation.neighbours.want(part)
    simulation.advance(2)
    solver, flow = simulation.solver, simulation.solver.flow
    fields = flow.fields() | tables_of(flow.properties.tables, flow.properties.fluids)
    numbers = flow.numbers(3)
    for sweep in solver.descriptions():
        found, before = [], {k: p.host(k).copy() for k in sweep.plan().results}
        for form in ("gather", "cuda", "lanes"):
            for k, values in before.items():  # which some sweeps read
                p.fields[k][...] = values
            sweep.bind(simulation.device, fields, {}, form)(len(p), **numbers)
            found.append({k: p.host(k).copy() for k in sweep.plan().results})
        for k, values in found[0].items():
            scale = max(np.abs(values).max(), 1e-300)
            for other in found[1:]:
                assert np.abs(values - other[k]).max() <= 1e-12 * scale, (sweep.name, k)


class Total(pc.Law):
    """Something of all neighbours that may be infinite."""

    def pair(self, i, j, ij):
        return {"total": ij.W * j.content}


@pytest.mark.parametrize("form", FORMS)
def test_what_is_infinite_stays_where_it_is(form):
    """Lanes that only fill a vector hold what was there before: of another row's neighbours."""
    random = np.random.default_rng(1)
    n = 40
    content = random.uniform(1.0, 2.0, n)
    content[[20, 37]] = np.inf  # early and late in rows
    scalars = {"support": np.full(n, 1.5), "content": content}
    scalars |= {name: np.ones(n) for name in ("volume", "mass", "grow", "gap")}
    x, v = random.uniform(0.0, 7.0, (n, 2)), np.zeros((n, 2))
    cloud = Cloud(2, n, scalars, {"x": x, "v": v})
    results = {"total": 0}
    found = cloud.read(cloud.sweep([Total()], results, {}), results, form)
    expected = [adds for (adds,) in cloud.by_hand([Total()])]
    values = np.array([adds.get("total", 0.0) for adds in expected])
    np.testing.assert_allclose(found["total"], values, rtol=1e-12)
    assert 0 < np.isinf(values).sum() < n // 2


class _Inverse(pc.Law):
    """Whole negative powers of what vanishes: of distances in lanes that are empty, of a field."""

    def pair(self, i, j, ij):
        inside = ij.r < ij.support
        return {"A_rate": where(inside, ij.r**-2 + ij.r**-1, 0.0), "B_rate": j.B**-1}


@pytest.mark.parametrize("form", ["gather", "lanes"])
def test_whole_negative_powers(form):
    """As many as 1/r² + 1/r over neighbours of a lattice; 1/0 is infinite, and no exception."""
    box = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
    scheme = pc.SDPD(support=1.2, more=[_Inverse()], fields=[pc.Field("A"), pc.Field("B")])
    water = pc.Fluid(density=1.0, viscosity=0.1, sound_speed=10.0)
    made = pc.Simulation(box, pc.fluid(box, water, 1.0), scheme, device=pc.Device(form=form))
    with np.errstate(all="ignore"), pytest.raises(pc.RunError, match="B"):
        made.advance(1)
    assert made.particles.by_id("A_rate") == pytest.approx(np.full(64, 8.0))
    assert np.isinf(made.particles.by_id("B")).all()
