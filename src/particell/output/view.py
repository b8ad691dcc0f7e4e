"""The particles in 3D, by pyvista."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from particell.errors import InputError, MissingExtra
from particell.output.files import replacing
from particell.output.quantities import Quantity, Shown
from particell.output.recorded import Recorded
from particell.units import length_scale

if TYPE_CHECKING:
    import pyvista

#: Up to that many particles are spheres with a surface; more are points shaded as spheres.
MOST_SPHERES = 20_000
#: Diameter of a sphere in particle spacings, and length of the longest arrow.
DIAMETER, ARROW = 0.8, 2.5


def view(
    run: Recorded,
    what: Quantity,
    frame: int,
    groups: str | Sequence[str] | None,
    component: int | str | None,
    arrows: bool,
    limits: tuple[float, float] | None,
    colours: str,
    path: str | Path | None,
    off_screen: bool | None,
) -> pyvista.Plotter:
    """See :meth:`particell.output.run.Run.view`."""
    try:
        import pyvista
    except ImportError:
        raise MissingExtra("view", "pyvista", "viz") from None
    k, chosen = run.checked(frame), run.chosen(groups)
    if not chosen.any():
        raise InputError("groups", groups, "some that have particles")
    shown = Shown(run, what, component)
    factor, unit = length_scale(float(run.domain.lengths.max()))
    cloud = pyvista.PolyData(_in_space(run.source.read("position", k)[chosen] / factor))
    name = shown.label or "value"
    cloud[name] = np.asarray(shown.at(k)[chosen], float)
    n = len(run.static["group"])
    spacing = (run.domain.volume / max(n, 1)) ** (1 / run.domain.dim) / factor
    plotter: Any = pyvista.Plotter(
        off_screen=path is not None if off_screen is None else off_screen
    )
    style: dict[str, Any] = {
        "scalars": name,
        "cmap": colours,
        "clim": limits,
        "scalar_bar_args": {"vertical": True, "position_x": 0.87, "position_y": 0.25},
    }
    if arrows:
        plotter.add_mesh(_arrows(cloud, run, k, chosen, spacing), **style)
    elif cloud.n_points <= MOST_SPHERES:
        ball = pyvista.Sphere(
            radius=0.5 * DIAMETER * spacing, theta_resolution=12, phi_resolution=12
        )
        plotter.add_mesh(cloud.glyph(geom=ball, scale=False, orient=False), **style)
    else:
        plotter.add_mesh(cloud, render_points_as_spheres=True, point_size=6, **style)
    lower, upper = (_in_space(x[None] / factor)[0] for x in (run.domain.lower, run.domain.upper))
    box = pyvista.Box(np.column_stack([lower, upper]).ravel())
    plotter.add_mesh(box, style="wireframe", color="grey", line_width=1)
    # VTK's own letters have no µ.
    axes = {f"{a}title": f"{a} [{unit.replace('µ', 'u')}]" for a in "xyz"}
    plotter.show_bounds(mesh=box, grid=False, location="outer", font_size=9, bold=False, **axes)
    plotter.add_text(run.title(k), font_size=9)
    plotter.set_background("white")
    if run.domain.dim < 3:
        plotter.view_xy()
    if path is not None:
        with replacing(path) as partial:
            plotter.screenshot(str(partial))
    return plotter


def _in_space(points: np.ndarray) -> np.ndarray:
    """Points or vectors (n, D) with three components."""
    padded = np.zeros((len(points), 3))
    padded[:, : points.shape[1]] = points
    return padded


def _arrows(
    cloud: pyvista.PolyData, run: Recorded, frame: int, chosen: np.ndarray, spacing: float
) -> pyvista.PolyData:
    """An arrow along each particle's velocity, the longest some spacings long."""
    velocity = _in_space(run.source.read("velocity", frame)[chosen])
    fastest = float(np.linalg.norm(velocity, axis=1).max())
    cloud["arrow"] = velocity / fastest if fastest > 0 else velocity
    return cloud.glyph(orient="arrow", scale="arrow", factor=ARROW * spacing)
