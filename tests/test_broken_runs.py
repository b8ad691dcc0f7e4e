"""A NaN anywhere, rates that overflow: the message names it, and the last good checkpoint stays."""

from __future__ import annotations

import numpy as np
import pytest

import particell as pc
from casefile.case_files import case
from particell.cases.base import Context
from particell.chemistry import engine
from particell.errors import InputError, RunError
from particell.observers import CHUNK
from particell.output.checkpoint import read_checkpoint
from particell.output.run import Run
from systems import periodic_lattice, same_bits, unit_fluid

SCHEMES = {
    "SDPD": {},
    "TransportVelocity": {
        "scheme": {"type": "TransportVelocity", "reference_speed": "1 mm/s", "fixed_volume": True}
    },
}
UNTIL, EVERY = 4e-4, 1e-4


def simulation(scheme: str) -> pc.Simulation:
    """Flow between walls with a species as a concentration and one of molecules."""
    species = [
        {"name": "dye", "diffusivity": "500 um^2/s"},
        {"name": "A", "diffusivity": "500 um^2/s", "molecules": True},
        {"name": "B", "molecules": True},
    ]
    made = case(
        **SCHEMES[scheme],
        species=species,
        reactions=[{"equation": "A <-> B", "forward": "200 1/s", "backward": "100 1/s"}],
        initial=[
            {"species": "dye", "concentration": "= y / height * dye"},
            {"species": "A", "count": 20},
        ],
    )
    return made.build(Context())


class Damage:
    """Puts a value into a field when the second frame is there; a condition that never stops."""

    def __init__(self, simulation: pc.Simulation, field: str, value: float):
        self.simulation, self.field, self.value, self.frames = simulation, field, value, 0

    def __call__(self, time, observables) -> bool:
        self.frames += 1
        if self.frames == 2:
            p = self.simulation.particles
            values = np.array(p.host(self.field))
            fluid = np.flatnonzero(p.host("is_wall") == 0)
            values[fluid[17]] = self.value
            p.set(self.field, values)
        return False


@pytest.mark.long  # to compile
@pytest.mark.parametrize("scheme", SCHEMES)
def test_nan_in_any_field(scheme, tmp_path):
    """Found within the interval of checks, or without effect where the field is made anew."""
    whole = simulation(scheme)
    whole.run(UNTIL, EVERY, out=tmp_path / "whole", progress=False, checkpoint_every=0)
    fields = [n for n in whole.particles if whole.particles.host(n).dtype.kind == "f"]
    assert {"x", "v", "density", "pressure", "mass", "support", "amount"} <= set(fields)
    found = {}
    for field in fields:
        broken, place = simulation(scheme), tmp_path / field
        stop = Damage(broken, field, np.nan)
        try:
            broken.run(UNTIL, EVERY, place, progress=False, stop=stop)
        except RunError as error:
            found[field] = error
        else:
            assert same_bits(broken, whole) == [], field
            continue
        error = found[field]
        frame = Run(tmp_path / "whole").steps[2]
        assert frame < error.step <= frame + CHUNK
        assert error.time == pytest.approx(error.step * whole.dt)
        for part in (f"'{error.field}'", f"particle {error.particle} ", f"step {error.step},"):
            assert part in str(error)
        state, _ = read_checkpoint(place / "checkpoint.h5")
        assert state["step"] <= error.step
        assert state["step"] == 0  # none was written of what was broken
    for field in ("x", "v", "density", "mass", "support", "amount"):
        assert field in found
    assert found["amount"].field == "amount" and found["mass"].field == "mass"


@pytest.mark.long  # to compile
def test_a_broken_run_goes_on_to_the_same_bits(tmp_path):
    """The checkpoint that is kept is that of the frame before, without the NaN."""
    whole = simulation("SDPD")
    whole.run(UNTIL, EVERY, out=tmp_path / "whole", progress=False)
    broken = simulation("SDPD")
    with pytest.raises(RunError):
        stop = Damage(broken, "v", np.nan)
        broken.run(UNTIL, EVERY, tmp_path / "b", progress=False, checkpoint_every=0, stop=stop)
    state, _ = read_checkpoint(tmp_path / "b" / "checkpoint.h5")
    for name, values in state["fields"].items():
        assert name.startswith("sponge") or not np.isnan(values.astype(float)).any(), name
    resumed = simulation("SDPD")
    resumed.restore(state)
    resumed.run(UNTIL, EVERY, tmp_path / "b", progress=False)
    assert same_bits(resumed, whole) == []
    assert resumed.conservation() == whole.conservation()
    one, two = Run(tmp_path / "whole"), Run(tmp_path / "b")
    for name in one.field_names:
        assert np.array_equal(one.field(name)[:], two.field(name)[:], equal_nan=True), name


def at_rest(species, reactions, **start) -> pc.Simulation:
    line = pc.Domain((0,), (10,), "x", depth=1.0)
    made = pc.Simulation(
        line, pc.fluid(line, unit_fluid(), 1.0), pc.Static(), species, reactions, dt=0.1
    )
    for name, value in start.items():
        set_it = made.chemistry.set_count if name == "M" else made.chemistry.set_concentration
        set_it(name, value)
    return made


CONCENTRATION, MOLECULES = [pc.Species("C")], [pc.Species("M", molecules=True)]


@pytest.mark.parametrize(
    ("species", "reaction", "start", "field"),
    [
        (CONCENTRATION, pc.Reaction("2 C -> 3 C", 1e6), {"C": 1.0}, "amount"),
        (CONCENTRATION, pc.Reaction("C -> 0", rate_law=lambda C, k: np.nan), {"C": 1.0}, "amount"),
        (MOLECULES, pc.Reaction("M -> 2 M", 1e300), {"M": 3}, "count"),
        (MOLECULES, pc.Reaction("0 -> M", 1e300), {}, "count"),
        (MOLECULES, pc.Reaction("2 M -> 0", 1e308, units="molecules"), {"M": 99}, "count"),
        (MOLECULES, pc.Reaction("M -> 2 M", propensity=lambda N, V, k: np.inf), {}, "count"),
    ],
)
def test_rates_that_overflow(monkeypatch, species, reaction, start, field):
    monkeypatch.setattr(engine, "MOST_EVENTS", 10_000)
    made = at_rest(species, [reaction], **start)
    with pytest.raises(RunError) as error:
        made.advance(3)
    assert (error.value.step, error.value.field) == (1, field)
    assert error.value.time == pytest.approx(0.1)
    assert 0 <= error.value.particle < 10
    assert "\n" not in str(error.value)


def test_the_particle_whose_reactions_overflow_is_named():
    law = pc.Reaction("C -> 0", rate_law=lambda C, k: np.inf if C[0] > 5 else 0.0)
    made = at_rest(CONCENTRATION, [law], C=np.where(np.arange(10) == 6, 9.0, 1.0))
    with pytest.raises(RunError) as error:
        made.advance()
    assert error.value.particle == made.particles.host("id")[6]


def test_laws_that_cannot_be_evaluated():
    for law in (lambda C, k: C.nothing, lambda C: 1.0, lambda C, k: "text", lambda C, k: C[7]):
        with pytest.raises(InputError, match="rate_law of C -> 0"):
            at_rest(CONCENTRATION, [pc.Reaction("C -> 0", rate_law=law)])


def test_checkpoints_of_another_description_are_refused():
    state = periodic_lattice(8, 2).state()
    with pytest.raises(InputError, match="scheme of the checkpoint"):
        periodic_lattice(8, 2, density_diffusion=0.1).restore(state)
    with pytest.raises(InputError, match="materials of the checkpoint"):
        periodic_lattice(8, 2, unit_fluid(viscosity=0.2)).restore(state)
    for junk in ({}, None, {"fields": {}}, {**state, "fields": 3}):
        with pytest.raises(InputError, match="checkpoint"):
            periodic_lattice(8, 2).restore(junk)


def run(**options) -> None:
    periodic_lattice(8, 2).run(**{"until": 1.0, "every": 0.5, "progress": False, **options})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"until": 1e300, "every": 1e299}, "dt = .* at least"),
        ({"every": 1e-12}, "1e.09 frames"),
        ({"every": 0.3}, "a whole part of the 1 s"),
        ({"stop": 3}, "a condition such as SteadyState"),
        ({"stop": pc.SteadyState("energy")}, "did you mean 'kinetic_energy'"),
        ({"checkpoint_every": -1}, "checkpoint_every"),
        ({"out": "/dev/null/x"}, "can be written to"),
    ],
)
def test_runs_that_would_not_end_or_begin(options, words):
    with pytest.raises(InputError, match=words):
        run(**options)


def test_a_directory_with_another_run(tmp_path):
    (tmp_path / "mine.txt").write_text("precious")
    run(out=tmp_path)
    with pytest.raises(InputError, match="overwrite=True"):
        run(out=tmp_path)
    (tmp_path / "summary.json").write_text("{}")
    run(out=tmp_path, overwrite=True)
    assert not (tmp_path / "summary.json").exists()  # it was the other run's
    assert (tmp_path / "mine.txt").read_text() == "precious"


def test_a_condition_that_never_holds_ends_at_until():
    stop = pc.SteadyState(tolerance=0.0, interval=1e-9)
    made = periodic_lattice(8, 2, velocity=lambda x: 0.1 * np.cos(x))
    found = made.run(until=0.5, every=0.25, progress=False, stop=stop)
    assert found.times[-1] == pytest.approx(0.5)
