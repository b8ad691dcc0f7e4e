"""Generated modules: kept as readable files beside the compiled code, and imported from there."""

from __future__ import annotations

import atexit
import functools
import hashlib
import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

from particell.compute.cache import place, usable


def directory() -> Path:
    """Where generated modules stand; they are run, so it is there where compiled code may be."""
    return (place() if usable(place()) else _own()) / "sweeps"


@functools.cache
def _own() -> Path:
    """A directory that this process has to itself, and takes along."""
    own = tempfile.mkdtemp(prefix="particell-")
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return Path(own)


def _kept(file: Path, text: bytes) -> Path:
    """The file with the text, or one of this process where it cannot be written."""
    try:
        if not file.is_file() or file.read_bytes() != text:
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(f".{os.getpid()}.part")
            part.write_bytes(text)
            part.replace(file)  # others may be reading it
    except OSError:
        file = _own() / file.name
        file.write_bytes(text)
    return file


def load(name: str, text: str, functions: dict[str, Any]) -> ModuleType:
    """Import a generated module; the same text is the same module.

    Parameters
    ----------
    name, text
        What the file is called, apart from a hash of the text; its content.
    functions
        What it calls and can't import: functions of scripts and notebooks.
    """
    digest = hashlib.sha256(text.encode()).hexdigest()[:12]
    qualified = f"particell_sweep_{name}_{digest}"
    if qualified in sys.modules:
        return sys.modules[qualified]
    file = _kept(directory() / f"{name}_{digest}.py", text.encode())
    spec = importlib.util.spec_from_file_location(qualified, file)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__.update(functions)
    sys.modules[qualified] = module
    # not by the loader, which trusts bytecode that it has kept beside the file
    exec(compile(text, str(file), "exec"), module.__dict__)
    return module
