"""Finite-element reference for the lid-driven cavity: centreline velocities, corner vortices.

Steady incompressible Navier-Stokes in the unit square, u = (1, 0) on the lid y = 1 (its two end
points belong to the side walls), no slip elsewhere; Re = 1/nu. Taylor-Hood elements (Q2-Q1) on a
tensor mesh that is graded towards all walls; Newton's method with continuation in Re, started from
the Stokes flow.

A corner vortex is as wide and high as the largest distance from the corner, up to 0.48, at which
the wall's shear changes its sign, on the bottom and on the side wall.

Usage: ``python references/lid_driven_cavity_fem.py --out DIR [--cells 64]``; needs numpy, scipy and
scikit-fem. It writes ``lid_driven_cavity_fem.csv`` and ``lid_driven_cavity_corners.csv`` and prints
what another mesh can be compared with.
"""

import argparse
import pathlib

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import bmat, csr_matrix
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad1,
    ElementQuad2,
    ElementVector,
    LinearForm,
    MeshQuad,
)
from skfem.helpers import ddot, div, dot, grad

REYNOLDS = (100, 1000, 10000)
STEPS = (100, 400, 1000, 2000, 3200, 4500, 6000, 8000, 10000)


def graded(cells, strength=2.0):
    """Points from 0 to 1 that are densest at both ends."""
    s = np.linspace(-1.0, 1.0, cells + 1)
    return 0.5 * (1.0 + np.tanh(strength * s) / np.tanh(strength))


@BilinearForm
def stress(u, v, w):
    return w.nu * ddot(grad(u), grad(v))


@BilinearForm
def pressure_divergence(u, q, w):
    return -div(u) * q


@BilinearForm
def advection_jacobian(u, v, w):
    # (U·∇)u + (u·∇)U
    U, dU = w["U"], grad(w["U"])
    carried = np.einsum("j...,ij...->i...", U, grad(u))
    carrying = np.einsum("j...,ij...->i...", u.value, dU)
    return dot(carried + carrying, v)


@LinearForm
def advection(v, w):
    U = w["U"]
    return dot(np.einsum("j...,ij...->i...", U, grad(U)), v)


class Cavity:
    """The discrete problem."""

    def __init__(self, cells):
        points = graded(cells)
        mesh = MeshQuad.init_tensor(points, points)
        self.velocity = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
        self.pressure = Basis(mesh, ElementQuad1(), intorder=5)
        b = pressure_divergence.assemble(self.velocity, self.pressure)
        self.b = csr_matrix(b)
        self.n, self.m = self.velocity.N, self.pressure.N
        x = self.velocity.doflocs
        edge = 1e-12
        wall = (x[0] < edge) | (x[0] > 1 - edge) | (x[1] < edge) | (x[1] > 1 - edge)
        lid = (x[1] > 1 - edge) & (x[0] > edge) & (x[0] < 1 - edge)
        horizontal = np.zeros(self.n, bool)
        horizontal[self.velocity.split_indices()[0]] = True
        self.u = np.where(lid & horizontal, 1.0, 0.0)
        self.p = np.zeros(self.m)
        # one pressure is zero
        self.free = np.concatenate([np.flatnonzero(~wall), self.n + np.arange(1, self.m)])

    def newton(self, reynolds, inertia=1.0):
        """Solve at a Reynolds number, starting from what is there."""
        a = stress.assemble(self.velocity, nu=1.0 / reynolds)
        for _ in range(30):
            U = self.velocity.interpolate(self.u)
            jacobian = a + inertia * advection_jacobian.assemble(self.velocity, U=U)
            residual = a @ self.u + inertia * advection.assemble(self.velocity, U=U)
            residual = np.concatenate([residual + self.b.T @ self.p, self.b @ self.u])
            matrix = csr_matrix(bmat([[jacobian, self.b.T], [self.b, None]]))
            free = self.free
            change = np.zeros(self.n + self.m)
            change[free] = splu(matrix[free][:, free].tocsc()).solve(-residual[free])
            self.u += change[: self.n]
            self.p += change[self.n :]
            if np.abs(change[: self.n]).max() < 1e-10:
                return
        raise RuntimeError(f"no convergence at Re = {reynolds}")

    def at(self, x, y):
        """Velocity (2, m) at points."""
        points = np.stack([np.atleast_1d(x), np.atleast_1d(y)]).astype(float)
        return (self.velocity.probes(points) @ self.u).reshape(2, -1)

    def shear(self, wall, s):
        """Derivative of the velocity along a wall, across it, at the distance s along it."""
        d = 1e-4
        near = [k * d for k in (1, 2)]
        if wall == "bottom":
            one, two = (self.at(s, e)[0, 0] for e in near)
        elif wall == "left":
            one, two = (self.at(e, s)[1, 0] for e in near)
        else:
            one, two = (self.at(1 - e, s)[1, 0] for e in near)
        return (2 * one - 0.5 * two) / d  # second order

    def corners(self):
        """Width on the bottom and height at the side of both vortices at the bottom."""

        def outermost_zero(function, start=0.02, stop=0.48, number=93):
            s = np.linspace(start, stop, number)
            values = [function(x) for x in s]
            for k in reversed(range(number - 1)):
                if values[k] * values[k + 1] < 0:
                    return brentq(function, s[k], s[k + 1])
            return np.nan

        return (
            outermost_zero(lambda s: self.shear("bottom", s)),
            outermost_zero(lambda s: self.shear("left", s)),
            outermost_zero(lambda s: self.shear("bottom", 1 - s)),
            outermost_zero(lambda s: self.shear("right", s)),
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--cells", type=int, default=64)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    cavity = Cavity(arguments.cells)
    cavity.newton(1.0, inertia=0.0)
    s = np.linspace(0, 1, 257)
    half = np.full_like(s, 0.5)
    columns, corners = [s], []
    for reynolds in STEPS:
        cavity.newton(reynolds)
        if reynolds not in REYNOLDS:
            continue
        u, v = cavity.at(half, s)[0], cavity.at(s, half)[1]
        columns += [u, v]
        sizes = ""
        if reynolds <= 1000:  # beyond, there are vortices within these
            corners.append((reynolds, *cavity.corners()))
            sizes = " ".join(f"{size:.4f}" for size in corners[-1][1:])
        print(
            f"Re {reynolds}: u_min {u.min():.5f} v_max {v.max():.5f} v_min {v.min():.5f}; {sizes}"
        )
    about = (
        "Lid-driven cavity of side 1, lid y = 1 moving with u = 1; steady, Q2-Q1 finite elements,\n"
        f"{arguments.cells}^2 graded cells, made by references/lid_driven_cavity_fem.py\n"
    )
    names = ["s", *(f"{c}_{re}" for re in REYNOLDS for c in "uv")]
    np.savetxt(
        arguments.out / "lid_driven_cavity_fem.csv",
        np.stack(columns, axis=1),
        "%.7f",
        ",",
        header=about + "u_Re(y = s) on x = 1/2, v_Re(x = s) on y = 1/2\n" + ",".join(names),
    )
    np.savetxt(
        arguments.out / "lid_driven_cavity_corners.csv",
        np.array(corners),
        ["%g", *["%.5f"] * 4],
        ",",
        header=about
        + "Largest distance from the corner at which the wall's shear changes sign, at the bottom"
        + " and the side\nreynolds,left_width,left_height,right_width,right_height",
    )


if __name__ == "__main__":
    main()
