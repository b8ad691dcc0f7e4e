"""Compiled code that is kept follows the sources, and never stops a run."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from particell.chemistry import massaction
from particell.compute import cache, generated
from particell.errors import CacheWarning
from particell.laws import continuity
from particell.schemes import flow_sweeps, sdpd


def path(module) -> Path:
    return Path(module.__file__).resolve()


def test_a_loop_depends_on_its_laws_and_not_on_its_users():
    found = cache.sources(path(flow_sweeps))
    assert path(continuity) in found
    assert path(cache) in found  # through compute.loop
    assert path(sdpd) not in found
    assert path(massaction) not in found


def test_an_edit_of_a_helper_changes_the_directory(monkeypatch):
    before = cache.cache_directory(path(flow_sweeps))
    read = cache._read.__wrapped__

    def edited(file):
        content, imported = read(file)
        return (content + b"#" if file == path(continuity) else content), imported

    monkeypatch.setattr(cache, "_read", edited)
    after = cache.cache_directory.__wrapped__
    assert after(path(flow_sweeps)) != before
    assert after(path(massaction)) == cache.cache_directory(path(massaction))


def test_every_form_of_import_is_seen(tmp_path):
    source = tmp_path / "law.py"
    source.write_text(
        "import particell.kernels\n"
        "from particell.laws import (\n    continuity as c,\n    pressure,\n)\n"
    )
    names = {file.name for file in cache.sources(source)}
    assert {"law.py", "kernels.py", "continuity.py", "pressure.py"} <= names


SOURCE = """
from particell.compute.loop import particle_loop

@particle_loop
def double(i, x):
    x[i] = 2.0 * x[i]
"""


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A directory of compiled code of its own, and what compiles a loop and says what was said."""
    place, file = tmp_path / "kept", tmp_path / "doubling.py"
    file.write_text(SOURCE)
    monkeypatch.setenv("PARTICELL_CACHE_DIR", str(place))

    def double() -> list[str]:
        for function in (cache.usable, cache.cache_directory):
            function.cache_clear()
        spec = importlib.util.spec_from_file_location("doubling", file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "doubling", module)
        spec.loader.exec_module(module)
        x = np.arange(3.0)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            module.double.specialise()(3, x)
        assert np.array_equal(x, [0.0, 2.0, 4.0])
        assert all(issubclass(w.category, CacheWarning) for w in said)
        assert not list(tmp_path.glob("__pycache__/*.nb*"))  # nothing beside the sources
        return [str(w.message) for w in said]

    yield place, double
    for function in (cache.usable, cache.cache_directory):
        function.cache_clear()


def files(place: Path, kind: str) -> list[Path]:
    found = list(place.rglob(f"*.{kind}"))
    assert found
    return found


DAMAGES = {
    "empty": lambda whole: b"",
    "cut off": lambda whole: whole[: len(whole) // 2],
    "garbage": lambda whole: np.random.default_rng(1).bytes(100),
    "a bit": lambda whole: whole[:-9] + bytes([whole[-9] ^ 1]) + whole[-8:],
    "a pickle": lambda whole: b"cos\nsystem\n(S'touch EXECUTED'\ntR.",
}


def test_what_is_damaged_is_compiled_anew(kept, monkeypatch, tmp_path):
    """One line each time, and the next time it is whole again."""
    monkeypatch.chdir(tmp_path)
    place, double = kept
    assert double() == [] and double() == []
    assert os.name != "posix" or place.stat().st_mode & 0o777 == 0o700
    for kind in ("nbi", "nbc"):
        for what, damage in DAMAGES.items():
            for file in files(place, kind):
                file.write_bytes(damage(file.read_bytes()))
            said = double()
            assert len(said) == 1 and "is made anew" in said[0] and "\n" not in said[0], what
            assert double() == [], what
    for file in files(place, "nbc"):
        file.unlink()
    assert double() == [] and files(place, "nbc")
    assert not (tmp_path / "EXECUTED").exists()


def test_what_cannot_be_kept(kept, monkeypatch):
    """No room: one line, and the run goes on."""
    _, double = kept

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache._Files, "_open_for_write", full)
    said = double()
    assert len(said) == 1 and "No space left on device" in said[0]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs owners of files")
@pytest.mark.parametrize("why", ["belongs to another user", "by everybody", "cannot be written to"])
def test_a_directory_that_is_not_the_user_s_alone(kept, monkeypatch, why):
    """Nothing is kept there, nothing is read there, and nothing is kept beside the sources."""
    place, double = kept
    double()
    if why == "by everybody":
        place.chmod(0o777)
    elif why == "belongs to another user":
        monkeypatch.setattr(os, "geteuid", lambda: place.stat().st_uid + 1)
    else:
        shutil.rmtree(place)
        place.write_text("a file")
    before = sorted(place.rglob("*"))
    said = double()
    assert len(said) == 1 and why in said[0] and str(place) in said[0]
    assert sorted(place.rglob("*")) == before
    assert not generated.directory().is_relative_to(place)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs modes of files")
def test_a_directory_of_a_group_becomes_the_user_s_with_a_line(kept):
    place, double = kept
    place.mkdir(exist_ok=True)
    place.chmod(0o770)
    said = double()
    assert len(said) == 1 and "a group could write to" in said[0] and str(place) in said[0]
    assert place.stat().st_mode & 0o777 == 0o700 and double() == []


def test_two_processes_that_compile_for_different_types_at_once(tmp_path, monkeypatch):
    """Neither finds the other's code: both have seen an empty index before either has written."""
    files = [cache._Files(str(tmp_path), "loop", "stamp") for _ in range(2)]
    keys = [("float32", "cpu"), ("float64", "cpu")]
    monkeypatch.setattr(cache._Files, "_load_index", lambda self: {})
    for own, key in zip(files, keys, strict=True):
        own.save(key, f"code for {key[0]}")
    monkeypatch.undo()
    for own, key in zip(files, keys, strict=True):
        assert own.load(key) in (None, f"code for {key[0]}")
        own.save(key, f"code for {key[0]}")
    assert [files[0].load(key) for key in keys] == ["code for float32", "code for float64"]
    files[0]._save_index({keys[0]: files[0]._name_of(keys[1])})
    with pytest.raises(ValueError, match="of other types"):
        files[0].load(keys[0])
