"""Small runs on CUDA give what they give on a CPU, to round-off.

As a script (``PYTHONPATH=tests python tests/compute/test_cuda_simulator.py [SYSTEM...]``) it runs
on the GPU at hand; as a test on Numba's CUDA simulator, in a process of its own.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

from particell.boundaries.reflection import Reflection
from particell.boundaries.sponge import Sponge
from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.compute.device import Device
from particell.geometry.domain import Domain
from particell.geometry.shapes import HalfSpace
from particell.materials import AVOGADRO
from particell.phases import channel_walls, fluid
from particell.schemes.sdpd import SDPD
from particell.schemes.static import Static
from particell.schemes.transport_velocity import TransportVelocity
from particell.simulation import Simulation
from simulated_gpu import lines_on_simulator
from systems import (
    UNIT_TEMPERATURE,
    beside_a_mirror,
    channel,
    periodic_lattice,
    transported_lattice,
    unit_fluid,
    vortices,
)

HOT = unit_fluid(viscosity=5.0, sound_speed=30.0, temperature=UNIT_TEMPERATURE)
SMALL = {"support": 2.2, "skin": 0.3}


def noisy(device):
    return periodic_lattice(
        6, 2, HOT, jitter=0.1, device=device, fluctuations=True, density="summation", **SMALL
    ), 3


def hot_walls(device):
    return channel(
        (6, 3),
        HOT,
        device=device,
        fluctuations=True,
        density="summation",
        density_diffusion=None,
        **SMALL,
    ), 2


def hot_walls_in_space(device):
    domain = Domain((0, 0, 0), (5, 2, 5), periodic="xz", depth=1.0)
    layers = channel_walls(domain, HOT, 1.0, axis=1, layers=2)
    scheme = SDPD(fluctuations=True, density="summation", support=1.9, skin=0.2)
    return Simulation(domain, [fluid(domain, HOT, 1.0), *layers], scheme, device=device), 2


def walls(device):
    sponge = Sponge(1.0, 4.0, time=0.5, velocity=lambda x: np.ones_like(x))
    return channel(
        (6, 3),
        device=device,
        velocity=(1.0, 0.3),
        gravity=(0.0, -1.0),
        boundaries=[sponge, Reflection(HalfSpace((0, 0), (0, 1)))],
        **SMALL,
    ), 3


def trapezoidal(device):
    return periodic_lattice(
        6, 2, jitter=0.1, device=device, velocity=(0.3, 0.1), integrator="trapezoidal", **SMALL
    ), 2


def species(device):
    domain = Domain((0, 0), (5e-6, 5e-6), periodic="xy", depth=1e-6)
    phase = fluid(domain, unit_fluid(density=1000.0), 1e-6)
    s = Simulation(
        domain,
        phase,
        Static(support=2.0),
        device=device,
        dt=1e-5,
        species=[Species("A", 1e-9), Species("B", 1e-9, molecules=True)],
        reactions=[Reaction("B -> 0", forward=1000.0)],
    )
    s.chemistry.set_concentration("A", lambda x: 1e-3 * (x[:, 0] > 2e-6))
    s.chemistry.set_concentration("B", lambda x: 1e-3 * (x[:, 1] > 2e-6))
    return s, 2


def transported(device):
    s = transported_lattice(
        2,
        6,
        0.1,
        device=device,
        velocity=vortices(6),
        dt=0.01,
        species=[Species("A", 0.1), Species("B", 0.1, molecules=True)],
        species_flux=True,
        support=2.2,
        skin=0.3,
    )
    s.chemistry.set_concentration("A", lambda x: x[:, 0])
    s.chemistry.set_concentration("B", lambda x: 20 * x[:, 0] / AVOGADRO)
    return s, 2


def plates(device):
    domain = Domain((0, 0), (6, 3), periodic="x", depth=1.0)
    moving = channel_walls(domain, unit_fluid(), 1.0, axis=1, velocity=(None, (1.0, 0.0)))
    scheme = TransportVelocity(
        gravity=(0.1, 0.0), filter_every=1, normalise_viscosity=True, support=2.2, skin=0.3
    )
    return Simulation(domain, [fluid(domain, unit_fluid(), 1.0), *moving], scheme, device=device), 2


def mirror(device):
    return beside_a_mirror(device), 2


SYSTEMS = (
    noisy,
    hot_walls,
    hot_walls_in_space,
    walls,
    trapezoidal,
    species,
    transported,
    plates,
    mirror,
)


def agree(make):
    """Every field after some steps."""
    states = []
    for backend in ("cpu", "cuda"):
        simulation, steps = make(Device(backend, form="gather" if backend == "cpu" else None))
        simulation.advance(steps)
        assert simulation.device.backend == backend
        states.append(simulation.state()["fields"])
    for name, cpu in states[0].items():
        scale = np.abs(cpu.astype(float)).max(initial=0) or 1.0
        error = np.abs(cpu.astype(float) - states[1][name]).max(initial=0) / scale
        assert error < 1e-11, (make.__name__, name, error)
    print(make.__name__, "agrees", flush=True)


@pytest.mark.parametrize("make", SYSTEMS, ids=lambda make: make.__name__)
def test_cuda_gives_what_the_cpu_gives(make):
    pytest.importorskip("numba.cuda", reason="numba.cuda is missing")
    assert lines_on_simulator(__file__, make.__name__) == [f"{make.__name__} agrees"]


if __name__ == "__main__":
    for make in SYSTEMS:
        if make.__name__ in (sys.argv[1:] or [make.__name__]):
            agree(make)
