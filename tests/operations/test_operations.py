"""What happens while a simulation runs: when, how often, and that it is put back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import particell as pc
from systems import periodic_lattice, same_bits, unit_fluid, vortices

BOX = pc.Domain((0, 0), (8, 8), periodic="xy", depth=1.0)


class Named(pc.Operation):
    def __init__(self, when):
        self.when = when


class Taken(pc.Operation):
    """Its field would stand in for a table of materials."""

    fields = (pc.Field("sound_speed"),)


def flow(scheme=None, dt=0.01, **options):
    inside = pc.fluid(BOX, unit_fluid(), 1.0, velocity=vortices(8.0))
    return pc.Simulation(BOX, inside, scheme or pc.SDPD(), dt=dt, **options)


class Record(pc.Operation):
    """Notes the moments, and the time that positions have reached."""

    def __init__(self, every=1):
        self.every, self.seen = every, []

    def acts(self):
        return {when: self.note(when) for when in pc.When}

    def note(self, when):
        return lambda state: self.seen.append((when, state.step, round(state.time / 0.01, 6)))


SCHEMES = {
    "sdpd": pc.SDPD(),
    "sdpd-summation": pc.SDPD(density="summation"),
    "trapezoidal": pc.SDPD(integrator="trapezoidal"),
    "transport-velocity": pc.TransportVelocity(filter_every=1),
    "static": pc.Static(),
}


@pytest.mark.parametrize("name", SCHEMES)
def test_moments_come_in_their_order(name):
    record = Record()
    simulation = flow(SCHEMES[name], operations=[record])
    simulation.advance(2)
    W = pc.When
    assert [w for w, *_ in record.seen if w in (W.START, W.BEGUN)] == [W.START, W.BEGUN]
    one = [(w, time) for w, step, time in record.seen if step == 1 and w is not W.DONE]
    ends = [(w, step, time) for w, step, time in record.seen if w in (W.END, W.DONE)]
    assert ends[:2] == [(W.END, 0, 0.0 if name == "static" else 1.0), (W.DONE, 1, 1.0)]
    if name == "static":
        return
    reached = [time for w, time in one if w is W.MOVED]
    half = [1.5, 2.0] if name in ("sdpd", "transport-velocity") else [2.0]
    assert reached == ([2.0, 2.0] if name == "trapezoidal" else half)
    kinds = [w for w, _ in one]
    assert kinds.index(W.MOVED) < kinds.index(W.DRIFTED) < len(kinds) - 1
    assert (W.HALF in kinds) == (name == "transport-velocity")
    assert W.FORCES in kinds and kinds[-1] is W.END


@pytest.mark.parametrize(
    ("options", "steps"),
    [
        ({"steps": 1}, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]),
        ({"steps": 4}, [4, 8]),
        ({"interval": 0.03}, [3, 6, 9]),
        ({"interval": 0.025}, [3, 5, 8, 10]),
        ({"interval": 0.004}, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]),
        ({"steps": 4, "when": pc.When.END}, [4, 8]),
        ({"interval": 0.03, "when": pc.When.END}, [3, 6, 9]),
    ],
)
def test_functions_are_called_every_so_often(options, steps):
    called = []
    ended = options.get("when") is pc.When.END
    every = pc.Every(lambda state: called.append(state.step + ended), **options)
    flow(operations=[every]).advance(10)
    assert called == steps


def test_functions_may_set_fields():
    def stop_everything(state):
        state.particles.set("v", 0.0)

    simulation = flow(operations=[pc.Every(stop_everything, steps=5)])
    simulation.advance(4)
    assert np.abs(simulation.particles.host("v")).max() > 0.5
    simulation.advance(1)
    assert not simulation.particles.host("v").any()


class Push(pc.Operation):
    """Accelerates a part of the fluid, remembers who, and counts."""

    when = pc.When.END
    every = 3
    fields = (pc.Field("pushed"), pc.Field("first_place", components=2))

    def __init__(self):
        self.calls = 0

    def attach(self, state):
        state.particles.set("first_place", state.particles.host("x"))

    def __call__(self, state):
        p = state.particles
        chosen = p.host("first_place")[:, 0] < 4
        p.set("v", p.host("v") + 0.01 * chosen[:, None])
        p.set("pushed", p.host("pushed") + chosen)
        self.calls += 1

    def observables(self, state):
        return {"pushed": state.particles.host("pushed").sum()}

    def counts(self, state):
        return {"pushes": float(self.calls)}

    def saved(self):
        return {"calls": self.calls}

    def restore(self, saved):
        self.calls = saved["calls"]


def test_an_operation_s_fields_and_state_are_put_back():
    whole, first, second = (flow(operations=[Push()]) for _ in range(3))
    whole.advance(40)
    first.advance(19)
    second.restore(first.state())
    second.advance(21)
    assert same_bits(whole, second) == []
    assert second.observables()["pushed"] == 13 * 32
    assert second.conservation()["pushes"] == 13
    other = flow()
    with pytest.raises(pc.InputError, match="operations of the checkpoint"):
        other.restore(first.state())


def test_observables_are_series_and_may_stop_a_run():
    simulation = flow(observables={"fastest": lambda s: np.abs(s.particles.host("v")).max()})
    run = simulation.run(1.0, 0.1, progress=False, stop=lambda time, o: time > 0.45)
    assert run.times[-1] == pytest.approx(0.5)
    x = pc.lattice(BOX, 1.0)
    assert run.observable("fastest")[0] == np.abs(vortices(8.0)(x)).max()
    broken = flow(observables={"nothing": lambda s: None})
    with pytest.raises(pc.InputError, match="observable 'nothing'"):
        broken.observables()


def test_a_boundary_of_one_s_own_stands_among_the_others():
    class Ceiling(pc.Operation):
        when = pc.When.DRIFTED

        def __call__(self, state):
            x = state.particles.host("x")
            x[:, 1] = np.minimum(x[:, 1], 7.9)
            state.particles.set("x", x)

    simulation = flow(boundaries=[Ceiling(), pc.MeanVelocity(0.0)])
    simulation.advance(20)
    assert simulation.particles.host("x")[:, 1].max() <= 7.9


def test_species_are_at_hand():
    held = []

    def look(state):
        held.append(state.species.concentration("C").mean())
        state.species.set_concentration("C", 2.0)

    simulation = flow(species=[pc.Species("C", 0.1)], operations=[pc.Every(look, steps=2)])
    simulation.advance(4)
    assert held == [0.0, pytest.approx(2.0, rel=1e-3)]  # volumes have changed


class Idle(pc.Operation):
    def call(self, state):
        """A misspelt __call__."""


class Textual(Idle):
    fields = ("T",)

    def __call__(self, state):
        """Do nothing."""


class Counting(pc.Operation):
    def observables(self, state):
        return 3


class Uncompiled(pc.Operation):
    def attach(self, state):
        @pc.particle_loop
        def wrong(i, v):
            v[i, 0] = undefined  # noqa: F821

        self._wrong = state.bind(wrong)

    def __call__(self, state):
        self._wrong(state.n)


class Bare(pc.SDPD):
    more = (1,)


@dataclass(frozen=True)
class Unannotated(pc.SDPD):
    more = (1,)


class Stageless(pc.SDPD):
    def stages(self):
        return ["kick"]


def test_what_goes_wrong_in_an_operation_says_where():
    def fail(state):
        raise KeyError("oops")

    with pytest.raises(KeyError) as error:
        flow(operations=[pc.Every(fail, steps=3)]).advance(5)
    assert error.value.__notes__ == ["(in operation fail, step 3)"]


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: pc.Every(print), "steps"),
        (lambda: pc.Every(print, steps=1, interval=1.0), "steps"),
        (lambda: pc.Every(print, steps=0), "steps"),
        (lambda: pc.Every(print, interval=-1.0), "interval"),
        (lambda: pc.Every(3, steps=1), "function"),
        (lambda: flow(operations=[print]), "operations"),
        (lambda: flow(operations=[Record(every=0)]), "every of Record"),
        (lambda: flow(pc.SDPD(fields=[pc.Field("pushed")]), operations=[Push()]), "name of Field"),
        (lambda: flow(operations=[Push(), Push()]), "name of Field"),
        (lambda: pc.Field("f", role="guess"), "role"),
        (lambda: pc.Every(print, steps=2, when=pc.When.BEGUN), "when"),
        (lambda: flow(operations=[pc.Every(print, steps=2, when=pc.When.HALF)]), "when of print"),
        (lambda: flow(operations=[Named("end")]), "when of Named"),
        (lambda: flow(operations=[Taken()]), "name of Field"),
        (lambda: flow(observables={"kinetic_energy": lambda s: 1.0}).observables(), "observable"),
        (lambda: flow(observables={"a/b": len}), "name of an observable"),
        (lambda: flow(observables={"a": lambda: 1.0}), "observable 'a'"),
        (lambda: flow(observables={"a": lambda s: "1"}).observables(), "observable 'a'"),
        (lambda: pc.Every(lambda: None, steps=1), "function"),
        (lambda: flow(operations=[Idle()]), "operation Idle"),
        (lambda: flow(operations=[Textual()]), "fields = 'T'"),
        (lambda: flow(operations=[Counting()]).observables(), "numbers of Counting"),
        (lambda: flow().particles.set("v", np.ones(3)), "values of 'v' = 'numbers of shape (3,)'"),
        (lambda: flow().particles.set("v", 1j), "values of 'v'"),
        (lambda: flow().particles.set("mass", ["a"] * 64), "values of 'mass'"),
        *((lambda n=n: flow(pc.SDPD(fields=[pc.Field(n)])), "name of Field")
          for n in ("box", "species", "dt", "speed", "time", "tau", "dt_over_time")),
        (lambda: Bare(), "more of Bare"),
        (lambda: Unannotated(), "more of Unannotated"),
        (lambda: flow(Stageless()), "Stageless.stages()"),
        (lambda: flow(operations=[Uncompiled()]).advance(2), "code of the loop 'wrong'"),
    ],
)  # fmt: skip
def test_wrong_operations_are_refused(make, key):
    with pytest.raises(pc.InputError) as error:
        make()
    assert str(error.value).startswith(key)
    assert "\n" not in str(error.value)


def test_a_vector_field_of_one_s_own_has_a_rate():
    """A mark that moves with the flow: its distance from the place of its particle stays."""

    class Follow(pc.Law):
        def finish(self, i, sums):
            return {"mark_rate": i.v}

    scheme = pc.SDPD(more=[Follow()], fields=[pc.Field("mark", components=2, unit="m")])
    simulation = periodic_lattice(8, 2, velocity=(0.3, -0.2))
    domain, phase = simulation.domain, simulation.phases[0]
    moving = pc.Simulation(domain, phase, scheme, dt=0.01)
    moving.advance(10)
    assert moving.particles.host("mark") == pytest.approx(
        np.tile([0.03, -0.02], (64, 1)), abs=1e-12
    )


def test_what_comes_once_comes_whatever_the_interval():
    record = Record(every=10)
    flow(operations=[record]).advance(10)
    W = pc.When
    seen = [w for w, *_ in record.seen]
    assert seen.count(W.START) == seen.count(W.BEGUN) == 1 and seen.count(W.LIST) >= 1
    assert seen.count(W.END) == seen.count(W.DONE) == 1


def test_intervals_are_met_after_many_steps():
    """Times are sums: after 3e5 steps they are off by more than round-off."""
    state, called = flow(dt=1e-3 / 3).system, []
    every = pc.Every(lambda s: called.append(s.step), interval=0.1 / 3)
    for _ in range(300_000):
        state.clock.tick()
        every(state)
    assert called == list(range(100, 300_001, 100))


def test_other_observables_are_refused_before_anything_is_restored():
    one, other = flow(observables={"a": lambda s: 1.0}), flow(observables={"b": lambda s: 1.0})
    one.advance(2)
    with pytest.raises(pc.InputError, match="observables of the checkpoint"):
        other.restore(one.state())


def test_a_broken_flow_with_a_force_names_step_and_particle():
    force = pc.BodyForce(lambda x, y, t: (0.1 * x, 0.0))
    simulation = flow(forces=[force], scheme=pc.SDPD(reference_speed=1.0))
    simulation.advance(1)
    x = simulation.particles.host("x")
    x[3] = np.nan
    simulation.particles.set("x", x)
    with pytest.raises(pc.RunError, match="step"):
        simulation.advance(1)
