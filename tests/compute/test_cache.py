"""The cache of compiled code follows the sources that a function is made from."""

from __future__ import annotations

from pathlib import Path

from particell.chemistry import massaction
from particell.compute import cache
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
