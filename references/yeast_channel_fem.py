"""Finite-element reference for ligand transport past a yeast cell in a microchannel.

A cell (disc, radius 2.5 um) sits at rest in a plane channel of 200 um x 100 um.  Ligand enters
through the upper half of the inlet, is carried by steady Navier-Stokes flow, diffuses in the
fluid and in the membrane (annulus 1.5 um < r < 2.5 um) and binds there to immobile receptors,
``L + R <-> RL``.

All computation is in scaled form: length H = 100 um, velocity v0 (the mean inlet velocity),
time t0 = H / v0, concentration c0 = 1 mol/m^3, pressure mu v0 / H.

Discretisation: unstructured graded triangles with edges curved on the two circles (quadratic
isoparametric), P2/P1 Taylor-Hood flow (one Stokes factorisation, inertia iterated: small
Reynolds numbers only), P2 ligand in convective form without stabilisation, receptors at the
P2 nodes of the membrane, and the L-stable two-stage second-order SDIRK scheme with the
reaction iterated to convergence in each stage.

Usage: ``python references/yeast_channel_fem.py --out DIR [--reynolds 0.025] [--coarse] [--figure
PNG]``; needs numpy, scipy, scikit-fem and gmsh (matplotlib for the figure only).
"""

import argparse
import pathlib
import time
from types import SimpleNamespace

import gmsh
import numpy as np
from scipy.sparse import bmat, csr_matrix
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2, LinearForm, MeshTri, MeshTri2

# The problem in SI units.
HEIGHT, LENGTH = 100e-6, 200e-6  # channel, m
MEAN_VELOCITY = 2.5e-4  # v0, m/s
DIFFUSIVITY = 347e-12  # ligand in fluid and membrane, m^2/s
K_ON, K_OFF, C0 = 1.0, 1.0, 1.0  # m^3/(mol s), 1/s; inlet ligand and initial receptor, mol/m^3
# The problem, scaled.
T0 = HEIGHT / MEAN_VELOCITY  # s
ASPECT = LENGTH / HEIGHT
CENTRE = np.array([0.25, 0.5])
R_IN, R_OUT = 0.015, 0.025
DIFF = DIFFUSIVITY / (MEAN_VELOCITY * HEIGHT)
KON, KOFF = K_ON * C0 * T0, K_OFF * T0
T_END, SAVE = 2.0, 0.05  # duration, and interval of the time series
GAMMA = 1.0 - np.sqrt(0.5)
FINE, COARSE = (1.0, 0.0025), (2.0, 0.005)  # mesh size factor, time step / t0
TIMES = (0.5, 1.0, 1.5, 2.0)
THETA = np.arange(0.0, 360.0, 3.0)
ACROSS_X = (0.1, 0.5, 1.0, 1.5)
CELLS = 40  # of the map, across the channel; its points are their middles


def element_size(x, y, factor):
    """Return ``factor`` times the element size wanted at a point."""
    r = np.hypot(x - CENTRE[0], y - CENTRE[1])
    cell = 0.001 + 0.12 * max(r - R_OUT, 0.0)
    inlet = 0.008 + 0.15 * x
    step = 0.0004 + 0.12 * np.hypot(x, y - 0.5)
    layer = 0.004 + 0.2 * np.sqrt(DIFF * max(x, 0.0) / 1.5) + 0.2 * abs(y - 0.5)
    return factor * min(0.02, cell, inlet, step, layer)


def make_mesh(factor):
    """Return straight triangles for fluid and membrane, and which of them are membrane."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
    gmsh.option.setNumber("Mesh.Algorithm", 6)  # frontal Delaunay
    geo = gmsh.model.geo
    points = [geo.addPoint(*p, 0) for p in [(0, 0), (ASPECT, 0), (ASPECT, 1), (0, 1), (0, 0.5)]]
    box = [geo.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    loops = [geo.addCurveLoop(box)]
    middle = geo.addPoint(*CENTRE, 0)
    for radius in (R_OUT, R_IN):
        ring = [
            geo.addPoint(CENTRE[0] + radius * c, CENTRE[1] + radius * s, 0)
            for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
        ]
        arcs = [geo.addCircleArc(ring[i], middle, ring[(i + 1) % 4]) for i in range(4)]
        loops.append(geo.addCurveLoop(arcs))
    geo.addPlaneSurface(loops[:2])
    geo.addPlaneSurface(loops[1:])
    geo.synchronize()
    gmsh.model.mesh.setSizeCallback(lambda d, t, x, y, z, lc: element_size(x, y, factor))
    gmsh.model.mesh.generate(2)
    (tags, xyz, _), (_, nodes) = gmsh.model.mesh.getNodes(), gmsh.model.mesh.getElementsByType(2)
    gmsh.finalize()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(tags.size)
    triangles = number[nodes.astype(np.int64)].reshape(-1, 3)
    used, triangles = np.unique(triangles, return_inverse=True)
    mesh = MeshTri(xyz.reshape(-1, 3)[used, :2].T.copy(), triangles.reshape(-1, 3).T.copy())
    offset = mesh.p[:, mesh.t].mean(axis=1) - CENTRE[:, None]
    return mesh, np.flatnonzero(np.hypot(*offset) < R_OUT)


def curve(mesh):
    """Return the quadratic mesh whose edges follow the two circles."""
    radius = np.hypot(*(mesh.p - CENTRE[:, None]))
    quad = MeshTri2.from_mesh(mesh)
    locs = quad.doflocs.copy()
    for target in (R_IN, R_OUT):
        on = (np.abs(radius - target) < 1e-9)[mesh.facets].all(axis=0)
        ids = mesh.nvertices + np.flatnonzero(on)  # midpoints of the edges on the circle
        offset = locs[:, ids] - CENTRE[:, None]
        locs[:, ids] = CENTRE[:, None] + target * offset / np.hypot(*offset)
    return MeshTri2(locs, quad.t)


mass = BilinearForm(lambda u, v, w: u * v)
stiffness = BilinearForm(lambda u, v, w: u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])
advection = BilinearForm(lambda u, v, w: (w["ux"] * u.grad[0] + w["uy"] * u.grad[1]) * v)
divergence = BilinearForm(lambda u, q, w: u.grad[int(w["axis"])] * q)
unit = LinearForm(lambda v, w: 1.0 * v)
parabola = LinearForm(lambda v, w: 6.0 * w.x[1] * (1.0 - w.x[1]) * v)


def solve_flow(mesh, reynolds, parabolic_outlet=False):
    """Solve the steady flow around the cell.

    Parameters
    ----------
    mesh : skfem.MeshTri2
        The fluid region.
    reynolds : float
        ``v0 H / nu``.
    parabolic_outlet : bool
        Prescribe the parabola at the outlet too, in place of ``du/dn - p n = 0``.

    Returns
    -------
    SimpleNamespace
        ``ux``, ``uy`` (P2 values), ``basis``, ``drag`` (per length, over mu v0), ``drop``
        (inlet less outlet pressure over mu v0 / H: plain and flux-weighted mean over the section).
    """
    basis = Basis(mesh, ElementTriP2(), intorder=5)
    pbasis = basis.with_element(ElementTriP1())
    x, y = basis.doflocs
    n, m = basis.N, pbasis.N
    on_cell = np.abs(np.hypot(x - CENTRE[0], y - CENTRE[1]) - R_OUT) < 1e-8
    inlet, outlet = x < 1e-9, x > ASPECT - 1e-9
    fixed = on_cell | inlet | (y < 1e-9) | (y > 1 - 1e-9) | (outlet & parabolic_outlet)
    lap = stiffness.assemble(basis)
    div = [divergence.assemble(basis, pbasis, axis=i) for i in (0, 1)]
    free = np.concatenate([~fixed, ~fixed, np.ones(m, bool)])
    if parabolic_outlet:
        free[2 * n] = False  # the level of the pressure
    state = np.zeros(2 * n + m)
    state[:n] = np.where((inlet | outlet) & fixed, 6.0 * y * (1.0 - y), 0.0)
    stokes = bmat(
        [[lap, None, -div[0].T], [None, lap, -div[1].T], [-div[0], -div[1], None]], format="csr"
    )
    lu = splu(stokes[free][:, free].tocsc(), permc_spec="COLAMD")
    for _ in range(60):
        ux, uy = (basis.interpolate(state[i * n : (i + 1) * n]) for i in (0, 1))
        inertia = reynolds * advection.assemble(basis, ux=ux, uy=uy)
        residual = stokes @ state
        residual[: 2 * n] += np.concatenate([inertia @ state[:n], inertia @ state[n : 2 * n]])
        step = lu.solve(residual[free])
        if np.abs(step).max() < 1e-8:
            break
        state[free] -= step
    else:
        raise RuntimeError("the flow did not converge; this Reynolds number is too large")
    means = []
    for end in (0.0, ASPECT):
        edge = pbasis.boundary(mesh.facets_satisfying(lambda p, e=end: np.abs(p[0] - e) < 1e-9))
        means.append([form.assemble(edge) @ state[2 * n :] for form in (unit, parabola)])
    return SimpleNamespace(
        ux=state[:n],
        uy=state[n : 2 * n],
        basis=basis,
        drag=-residual[:n][on_cell].sum(),
        drop=np.subtract(*means),
    )


def probe(basis, points):
    """Return the sparse matrix that evaluates a P2 field at ``points`` (2 x n)."""
    mesh, n = basis.mesh, points.shape[1]
    centroids = mesh.p[:, mesh.t[:3]].mean(axis=1)
    best, home, local = np.full(n, -np.inf), np.zeros(n, int), np.zeros((2, n))
    candidates = cKDTree(centroids.T).query(points.T, k=12)[1]
    for cells in candidates.T:
        ref = np.full((2, n, 1), 1.0 / 3.0)
        for _ in range(6):  # Newton's method; exact at once where the element is straight
            miss = points[:, :, None] - basis.mapping.F(ref, tind=cells)
            ref = ref + np.einsum("ijkl,jkl->ikl", basis.mapping.invDF(ref, tind=cells), miss)
            ref = np.clip(ref, -5.0, 5.0)
        ref, found = ref[:, :, 0], np.hypot(*miss[:, :, 0]) < 1e-10
        inside = np.where(found, np.minimum(ref.min(axis=0), 1.0 - ref.sum(axis=0)), -np.inf)
        ok = inside > best
        best[ok], home[ok], local[:, ok] = inside[ok], cells[ok], ref[:, ok]
    if best.min() < -1e-6:
        raise ValueError("a sampling point lies outside the mesh")
    dofs = basis.element_dofs[:, home]
    values = np.array([basis.elem.lbasis(local, i)[0] for i in range(dofs.shape[0])])
    rows = np.broadcast_to(np.arange(n), dofs.shape)
    return csr_matrix((values.ravel(), (rows.ravel(), dofs.ravel())), shape=(n, basis.N))


def tabulate(basis, ux, kept, series):
    """Return the tables; ``kept`` maps a time to the ligand and the complex at that time."""
    xs = np.round(np.arange(0.0, ASPECT + 1e-9, 0.005), 6)
    ys = np.round(np.arange(0.0, 1.0 + 1e-9, 0.005), 6)
    outside = np.abs(xs - CENTRE[0]) > R_IN - 1e-9
    gauss, weight = np.polynomial.legendre.leggauss(6)
    r = 0.5 * (R_IN + R_OUT) + 0.5 * (R_OUT - R_IN) * gauss
    weight = weight * r / (weight @ r)
    angle = np.deg2rad(THETA)[:, None]
    ring = np.array(
        [(CENTRE[0] + r * np.cos(angle)).ravel(), (CENTRE[1] + r * np.sin(angle)).ravel()]
    )
    ringed = probe(basis, ring)
    sections = [probe(basis, np.array([np.full(ys.size, x), ys])) for x in ACROSS_X]
    line = np.full((xs.size, 6), np.nan)
    line[:, 0], line[:, 5] = xs, 0.0
    line[outside, 1:] = probe(basis, np.array([xs, np.full(xs.size, 0.5)])[:, outside]) @ (
        np.column_stack([ligand for ligand, _ in kept.values()] + [ux])
    )
    xm, ym = ((np.arange(n) + 0.5) / CELLS for n in (round(ASPECT * CELLS), CELLS))
    grid = np.array(np.meshgrid(xm, ym)).reshape(2, -1)
    fields = [bound for _, bound in kept.values()] + [kept[1.0][0], kept[2.0][0]]
    return {
        "centreline": line,
        "across": np.column_stack(
            [ys] + [m @ kept[t][0] for t in (2.0, 1.0) for m in sections] + [sections[2] @ ux]
        ),
        "membrane": np.column_stack(
            [THETA] + [(ringed @ field).reshape(THETA.size, -1) @ weight for field in fields]
        ),
        "mean": np.array(series),
        "map": np.column_stack([ym, (probe(basis, grid) @ kept[2.0][0]).reshape(CELLS, -1)]),
    }


def solve_species(mesh, membrane, flow, dt):
    """March ligand and complex to ``T_END`` and collect the tables.

    Parameters
    ----------
    mesh, membrane : skfem.MeshTri2, ndarray of int
        Fluid and membrane, and the elements of the latter.
    flow : SimpleNamespace
        From `solve_flow`.
    dt : float
        Time step over t0; ``SAVE`` is a multiple of it.

    Returns
    -------
    SimpleNamespace
        ``tables`` (name to array), ``basis``, ``ligand``, ``ux``, ``uy``.
    """
    basis = Basis(mesh, ElementTriP2(), intorder=5)
    inner = Basis(mesh, ElementTriP2(), intorder=5, elements=membrane)
    far, index = cKDTree(flow.basis.doflocs.T).query(basis.doflocs.T)
    ux, uy = (np.where(far < 1e-10, f[index], 0.0) for f in (flow.ux, flow.uy))  # 0 in the cell
    mass_all, mass_cell = mass.assemble(basis), mass.assemble(inner)
    weights, weights_cell = unit.assemble(basis), unit.assemble(inner)
    cell = np.unique(basis.element_dofs[:, membrane])
    operator = DIFF * stiffness.assemble(basis) + advection.assemble(
        basis, ux=basis.interpolate(ux), uy=basis.interpolate(uy)
    )
    system = (mass_all + GAMMA * dt * operator).tocsr()
    fixed = basis.doflocs[0] < 1e-9
    free = ~fixed
    ligand = np.where(fixed, np.heaviside(np.round(basis.doflocs[1] - 0.5, 9), 0.5), 0.0)
    boundary = system[free][:, fixed] @ ligand[fixed]
    lu = splu(
        system[free][:, free].tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.01,
        options={"SymmetricMode": True},
    )
    mass_rows, cell_rows = mass_all.tocsr()[free], mass_cell.tocsr()[free][:, cell]
    bound = np.zeros(cell.size)

    def stage(old, old_bound, guess):  # solves Y - gamma dt f(Y) = old
        base = mass_rows @ old - boundary
        new, new_bound = old.copy(), guess
        for _ in range(30):
            new[free] = lu.solve(base - cell_rows @ (new_bound - old_bound))
            rate = GAMMA * dt * KON * new[cell]
            update = (old_bound + rate) / (1.0 + rate + GAMMA * dt * KOFF)
            if np.abs(update - new_bound).max() < 1e-11:
                return new, update
            new_bound = update
        raise RuntimeError("the reaction iteration did not converge")

    full, kept, series = np.zeros(basis.N), {}, [(0.0, 0.0, 0.0)]
    ratio = (1.0 - GAMMA) / GAMMA
    for step in range(1, round(T_END / dt) + 1):
        first, first_bound = stage(ligand, bound, bound)
        ligand, bound = stage(
            ligand + ratio * (first - ligand), bound + ratio * (first_bound - bound), first_bound
        )
        now = round(step * dt, 9)
        if abs(now / SAVE - round(now / SAVE)) < 1e-6:
            full[cell] = bound
            series.append(
                (
                    now,
                    C0 * (weights_cell @ full) / weights_cell.sum(),
                    C0 * HEIGHT**2 * (weights @ ligand),
                )
            )
            if now in TIMES:
                kept[now] = (ligand.copy(), full.copy())
    return SimpleNamespace(
        tables=tabulate(basis, ux, kept, series), basis=basis, ligand=ligand, ux=ux, uy=uy
    )


def run(reynolds, factor, dt, parabolic_outlet=False):
    """Mesh, solve the flow and march the species; return the result of `solve_species`."""
    start = time.perf_counter()
    mesh, membrane = make_mesh(factor)
    fluid = mesh.restrict(np.setdiff1d(np.arange(mesh.nelements), membrane))
    flow = solve_flow(curve(fluid), reynolds, parabolic_outlet)
    result = solve_species(curve(mesh), membrane, flow, dt)
    result.tables["flow"] = np.array([[reynolds, parabolic_outlet, factor, flow.drag, *flow.drop]])
    result.elements, result.dt, result.reynolds = mesh.nelements, dt, reynolds
    print(
        f"Re={reynolds:g} size={factor:g} dt={dt:g} parabolic_outlet={parabolic_outlet}: "
        f"{mesh.nelements} elements, {time.perf_counter() - start:.0f} s",
        flush=True,
    )
    return result


TABLES = {  # title and columns
    "centreline": (
        "L (mol/m^3; nan in the cytoplasm) and u/v0 (0 in the cell) on y = H/2, x_star = x/H",
        "x_star,L_t0.5,L_t1.0,L_t1.5,L_t2.0,u",
    ),
    "across": (
        "L (mol/m^3) at x = 10, 50, 100, 150 um and u/v0 at x = 100 um, y_star = y/H",
        "y_star,L_x10_t2,L_x50_t2,L_x100_t2,L_x150_t2,L_x10_t1,L_x50_t1,L_x100_t1,L_x150_t1,u_x100",
    ),
    "membrane": (
        "RL, L (mol/m^3): area-weighted mean over 1.5 um < r < 2.5 um; 0 deg is +x, 90 +y",
        "theta_deg,RL_t0.5,RL_t1.0,RL_t1.5,RL_t2.0,L_t1.0,L_t2.0",
    ),
    "mean": (
        "Mean RL over the membrane (mol/m^3); free ligand in fluid and membrane (mol/m)",
        "t_star,RL_mean,L_total",
    ),
    "map": (
        "L (mol/m^3) at t_star = 2; columns: x_star = x/H in thousandths",
        ",".join(["y_star", *(f"L_x{(2 * k + 1) * 500 / CELLS:g}" for k in range(2 * CELLS))]),
    ),
    "flow": (
        "Drag per length over mu v0; pressure drop over mu v0/H (24 without a cell), plain\n"
        "and flux-weighted mean; outlet 0: zero traction, 1: parabola; size 2: coarse mesh",
        "reynolds,outlet,size,drag,pressure_drop,pressure_drop_flux_weighted",
    ),
}
CASE = """Case: channel 200 um x 100 um (H), cell of radius 2.5 um at (25, 50) um, cytoplasm
r < 1.5 um closed to L; v0 = 2.5e-4 m/s mean, parabolic inlet, no slip; L diffuses with
347e-12 m^2/s in fluid and membrane; k = 1 m^3/(mol s), k_off = 1 /s; in the membrane R = 1
mol/m^3 at t = 0; inlet L = 1 mol/m^3 above H/2, 0 below; t_star = t/t0, t0 = H/v0 = 0.4 s."""


def write_tables(out, best, others, options):
    """Write the CSV files; ``others`` maps a label to the run that it is compared with."""
    for name, (title, columns) in TABLES.items():
        data = best.tables[name]
        lines = [
            title,
            CASE,
            f"Reynolds number {best.reynolds:g}; P2/P1 flow, P2 ligand, "
            f"{best.elements} curved triangles, SDIRK2, dt = {best.dt:g} t0.",
        ]
        ok, first = np.isfinite(data).all(axis=1), 3 if name == "flow" else 1
        norm = np.linalg.norm(data[ok, first:], axis=0)
        for label, other in others.items():
            error = np.linalg.norm((other.tables[name] - best.tables[name])[ok, first:], axis=0)
            worst = (error / norm).max()
            lines.append(f"Relative L2 difference (worst column) to {label}: {worst:.1e}")
            if name == "flow" and other.dt == best.dt:
                data = np.vstack([data, other.tables[name]])
        lines += [f"Made by: python references/yeast_channel_fem.py {options}", "Columns:", columns]
        np.savetxt(
            out / f"yeast_channel_{name}.csv",
            data,
            fmt="%.8g",
            delimiter=",",
            header="\n".join(lines),
        )


def draw(path, best):
    """Draw the ligand at the end, the centreline and the complex around the membrane."""
    import matplotlib.pyplot as plt

    parts = best.basis.element_dofs[[[0, 3, 3, 5], [3, 1, 4, 4], [5, 4, 5, 2]]].reshape(3, -1).T
    scale = HEIGHT * 1e6
    fig, ((field, zoom), (line, ring)) = plt.subplots(
        2, 2, figsize=(11, 7.6), layout="constrained", width_ratios=[2, 1]
    )
    for ax, (x0, x1, y0, y1) in ((field, (0, 2, 0, 1)), (zoom, (0.18, 0.36, 0.41, 0.59))):
        image = ax.tripcolor(
            *(scale * best.basis.doflocs),
            parts,
            best.ligand,
            shading="gouraud",
            vmin=0,
            vmax=1,
            rasterized=True,
        )
        gx, gy = np.linspace(x0, x1, 161), np.linspace(y0, y1, 121)
        grid = np.array(np.meshgrid(gx, gy)).reshape(2, -1)
        inner = np.hypot(*(grid - CENTRE[:, None])) < R_OUT
        matrix = probe(best.basis, np.where(inner, 0.0, grid))
        u, v = (np.where(inner, np.nan, matrix @ f).reshape(121, 161) for f in (best.ux, best.uy))
        seeds = scale * np.array([np.full(12, x0 + 1e-4), np.linspace(y0, y1, 14)[1:-1]]).T
        ax.streamplot(
            scale * gx,
            scale * gy,
            u,
            v,
            start_points=seeds,
            color="w",
            linewidth=0.6,
            arrowsize=0.6,
            broken_streamlines=False,
        )
        ax.contour(
            scale * gx,
            scale * gy,
            np.hypot(*(grid - CENTRE[:, None])).reshape(u.shape),
            [R_IN, R_OUT],
            colors="k",
            linewidths=0.8,
        )
        ax.set(
            xlim=(scale * x0, scale * x1),
            ylim=(scale * y0, scale * y1),
            aspect="equal",
            xlabel="x (µm)",
            ylabel="y (µm)",
            title="the cell (circles: the membrane)",
        )
    field.set_title(f"L at t* = 2 and streamlines, Re = {best.reynolds:g}")
    fig.colorbar(image, ax=zoom, label="L (mol/m³)", shrink=0.8)
    for ax, name in ((line, "centreline"), (ring, "membrane")):
        ax.plot(best.tables[name][:, 0], best.tables[name][:, 1:5])
    line.set(xlabel="x/H", ylabel="L (mol/m³)", title="along y = H/2", xlim=(0, 2))
    ring.set(
        xlabel="angle (degrees)",
        ylabel="RL (mol/m³)",
        title="around the membrane",
        xlim=(0, 360),
        xticks=range(0, 361, 90),
        ylim=(0, None),
    )
    line.legend(line.lines, [f"t* = {t:g}" for t in TIMES])
    fig.savefig(path, dpi=130)


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the CSV files")
    parser.add_argument("--reynolds", type=float, default=0.025, help="v0 H / nu")
    parser.add_argument("--coarse", action="store_true", help="one quick run, no comparisons")
    parser.add_argument("--figure", type=pathlib.Path, help="also draw this PNG file")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    re, (size, dt) = args.reynolds, COARSE if args.coarse else FINE
    best = run(re, size, dt)
    others = (
        {}
        if args.coarse
        else {
            "elements twice as large": run(re, COARSE[0], dt),
            "time steps twice as long": run(re, size, COARSE[1]),
            "Re = 1": run(1.0, size, dt),
            "a parabolic outlet": run(re, size, dt, parabolic_outlet=True),
        }
    )
    options = f"--out DIR --reynolds {re:g}" + " --coarse" * args.coarse
    write_tables(args.out, best, others, options)
    if args.figure:
        draw(args.figure, best)


if __name__ == "__main__":
    main()
