"""Small symmetric tensors against NumPy's linear algebra, on random and degenerate ones."""

from __future__ import annotations

import numpy as np
import pytest

from particell.laws.tensors import carried, factorise, is_thin, substitute, within

ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))


def tensors():
    """Positive ones, with eigenvalues that are far apart, equal or nothing, and diagonal ones."""
    random, found = np.random.default_rng(1), []
    for values in ((3, 2, 1), (3, 0.2, 0.1), (2, 2, 0.1), (1, 1, 1), (5, 0, 0), (1e3, 1, 1e-3)):
        for _ in range(5):
            turned, _ = np.linalg.qr(random.normal(size=(3, 3)))
            found.append(turned @ np.diag(values) @ turned.T)
        found.append(np.diag(values).astype(float))
    return found


def packed(tensor):
    return tuple(float(tensor[place]) for place in ORDER)


def projector(tensor, least):
    values, vectors = np.linalg.eigh(tensor)
    above = vectors[:, values > least]
    return above @ above.T


def test_projectors():
    for tensor in tensors():
        for least in (0.5, 1.5, 1e4):
            found = carried.py_func(*packed(tensor), least)
            assert found == pytest.approx(packed(projector(tensor, least)), abs=1e-12)


def test_what_is_left_within_a_projector():
    """Π R Π − Π tr(Π R Π)/tr Π."""
    other = np.random.default_rng(2).normal(size=(3, 3))
    other += other.T
    for tensor in tensors():
        p = projector(tensor, 0.5)
        inside = p @ other @ p
        inside -= p * np.trace(inside) / max(1.0, np.trace(p))
        assert within.py_func(packed(p), *packed(other)) == pytest.approx(packed(inside), abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_tensor_is_thin_where_an_eigenvalue_is_small(dim):
    found = []
    for tensor in tensors():
        plane = np.zeros((3, 3))
        plane[:dim, :dim] = tensor[:dim, :dim]
        values = np.linalg.eigvalsh(plane[:dim, :dim])
        for least in (0.05, 0.5, 0.8, 1.5, 2.5):
            if np.abs(values - least).min() > 1e-9:
                thin = is_thin.py_func(*packed(plane), least, dim)
                assert thin == (values.min() < least)
                found.append(thin)
    assert min(found.count(True), found.count(False)) > 20


@pytest.mark.parametrize("number", [1, 3, 6])
def test_equations(number):
    random = np.random.default_rng(3)
    root = random.normal(size=(number, number))
    matrix, right = root @ root.T, random.normal(size=number)
    row, column = np.tril_indices(number)
    work = np.concatenate([[7.0], matrix[row, column], [8.0], right])
    factorise.py_func(work, 1, number, 0.25)
    substitute.py_func(work, 1, 2 + len(row), number)
    exact = np.linalg.solve(matrix + 0.25 * np.eye(number), right)
    assert work[2 + len(row) :] == pytest.approx(exact, rel=1e-11)
    assert (work[0], work[1 + len(row)]) == (7.0, 8.0)
