"""What is installed: extras that are missing say so, the README of package indexes, the bounds."""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import particell as pc
from particell.errors import InputError, MissingExtra
from particell.output.run import Run

ROOT = Path(pc.__file__).resolve().parents[2]
PROJECT = ROOT / "pyproject.toml"
pytestmark = pytest.mark.skipif(not PROJECT.exists(), reason="installed, not a clone")


def a_run() -> Run:
    static = {"id": np.arange(1), "group": np.zeros(1, np.int32), "support": np.ones(1)}
    frame = {"position": np.ones((1, 2)), "velocity": np.zeros((1, 2))}
    return Run.from_memory(pc.Domain((0, 0), (2, 2)), ["a"], static, [0], [0.0], [frame])


def sbml(path: Path):
    path.write_text("<sbml/>")
    return pc.read_sbml(path)


#: Module, extra, and what needs it.
EXTRAS = {
    "xarray": ("xarray", lambda place: a_run().to_xarray()),
    "pyvista": ("viz", lambda place: a_run().view()),
    "libsbml": ("sbml", lambda place: sbml(place / "a.xml")),
    "numba.cuda": ("cuda", lambda place: pc.Device("cuda")),
}


@pytest.mark.parametrize("module", EXTRAS)
def test_a_missing_extra_reads_as_a_missing_extra(module, monkeypatch, tmp_path):
    extra, use = EXTRAS[module]
    if module == "numba.cuda":  # "from numba import cuda" looks at the attribute first
        import numba

        monkeypatch.delattr(numba, "cuda", raising=False)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtra) as error:
        use(tmp_path)
    said = str(error.value)
    assert said.endswith(f"which is not installed: pip install 'particell[{extra}]'")
    assert "\n" not in said and isinstance(error.value, InputError)


def test_extras_that_messages_name_exist():
    extras = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    named = set()
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        named |= set(re.findall(r"MissingExtra\([^)]*\"(\w+)\"\)", text))
        named |= set(re.findall(r"particell\[(\w+)\]", text))
    assert {"viz", "sbml", "xarray", "cuda", "cluster", "equations"} <= named <= set(extras)


def for_index():
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.for_index


@pytest.mark.parametrize("repository", ["", "https://example.org/particell"])
def test_the_readme_of_package_indexes_has_no_relative_link(repository):
    text = for_index()((ROOT / "README.md").read_text(encoding="utf-8"), repository)
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    assert all(t.startswith(("https://", "http://", "#")) for t in targets), targets
    assert bool(repository) == ("![" in text)
    assert "pip install" in text and "Twenty lines" in text
    one = "[a](docs/a.md) ![p](b.png) [c](https://d.org) [e](#f)"
    assert for_index()(one) == "a  [c](https://d.org) [e](#f)"
    absolute = "[a](https://h.org/blob/HEAD/docs/a.md) ![p](https://h.org/raw/HEAD/b.png)"
    assert for_index()(one, "https://h.org/") == f"{absolute} [c](https://d.org) [e](#f)"


def test_bounds_that_are_known_to_matter():
    """pint 0.24 to 0.24.3 fail on import; every dependency has a bound that a script tries."""
    needed = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["dependencies"]
    assert "pint>=0.24.4" in needed
    assert all(re.fullmatch(r"[\w-]+>=[\d.]+", each) for each in needed)
