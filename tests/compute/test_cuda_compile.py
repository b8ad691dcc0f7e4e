"""Every loop body that small runs use compiles to PTX, where a compiler is (no GPU is needed)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numba import typeof, types

from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.chemistry.formula import FUNCTIONS, Number, Symbol, Time, call, operation
from particell.chemistry.lawcode import Law
from particell.chemistry.reactions import Reaction
from particell.chemistry.reservoirs import FluxWall
from particell.chemistry.species import Species
from particell.compute.loop import Loop, cuda_python
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace
from particell.materials import AVOGADRO
from particell.phases import channel_walls, fluid
from particell.schemes.static import Static
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from systems import (
    UNIT_TEMPERATURE,
    beside_a_mirror,
    channel,
    periodic_lattice,
    transported_lattice,
    unit_fluid,
    vortices,
)

CAPABILITY = (8, 0)


@pytest.fixture(scope="module")
def to_ptx():
    """A function from a Python kernel and its argument types to PTX."""
    pytest.importorskip("numba_cuda", reason="numba-cuda is missing (extra 'cuda')")
    try:
        from numba import cuda
        from numba.cuda import dispatcher

        def probe(n, x):
            x[n] = 1.0

        with pytest.MonkeyPatch.context() as patch:
            # helpers are compiled for the device at hand, and there is none
            device = SimpleNamespace(compute_capability=CAPABILITY)
            patch.setattr(dispatcher, "get_current_device", lambda: device)
            signature = (types.int64, types.float64[::1])
            cuda.compile_ptx(probe, signature, device=False, cc=CAPABILITY)
            yield lambda kernel, given: cuda.compile_ptx(kernel, given, device=False, cc=CAPABILITY)
    except Exception as error:  # whatever is missing: numba-cuda, NVVM, its libraries
        pytest.skip(f"no CUDA compiler here (extra 'cuda'): {type(error).__name__}")


def argument_types(args):
    found = [types.int64]
    for value in args:
        kind = typeof(value)
        if isinstance(kind, types.Array):
            kind = types.Array(kind.dtype, kind.ndim, "C")
        found.append(kind)
    return tuple(found)


def flows():
    hot = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
    sponge = Sponge(1.0, 4.0, time=0.5, velocity=lambda x: np.ones_like(x))
    floor = Reflection(HalfSpace((0, 0), (0, 1)))
    yield periodic_lattice(8, 2, hot, fluctuations=True, density="summation")
    yield periodic_lattice(8, 3, hot, fluctuations=True, density="summation")
    yield channel((8, 6), gravity=(0.1, 0.0), boundaries=[sponge, floor], density_diffusion=0.1)
    yield channel((8, 6), hot, fluctuations=True, density="summation", density_diffusion=None)
    yield periodic_lattice(8, 2, integrator="trapezoidal")
    yield periodic_lattice(8, 1)
    yield beside_a_mirror()


def transported():
    carried = [Species("A", 0.1), Species("B", 0.1, molecules=True)]
    options = {"jitter": 0.2, "velocity": vortices(8), "species": carried, "species_flux": True}
    for dim in (2, 3):
        made = transported_lattice(dim, 8, dt=0.01, density_diffusion=0.1, **options)
        made.chemistry.set_concentration("A", lambda x: x[:, 0])
        made.chemistry.set_concentration("B", lambda x: x[:, 0] / AVOGADRO)
        yield made
    domain = Domain((0, 0), (8, 6), periodic="x", depth=1.0)
    walls = channel_walls(domain, unit_fluid(), 1.0, axis=1, velocity=(None, (1.0, 0.0)))
    inside = fluid(domain, unit_fluid(), 1.0)
    for options in ({}, {"normalise_viscosity": True, "pressure_switch": True}):
        scheme = TransportVelocity(gravity=(0.1, 0.0), filter_every=1, **options)
        yield Simulation(domain, [inside, *walls], scheme)


def reacting():
    domain = Domain((0, 0), (8e-6, 8e-6), periodic="xy", depth=1e-6)
    phase = fluid(domain, unit_fluid(density=1000.0), 1e-6)
    species = [Species("A", 1e-9), Species("B", 1e-9, molecules=True)]
    reactions = [Reaction("B -> 0", forward=1e3), Reaction("A -> 0", forward=1e3)]
    made = Simulation(
        domain, phase, Static(), species=species, reactions=reactions, dt=1e-5,
        normalise_diffusion=True,
    )  # fmt: skip
    made.chemistry.set_concentration("A", 1e-3)
    made.chemistry.set_concentration("B", 1e-3)
    yield made
    between = Domain((0, 0), (8e-6, 8e-6), periodic="y", depth=1e-6)
    walls = channel_walls(between, unit_fluid(density=1000.0), 1e-6, axis=0)
    phase = fluid(between, unit_fluid(density=1000.0), 1e-6)
    switching = Species("S", 1e-9, molecules=True, switch_above=100, switch_below=50)
    made = Simulation(
        between, [phase, *walls], Static(), species=[*species, switching], dt=1e-5,
        reactions=[Reaction("A + B <-> S", forward=1.0, backward=1.0)], splitting="strang",
        boundaries=[FluxWall(walls[0].name, flux={"A": 1e-3, "B": 1e-6, "S": 1e-6})],
    )  # fmt: skip
    made.chemistry.set_concentration("S", lambda x: 0.1 + 0.3 * (x[:, 0] > 4e-6))
    yield made


def by_formulas():
    """Laws of every function that formulas have, and of the time."""
    every = Number(0.0)
    for name, function in FUNCTIONS.items():
        arguments = [Symbol("A"), Number(0.5), Time()][: function.arguments]
        every = operation("+", every, call("abs", call(name, *arguments)))
    every = call("where", call("<", Symbol("A"), Number(1.0)), Number(1.0), every)
    counted = call("where", call("<", Symbol("B"), Number(1.0)), Symbol("B"), Number(0.0))
    domain = Domain((0, 0), (8e-6, 8e-6), periodic="xy", depth=1e-6)
    phase = fluid(domain, unit_fluid(density=1000.0), 1e-6)
    yield Simulation(
        domain, phase, Static(), [Species("A"), Species("B", molecules=True)],
        [
            Reaction("0 -> A", 1e-3, rate_law=Law(every)),
            Reaction("B -> 0", 1.0, propensity=Law(counted, molecules=True)),
        ],
        dt=1e-5,
    )  # fmt: skip


@pytest.mark.parametrize("systems", [flows, transported, reacting, by_formulas])
def test_bodies_compile_to_ptx(to_ptx, systems, monkeypatch):
    specialise, recorded = Loop.specialise, {}

    def recording(self, backend="cpu", **constants):
        run = specialise(self, backend, **constants)

        def call(n, *args):
            key = (self.__name__, *sorted((k, str(v)) for k, v in constants.items()))
            recorded.setdefault(key, (self, constants, argument_types(args)))
            run(n, *args)

        return call

    monkeypatch.setattr(Loop, "specialise", recording)
    for simulation in systems():
        simulation.advance(2)
        simulation.watch.look()
    failed = []
    for key, (loop, constants, signature) in recorded.items():
        try:
            ptx, _ = to_ptx(cuda_python(loop, constants), signature)
        except Exception as error:
            failed.append(f"{key}: {type(error).__name__} {str(error)[-300:]}")
        else:
            assert ".entry" in ptx
    assert not failed, "\n".join(failed)
    assert len(recorded) > (2 if systems is by_formulas else 8)
