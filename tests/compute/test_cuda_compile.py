"""Every loop that small runs use compiles to PTX, where a compiler is (no GPU is needed).

Runs of loops that do nothing record which there are, and on what they act.
"""

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
from particell.compute.device import Device
from particell.compute.loop import Loop, cuda_python
from particell.compute.sweep import Sweep
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


def flows(device):
    hot = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
    sponge = Sponge(1.0, 4.0, time=0.5, velocity=lambda x: np.ones_like(x))
    floor = Reflection(HalfSpace((0, 0), (0, 1)))
    noise = {"fluctuations": True, "density": "summation", "device": device}
    yield periodic_lattice(8, 2, hot, **noise)
    yield periodic_lattice(8, 3, hot, **noise)
    yield periodic_lattice(8, 2, device=device, density_diffusion=0.1)
    yield periodic_lattice(8, 3, device=device, density_diffusion=0.1)
    yield channel((8, 6), gravity=(0.1, 0.0), boundaries=[sponge, floor], device=device)
    yield channel((8, 6), hot, density_diffusion=None, **noise)
    yield periodic_lattice(8, 2, integrator="trapezoidal", device=device)
    yield periodic_lattice(8, 1, device=device)
    yield beside_a_mirror(device)


def transported(device):
    carried = [Species("A", 0.1), Species("B", 0.1, molecules=True)]
    options = {"jitter": 0.2, "velocity": vortices(8), "species": carried, "species_flux": True}
    for dim in (2, 3):
        made = transported_lattice(dim, 8, dt=0.01, density_diffusion=0.1, device=device, **options)
        made.chemistry.set_concentration("A", lambda x: x[:, 0])
        made.chemistry.set_concentration("B", lambda x: x[:, 0] / AVOGADRO)
        yield made
    domain = Domain((0, 0), (8, 6), periodic="x", depth=1.0)
    walls = channel_walls(domain, unit_fluid(), 1.0, axis=1, velocity=(None, (1.0, 0.0)))
    inside = fluid(domain, unit_fluid(), 1.0)
    for options in ({}, {"normalise_viscosity": True, "pressure_switch": True}):
        scheme = TransportVelocity(gravity=(0.1, 0.0), filter_every=1, **options)
        yield Simulation(domain, [inside, *walls], scheme, device=device)


def reacting(device):
    domain = Domain((0, 0), (8e-6, 8e-6), periodic="xy", depth=1e-6)
    phase = fluid(domain, unit_fluid(density=1000.0), 1e-6)
    species = [Species("A", 1e-9), Species("B", 1e-9, molecules=True)]
    reactions = [Reaction("B -> 0", forward=1e3), Reaction("A -> 0", forward=1e3)]
    made = Simulation(
        domain, phase, Static(), species=species, reactions=reactions, dt=1e-5,
        normalise_diffusion=True, device=device,
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
        device=device,
        boundaries=[FluxWall(walls[0].name, flux={"A": 1e-3, "B": 1e-6, "S": 1e-6})],
    )  # fmt: skip
    made.chemistry.set_concentration("S", lambda x: 0.1 + 0.3 * (x[:, 0] > 4e-6))
    yield made


def by_formulas(device):
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
        dt=1e-5, device=device,
    )  # fmt: skip


class Recorder:
    """A kernel that is not launched: notes its Python function and the types of its arguments."""

    def __init__(self, kernel, recorded):
        self.kernel, self.recorded = kernel, recorded

    def __getitem__(self, shape):
        def launch(*args):
            signature = argument_types(args)[1:]
            key = (self.kernel.py_func.__name__, *map(str, signature))
            self.recorded[key] = (self.kernel.py_func, signature)

        return launch


def of_lists_and_reductions(device, recorded, monkeypatch):
    """What a GPU runs for the list and for sums besides loops over particles."""
    from particell.compute import cuda_list, cuda_reduce, cuda_scan

    for module, names in (
        (cuda_scan, ("sum_tiles", "add_totals")),
        (cuda_list, ("count_cells",)),
        (cuda_reduce, ("add_reals", "add_integers")),
    ):
        for name in names:
            monkeypatch.setattr(module, name, Recorder(getattr(module, name), recorded))
    made = cuda_scan.maxima_of_blocks
    monkeypatch.setattr(cuda_scan, "maxima_of_blocks", lambda kind: Recorder(made(kind), recorded))
    for side in (8, 120):  # of one tile and more
        neighbours = periodic_lattice(side, 2, device=device).neighbours
        f = neighbours.fields
        on_gpu = cuda_list.DeviceList(device, f, 2, 0.1, 1.0)
        on_gpu.sort(f["cell"], np.zeros(neighbours.n, np.int64), f["cell_start"], neighbours.order)
        on_gpu.longest(np.zeros(neighbours.n, np.int64))
        on_gpu.worn_out()
    reduction = cuda_reduce.DeviceReduction(device)
    for kind in (device.real, np.float64, np.int64, np.uint8):
        reduction.sum(np.zeros((4, 1), kind))
        reduction.max(np.zeros(4, kind))


def record(monkeypatch, recorded):
    """Loops do nothing from now on but note themselves, in the form that a GPU has of them."""

    def specialise(self, backend="cpu", **constants):
        if "BATCH" in constants:
            constants["BATCH"] = 1

        def call(n, *args):
            signature = argument_types(args)
            key = (self.__name__, *sorted((k, str(v)) for k, v in constants.items()), signature)
            if key not in recorded:
                recorded[key] = (cuda_python(self, constants), signature)

        return call

    monkeypatch.setattr(Loop, "specialise", specialise)
    monkeypatch.setattr(Sweep, "form_on", lambda self, device: "cuda")


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("systems", [flows, transported, reacting, by_formulas])
def test_bodies_compile_to_ptx(to_ptx, systems, precision, monkeypatch):
    recorded = {}
    record(monkeypatch, recorded)
    device = Device(precision=precision, form="gather")
    for simulation in systems(device):
        simulation.advance(2)
        simulation.watch.look()
    if systems is flows:
        of_lists_and_reductions(device, recorded, monkeypatch)
    failed = []
    for key, (kernel, signature) in recorded.items():
        try:
            ptx, _ = to_ptx(kernel, signature)
        except Exception as error:
            failed.append(f"{key}: {type(error).__name__} {str(error)[-300:]}")
        else:
            assert ".entry" in ptx
    assert not failed, "\n".join(failed)
    assert len(recorded) > (8 if systems is by_formulas else 25)
