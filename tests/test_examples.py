"""The scripts in examples/ run, at a small size, and get right what they are about."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def example(tmp_path, monkeypatch):
    """Runs an example in an empty directory; gives its variables."""
    monkeypatch.chdir(tmp_path)

    def run(name: str, *arguments: str) -> dict:
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *arguments])
        return runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")

    return run


def test_first_run(example, tmp_path):
    found = example("first_run", "16")
    assert found["error"] < 0.03
    assert (tmp_path / "out/first_run/run.h5").stat().st_size > 0
    assert (tmp_path / "out/first_run/velocity.png").stat().st_size > 0


def test_reaction_diffusion(example):
    found = example("reaction_diffusion", "20")
    errors, mean = found["errors"], found["mean"]
    assert np.abs(errors["concentrations"]).max() < 5e-3 * mean
    # Molecules scatter around the same mean as a Poisson number does; 2.5 is beyond 1e-6 chance.
    noise = found["exact"].mean() / found["per_particle"] ** 0.5
    assert 0 < errors["molecules"].std() < 2.5 * noise


def test_thermal_box(example):
    found = example("thermal_box", "12", "60")
    assert abs(found["ratio"] - 1) < 0.04
    assert found["momentum"] < 1e-12


def test_ensemble(example, tmp_path):
    runs = 30
    found = example("ensemble", str(runs), "1")
    total, share = found["total"], found["share"]
    exact = (total * share * (1 - share)) ** 0.5
    # 5 standard errors: beyond 1e-6 chance; of a deviation it is √(1/2(n - 1))
    assert abs(found["mean"] - total * share) < 5 * exact / runs**0.5
    assert abs(found["deviation"] / exact - 1) < 5 / (2 * (runs - 1)) ** 0.5
    assert (tmp_path / "out/ensemble/amounts.png").stat().st_size > 0


def test_sbml_model(example):
    pytest.importorskip("libsbml")
    assert example("sbml_model")["error"] < 1e-4


def test_readme_shows_first_run():
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    script = (ROOT / "examples/first_run.py").read_text(encoding="utf-8")
    for line in filter(None, code.splitlines()):
        assert line in script


@pytest.mark.parametrize("script", sorted(p.name for p in (ROOT / "examples").glob("*.py")))
def test_every_example_is_short(script):
    assert len((ROOT / "examples" / script).read_text(encoding="utf-8").splitlines()) < 40
