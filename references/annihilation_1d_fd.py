"""Finite-difference reference for A + B -> 0 between two walls.

With a = C_A/C0, b = C_B/C0, x in units of L and tau in units of L^2/kappa,

    a_tau = a'' - Da a b,   b_tau = b'' - Da a b;   a = 1, b = 0 at x = 0;   a = 0, b = 1 at x = 1,

from a = b = 0. Second-order differences on points that are densest in the middle, where the
reaction is; Radau's method in time; Richardson extrapolation from two grids, and a cubic spline to
129 equal points. In the steady state b = a - 1 + 2x, and a'' = Da a b is solved by Newton's method.
The difference a - b does not depend on Da and is known exactly, which the script checks.

Usage: ``python references/annihilation_1d_fd.py --out DIR [--damkohler 1 16000 ...]``; needs numpy
and scipy; a minute for each Da. It writes ``annihilation_Da*.csv``.
"""

import argparse
import pathlib
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.sparse import bmat, diags
from scipy.sparse.linalg import spsolve

DAMKOHLER = (1, 16_000, 32_000, 64_000, 160_000, 320_000, 640_000)
TIMES = (0.2, 0.4, 0.6, 0.8, 1.0)  # L^2/(10 kappa)
PLACES = np.linspace(0, 1, 129)
GRIDS, STEADY_GRIDS = (400, 800), (2000, 4000)


def make_grid(number, strength):
    """Points from 0 to 1; equal ones where ``strength`` is 0, else denser in the middle."""
    s = np.linspace(-1, 1, number + 1)
    return 0.5 + 0.5 * (np.sinh(strength * s) / np.sinh(strength) if strength else s)


def second_derivative(x):
    """Of values at the inner points: a matrix, and what the two ends add to the outermost."""
    left, right = np.diff(x)[:-1], np.diff(x)[1:]
    below, above = 2 / (left * (left + right)), 2 / (right * (left + right))
    matrix = diags([below[1:], -below - above, above[:-1]], [-1, 0, 1], format="csc")
    return matrix, below[0], above[-1]


def exact_difference(x, t, terms=4000):
    """a - b at places x (n,) and a time t in L^2/(10 kappa)."""
    n = 2 * np.arange(1, terms)[:, None]
    decay = np.exp(-(n**2) * np.pi**2 * 0.1 * t)
    return 1 - 2 * x - (4 / (n * np.pi) * np.sin(n * np.pi * x) * decay).sum(axis=0)


def transient(damkohler, number, strength):
    """Points, and a and b there (2, n) at each of :data:`TIMES`."""
    x = make_grid(number, strength)
    matrix, first, last = second_derivative(x)
    n = number - 1
    ends = np.zeros((2, n))
    ends[0, 0], ends[1, -1] = first, last

    def rate(_, y):
        a, b = y.reshape(2, n)
        lost = damkohler * a * b
        return np.concatenate([matrix @ a + ends[0] - lost, matrix @ b + ends[1] - lost])

    def jacobian(_, y):
        a, b = (diags(damkohler * part) for part in y.reshape(2, n))
        return bmat([[matrix - b, -a], [-b, matrix - a]], format="csc")

    times = 0.1 * np.array(TIMES)
    options = {"method": "Radau", "rtol": 1e-8, "atol": 1e-11, "jac": jacobian}
    found = solve_ivp(rate, (0, times[-1]), np.zeros(2 * n), t_eval=times, **options).y
    profiles = []
    for k in range(len(times)):
        a, b = found[:, k].reshape(2, n)
        profiles.append(np.array([np.r_[1, a, 0], np.r_[0, b, 1]]))
    return x, profiles


def steady(damkohler, number, strength):
    """Points, and a there (n,) in the steady state."""
    x = make_grid(number, strength)
    matrix, first, _ = second_derivative(x)
    end = np.zeros(number - 1)
    end[0] = first
    straight = 1 - 2 * x[1:-1]
    a = 0.5 * (straight + np.sqrt(straight**2 + damkohler ** (-2 / 3)))
    for _ in range(60):
        residual = matrix @ a + end - damkohler * a * (a - straight)
        step = spsolve((matrix - diags(damkohler * (2 * a - straight))).tocsc(), residual)
        a = a - step
        if np.abs(step).max() < 1e-9:  # it squares: the next one is round-off
            return x, np.r_[1, a, 0]
    raise RuntimeError(f"Newton's method does not converge at Da = {damkohler:g}")


def extrapolated(coarse, fine):
    """Richardson's value at the points of the coarser grid, of second-order values on both."""
    return fine[..., ::2] + (fine[..., ::2] - coarse) / 3


def solve(damkohler, grids=GRIDS, steady_grids=STEADY_GRIDS):
    """The table (129, 13): x, a and b at each time, and in the steady state.

    Returns
    -------
    table, error
        Also the largest error of the exact difference.
    """
    strength = 4 if damkohler > 10 else 0
    (x, coarse), (_, fine) = (transient(damkohler, number, strength) for number in grids)
    columns, error = [PLACES], 0.0
    for t, one, two in zip(TIMES, coarse, fine, strict=True):
        best = extrapolated(one, two)
        columns += list(CubicSpline(x, best, axis=1)(PLACES))
        error = max(error, np.abs(best[0] - best[1] - exact_difference(x, t)).max())
    (x, one), (_, two) = (steady(damkohler, number, strength) for number in steady_grids)
    a = CubicSpline(x, extrapolated(one, two))(PLACES)
    return np.column_stack([*columns, a, a - 1 + 2 * PLACES]), error


HEADER = """C_A/C0 and C_B/C0 of A + B -> 0 in a slab: A = C0 at x = 0, B = C0 at x = L, each 0 at
the other wall and everywhere at t = 0; x in units of L, t in L^2/(10 kappa), kappa of A and B.
Da = k C0 L^2/kappa = {damkohler:g}. Finite differences, Richardson extrapolation:
references/annihilation_1d_fd.py; the exact C_A - C_B holds to {error:.1e}.
x, {names}, A_tinf, B_tinf"""


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the CSV files")
    parser.add_argument("--damkohler", type=float, nargs="+", default=DAMKOHLER)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    names = ", ".join(f"A_t{t:g}, B_t{t:g}".replace("t1,", "t1.0,") for t in TIMES[:-1])
    names += ", A_t1.0, B_t1.0"
    for damkohler in args.damkohler:
        start = time.perf_counter()
        table, error = solve(damkohler)
        np.savetxt(
            args.out / f"annihilation_Da{damkohler:.0f}.csv",
            table,
            fmt="%.8g",
            delimiter=",",
            header=HEADER.format(damkohler=damkohler, error=error, names=names),
        )
        took = time.perf_counter() - start
        print(
            f"Da = {damkohler:g}: a(1/2) = {table[64, 11]:.8f} steady, {table[64, 9]:.8f} at t = 1"
        )
        print(f"    a - b to {error:.1e}; {took:.0f} s", flush=True)


if __name__ == "__main__":
    main()
