"""One flow in PySPH's transport-velocity scheme: seconds a step. Run by ``against_pysph.py``.

It is run by the interpreter of PySPH's own environment, and prints one line of JSON.
"""

import json
import sys
import time

import numpy as np
from pysph.base.kernels import CubicSpline
from pysph.base.nnps import DomainManager
from pysph.base.utils import get_particle_array
from pysph.solver.application import Application
from pysph.sph.scheme import TVFScheme

WALL = 3  # layers


class Flow(Application):
    """Cavity or Taylor–Green vortices: side 1, U = 1, c₀ = 10, ρ₀ = 1."""

    def __init__(self, given):
        self.given, self.dx = given, 1.0 / given["n"]
        # PySPH's cubic spline ends at 2 h
        self.h = 0.5 * given["support"] * self.dx
        self.nu = 1.0 / given["reynolds"]
        self.seconds = []
        super().__init__()

    def create_scheme(self):
        dt = min(0.25 * self.h / 11.0, 0.125 * self.h**2 / self.nu)
        self.dt = dt
        solids = ["solid"] if self.given["flow"] == "cavity" else []
        scheme = TVFScheme(
            ["fluid"], solids, dim=2, rho0=1.0, c0=10.0, nu=self.nu, p0=100.0, pb=100.0, h0=self.h
        )
        scheme.configure_solver(kernel=CubicSpline(dim=2), tf=1e9, dt=dt, pfreq=10**9)
        return scheme

    def create_domain(self):
        if self.given["flow"] == "cavity":
            return None
        return DomainManager(xmin=0, xmax=1, ymin=0, ymax=1, periodic_in_x=True, periodic_in_y=True)

    def create_particles(self):
        dx, n = self.dx, self.given["n"]
        cavity = self.given["flow"] == "cavity"
        beyond = WALL if cavity else 0
        line = (np.arange(-beyond, n + beyond) + 0.5) * dx
        x, y = (a.ravel() for a in np.meshgrid(line, line))
        inside = (x > 0) & (x < 1) & (y > 0) & (y < 1)
        common = {"m": dx * dx, "rho": 1.0, "h": self.h}
        arrays = [get_particle_array(name="fluid", x=x[inside], y=y[inside], **common)]
        fluid = arrays[0]
        if cavity:
            solid = get_particle_array(name="solid", x=x[~inside], y=y[~inside], **common)
            arrays.append(solid)
        self.scheme.setup_properties(arrays)
        for array in arrays:
            array.V[:] = 1.0 / (dx * dx)
        if cavity:
            solid.u[:] = np.where(solid.y > 1, 1.0, 0.0)
        else:
            k = 2 * np.pi
            fluid.u[:] = -np.cos(k * fluid.x) * np.sin(k * fluid.y)
            fluid.v[:] = np.sin(k * fluid.x) * np.cos(k * fluid.y)
        return arrays

    def post_step(self, solver):
        clock = time.process_time if self.given["cores"] == 1 else time.perf_counter
        self.seconds.append(clock())


def main():
    given = json.loads(sys.argv[1])
    flow = Flow(given)
    first, steps, blocks = given["first"], given["steps"], given["blocks"]
    total = first + steps * blocks
    flow.run(
        argv=[
            f"--max-steps={total}",
            "--disable-output",
            "--openmp" if given["cores"] > 1 else "--no-openmp",
            "--directory=out",
            "--logfile=",
        ]
    )
    marks = np.array(flow.seconds)[first - 1 :: steps]
    energy = 0.5 * float(np.mean(flow.particles[0].u ** 2 + flow.particles[0].v ** 2))
    import pysph

    found = {
        "seconds": (np.diff(marks) / steps).tolist(),
        "dt": flow.dt,
        "energy": energy,
        "version": pysph.__version__,
    }
    print("\n" + json.dumps(found))


if __name__ == "__main__":
    main()
