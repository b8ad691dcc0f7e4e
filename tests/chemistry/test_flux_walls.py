"""Walls with a flux (Neumann) or a transfer (Robin), for both kinds of species."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from particell.chemistry.reservoirs import FixedValueWall, FluxWall
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.materials import AVOGADRO

KAPPA = 1e-10
FLUX = 3e-5  # mol/m²/s
LENGTH = 10 / 16 * 1e-5  # of the fluid between the walls of wall_lattice
LEFT = 6 / 16 * 1e-5
HEIGHT = 1e-5


def make(box, species, boundaries, **options):
    return box.chemistry(species, (), boundaries, kernel="lucy", **options)


def distance(chem):
    """Distance of the fluid particles from the left wall."""
    return chem.particles.host("x")[chem.particles.select("fluid"), 0] - LEFT


def fluid(chem, name):
    return chem.concentration(name)[chem.particles.select("fluid")]


@pytest.mark.parametrize(
    ("wall", "flux"),
    [
        (FluxWall("left", flux={"A": FLUX}), FLUX),
        (FluxWall("left", transfer={"A": (4e-5, 3.0)}), 3.0 / (1 / 4e-5 + LENGTH / KAPPA)),
    ],
)
def test_linear_profile_is_steady(wall_lattice, wall, flux):
    """Constant flux, or transfer, on the left and C = 0 on the right."""
    boundaries = [wall, FixedValueWall("right", {"A": 0.0})]
    chem = make(wall_lattice(), [Species("A", KAPPA)], boundaries, normalise=True)

    def line(d):
        return flux / KAPPA * (LENGTH - d)

    chem.set_concentration("A", lambda x: line(x[:, 0] - LEFT), "fluid")
    tau = 0.4 * chem.limits()["diffusion of concentrations"]
    for step in range(50):
        chem.step(step, tau)
    np.testing.assert_allclose(fluid(chem, "A"), line(distance(chem)), rtol=1e-11)


def test_what_enters_is_flux_times_area_times_time(wall_lattice):
    """On a disturbed lattice, where the sum of the kernels' shares is not exactly the area."""
    species = [Species("A", KAPPA), Species("B")]
    boundaries = [FluxWall("left", flux={"A": FLUX, "B": 2 * FLUX})]
    chem = make(wall_lattice(disturb=0.15), species, boundaries)
    tau = 0.4 * chem.limits()["diffusion of concentrations"]
    chem.step(0, tau)
    area = chem._diffusion.areas[1]  # layers that are disturbed too: near the height of the box
    assert area == pytest.approx(HEIGHT, rel=0.05)
    for step in range(1, 40):
        chem.step(step, tau)
    totals = chem.totals()
    for name, flux in (("A", FLUX), ("B", 2 * FLUX)):
        assert totals[name][0] == pytest.approx(flux * area * 40 * tau, rel=1e-12)
        assert totals[name][1] == pytest.approx(totals[name][0], rel=1e-12)


def test_area_is_exact_for_layers_and_can_be_given(wall_lattice):
    wall = FluxWall("left", flux={"A": FLUX})
    chem = make(wall_lattice(), [Species("A", KAPPA)], [wall])
    chem.step(0, 1e-5)
    assert chem._diffusion.areas[1] == pytest.approx(HEIGHT, rel=1e-12)
    given = FluxWall("left", flux={"A": FLUX}, area=0.5 * HEIGHT * 1e-6)
    chem = make(wall_lattice(), [Species("A", KAPPA)], [given])
    chem.step(0, 1e-5)
    assert chem.totals()["A"][0] == pytest.approx(0.5 * FLUX * HEIGHT * 1e-5, rel=1e-12)


def robin_series(d, time, transfer, external, terms=60):
    """Slab of the fluid's length, C = 0 in the beginning, impermeable on the right."""
    biot = transfer * LENGTH / KAPPA
    roots = [
        brentq(lambda b: b * np.tan(b) - biot, n * np.pi + 1e-9, (n + 0.5) * np.pi - 1e-9)
        for n in range(terms)
    ]
    c = np.zeros_like(d)
    for b in roots:
        factor = 4 * np.sin(b) / (2 * b + np.sin(2 * b))
        c += factor * np.cos(b * (1 - d / LENGTH)) * np.exp(-(b**2) * KAPPA * time / LENGTH**2)
    return external * (1 - c)


def test_transient_transfer_against_the_series(wall_lattice):
    transfer, external = 2 * KAPPA / LENGTH, 2.0
    wall = FluxWall("left", transfer={"A": (transfer, external)})
    chem = make(wall_lattice(), [Species("A", KAPPA)], [wall], normalise=True, splitting="strang")
    time = 0.3 * LENGTH**2 / KAPPA
    steps = int(np.ceil(time / (0.5 * chem.limits()["diffusion of concentrations"])))
    for step in range(steps):
        chem.step(step, time / steps)
    exact = robin_series(distance(chem), time, transfer, external)
    error = np.sqrt(((fluid(chem, "A") - exact) ** 2).sum() / (exact**2).sum())
    assert error < 3e-3  # ten particles across
    total, booked = chem.totals()["A"]
    assert total == pytest.approx(booked, rel=1e-12)


def test_molecules_are_poisson_around_the_concentrations(wall_lattice):
    """From empty, both with a flux and a transfer: independent Poisson numbers."""
    scale = 1e-3
    species = [Species("A", KAPPA), Species("M", KAPPA, molecules=True)]
    box = wall_lattice()
    transfer = 5e-5
    wall = FluxWall(
        "left",
        flux={"A": FLUX, "M": FLUX * scale},
        transfer={"A": (transfer, 1.0), "M": (transfer, scale)},
    )
    sink = FluxWall("right", transfer={"A": (transfer, 0.0), "M": (transfer, 0.0)})
    chem = make(box, species, [wall, sink], seed=3)
    chosen = chem.particles.select("fluid")
    tau = 1.0 * chem.limits()["diffusion of concentrations"]
    found = []
    for parts in (100, 200):  # Richardson's extrapolation of two Euler solutions
        chem.set_concentration("A", 0.0)
        for step in range(parts):
            chem.step(step, tau / parts)
        found.append(fluid(chem, "A"))
    mean = 2 * found[1] - found[0]
    volume = (box.length / box.side) ** 2 * box.depth
    expected = mean * scale * volume * AVOGADRO
    got = np.empty((150, chosen.sum()))
    for r in range(len(got)):
        chem.set_count("M", 0)
        zero = chem.totals()["M"]
        for s in range(2):
            chem.step(1000 + 2 * r + s, tau / 2)
        after = chem.totals()["M"]
        assert after[0] - after[1] == -zero[1]
        got[r] = chem.particles.host("count")[chosen, 0]
    near = expected > 0.02
    assert near.sum() > 60
    got, expected = got[:, near], expected[near]
    repeats = len(got)
    # 6 sigma: false-alarm rate 2e-9 for each of at most 160 means, and of the sum of squares
    assert np.abs((got.mean(0) - expected) / np.sqrt(expected / repeats)).max() < 6.0
    squares = ((got - expected) ** 2 / expected).sum()
    variance = repeats * (2 + 1 / expected).sum()
    assert abs(squares - got.size) < 6.0 * np.sqrt(variance)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"flux": {"A": -1.0}},
        {"flux": 1.0},
        {"transfer": {"A": 1.0}},
        {"transfer": {"A": (1.0, -1.0)}},
        {"flux": {"A": 1.0}, "area": 0.0},
    ],
)
def test_wrong_walls_are_refused(options):
    with pytest.raises(InputError):
        FluxWall("left", **options)
