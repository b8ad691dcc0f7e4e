"""Finite-element reference for natural convection around a cylinder in a square cavity.

A cylinder of diameter 0.2 stands at the centre of the unit square; on it C = 1, on the square
C = 0, no slip on both. With v0 = sqrt(g beta dC L) and L as units the steady Boussinesq equations
are

    u . grad u = -grad p + sqrt(Sc/Ra) lap u + C e_y,  div u = 0,  u . grad C = lap C / sqrt(Ra Sc).

The flow that is symmetric about x = 1/2 is computed in the half x > 1/2: Taylor-Hood elements
(Q2-Q1, C in Q2) on a tensor mesh between cylinder and square, curved along the cylinder and graded
towards both; Newton's method with continuation in Ra. The transfer Q/(kappa dC) is the reaction at
the nodes of the cylinder, and at those of the square, of both halves.

Usage: ``python references/natural_convection_fem.py --out DIR [--cells 24]``; needs numpy, scipy
and scikit-fem. ``--cells`` counts elements along half a side of the square; 8/3 as many lie from
the cylinder to the square. The stored data are of 36 cells, from which 24 differ by at most 2e-5.
It writes ``natural_convection_Ra1e4.csv`` and those of 1e5 and 1e6, and prints what another mesh
can be compared with.
"""

import argparse
import pathlib

import numpy as np
from scipy.sparse import bmat
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad1,
    ElementQuad2,
    ElementVector,
    MeshQuad,
    MeshQuad2,
)
from skfem.helpers import ddot, div, dot, grad, mul

RADIUS, SCHMIDT = 0.1, 0.7
PATH = (1e4, 2.5e4, 6e4, 1e5, 2e5, 4e5, 1e6)
WANTED = (1e4, 1e5, 1e6)
PLACES = np.linspace(0.6, 1.0, 401)
NEAR = 1e-9


def make_mesh(cells):
    """The half of the gap: from below the cylinder (s = 0) around to above it (s = 4)."""
    s = np.linspace(0, 4, 4 * cells + 1)
    across = np.linspace(-1, 1, round(8 * cells / 3) + 1)
    t = 0.5 * (1 + np.tanh(1.6 * across) / np.tanh(1.6))
    mesh = MeshQuad2.from_mesh(MeshQuad.init_tensor(s, t))
    around, out = mesh.doflocs
    angle = np.deg2rad(-90 + 45 * around)
    circle = 0.5 + RADIUS * np.array([np.cos(angle), np.sin(angle)])
    low, high = around <= 1, around > 3
    wall = np.array(
        [
            np.where(low, 0.5 + 0.5 * around, np.where(high, 0.5 + 0.5 * (4 - around), 1.0)),
            np.where(low, 0.0, np.where(high, 1.0, 0.5 * (around - 1))),
        ]
    )
    return MeshQuad2((1 - out) * circle + out * wall, mesh.t)


inner_product = BilinearForm(lambda u, v, w: ddot(grad(u), grad(v)))
laplacian = BilinearForm(lambda c, d, w: dot(grad(c), grad(d)))
divergence = BilinearForm(lambda u, q, w: -div(u) * q)
buoyancy = BilinearForm(lambda c, v, w: -c * v[1])
carried = BilinearForm(lambda u, v, w: dot(mul(grad(u), w["u0"]), v))
carrying = BilinearForm(lambda u, v, w: dot(mul(grad(w["u0"]), u), v))
species_carried = BilinearForm(lambda c, d, w: dot(w["u0"], grad(c)) * d)
species_carrying = BilinearForm(lambda u, d, w: dot(u, grad(w["c0"])) * d)


class Problem:
    """Unknowns: velocities, concentrations, pressures, one after the other in ``solution``."""

    def __init__(self, cells):
        mesh = make_mesh(cells)
        self.flow = Basis(mesh, ElementVector(ElementQuad2()), intorder=6)
        self.species = Basis(mesh, ElementQuad2(), intorder=6)
        pressure = Basis(mesh, ElementQuad1(), intorder=6)
        self.component = np.zeros(self.flow.N, int)
        for dofs in (self.flow.nodal_dofs, self.flow.facet_dofs, self.flow.interior_dofs):
            self.component[dofs[1]] = 1
        on_wall, on_cylinder, on_axis = _sides(self.flow.doflocs)
        fixed = on_wall | on_cylinder | (on_axis & (self.component == 0))
        self.wall, self.cylinder, _ = (np.flatnonzero(m) for m in _sides(self.species.doflocs))
        n = self.flow.N + self.species.N
        self.solution = np.zeros(n + pressure.N)
        self.solution[self.flow.N + self.cylinder] = 1.0
        self.free = np.ones(len(self.solution), bool)
        self.free[: self.flow.N] = ~fixed
        self.free[self.flow.N + self.wall] = False
        self.free[self.flow.N + self.cylinder] = False
        self.free[n] = False  # the level of the pressure
        self.friction = inner_product.assemble(self.flow)
        self.diffusion = laplacian.assemble(self.species)
        self.divergence = divergence.assemble(self.flow, pressure)
        self.buoyancy = buoyancy.assemble(self.species, self.flow)

    def split(self):
        """Velocities, concentrations, pressures."""
        return np.split(self.solution, [self.flow.N, self.flow.N + self.species.N])

    def solve(self, rayleigh):
        """Newton's method from the present solution; gives Q of cylinder and square."""
        nu, kappa = np.sqrt(SCHMIDT / rayleigh), 1 / np.sqrt(rayleigh * SCHMIDT)
        for _ in range(25):
            u, c, p = self.split()
            known = {"u0": self.flow.interpolate(u), "c0": self.species.interpolate(c)}
            advection = carried.assemble(self.flow, u0=known["u0"])
            transport = species_carried.assemble(self.species, u0=known["u0"])
            transfer = transport @ c + kappa * (self.diffusion @ c)
            force = advection @ u + nu * (self.friction @ u) + self.buoyancy @ c
            force += self.divergence.T @ p
            residual = np.concatenate([force, transfer, self.divergence @ u])
            if np.abs(residual[self.free]).max() < 1e-11:
                sides = transfer[self.cylinder].sum(), -transfer[self.wall].sum()
                return 2 / kappa * sides[0], 2 / kappa * sides[1]
            turning = carrying.assemble(self.flow, u0=known["u0"])
            bringing = species_carrying.assemble(self.flow, self.species, c0=known["c0"])
            jacobian = bmat(
                [
                    [
                        advection + turning + nu * self.friction,
                        self.buoyancy,
                        self.divergence.T,
                    ],
                    [bringing, transport + kappa * self.diffusion, None],
                    [self.divergence, None, None],
                ],
                format="csr",
            )
            system = jacobian[self.free][:, self.free].tocsc()
            self.solution[self.free] -= splu(system).solve(residual[self.free])
        raise RuntimeError(f"Newton's method does not converge at Ra = {rayleigh:g}")

    def centreline(self):
        """C, v_y, v_x at :data:`PLACES` on y = 1/2, which is a line of the mesh."""
        u, c, _ = self.split()
        middle = np.abs(self.flow.doflocs[1] - 0.5) < NEAR
        lines = [(self.species.doflocs[0], c, np.abs(self.species.doflocs[1] - 0.5) < NEAR)]
        lines += [(self.flow.doflocs[0], u, middle & (self.component == k)) for k in (1, 0)]
        found = []
        for x, values, on in lines:
            order = np.argsort(x[on])
            found.append(_quadratic(x[on][order], values[on][order], PLACES))
        return found


def _sides(x):
    """Masks: on the square, on the cylinder, on the axis of symmetry."""
    square = (np.abs(x[0] - 1) < NEAR) | (np.abs(x[1]) < NEAR) | (np.abs(x[1] - 1) < NEAR)
    # middles of curved edges are on a parabola, not on the circle
    cylinder = np.abs(np.hypot(x[0] - 0.5, x[1] - 0.5) - RADIUS) < 1e-5
    return square, cylinder, np.abs(x[0] - 0.5) < NEAR


def _quadratic(nodes, values, x):
    """Values between nodes of which every second one ends an element of degree 2."""
    k = 2 * np.clip(np.searchsorted(nodes[::2], x, side="right") - 1, 0, len(nodes) // 2 - 1)
    a, b, c = nodes[k], nodes[k + 1], nodes[k + 2]
    return (
        values[k] * (x - b) * (x - c) / ((a - b) * (a - c))
        + values[k + 1] * (x - a) * (x - c) / ((b - a) * (b - c))
        + values[k + 2] * (x - a) * (x - b) / ((c - a) * (c - b))
    )


HEADER = """C, velocity over v0 on the horizontal centreline, from the cylinder (0.6) to the wall
x_star = x/L. Cylinder of diameter 0.2 L with C = 1 at the centre of a closed square cavity with
C = 0 on its walls, no slip; Ra = {ra}, Sc = 0.7; v0 = sqrt(g beta dC L), Re = v0 L/nu = sqrt(Ra/Sc)
Steady state, symmetric about x = 0.5; vy is upwards.
Finite elements: references/natural_convection_fem.py, {cells} cells;
Q/(kappa dC) = {cylinder:.6f} from the cylinder, {wall:.6f} into the walls.
x_star, C, vy, vx"""


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the CSV files")
    parser.add_argument("--cells", type=int, default=24, help="elements along half a side")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    problem = Problem(args.cells)
    print(f"{len(problem.solution)} unknowns", flush=True)
    for rayleigh in PATH:
        cylinder, wall = problem.solve(rayleigh)
        c, vy, vx = problem.centreline()
        print(
            f"Ra = {rayleigh:g}: Q/2 = {cylinder / 2:.6f} (walls {wall / 2:.6f}), "
            f"largest vy {vy.max():.6f}, least {vy.min():.6f}",
            flush=True,
        )
        if rayleigh in WANTED:
            name = f"1e{round(np.log10(rayleigh))}"
            header = HEADER.format(ra=name, cells=args.cells, cylinder=cylinder, wall=wall)
            np.savetxt(
                args.out / f"natural_convection_Ra{name}.csv",
                np.column_stack([PLACES, c, vy, vx]),
                fmt="%.8f",
                delimiter=",",
                header=header,
            )


if __name__ == "__main__":
    main()
