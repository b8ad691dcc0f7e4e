"""Where compiled code is kept: one directory per state of the sources it is made from.

Numba keys a cached function on its own file only and does not see an edit of a helper in another
file. The directory of a function therefore carries a hash of its module and of every module of
the package that this one imports, directly or not.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from platformdirs import user_cache_path

#: Numba sets the attributes of its configuration at run time, unseen by type checkers.
NUMBA_CONFIG: Any = numba.config
PACKAGE = Path(__file__).resolve().parent.parent
IMPORT = re.compile(
    rf"^\s*from ({PACKAGE.name}[\w.]*) import (?:\(([^)]*)\)|([^(\n]*))"
    rf"|^\s*import ({PACKAGE.name}[\w.]*)",
    re.MULTILINE,
)


def _file(module: str) -> Path | None:
    """The source of a module of the package; None where the name is no module."""
    path = PACKAGE.parent.joinpath(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((file for file in candidates if file.is_file()), None)


@cache
def _read(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """The content of a source file, and the sources that it imports."""
    content = file.read_bytes()
    found: list[Path | None] = []
    for module, several, one, plain in IMPORT.findall(content.decode()):
        found.append(_file(module or plain))
        names = re.findall(r"(\w+)(?: as \w+)?", several or one)
        found += [_file(f"{module}.{name}") for name in names]
    return content, tuple(file for file in found if file is not None)


def sources(file: Path) -> list[Path]:
    """``file`` and all sources of the package that it imports, directly or not, sorted."""
    seen: set[Path] = set()
    waiting = [file]
    while waiting:
        source = waiting.pop()
        if source not in seen:
            seen.add(source)
            waiting += _read(source)[1]
    return sorted(seen)


@cache
def cache_directory(file: Path) -> Path:
    """Directory of the compiled functions of a source file, as it and its imports are now.

    ``PARTICELL_CACHE_DIR`` overrides the user's cache directory.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sources(file):
        digest.update(str(source.relative_to(PACKAGE.parent) if source != file else "").encode())
        digest.update(_read(source)[0])
    override = os.environ.get("PARTICELL_CACHE_DIR")
    root = Path(override) if override else user_cache_path("particell")
    return root / digest.hexdigest()[:16]


def compiled_before(file: Path) -> bool:
    """Whether a function of a source file, as it is now, has been compiled and kept."""
    return any(cache_directory(file).rglob("*.nbi"))


@contextmanager
def compiled_here(file: str) -> Iterator[None]:
    """Make Numba pick :func:`cache_directory` for functions created inside the block."""
    previous = NUMBA_CONFIG.CACHE_DIR
    NUMBA_CONFIG.CACHE_DIR = str(cache_directory(Path(file).resolve()))
    try:
        yield
    finally:
        NUMBA_CONFIG.CACHE_DIR = previous
