"""Order of the splittings, and the law of molecules under Strang's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from particell.chemistry.reactions import Reaction
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.kernels import WENDLAND_C2, normalisation, shape_f

KAPPA = 1e-10
LEVEL = 1e-7  # false-alarm rate of the chi-square test


def final(lattice, splitting, parts):
    species = [Species("A", KAPPA), Species("B", 0.3 * KAPPA)]
    reactions = [Reaction("A + B -> 0", forward=400.0)]
    chem = lattice(side=8, disturb=0.1).chemistry(species, reactions, splitting=splitting)
    chem.set_concentration("A", lambda x: 1 + 0.9 * np.sin(x[:, 0] * 2e5 * np.pi))
    chem.set_concentration("B", lambda x: 1 + 0.9 * np.cos(x[:, 1] * 2e5 * np.pi))
    time = 4 * chem.limits()["diffusion of concentrations"]
    for step in range(parts):
        chem.step(step, time / parts)
    return np.concatenate([chem.concentration("A"), chem.concentration("B")])


def test_order(lattice):
    fine = final(lattice, "strang", 256)
    found = {}
    for splitting, order in (("lie", 1), ("strang", 2)):
        each = [np.abs(final(lattice, splitting, parts) - fine).max() for parts in (8, 16, 32)]
        orders = np.log2(np.array(each[:-1]) / each[1:])
        assert np.abs(orders - order).max() < 0.25
        found[splitting] = each
    assert found["strang"][0] < 0.1 * found["lie"][0]


def test_molecules_have_the_law_of_the_split_exponentials(lattice):
    species = [Species("M", KAPPA, molecules=True), Species("N", molecules=True)]
    box = lattice(disturb=0.2)
    tau = 2e-3
    a, b = 150.0, 60.0
    reactions = [Reaction("M <-> N", forward=a, backward=b)]
    chem = box.chemistry(species, reactions, splitting="strang", seed=5)
    p = chem.particles
    x, h = p.host("x"), p.host("support")[0]
    d = x[:, None] - x[None]
    d -= box.length * np.rint(d / box.length)
    q = np.sqrt((d**2).sum(-1)) / h
    f = normalisation(WENDLAND_C2, 2) / h**4 * np.vectorize(shape_f)(q, WENDLAND_C2)
    k = 2 * KAPPA * (p.host("mass") / p.host("density"))[None, :] * f
    np.fill_diagonal(k, 0.0)
    size = len(x)
    jumps = np.zeros((2 * size, 2 * size))
    jumps[:size, :size] = k - np.diag(k.sum(axis=1))
    turns = np.kron(np.array([[-a, a], [b, -b]]), np.eye(size))
    half = expm(0.5 * tau * turns)
    law = np.linalg.matrix_power(half @ expm(tau * jumps) @ half, 2)
    exact = expm(2 * tau * (jumps + turns))
    number = 400_000
    start = np.zeros(size)
    start[8] = number
    chem.set_count("M", start)
    for step in range(2):
        chem.step(step, tau)
    got = chem.particles.host("count").T.ravel()
    expected = number * law[8]
    assert got.sum() == number
    enough = expected > 10
    tail = [got[~enough].sum()], [expected[~enough].sum()]
    got, expected = np.append(got[enough], tail[0]), np.append(expected[enough], tail[1])
    assert stats.chisquare(got[expected > 0], expected[expected > 0]).pvalue > LEVEL
    # the splitting itself: first order would be off by some per cent here
    assert np.abs(law[8] - exact[8]).sum() < 0.01


def test_unknown_splitting_is_refused(lattice):
    with pytest.raises(InputError, match="splitting"):
        lattice().chemistry([Species("A")], splitting="godunov")
