"""Profiles of two species that annihilate in a slab, for any Da: on the way, and when steady."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.sparse import diags, eye, kron

#: Times that are looked at, 10 κt/L², and their unit in L²/κ.
TIMES, UNIT = (0.2, 0.4, 0.6, 0.8, 1.0), 0.1


def reference_profiles(damkohler: float, points: int = 512) -> dict[str, np.ndarray]:
    """Profiles of the same form as the committed ones, by finite differences.

    Parameters
    ----------
    damkohler
        Da.
    points
        Number of intervals.
    """
    inner = points - 1
    laplacian = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(inner, inner)) * points**2
    both = kron(eye(2), laplacian).tocsr()
    source = np.zeros(2 * inner)
    source[0] = source[-1] = points**2

    def slope(_: float, c: np.ndarray) -> np.ndarray:
        lost = damkohler * c[:inner] * c[inner:]
        return both @ c + source - np.concatenate([lost, lost])

    def jacobian(_: float, c: np.ndarray):
        a, b = diags(damkohler * c[:inner]), diags(damkohler * c[inner:])
        return (both - kron([[1, 0], [1, 0]], b) - kron([[0, 1], [0, 1]], a)).tocsc()

    fourier = UNIT * np.array(TIMES)
    start = np.zeros(2 * inner)
    options = {"method": "BDF", "rtol": 1e-7, "atol": 1e-9, "jac": jacobian}
    solved = solve_ivp(slope, (0, fourier[-1]), start, t_eval=fourier, **options).y
    table = {"x": np.linspace(0, 1, points + 1)}
    for k, t in enumerate(TIMES):
        a, b = solved[:inner, k], solved[inner:, k]
        table[f"A_t{t}"] = np.concatenate([[1], a, [0]])
        table[f"B_t{t}"] = np.concatenate([[0], b, [1]])
    return table


def steady_profile(damkohler: float, x: np.ndarray) -> np.ndarray:
    """C/C₀ of A and B, (2, n), in the steady state at places x/L (n,).

    a'' = Da a b with a - b = 1 - 2x, and so b = a - 1 + 2x.
    """
    # what is asymptotic at large Da: both are straight but for a layer of Da^(-1/3)
    width = max(damkohler, 1.0) ** (-1 / 3)
    fine = 0.5 + np.concatenate([-(part := np.geomspace(1e-3 * width, 0.5, 400))[::-1], [0], part])
    straight = 0.5 - fine
    guess = straight + np.sqrt(straight**2 + width**2)
    found = solve_bvp(
        lambda x, y: np.stack([y[1], damkohler * y[0] * (y[0] - 1 + 2 * x)]),
        lambda left, right: np.array([left[0] - 1, right[0]]),
        fine,
        np.stack([guess, np.gradient(guess, fine)]),
        tol=1e-8,
        max_nodes=200_000,
    )
    if not found.success:
        raise ArithmeticError(f"no steady state for Da = {damkohler:g}: {found.message}")
    a = found.sol(x)[0]
    return np.stack([a, a - 1 + 2 * x])
