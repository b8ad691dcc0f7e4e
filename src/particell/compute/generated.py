"""Generated modules: kept as readable files beside the compiled code, and imported from there."""

from __future__ import annotations

import atexit
import hashlib
import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

from platformdirs import user_cache_path


def directory() -> Path:
    """Where generated modules stand; ``PARTICELL_CACHE_DIR`` overrides the user's cache."""
    override = os.environ.get("PARTICELL_CACHE_DIR")
    return (Path(override) if override else user_cache_path("particell")) / "sweeps"


def _kept(file: Path, text: bytes) -> Path:
    """The file with the text, or one of this process where it cannot be written."""
    try:
        if not file.is_file() or file.read_bytes() != text:
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(f".{os.getpid()}.part")
            part.write_bytes(text)
            part.replace(file)  # others may be reading it
    except OSError:
        own = tempfile.mkdtemp(prefix="particell-")
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        file = Path(own) / file.name
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
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__.update(functions)
    sys.modules[qualified] = module
    spec.loader.exec_module(module)
    return module
