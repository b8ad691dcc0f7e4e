from __future__ import annotations

import signal

import numpy as np
import pytest

from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import FixedValueWall
from particell.chemistry.species import Species
from particell.compute.threads import set_threads
from particell.errors import InputError, Interrupted, RunError
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace
from particell.output.checkpoint import read_checkpoint, write_checkpoint
from particell.phases import Phase, channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.static import Static
from particell.simulation import Simulation
from systems import UNIT_TEMPERATURE, channel, periodic_lattice, same_bits, unit_fluid

HOT = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
THERMAL = {"fluctuations": True, "density": "summation"}


def noisy_fluid(seed=1):
    return periodic_lattice(12, 2, HOT, jitter=0.1, seed=seed, **THERMAL)


def noisy_channel(side=(12, 10)):
    """Noise, walls, a reflecting safeguard and a sponge."""
    target = lambda x: np.stack([0.5 + 0 * x[:, 0], 0 * x[:, 1]], -1)  # noqa: E731
    return channel(
        side,
        HOT,
        boundaries=[
            Reflection(HalfSpace((0, 0), (0, 1))),
            Reflection(HalfSpace((0, side[1]), (0, -1))),
            Sponge(1.0, 4.0, time=0.5, velocity=target),
        ],
        jitter=0.1,
        gravity=(0.1, 0.0),
        **THERMAL,
    )


@pytest.mark.parametrize("make", [noisy_fluid, noisy_channel])
def test_restart_goes_on_bit_for_bit(make, tmp_path):
    whole = make()
    whole.advance(20)
    write_checkpoint(tmp_path / "c.h5", whole.state())
    whole.advance(30)
    builds = whole.neighbours.builds
    state, _ = read_checkpoint(tmp_path / "c.h5")
    resumed = make()
    resumed.restore(state)
    resumed.advance(30)
    assert same_bits(whole, resumed) == []
    assert (resumed.step, resumed.time, resumed.neighbours.builds) == (50, whole.time, builds)
    assert builds > 2  # the list was renewed after the restart too
    assert resumed.conservation() == whole.conservation()


def test_rows_of_a_checkpoint_may_stand_in_any_order():
    """They are put right, as lists are made of positions and ids alone."""
    whole = noisy_channel()
    whole.advance(20)
    state = whole.state()
    order = np.random.default_rng(2).permutation(whole.particles.n)
    other = {**state, "fields": {k: v[order] for k, v in state["fields"].items()}}
    listed = state["neighbours"]
    other["neighbours"] = {**listed, "x_built": listed["x_built"][order]}
    resumed = noisy_channel()
    resumed.restore(other)
    for simulation in (whole, resumed):
        simulation.advance(20)
    assert same_bits(whole, resumed) == []
    with pytest.raises(InputError, match="checkpoint"):
        noisy_channel().restore({**state, "neighbours": {}})


def test_checkpoints_of_earlier_versions_are_refused_in_one_line():
    whole = noisy_fluid()
    old = {"fields": whole.state()["fields"], "list": {}, "chemistry_every": 1, "step": 0}
    with pytest.raises(InputError, match="earlier version"):
        noisy_fluid().restore(old)


def test_restart_refuses_other_simulations():
    state = noisy_fluid().state()
    for other in (noisy_fluid(seed=2), noisy_channel()):
        with pytest.raises(InputError, match="checkpoint"):
            other.restore(state)


def test_a_continuation_takes_the_step_of_the_speed_that_the_flow_has_reached():
    first, second = (periodic_lattice(8, 2) for _ in range(2))
    slow = first.plan(1.0)
    assert first.timing.outran(2.0 * first.materials[0].sound_speed)
    second.restore(first.state())
    assert second.plan(1.0) == first.plan(1.0) > slow
    assert second.dt == first.dt


def test_observables_are_sums_over_what_moves_in_the_whole_depth():
    """24 particles of 2 kg/m³ · 1 m² · 0.5 m at (3, 4) m/s between walls that slide."""
    domain = Domain((0, 0), (6, 4), periodic="x", depth=0.5)
    material = unit_fluid(density=2.0)
    inside = fluid(domain, material, 1.0, velocity=(3.0, 4.0))
    walls = channel_walls(domain, material, 1.0, axis=1, velocity=((1.0, 0.0), None))
    found = Simulation(domain, [inside, *walls], SDPD(support=2.0)).observables()
    assert found["kinetic_energy"] == pytest.approx(0.5 * 24 * 25, rel=1e-14)
    assert found["momentum_x"] == pytest.approx(24 * 3, rel=1e-14)
    assert found["momentum_y"] == pytest.approx(24 * 4, rel=1e-14)
    assert found["largest_speed"] == 5.0


def test_what_comes_in_counts_in_the_whole_depth():
    """Through a wall, into a plane of 0.5 m: what the particles hold then, to round-off."""
    domain = Domain((0, 0), (6, 4), periodic="x", depth=0.5)
    material = unit_fluid()
    phases = [fluid(domain, material, 1.0), *channel_walls(domain, material, 1.0, axis=1)]
    wall, species = FixedValueWall("wall-lower", {"A": 2.0}), [Species("A", 0.1)]
    simulation = Simulation(domain, phases, Static(support=2.0), species, boundaries=[wall])
    simulation.advance(20)
    inside = simulation.particles.by_id("is_wall") == 0
    held = 0.5 * simulation.frame()["concentration/A"][inside].sum()
    found = simulation.observables()
    assert held > 0.1
    assert found["amount_A"] == pytest.approx(held, rel=1e-13)
    assert found["inflow_A"] == pytest.approx(held, rel=1e-12)
    assert simulation.frame()["inflow/A"].sum() == pytest.approx(held, rel=1e-12)


@pytest.mark.usefixtures("always_shared")
def test_same_bits_for_any_number_of_threads():
    """Fifty noisy steps between walls on one and on two threads."""
    everything = set_threads(None)
    runs = []
    try:
        for threads in (1, 2):
            set_threads(threads)
            runs.append(noisy_channel())
            runs[-1].advance(50)
    finally:
        set_threads(everything)
    assert same_bits(*runs) == []
    assert runs[0].neighbours.builds > 1


def test_seeds_differ_and_repeat():
    runs = [noisy_fluid(seed) for seed in (1, 1, 2)]
    for simulation in runs:
        simulation.advance(3)
    assert same_bits(runs[0], runs[1]) == []
    assert "v" in same_bits(runs[0], runs[2])


def test_momentum_is_kept_to_round_off():
    simulation = noisy_fluid()
    simulation.advance(50)
    assert simulation.conservation()["momentum"] < 1e-13


@pytest.mark.parametrize("name", ["x", "v", "density"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_broken_fields_are_found(name, value):
    simulation = periodic_lattice(8, 2)
    simulation.advance(2)
    p = simulation.particles
    values, row = np.array(p.host(name)), 17
    broken, place = int(p.host("id")[row]), p.by_id("x")
    values[row] = value
    p.set(name, values)
    with pytest.raises(RunError) as error:
        simulation.advance(1)
    e = error.value
    assert e.step == 3
    assert e.time == pytest.approx(3 * simulation.dt)
    assert e.field in ("x", "v", "density", "a")
    offset = place[e.particle] - place[broken]
    assert np.linalg.norm(offset - 8 * np.rint(offset / 8)) < 3.2  # it, or one that it touched
    for part in (f"'{e.field}'", f"particle {e.particle}", "step 3", "t = "):
        assert part in str(e)


def test_lost_particles_are_found():
    domain = Domain((0, 0), (8, 8), periodic="x", depth=1.0)
    phase = fluid(domain, unit_fluid(), 1.0)
    fast = np.zeros((64, 2))
    fast[37] = (0.0, 60.0)
    phase = Phase("fluid", phase.material, phase.points, 1.0, velocity=fast)
    simulation = Simulation(domain, phase, SDPD(density_diffusion=0.0), dt=0.2)
    with pytest.raises(RunError, match="left the domain") as error:
        simulation.advance(1)
    assert (error.value.particle, error.value.field, error.value.step) == (37, "position", 1)


def test_a_run_keeps_frames_and_reports(tmp_path):
    simulation = periodic_lattice(8, 2, velocity=lambda x: 0.1 * np.cos(x))
    run = simulation.run(until=0.5, every=0.25, progress=False)
    assert run.times == pytest.approx([0, 0.25, 0.5])
    assert {"wall_seconds", "particle_steps_per_second"} <= set(simulation.performance)
    assert simulation.settings["scheme"] == "SDPD"
    assert "step=" in repr(simulation)
    with pytest.raises(InputError, match="until"):
        simulation.run(until=0.1, progress=False)


BOX = Domain((0, 0), (8, 8), periodic="xy", depth=1.0)
POINTS = np.array([[1.0, 1.0], [2.0, 2.0]])


def phase(**changes):
    given = {"name": "fluid", "material": unit_fluid(), "points": POINTS, "volume": 1.0}
    return Phase(**{**given, **changes})


def simulate(phases, scheme=None, domain=BOX, **options):
    return Simulation(domain, phases, scheme or SDPD(), **options)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: phase(kind="gas"), "kind"),
        (lambda: phase(points=np.zeros(3)), "points of 'fluid'"),
        (lambda: phase(points=np.zeros((3, 4))), "points of 'fluid'"),
        (lambda: phase(points=np.array([[np.nan, 0]])), "points of 'fluid'"),
        (lambda: phase(volume=0.0), "volume of 'fluid'"),
        (lambda: phase(volume=np.array([1.0, np.nan])), "volume of 'fluid'"),
        (lambda: simulate([]), "phases"),
        (lambda: simulate([phase(), phase()]), "phase"),
        (lambda: simulate(phase(points=np.zeros((1, 3)))), "points of 'fluid'"),
        (lambda: simulate(phase(points=POINTS + 7)), "points of 'fluid'"),
        (lambda: simulate(phase(velocity=(np.inf, 0.0))), "velocity of 'fluid'"),
        (lambda: simulate(phase(), dt=0.0), "dt"),
        (lambda: simulate(phase(), dt="fast"), "dt"),
        (lambda: simulate(phase(), dt=np.nan), "dt"),
        (lambda: simulate(phase(spacing=2.0)), "support"),
        (lambda: simulate(phase(), SDPD(gravity=(1.0,))), "gravity"),
        (lambda: simulate(phase(), SDPD(fluctuations=True)), "temperature"),
        (lambda: simulate(phase(material=unit_fluid(sound_speed=None))), "sound_speed"),
        (lambda: simulate(phase(), reactions=[Reaction("A -> 0", forward=1.0)]), "reactions"),
        (lambda: simulate(phase(), seed=-1), "seed"),
        (lambda: fluid(BOX, unit_fluid(), 1.0, shape=HalfSpace((-9, 0), (1, 0))), "spacing"),
    ],
)
def test_input_is_refused_in_one_line(make, key):
    with pytest.raises(InputError) as error:
        make()
    assert error.value.key == key
    assert "\n" not in str(error.value)


def test_walls_continue_the_lattice():
    domain = Domain((0, 0), (8, 4), periodic="x")
    lower, upper = channel_walls(domain, unit_fluid(), 1.0, axis=1, layers=3)
    assert sorted(set(lower.points[:, 1])) == [-2.5, -1.5, -0.5]
    assert sorted(set(upper.points[:, 1])) == [4.5, 5.5, 6.5]
    assert (lower.surface.signed_distance(lower.points) < 0).all()
    assert (upper.surface.signed_distance(upper.points) < 0).all()
    assert lower.kind == "wall" and lower.name == "wall-lower"


def test_fast_diffusion_limits_the_step_of_a_flow():
    """0.05 h²/κ of explicit diffusion: automatic steps keep to it, others are refused."""
    domain = Domain((0, 0), (10, 10), periodic="xy", depth=1.0)
    fast = [Species("A", diffusivity=50.0)]

    def simulation(dt):
        return Simulation(domain, fluid(domain, unit_fluid(), 1.0), SDPD(), fast, dt=dt)

    automatic = simulation("auto")
    limit = automatic.chemistry.limits()["diffusion of concentrations"]
    automatic.plan(1.0)
    assert automatic.dt <= limit
    with pytest.raises(InputError, match="diffusion"):
        simulation(2 * limit).plan(1.0)


def test_frames_closer_than_a_step_of_the_species():
    domain = Domain((0, 0), (10, 10), periodic="xy", depth=1.0)
    slow = [Species("A", diffusivity=1e-6)]
    simulation = Simulation(domain, fluid(domain, unit_fluid(), 1.0), SDPD(), slow)
    largest = simulation.largest_step()
    assert simulation.plan(1.5 * largest) == 2
    assert simulation.dt == pytest.approx(0.75 * largest)


def test_a_second_run_has_frames_of_its_own():
    """By default a tenth of what is left, not of where it ends."""
    simulation = periodic_lattice(8, 2, dt=0.01)
    simulation.run(until=0.1, progress=False)
    run = simulation.run(until=0.3, progress=False)
    assert run.times == pytest.approx(np.linspace(0.1, 0.3, 11))


def test_a_wish_to_stop_while_it_starts_is_kept(tmp_path, monkeypatch):
    """What is raised while loops are compiled may be lost: the run ends before its first step."""
    simulation, start = periodic_lattice(8, 2, dt=0.01), Simulation.start

    def asked_meanwhile(self):
        monkeypatch.undo()
        signal.raise_signal(signal.SIGINT)
        start(self)

    monkeypatch.setattr(Simulation, "start", asked_meanwhile)
    with pytest.raises(Interrupted):
        simulation.run(until=0.1, out=tmp_path, progress=False)
    assert simulation.step == 0
    resumed, whole = (periodic_lattice(8, 2, dt=0.01) for _ in range(2))
    resumed.restore(read_checkpoint(tmp_path / "checkpoint.h5")[0])
    run = resumed.run(until=0.1, out=tmp_path, progress=False)
    assert np.array_equal(run.times, whole.run(until=0.1, progress=False).times)
    assert not same_bits(resumed, whole)
