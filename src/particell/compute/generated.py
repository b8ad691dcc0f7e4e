"""Generated modules: kept as readable files beside the compiled code, and imported from there."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from platformdirs import user_cache_path


def directory() -> Path:
    """Where generated modules stand; ``PARTICELL_CACHE_DIR`` overrides the user's cache."""
    override = os.environ.get("PARTICELL_CACHE_DIR")
    return (Path(override) if override else user_cache_path("particell")) / "sweeps"


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
    file = directory() / f"{name}_{digest}.py"
    if not file.is_file() or file.read_text() != text:
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(f".{os.getpid()}.part")
        part.write_text(text)
        part.replace(file)  # others may be reading it
    spec = importlib.util.spec_from_file_location(qualified, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__.update(functions)
    sys.modules[qualified] = module
    spec.loader.exec_module(module)
    return module
