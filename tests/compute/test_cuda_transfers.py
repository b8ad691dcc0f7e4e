"""What passes between host and GPU in a step: one word, and at builds of lists two numbers more.

As a script (``PYTHONPATH=tests python tests/compute/test_cuda_transfers.py``) it runs on the GPU at
hand; as a test on Numba's CUDA simulator, in a process of its own.
"""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np
import pytest

from particell.compute import loop
from particell.compute.accumulator import WIDTH
from particell.compute.device import Device
from particell.geometry.domain import Domain
from particell.operations.kept_volume import EVERY
from particell.phases import channel_walls, fluid
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from simulated_gpu import lines_on_simulator
from systems import UNIT_TEMPERATURE, channel, periodic_lattice, unit_fluid, vortices

HOT = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
SMALL = {"support": 2.2, "skin": 0.3}
#: Bytes of a word that the host reads, and of an exact sum.
WORD, SUM = 8, 8 * WIDTH


@contextmanager
def transfers():
    """A list that gets (kind, bytes) of whatever passes between host and GPU."""
    from numba import cuda

    seen: list[tuple[str, int]] = []
    kind = type(cuda.to_device(np.zeros(1)))
    read, write, made = kind.copy_to_host, kind.copy_to_device, cuda.to_device

    def copy_to_host(self, *args, **options):
        seen.append(("read", self.nbytes))
        return read(self, *args, **options)

    def copy_to_device(self, source, *args, **options):
        if isinstance(source, np.ndarray):
            seen.append(("write", source.nbytes))
        return write(self, source, *args, **options)

    def to_device(source, *args, **options):
        seen.append(("new", source.nbytes))
        return made(source, *args, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kind, "copy_to_host", copy_to_host)
        patch.setattr(kind, "copy_to_device", copy_to_device)
        patch.setattr(cuda, "to_device", to_device)
        yield seen


def only_device_arrays(monkeypatch):
    """Launches with arrays of the host would copy them to the GPU and back, each time."""
    specialise = loop.Loop.specialise

    def checked(self, backend="cpu", **constants):
        run = specialise(self, backend, **constants)
        if backend != "cuda":
            return run

        def call(n, *args):
            assert not any(type(a) is np.ndarray for a in args), self.__name__
            run(n, *args)

        return call

    monkeypatch.setattr(loop.Loop, "specialise", checked)


def noisy(gpu):
    options = {"fluctuations": True, "density": "summation", **SMALL}
    return periodic_lattice(6, 2, HOT, jitter=0.1, device=gpu, **options)


def walls(gpu):
    return channel((6, 3), device=gpu, velocity=(1.0, 0.3), gravity=(0.0, -1.0), **SMALL)


def shifted(gpu):
    """Transport velocity beside plates, one of which slides."""
    domain = Domain((0, 0), (6, 3), periodic="x", depth=1.0)
    plates = channel_walls(domain, unit_fluid(), 1.0, axis=1, velocity=(None, (1.0, 0.0)))
    inside = fluid(domain, unit_fluid(), 1.0, velocity=vortices(6.0))
    scheme = TransportVelocity(filter_every=1, **SMALL)
    return Simulation(domain, [inside, *plates], scheme, device=gpu)


def in_a_step(gpu, make):
    """One word a step; where it says so the longest row; every few steps a volume that is kept."""
    with pytest.MonkeyPatch.context() as patch:
        only_device_arrays(patch)
        simulation = make(gpu)
        simulation.advance(1)
    step, neighbours = simulation.solver.step, simulation.neighbours
    kept = [("read", SUM)] * bool(simulation.solver.flow.kept_volume.volume)
    for _ in range(EVERY):
        before = neighbours.builds
        with transfers() as seen:
            step()
        expected = [("read", WORD)]
        if neighbours.builds > before:
            expected += [("read", WORD)]
        if simulation.step % EVERY == 0:
            expected += kept
        assert seen == expected, (make.__name__, seen)
    with transfers() as seen:
        simulation.solver.build_list()
    assert seen == [("read", WORD)], (make.__name__, seen)
    print(make.__name__, flush=True)


SYSTEMS = (noisy, walls, shifted)


def test_what_passes_in_a_step():
    pytest.importorskip("numba.cuda", reason="numba.cuda is missing")
    assert lines_on_simulator(__file__) == [make.__name__ for make in SYSTEMS]


if __name__ == "__main__":
    for make in SYSTEMS:
        in_a_step(Device("cuda"), make)
