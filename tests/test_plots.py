from __future__ import annotations

import subprocess
import sys

import matplotlib
import numpy as np
import pytest

from particell import plots
from particell.geometry.domain import Domain


def test_readable_scales():
    assert plots.length_scale(100e-6) == (1e-6, "µm")
    assert plots.length_scale(1.0) == (1.0, "m")
    assert plots.length_scale(1e-3) == (1e-3, "mm")
    assert plots.time_scale(2e-9) == (1e-9, "ns")
    assert plots.time_scale(0.0) == (1.0, "s")
    assert plots.field_label("concentration/L") == "concentration of L [mol/m³]"
    assert plots.field_label("count/R") == "count of R"
    assert plots.label("viscosity", "Pa*s") == "viscosity [Pa s]"


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("style", ["scatter", "tripcolor"])
def test_field_map(dim, style, tmp_path):
    random = np.random.default_rng(0)
    domain = Domain((0,) * dim, (2e-4, 1e-4, 1e-4)[:dim])
    position = random.random((100, dim)) * domain.lengths
    figure = plots.field_map(position, 1e21 * position[:, 0], domain=domain, label="c", style=style)
    assert figure.axes[0].get_xlabel() == "x [µm]"
    assert plots.save(figure, tmp_path / "a.png").stat().st_size > 1000


def test_other_figures(tmp_path):
    domain = Domain((0, 0), (1, 1))
    x = np.random.default_rng(0).random((50, 2))
    groups = np.arange(50) % 2
    plots.save(plots.arrangement(x, groups, ["fluid", "wall"], domain=domain), tmp_path / "a.png")
    y = np.linspace(0, 1, 11)
    figure = plots.profile(
        y, {"SPH": y}, reference={"exact": (y, y)}, xlabel="y [m]", ylabel="v [m/s]"
    )
    plots.save(figure, tmp_path / "b.pdf")
    figure = plots.time_series(
        y * 1e-3, {"a": y + 1}, reference={"exact": 1.0}, ylabel="a", logarithmic=True
    )
    assert figure.axes[0].get_xlabel() == "t [ms]"
    plots.save(figure, tmp_path / "c.svg")
    assert {p.name for p in tmp_path.iterdir()} == {"a.png", "b.pdf", "c.svg"}


def test_user_settings_are_left_alone():
    before = dict(matplotlib.rcParams)
    plots.new_figure()
    assert dict(matplotlib.rcParams) == before
    code = "import sys, particell.plots; print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
